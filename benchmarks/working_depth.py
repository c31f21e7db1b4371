"""Stiffness at working depth and K, with their relative errors, on others' recordings.

``python -m benchmarks.working_depth``. K is the force at one metre of depth, where no probe has
been; a recording determines the stiffness ∂F/∂x at the median penetration. The recordings are
those of ``PALPATE_DATA``, or of ``../shared/data`` next to the checkout.
"""

import math
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.recordings import recorded
from benchmarks.common.report import describe_machine, list_facts, markdown_table, run_command, show
from palpate import Identification, RecordingError, identify
from palpate.digits import rounded, with_error

MARKS = ("trust", "with-care", "do-not-trust", "any")
HEADINGS = (
    "recording",
    "verdict on the stiffness",
    "depth, mm",
    "stiffness, N/m (± statistical ± systematic)",
    "total error",
    "statistical",
    "K, N/mⁿ",
    "its error",
    "n",
)
WHY = (
    "How well is the stiffness known where the probe was, compared with K? For the recordings "
    "marked `trust`, the stiffness is known to {whole} in total, and K to {coefficient} (medians). "
    "K is the force at one metre of depth, where no probe has been, in a unit that depends on the "
    "exponent."
)
NOTE = (
    "Each recording is identified by `palpate identify --law hunt-crossley`. The stiffness is "
    "∂F/∂x at the median penetration. Its statistical error is from the scatter of the residual "
    "and the uncertainty of the surface; the total error adds the systematic uncertainty from the "
    "diagnosis. K's error is from the scatter and the surface only. Errors are one standard "
    "deviation, in per cent of the value's size."
)


@dataclass(frozen=True, slots=True)
class Row:
    """One recording's verdict, its relative errors, and its cells under ``HEADINGS``."""

    verdict: str
    whole: float
    statistical: float
    coefficient: float
    cells: list[str]


def main(markdown: Path | None = None) -> None:
    """Measure, and print the table.

    Parameters
    ----------
    markdown
        Write the page to this file.
    """
    rows, skipped = [], []
    for file in recorded():
        try:
            rows.append(row_of(file.stem, identify(file, law="hunt-crossley")))
        except RecordingError as error:
            skipped.append(f"{file.stem}: skipped, {str(error).removeprefix(f'{file}: ')}.")
    if not rows:
        sys.exit("no recordings in PALPATE_DATA or ../shared/data")
    medians = {mark: [row for row in rows if mark in (row.verdict, "any")] for mark in MARKS}
    about = ("stiffness marked", "recordings", "total error", "statistical", "K's error")
    summary = [_summary(mark, chosen) for mark, chosen in medians.items() if chosen]
    lines = [
        *_why(medians["trust"]),
        NOTE,
        "",
        *markdown_table((*about, "K's over the statistical one"), summary),
        "",
        *markdown_table(HEADINGS, [row.cells for row in rows]),
        "",
        *(f"- {words}" for words in skipped),
        *list_facts(describe_machine()),
    ]
    show(lines, "Stiffness at working depth, compared with K", markdown)


def row_of(name: str, result: Identification) -> Row:
    """Return what one recording gave."""
    there, law = result.diagnosis.working_depth, result.law
    stiffness, errors = there.stiffness, result.standard_errors.tolist()
    parts = (stiffness.standard_error, stiffness.systematic)
    verdict, size = result.diagnosis.verdict.stiffness, abs(stiffness.value)
    whole, statistical = math.hypot(*parts) / size, parts[0] / size
    coefficient = errors[0] / abs(law.K)
    known = (with_error(stiffness.value, *parts), _percent(whole), _percent(statistical))
    k, n = with_error(law.K, errors[0]), with_error(law.n, errors[2])
    cells = [name, verdict, rounded(1e3 * there.depth, 3), *known, k, _percent(coefficient), n]
    return Row(verdict, whole, statistical, coefficient, cells)


def _why(trusted: list[Row]) -> list[str]:
    if not trusted:
        return []
    whole = statistics.median(row.whole for row in trusted)
    coefficient = statistics.median(row.coefficient for row in trusted)
    return [WHY.format(whole=_percent(whole), coefficient=_percent(coefficient)), ""]


def _summary(mark: str, rows: list[Row]) -> list[str]:
    errors = [(row.whole, row.statistical, row.coefficient) for row in rows]
    medians = [_percent(statistics.median(each)) for each in zip(*errors, strict=True)]
    times = statistics.median(row.coefficient / row.statistical for row in rows)
    return [mark, str(len(rows)), *medians, f"{rounded(times, 2)} times"]


def _percent(value: float) -> str:
    return f"{rounded(100.0 * value, 2)} %" if math.isfinite(value) else "–"


if __name__ == "__main__":
    run_command(main)
