"""Marks of stiffness and damping beside the truth: one recording of a bank, judged."""

import math
import time
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from benchmarks.diagnosis.material_faults import MATERIAL_FAULTS
from benchmarks.diagnosis.noises import LENGTHS, MOTION, NOISES, clean
from benchmarks.diagnosis.outcome import named_by
from benchmarks.diagnosis.sensor_faults import SENSOR_FAULTS
from benchmarks.diagnosis.trials import Trial, Unseen, good, hard
from palpate import PalpateError, identify

NONE = [Unseen("none", str(k)) for k in range(5)]
UNSEEN: list[Unseen] = [*NONE, *SENSOR_FAULTS, *MATERIAL_FAULTS]
BANKS = {"good": good, "hard": hard}
#: A lie is off by more than so many bars, both parts, and by more than this fraction.
BARS, LEAST = 3.0, {"stiffness": 0.05, "damping": 0.10}
QUANTITIES = tuple(LEAST)


@dataclass
class Marked:
    """What palpate says of one recording, and the truth.

    Attributes
    ----------
    overall, stiffness, damping : str
        The verdicts; ``"refused"`` if the recording was not identified.
    errors : dict
        Of both quantities at the printed depth, over the truth.
    statistical, systematic : dict
        The bars, over the size of the truth.
    deviations : tuple of float
        Of K, B and n without the fault, in the standard errors of the estimate, where
        Hunt and Crossley's law was selected.
    named : tuple of str
        The checks of :func:`named_by`, the most severe first.
    seconds : float
        CPU of the diagnosis.
    """

    overall: str = "refused"
    stiffness: str = "refused"
    damping: str = "refused"
    errors: dict[str, float] = field(default_factory=dict)
    statistical: dict[str, float] = field(default_factory=dict)
    systematic: dict[str, float] = field(default_factory=dict)
    deviations: tuple[float, ...] = ()
    named: tuple[str, ...] = ()
    sentence: str = ""
    seconds: float = math.nan


def unseen(job: tuple[str, int, int]) -> list[dict[str, Any]]:
    """Return the row of a bank, a fault's place and a seed."""
    bank, place, seed = job
    fault = UNSEEN[place]
    made = BANKS[bank](seed, f"{bank}/{fault.kind}/{fault.severity}")
    head = {
        "bank": bank,
        "kind": fault.kind,
        "severity": fault.severity,
        "shown": fault.shown,
        "rate": made.rate,
        "noise": made.noise / made.peak,
        "motion": made.motion,
        "length": float(made.time[-1]),
        "seed": seed,
    }
    if not fault.sampled:
        fault.damage(made)
        head["shows"] = made.shows()
    made.sample()
    if fault.sampled:
        fault.damage(made)
    return [{**head, **asdict(marked(made))}]


def without_fault(job: tuple[str, str, str, int]) -> list[dict[str, Any]]:
    """Return the row of a kind of noise, a motion, a length and a seed."""
    kind, motion, length, seed = job
    made = clean(seed, kind, motion, length)
    head = {"bank": "clean", "kind": kind, "motion": motion, "length": length, "seed": seed}
    head |= {"rate": made.rate, "noise": made.noise / made.peak}
    return [{**head, **asdict(marked(made))}]


def marked(made: Trial) -> Marked:
    """Identify and diagnose; compare with the truth."""
    try:
        result = identify(made.contact)
        start = time.process_time()
        found = result.diagnosis
        seconds = time.process_time() - start
    except PalpateError as error:
        return Marked(sentence=str(error))
    there = found.working_depth
    said = Marked(
        found.verdict.overall,
        found.verdict.stiffness,
        found.verdict.damping,
        named=named_by(result),
        sentence=found.reason,
        seconds=seconds,
    )
    for name, true in zip(QUANTITIES, made.truth(there.depth), strict=True):
        quantity = getattr(there, name)
        said.errors[name] = (quantity.value - true) / abs(true)
        said.statistical[name] = quantity.standard_error / abs(true)
        said.systematic[name] = quantity.systematic / abs(true)
    if len(result.law.parameters) == len(made.law.parameters):
        off = np.subtract(result.law.parameters, made.law.parameters)
        said.deviations = tuple((off / result.estimate.standard_errors).tolist())
    return said


def bar(row: dict[str, Any], name: str) -> float:
    """Both parts together, over the truth."""
    return math.hypot(row["statistical"].get(name, 0.0), row["systematic"].get(name, 0.0))


def wrong(row: dict[str, Any], name: str, error: float) -> bool:
    """Whether a quantity is off by more than three times an error, and by more than a little."""
    off = abs(row["errors"].get(name, 0.0))  # nothing is wrong in a refusal
    return bool(off > LEAST[name]) and not off <= BARS * error


def lies(row: dict[str, Any], name: str) -> bool:
    """Whether a quantity is wrong by both parts of its bar together."""
    return wrong(row, name, bar(row, name))


def clean_keys() -> list[tuple[str, str, str]]:
    return [(kind, motion, length) for kind in NOISES for motion in MOTION for length in LENGTHS]
