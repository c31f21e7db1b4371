"""One measured case of each row of the table, as plain numbers."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

import palpate
from benchmarks.gains.cases import (
    Case,
    good_recording,
    poor_recording,
    soft_case,
    stiff_case,
)
from palpate.control_loops.laws import KnownLaw, LawDraws
from palpate.control_loops.response import find_onset
from palpate.control_loops.touching import find_limits, observation_time

Found = dict[str, Any]
#: Factors on the gain over the linear onset, 5 % apart.
GRID = np.geomspace(0.2, 1.6, 44)
_MATERIAL_AT_REST = 0.05  # rad/s


def true_draws(case: Case) -> LawDraws:
    """Return the true law alone."""
    law = case.law
    known = KnownLaw(law, np.zeros((len(law.names()),) * 2), case.depth)
    return known.draws(1, _MATERIAL_AT_REST)


def true_onset(case: Case) -> tuple[float, float]:
    """Return the linear onset of the true law, and its frequency [rad/s]; ∞ without one."""
    draws = true_draws(case)
    depth = draws.depth(case.loop.wanted_force)
    frequency = np.array([2.0 * math.pi])
    for _ in range(20 if draws.remembers else 1):
        onset = find_onset(case.loop, *draws.stiffness_and_damping(depth, frequency))
        if not np.isfinite(onset.gain[0]):
            break
        frequency = np.sqrt(frequency * onset.frequency)
    return float(onset.gain[0]), float(onset.frequency[0])


def duration_of(case: Case, frequency: float) -> float:
    """Return how long a loop is watched, s."""
    return observation_time(case.loop, case.depth, float(np.nan_to_num(frequency)))


def _edges(fails: np.ndarray, factors: np.ndarray) -> float:
    """Return the middle of the lowest cell of the grid from fine to failing; NaN without one."""
    first = int(np.argmax(fails))
    if not fails.any() or first == 0:
        return math.nan
    return float(math.sqrt(factors[first - 1] * factors[first]))


def known_law(case: Case, step: float = 2.5e-4) -> Found | None:
    """Predict the onsets for the true law, and measure them in MuJoCo."""
    from benchmarks.gains.mujoco_loop import run

    onset, frequency = true_onset(case)
    if not math.isfinite(onset):
        return None
    seconds = min(duration_of(case, frequency), 2.0 if case.material == "stiff" else 3.0)
    predicted = find_limits(case.loop, true_draws(case), onset, seconds)
    factors = onset * GRID
    swings, fails = run(case, factors, seconds, step)
    return {
        "linear": onset,
        "frequency": frequency,
        "swing": predicted[0],
        "bounce": predicted[1],
        "swing_in_mujoco": _edges(swings, factors),
        "bounce_in_mujoco": _edges(fails, factors),
        "always_bounces": bool(fails[0]),
    }


def identified_law(case: Case, contact: palpate.Contact) -> Found:
    """Identify a recording, and take the recommended gain."""
    try:
        result = palpate.identify(contact, trace=False)
        answer = palpate.gains(result, case.loop)
    except palpate.PalpateError as error:
        return {"refused": "identification", "error": str(error)[:200]}
    found: Found = {
        "material": case.material,
        "controller": case.loop.name,
        "law": str(result.law_verdict and result.law_verdict.candidate),
        "laws": len(answer.knowledge.laws),
        "verdict": answer.verdict,
        "frequency": answer.frequency,
        "recorded_frequency": answer.knowledge.recorded_frequency,
        "recorded_force": answer.knowledge.largest_force / case.loop.wanted_force,
    }
    onset, frequency = true_onset(case)
    found |= {"true_onset": onset, "true_frequency": frequency}
    if answer.recommended is None:
        return {**found, "refused": str(answer.refusal)}
    return {
        **found,
        "factor": answer.recommended_factor,
        "speed": answer.recommended.approach_speed,
        "slowed": answer.recommended.approach_speed < case.loop.approach_speed,
    }


def touched(case: Case, found: Found) -> Found:
    """Touch in MuJoCo with the recommended gain, and with half of it."""
    from benchmarks.gains.mujoco_loop import run

    if "factor" not in found:
        return found
    slower = replace(case, loop=replace(case.loop, approach_speed=found["speed"]))
    seconds = duration_of(slower, found["true_frequency"])
    swings, fails = run(slower, np.array([1.0, 0.5]) * found["factor"], seconds)
    return {
        **found,
        "swings": bool(swings[0]),
        "fails": bool(fails[0]),
        "half_fails": bool(fails[1]),
    }


def price(case: Case) -> Found | None:
    """Compare the recommended gain with the largest that neither swings nor bounces."""
    onset, frequency = true_onset(case)
    if not math.isfinite(onset):
        return None
    seconds = duration_of(case, frequency)
    largest = find_limits(case.loop, true_draws(case), onset, seconds)[1]
    contact = good_recording(case, np.random.default_rng(case.seed))
    found = identified_law(case, contact)
    found["ratio"] = found.get("factor", math.nan) / largest if largest > 0.0 else math.nan
    return found


def following(case: Case, noise: float = 5e-5) -> Found | None:
    """Measure delay and bandwidth from a free motion, and compare the onset with the true one."""
    from benchmarks.gains.following import commanded, followed
    from palpate.control_loops import measure_following

    onset, _ = true_onset(case)
    if case.loop.name != "admittance" or not math.isfinite(onset):
        return None
    random = np.random.default_rng(case.seed)
    step = 1.0 / case.loop.sample_rate
    command = commanded(10.0, step)
    position = followed(command, step, case.loop.bandwidth, case.loop.delay)
    position = position + noise * random.standard_normal(len(position))
    measured = measure_following(step * np.arange(len(command)), command, position)
    loop = replace(case.loop, delay=measured.delay, bandwidth=measured.bandwidth)
    again, _ = true_onset(replace(case, loop=loop))
    return {
        "ratio": again / onset,
        "delay_error": measured.delay - case.loop.delay,
        "bandwidth_ratio": measured.bandwidth / case.loop.bandwidth,
        "delay_deviation": measured.delay_error,
        "bandwidth_deviation": measured.bandwidth_error,
    }


def answer_time(case: Case) -> Found | None:
    """Measure the CPU time of an answer with its picture, from a good recording, s."""
    from palpate.control_loops.figures import draw_gains
    from palpate.output.figures.style import as_svg

    contact = good_recording(case, np.random.default_rng(case.seed))
    result = palpate.identify(contact, trace=False)
    _ = result.diagnosis
    begun = time.process_time()
    answer = palpate.gains(result, case.loop)
    middle = time.process_time()
    if answer.recommended is None:  # there is nothing to draw
        return None
    as_svg(draw_gains(answer))
    return {"answer": middle - begun, "with_picture": time.process_time() - begun}


def poor(seed: int, *, relaxing: bool) -> Found:
    """Measure the recommended gain from a poor recording."""
    case = soft_case(seed, relaxing=relaxing)
    contact = poor_recording(case, np.random.default_rng(seed))
    return touched(case, identified_law(case, contact))


def in_drake(case: Case) -> Found | None:
    """Touch in Drake, below and above the predicted onset."""
    from benchmarks.gains.drake_loop import run

    onset, frequency = true_onset(case)
    if not math.isfinite(onset):
        return None
    seconds = min(duration_of(case, frequency), 3.0)
    predicted = find_limits(case.loop, true_draws(case), onset, seconds)[1]
    if predicted <= 0.0:
        return None
    below, above = (run(case, part * predicted, seconds) for part in (0.9, 1.1))
    return {"below_fails": below, "above_fails": above}


#: What each row measures, by seed.
MEASURES: Mapping[str, Callable[[int], Found | None]] = {
    "known": lambda seed: known_law(soft_case(seed)),
    "stiff": lambda seed: known_law(stiff_case(seed), 1e-4),
    "poor": lambda seed: poor(1000 + seed, relaxing=False),
    "relaxing": lambda seed: poor(seed, relaxing=True),
    "price": lambda seed: price(soft_case(2000 + seed)),
    "following": lambda seed: following(soft_case(3 * seed + 3000)),
    "drake": lambda seed: in_drake(soft_case(4000 + seed)),
    "time": lambda seed: answer_time(soft_case(5000 + seed)),
}
