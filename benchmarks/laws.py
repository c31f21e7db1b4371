"""``python -m benchmarks.laws``: the selected law, its memory and parameters, against the truth.

Others' recordings are read from ``PALPATE_DATA``, or ``../shared/data`` next to the checkout, and
skipped if they are absent.
"""

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Annotated

import numpy as np
from cyclopts import App, Parameter
from rich.console import Console

from benchmarks import machine, report
from benchmarks.law_cost import measure_cost
from benchmarks.law_recordings import folder_of_recordings, held_out, microrheology, whole_files
from benchmarks.law_sums import measure_sums
from benchmarks.law_traps import measure_traps
from benchmarks.law_trials import PERCENT, measure_false_memory, measure_verdicts
from benchmarks.report import Limit, Row, Section
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.laws", help_format="plaintext", version_flags=[])


def measure_recordings(folder: Path) -> Section:
    """Measure how well the law of one part predicts the other, over Hunt–Crossley."""
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
    return Section("Others' recordings: RMSE of the held-out part over that of Hunt–Crossley", rows)


def measure_whole_files(folder: Path) -> Section:
    """Identify complete files as ``palpate identify --method viscoelastic`` does."""
    rows = [Row(f"{name}: {words}", ratio, "") for name, words, ratio in whole_files(folder)]
    return Section("Complete recordings: law, and its residual over Hunt–Crossley's", rows)


@app.default
def main(
    *,
    quick: Annotated[bool, Parameter(negative="")] = False,
    seeds: int = 100,
    first: int = 0,
    markdown: Path | None = None,
) -> None:
    """Measure, and print each table as soon as it is complete.

    Parameters
    ----------
    quick
        A short run, for a first look: 5 seeds.
    seeds
        Number for each law.
    first
        The first seed.
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
    """Yield each table in turn."""
    yield measure_sums()
    for decibels in (30.0, 40.0):
        for full in (False, True):
            yield measure_verdicts(seeds, decibels, full)
    yield measure_false_memory(seeds)
    yield measure_traps(seeds)
    # The minimum of some ten passes hardly contains the load of other processes.
    yield measure_cost(20_000, 3 if quick else 20)
    folder = folder_of_recordings()
    if folder is not None:
        yield measure_recordings(folder)
        yield measure_whole_files(folder)


if __name__ == "__main__":
    app()
