"""What is trusted of the damping with and without a known clock.

    python -m benchmarks.known_clock

First a clock that nothing shows, by the largest skew that a trusted damping must survive;
then payload logs, whose free air shows the clock; two files; and, where there are any, the silicone
recordings of ``benchmarks.common.recordings`` with the lag of their rig stated.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np

import palpate
from benchmarks.bank.material_faults import MATERIAL_FAULTS
from benchmarks.bank.trials import Fault, good, hard, spoil
from benchmarks.common.recordings import recorded
from benchmarks.common.report import markdown_table, run_command, show
from benchmarks.diagnosis.marks import NONE
from benchmarks.diagnosis.mix import FAULTS
from benchmarks.late_force import record, relaxing_material
from benchmarks.two_clocks import LAWS, run_pair
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.identification.diagnosis.causes import USUAL_SKEW
from palpate.method.contact import Delay
from tests.robot_logs import identify as identify_log
from tests.robot_logs import random_setup

LARGEST = (1e-3, 2e-3, 3e-3, 5e-3, 10e-3)  # s
WRONG = 0.2  # of B′
RIG_LAG = (-22.5e-3, 0.5e-3)  # s, of the silicone recordings
Truth: TypeAlias = Callable[[palpate.Identification], float]
Bank: TypeAlias = Iterator[tuple[Callable[[], palpate.Contact], Truth]]


def spoiled(faults: list[Fault], key: str, seeds: range) -> Bank:
    """Draw recordings with one fault of a sensor or a material each."""
    for seed in seeds:
        fault = faults[37 * seed % len(faults)]
        name = f"{key}/{fault.kind}/{fault.severity}"
        made = spoil((hard if seed % 3 == 2 else good)(seed, name), fault)
        yield (
            lambda made=made: made.contact,  # type: ignore[misc]
            lambda result, made=made: made.truth(result.working_depths[0].depth)[1],  # type: ignore[misc]
        )


def late_materials(seeds: range) -> Bank:
    """Draw materials that relax, whose force is up to 6 ms late or early."""
    for seed in seeds:
        random = np.random.default_rng(seed)
        law = relaxing_material(random)
        contact = record(law, random.uniform(-6e-3, 6e-3), random)

        def truth(result: palpate.Identification, law: GeneralisedHuntCrossley = law) -> float:
            at = law.dynamic_stiffness(result.working_depths[0].depth, result.frequency)
            return float(at.imag) / result.frequency

        yield lambda contact=contact: contact, truth  # type: ignore[misc]


def judge(contact: palpate.Contact, truth: Truth) -> list[tuple[bool, bool]]:
    """Return *trust*, and *trust* and wrong, by the largest skew that the damping survives."""
    result = palpate.identify(contact, trace=False)
    trusted = [result.diagnosis.verdict.damping == "trust"] * len(LARGEST)
    if not result.law.power_law:
        stated = replace(contact, delay=Delay(0.0, USUAL_SKEW))
        at = palpate.identify(stated, trace=False).diagnosis
        bar, stiffness = at.working_depth.damping, at.working_depth.stiffness.value
        trusted = [
            at.verdict.damping == "trust"
            and math.hypot(bar.whole_error, stiffness * math.sqrt(skew**2 - USUAL_SKEW**2))
            <= WRONG * abs(bar.value)
            for skew in LARGEST
        ]
    off = abs(result.working_depths[0].damping.value / truth(result) - 1.0)
    return [(mark, mark and off > WRONG) for mark in trusted]


def measure_unknown(first: int, count: int) -> list[str]:
    """Return the table for clocks that nothing shows."""
    seeds = range(first, first + count)
    banks: dict[str, Bank] = {
        "`mix`: Hunt–Crossley, faults of sensors": spoiled([*FAULTS, *NONE], "mix", seeds),
        "other materials, in step": spoiled(MATERIAL_FAULTS, "materials", seeds),
        "materials that relax, up to 6 ms late": late_materials(seeds),
    }
    lines = []
    for name, bank in banks.items():
        found = []
        for make, truth in bank:
            try:
                found.append(judge(make(), truth))
            except palpate.PalpateError:
                continue
        shares = 100.0 * np.mean(found, axis=0)
        lines.append([name, len(found), *(f"{a:.0f}; {b:.1f}" for a, b in shares)])
    headings = [f"{1e3 * skew:g} ms" for skew in LARGEST]
    return markdown_table(("*trust*; of these off > 20 % [%]", "recordings", *headings), lines)


def measure_payloads(first: int, count: int) -> list[str]:
    """Return the table for logs of a wrench whose free air shows the clock."""
    rows = []
    for seed in range(first, first + count):
        still = {"friction": 0.0} if seed % 2 else {}
        rows.append(identify_log(random_setup(seed, touch_tilt=0.0, **still)))
    off = np.abs([row.absolute["C, %"] for row in rows])
    in_bars = np.abs([row.in_errors["C"] for row in rows])
    trusted = np.array([row.damping_mark == "trust" for row in rows])
    line = [
        len(rows),
        f"{100.0 * trusted.mean():.0f} %",
        f"{100.0 * np.mean(trusted & (off > 100.0 * WRONG)):.1f} %",
        f"{np.median(off / in_bars) / np.median(off):.1f}",
        f"{100.0 * np.mean(in_bars <= 2.0):.0f} %",
    ]
    headings = ("payload logs", "*trust*", "*trust*, off > 20 %", "bar / error", "≤ 2 bars")
    return markdown_table(headings, [line])


def measure_pairs(first: int) -> list[str]:
    """Return the table for positions and forces in two files, of one clock or of two."""
    lines = []
    for name, offset in (("one clock", 1.7e9), ("two clocks", None)):
        rows, refused = [], 0
        for k in range(48):
            law, kind = [*LAWS][k % 6], ("touches", "sines")[k // 6 % 2]
            try:
                rows.append(run_pair(LAWS[law], kind, k // 12 % 2 == 1, first + k, offset))
            except palpate.RecordingError:
                refused += 1
        trusted = [row for row in rows if row.damping_mark == "trust"]
        wrong = [row for row in trusted if row.damping_error > WRONG]
        within = np.mean([row.in_bars[1] <= 2.0 for row in rows])
        lines.append([name, 48, refused, len(trusted), len(wrong), f"{100.0 * within:.0f} %"])
    headings = ("two files", "pairs", "refused", "*trust*", "*trust*, off > 20 %", "≤ 2 bars")
    return markdown_table(headings, lines)


def measure_silicone() -> list[str]:
    """Return the table for the silicone recordings; empty without them."""
    contacts = [palpate.prepare(file) for file in recorded("G_*.csv")]
    shifted = [palpate.prepare(file, delay=RIG_LAG) for file in recorded("G_*.csv")]
    lines = []
    for name, used in (("as it is", contacts), ("its lag stated to ± 0.5 ms", shifted)):
        marks = [palpate.identify(each, trace=False).diagnosis.verdict.damping for each in used]
        lines.append([name, len(marks), marks.count("trust")])
    return markdown_table(("silicone", "recordings", "*trust*"), lines) if contacts else []


def main(*, first: int = 0, count: int = 200, logs: int = 150) -> None:
    """Measure, and print the tables.

    Parameters
    ----------
    first
        The first seed.
    count
        Recordings of each bank whose clock is unknown.
    logs
        Payload logs.
    """
    show(measure_unknown(first, count))
    show(measure_payloads(first, logs))
    show(measure_pairs(first))
    show(measure_silicone())


if __name__ == "__main__":
    run_command(main)
