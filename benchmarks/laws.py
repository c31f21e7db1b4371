"""``python -m benchmarks.laws``: which law it is, its memory and its numbers, against the truth.

Recordings made by others are looked for in ``PALPATE_DATA``, or ``../shared/data`` beside the
checkout, and are left out where they are absent.
"""

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Annotated

import numpy as np
from cyclopts import App, Parameter
from rich.console import Console

from benchmarks import machine, report
from benchmarks.law_recordings import folder_of_recordings, held_out, microrheology, whole_files
from benchmarks.law_traps import measure_traps
from benchmarks.law_trials import PERCENT, measure_false_memory, measure_sums, measure_verdicts
from benchmarks.law_truths import DT, GATE, UNITS, law_of, motion, noise
from benchmarks.report import Limit, Row, Section
from palpate import FlatSpectrum, ViscoelasticContact
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.laws", help_format="plaintext", version_flags=[])


def measure_cost(samples: int) -> Section:
    """Time a sample, the longest call, and the size of one."""
    rows = []
    for name, memory, limits in (
        ("everyday", "auto", (250.0, 4.0)),
        ("full", "any", (1500.0, 20.0)),
    ):
        law = law_of("hunt-crossley", 0.5, FlatSpectrum(DT, 4096.0 * DT))
        x, v = (np.tile(part, 1 + samples // part.size)[:samples] for part in motion(0))
        force = law.force_along(x, v, DT) + 0.01 * noise(0, x.size, 0.0)
        estimator = ViscoelasticContact(memory=memory, gate=GATE, scale=UNITS)  # type: ignore[arg-type]
        begun = perf_counter()
        estimator.replay(x, v, force, at=())
        spent = 1e9 * (perf_counter() - begun) / samples
        calls = []
        estimator.reset()
        for row in zip(x[:20_000].tolist(), v.tolist(), force.tolist(), strict=False):
            begun = perf_counter()
            estimator.update(*row)
            calls.append(perf_counter() - begun)
        size = len(estimator._state()) / 1e3
        rows += [
            Row(f"{name}: a sample", spent, "ns", limit=Limit(limits[0])),
            Row(f"{name}: memory of one", size, "kB", limit=Limit(limits[1])),
            # Of 20 000 calls the machine interrupts some: of the hundred longest the shortest.
            Row(f"{name}: longest call", 1e6 * sorted(calls)[-100], "µs", limit=Limit(200.0)),
        ]
    return Section(f"Cost, {samples} samples", rows)


def measure_recordings(folder: Path) -> Section:
    """How far the law of one part of a recording predicts the other, over Hunt–Crossley."""
    rows = []
    for split, limit in (("second half", 0.72), ("odd blocks", 0.62)):
        ratios = held_out(folder, split)
        rows += [Row(f"{split}: {name}", ratio, "") for name, ratio in ratios.items()]
        mean = float(np.exp(np.mean(np.log(list(ratios.values())))))
        rows.append(Row(f"{split}: geometric mean of {len(ratios)}", mean, "", limit=Limit(limit)))
        if split == "odd blocks":
            worst = max(ratios.values())
            rows.append(Row("odd blocks: the largest", worst, "", limit=Limit(1.1)))
    for name, stiffness, damping in microrheology(folder):
        rows += [
            Row(f"{name}: K′ at 100 Hz", PERCENT * abs(stiffness), "%", limit=Limit(25.0)),
            Row(f"{name}: B′ at 100 Hz", PERCENT * abs(damping), "%", limit=Limit(10.0)),
        ]
    return Section("Recordings made by others: RMSE of the held-out part over that of HC", rows)


def measure_whole_files(folder: Path) -> Section:
    """Whole files as ``palpate identify --method viscoelastic`` takes them."""
    rows = [Row(f"{name}: {words}", ratio, "") for name, words, ratio in whole_files(folder)]
    return Section("Whole recordings: law, and what it leaves over what Hunt–Crossley does", rows)


@app.default
def main(
    *,
    quick: Annotated[bool, Parameter(negative="")] = False,
    seeds: int = 100,
    first: int = 0,
    markdown: Path | None = None,
) -> None:
    """Measure, and print a table as soon as it is known.

    Parameters
    ----------
    quick
        A short run, for a first look: 5 seeds.
    seeds
        So many of each law.
    first
        The first of them.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([] if markdown is None else [markdown])
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=140)
    sections, begun = [], perf_counter()
    for section in measured(range(first, first + (5 if quick else seeds)), quick):
        sections.append(section)
        report.print_sections([section], {"after": f"{perf_counter() - begun:.0f} s"}, console)
    where = machine.describe("")
    for name, value in where.items():
        console.print(f"{name}: {value}", soft_wrap=True)
    console.print(report.verdict(sections), style="bold")
    if markdown is not None:
        write_text(markdown, report.as_markdown(sections, where))


def measured(seeds: range, quick: bool) -> Iterator[Section]:
    """Each table in turn."""
    yield measure_sums()
    for decibels in (30.0, 40.0):
        for full in (False, True):
            yield measure_verdicts(seeds, decibels, full)
    yield measure_false_memory(seeds)
    yield measure_traps(seeds)
    yield measure_cost(100_000 if quick else 1_000_000)
    folder = folder_of_recordings()
    if folder is not None:
        yield measure_recordings(folder)
        yield measure_whole_files(folder)


if __name__ == "__main__":
    app()
