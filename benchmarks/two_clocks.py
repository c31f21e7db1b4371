"""A position and a force in two files: offset of their clocks, stiffness and damping.

    python -m benchmarks.two_clocks --seeds 6

Six laws, three motions, penetration or position; rates of 125 to 1000 Hz for the position and 500
to 2000 Hz for the force, and offsets of 0, 37 ms, −0.4 s, 12 s, and a date against zero, in turn.
"""

import math
from collections import defaultdict
from itertools import product

import numpy as np

import palpate
from benchmarks.bank.trials import rise
from benchmarks.common.report import markdown_table, run_command, show
from palpate.force_laws import FlatSpectrum, GeneralisedHuntCrossley, SingleRelaxation
from palpate.validation import Floats

LAWS = {
    "Hunt–Crossley": GeneralisedHuntCrossley(K=9000.0, n=1.4, B=15000.0, p=1.4),
    "ball": GeneralisedHuntCrossley(K=2000.0, n=1.0, B=10000.0, p=1.0),
    "Kelvin–Voigt": GeneralisedHuntCrossley(K=1000.0, n=1.0, B=10.0, p=0.0),
    "half-space": GeneralisedHuntCrossley(K=6000.0, n=1.4, B=60.0, p=0.4),
    "tissue": GeneralisedHuntCrossley(
        K=8000.0, n=1.5, B=2000.0, p=1.5, M=8000.0, relaxation=FlatSpectrum(1e-3, 4.0)
    ),
    "relaxing": GeneralisedHuntCrossley(
        K=3000.0, n=1.4, B=2000.0, p=1.4, M=3000.0, relaxation=SingleRelaxation(0.3)
    ),
}
FINE = 1.0 / 8000.0  # s
RATES = ((125.0, 1000.0), (500.0, 500.0), (1000.0, 500.0), (250.0, 2000.0), (500.0, 1000.0))
OFFSETS = (37e-3, -0.4, 0.0, 12.0, 1.7e9 + 37e-3)  # s
NOISES = (0.01, 0.03, 0.06)  # N


def motion(kind: str, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Time and penetration, from free air to free air."""
    t = np.arange(0.0, 9.0, FINE)
    if kind == "press":
        return t, -4e-3 + 10e-3 * rise((t - 1.0) / 1.2) * (1.0 - rise((t - 5.0) / 0.8))
    if kind == "sines":
        sines = ((1.8e-3, 4.0), (1.5e-3, 11.0), (1e-3, 17.0))
        waves = sum(a * np.sin(w * t + random.uniform(0.0, 6.0)) for a, w in sines)
        return t, -3e-3 + rise((t - 0.6) / 0.8) * (1.0 - rise((t - 7.4) / 0.8)) * (9e-3 + waves)
    x, start = np.full(t.size, -4e-3), 0.7
    for _ in range(7):
        depth, seconds = random.uniform(7e-3, 12e-3), random.uniform(0.5, 1.0)
        phase = np.clip((t - start) / seconds, 0.0, 1.0)
        x += depth * 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))
        start += seconds + random.uniform(0.05, 0.35)
    return t, x


def run(law: GeneralisedHuntCrossley, kind: str, placed: bool, seed: int) -> list[float]:
    """Return error [ms] and standard error of the offset, errors of S and C in bars, bar of C."""
    random = np.random.default_rng(seed)
    t, x = motion(kind, random)
    force = law.force_along(x, np.gradient(x, t), FINE)
    force = np.where(x > 0.0, np.maximum(force, 0.0), 0.0)
    (pose, push), offset = RATES[seed % 5], OFFSETS[(seed + placed) % 5]
    at, other = (
        np.arange(random.uniform(0.0, 0.2), t[-1] - random.uniform(0.0, 0.2), 1.0 / rate)
        for rate in (pose, push)
    )
    x = np.interp(at, t, x) + 5e-6 * random.standard_normal(at.size)
    force = np.interp(other, t, force) + NOISES[seed % 3] * random.standard_normal(other.size)
    depth = {"z_m": 0.1 - x} if placed else {"penetration_m": x}
    files = {"time_s": at, **depth}, {"time_s": other + offset, "force_N": force}
    first, second = map(palpate.Recording, files)
    result = palpate.identify(first, companion=second, trace=False)
    clock = result.contact.prepared.recording.channels["force/time_s"]
    error, depth_at = float(np.median(other - clock)), result.working_depths[0]
    dynamic = law.dynamic_stiffness(depth_at.depth, result.frequency)
    truth = dynamic.real, dynamic.imag / result.frequency
    found = depth_at.stiffness, depth_at.damping
    bars = [abs(q.value - true) / q.whole_error for q, true in zip(found, truth, strict=True)]
    delay = result.contact.delay
    assert delay is not None
    return [1e3 * error, 1e3 * delay.standard_error, *bars, found[1].whole_error / truth[1]]


def main(*, seeds: int = 6) -> None:
    """Measure, and print the table.

    Parameters
    ----------
    seeds
        Runs of each law, motion and kind of position.
    """
    rows = defaultdict[str, list[list[float]]](list)
    cases = product(LAWS, ("touches", "press", "sines"), (False, True), range(seeds))
    for name, kind, placed, seed in cases:
        try:
            rows[name].append(run(LAWS[name], kind, placed, seed))
        except palpate.RecordingError as refusal:
            print(f"{name}, {kind}, {seed}: {refusal}")
            rows[name].append([math.nan] * 5)
    lines = []
    for name, found in [*rows.items(), ("all", [row for each in rows.values() for row in each])]:
        error, deviation, stiffness, damping, bar = np.array(found).T
        within = (abs(error) <= 2.0, abs(error) <= 2.0 * deviation, stiffness <= 3.0, damping <= 2)
        shares = [f"{100.0 * np.mean(each):.0f} %" for each in within]
        shares[2:2] = [f"{np.nanmedian(deviation):.2f}"]
        lines.append([name, len(found), *shares, f"{100 * np.nanmedian(bar):.0f} %"])
    headings = ("runs", "≤ 2 ms", "≤ 2 s.e.", "s.e. [ms]", "S ≤ 3 bars", "C ≤ 2 bars", "bar of C")
    show(markdown_table(("law", *headings), lines))


if __name__ == "__main__":
    run_command(main)
