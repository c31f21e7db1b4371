"""``python -m benchmarks.diagnosis.bars``: bars and marks on banks written apart from ``mix``.

Rows of a bank: recordings; mean log score of the bar as the scale of Student's t (ν 4); median bar
over median error, clean and with a fault; within two bars; *trust*; *trust* and off by more than
10 % (stiffness) or 20 % (damping). The robot of the laboratory is a third simulator. A last line
counts the printed reasons that name the largest part of their number's bar.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from benchmarks.bank import second
from benchmarks.common.report import markdown_table, run_command
from benchmarks.common.workers import Workers
from benchmarks.diagnosis.marks import largest_named
from palpate import Contact, HuntCrossley, PalpateError, identify, lab
from palpate.validation import Floats

LIMITS = {"K′": 0.10, "B′": 0.20}
FAULTS, KINDS = tuple(second.FAULTS), tuple(second.KINDS)
ROBOT = [
    (lab.MATERIALS[material], lab.TRAJECTORIES[motion])
    for material in ("ball", "sponge", "pvc")
    for motion in ("three-sines", "two-sines", "palpation")
]
Job = tuple[str, str, int, str | None]  # bank, kind, seed, law


class Outcome(NamedTuple):
    """Relative errors, bars and marks of K′ and B′; errors are NaN where none is given."""

    bank: str
    kind: str
    errors: tuple[float, float] = (math.nan, math.nan)
    bars: tuple[float, float] = (math.nan, math.nan)
    trusted: tuple[bool, bool] = (False, False)
    largest_named: tuple[bool, ...] = ()


def jobs_of(first: int, count: int) -> Iterator[Job]:
    """The recordings of all banks: so many of the second bank, and fewer of the others."""
    for k in range(first, first + count):
        if k % 2:
            yield "second", "clean", k, None
        yield "second", FAULTS[k % len(FAULTS)], k, None
        yield "kinds in no design", KINDS[k % len(KINDS)], k, None
        yield "materials that relax", "relaxing", k, None
        if k < first + 120:
            yield "second", "filtered", k, None
        if k < first + 90:
            yield "robot of the laboratory", "robot", k, None
        if k < first + 40:
            yield "PVC, named law", "robot", len(ROBOT) * k + 6, "hunt-crossley"
        if k < first + 38:
            yield "hammer with a mass", "hammer", k, None


def outcome(job: Job) -> Outcome:
    """Identify one recording, and compare with its truth."""
    bank, kind, seed, law = job
    contact, truth = _recording(kind, seed)
    try:
        result = identify(contact, law=law, trace=False)
        named = tuple(largest_named(result))
    except PalpateError:
        return Outcome(bank, kind)
    at, verdict = result.diagnosis.working_depth, result.diagnosis.verdict
    true = np.abs(truth(at.depth, result.frequency))
    values = np.array([at.stiffness.value, at.damping.value])
    errors = np.abs(values - truth(at.depth, result.frequency)) / true
    bars = np.array([at.stiffness.whole_error, at.damping.whole_error]) / true
    trusted = verdict.stiffness == "trust", verdict.damping == "trust"
    return Outcome(bank, kind, (errors[0], errors[1]), (bars[0], bars[1]), trusted, named)


def _recording(kind: str, seed: int) -> tuple[Contact, second.Truth]:
    if kind == "hammer":
        return second.strike(seed)
    if kind != "robot":
        return second.press(kind, seed)
    material, motion = ROBOT[seed % len(ROBOT)]
    law: HuntCrossley = material.law  # type: ignore[attr-defined]  # of a homogeneous one
    contact = lab.Bench(material, motion).run(seed).contact
    return contact, lambda depth, turns: (law.stiffness_at(depth), law.damping_at(depth))


def rows_of(outcomes: list[Outcome]) -> Iterator[list[object]]:
    """A row for each bank and number."""
    banks: dict[str, list[Outcome]] = {}
    for each in outcomes:
        banks.setdefault(each.bank, []).append(each)
        if each.kind == "filtered":
            banks.setdefault("its filtered sensors", []).append(each)
    for bank, own in banks.items():
        faulty = np.array([each.kind in FAULTS + KINDS for each in own])
        for number, (name, limit) in enumerate(LIMITS.items()):
            errors, bars = (np.array([x[k][number] for x in own]) for k in (2, 3))
            trusted = np.array([each.trusted[number] for each in own])
            clean = ~faulty & np.array(
                [each.kind != "filtered" or bank != "second" for each in own]
            )
            given = np.isfinite(errors) & np.isfinite(bars)
            score = student.logpdf(errors / bars, 4.0) - np.log(bars)
            wrong = trusted & (errors > limit)
            yield [
                bank,
                name,
                len(own),
                f"{np.mean(score[given]):.2f}",
                *(_ratio(bars[given & k], errors[given & k]) for k in (clean, faulty)),
                f"{100.0 * np.mean(errors[given] <= 2.0 * bars[given]):.1f}",
                f"{100.0 * trusted.mean():.1f}",
                f"{100.0 * wrong.mean():.1f} ({wrong.sum()})",
                np.count_nonzero(~trusted),
            ]


def _ratio(bars: Floats, errors: Floats) -> str:
    return f"{np.median(bars) / np.median(errors):.1f}" if bars.size else "–"


def main(*, first: int = 0, count: int = 300, workers: int | None = None) -> None:
    """Measure, and print the table.

    Parameters
    ----------
    first
        The first seed.
    count
        Recordings with a fault of the second bank.
    workers
        Worker processes. Default: one per core.
    """
    outcomes = Workers(workers).map("recordings", outcome, list(jobs_of(first, count)))
    heads = ["bank", "number", "recordings", "log score", "bar / error, clean", "faulty"]
    heads += ["within two bars, %", "*trust*, %", "*trust* and off, %", "not *trust*"]
    print("\n".join(markdown_table(heads, list(rows_of(outcomes)))))
    named = [largest for each in outcomes for largest in each.largest_named]
    print(f"\nOf {len(named)} reasons that name a part of a bar, {sum(named)} name the largest.")


if __name__ == "__main__":
    run_command(main)
