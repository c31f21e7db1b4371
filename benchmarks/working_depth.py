"""Stiffness at working depth and K, with their relative errors, on others' recordings.

``python -m benchmarks.working_depth``. K is the force at one metre of depth, where no probe has
been; a recording determines the stiffness ∂F/∂x at the median penetration. The recordings are
those of ``PALPATE_DATA``, or of ``../shared/data`` next to the checkout.
"""

import math
import statistics
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.recordings import recorded
from benchmarks.common.report import command_line, describe_machine, markdown_table, run_command
from palpate import Identification, RecordingError, identify
from palpate.digits import rounded, with_error
from palpate.writing import check_writable, write_text

MARKS = ("trust", "with-care", "do-not-trust")
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
    """One recording's numbers; errors are relative."""

    name: str
    verdict: str
    depth: float
    stiffness: str
    whole: float
    repeatable: float
    coefficient: str
    coefficient_error: float
    exponent: str

    def cells(self) -> list[str]:
        """The row as words, under ``HEADINGS``."""
        return [
            self.name,
            self.verdict,
            rounded(1e3 * self.depth, 3),
            self.stiffness,
            _percent(self.whole),
            _percent(self.repeatable),
            self.coefficient,
            _percent(self.coefficient_error),
            self.exponent,
        ]


def main(markdown: Path | None = None) -> None:
    """Measure, and print the table.

    Parameters
    ----------
    markdown
        Write the page to this file.
    """
    if markdown is not None:
        check_writable(markdown)
    rows, skipped = [], []
    for file in recorded():
        try:
            rows.append(row_of(file.stem, identify(file, law="hunt-crossley")))
        except RecordingError as error:
            skipped.append(f"{file.stem}: skipped, {str(error).removeprefix(f'{file}: ')}.")
        print(f"{file.stem}: done", file=sys.stderr)
    if not rows:
        sys.exit("no recordings in PALPATE_DATA or ../shared/data")
    text = page(rows, skipped)
    print(text)
    if markdown is not None:
        write_text(markdown, text)


def row_of(name: str, result: Identification) -> Row:
    """Return what one recording gave."""
    there, law = result.diagnosis.working_depth, result.law
    stiffness, errors = there.stiffness, result.standard_errors
    parts = (stiffness.standard_error, stiffness.systematic)
    return Row(
        name,
        result.diagnosis.verdict.stiffness,
        there.depth,
        with_error(stiffness.value, *parts),
        math.hypot(*parts) / abs(stiffness.value),
        stiffness.standard_error / abs(stiffness.value),
        with_error(law.stiffness, float(errors[0])),
        float(errors[0]) / abs(law.stiffness),
        with_error(law.exponent, float(errors[2])),
    )


def page(rows: Sequence[Row], skipped: Sequence[str]) -> str:
    """Return the table, with what it comes to, as Markdown."""
    about = ("stiffness marked", "recordings", "total error", "statistical", "K's error")
    lines = [
        f"<!-- Written by {command_line()} -->",
        "",
        "# Stiffness at working depth, compared with K",
        "",
        *_why(rows),
        NOTE,
        "",
        *markdown_table((*about, "K's over the statistical one"), list(_summaries(rows))),
        "",
        *markdown_table(HEADINGS, [row.cells() for row in rows]),
        "",
        *(f"- {words}" for words in skipped),
        *(f"- {name}: {value}" for name, value in describe_machine().items()),
    ]
    return "\n".join(lines) + "\n"


def _why(rows: Sequence[Row]) -> list[str]:
    trusted = [row for row in rows if row.verdict == "trust"]
    if not trusted:
        return []
    whole = statistics.median(row.whole for row in trusted)
    coefficient = statistics.median(row.coefficient_error for row in trusted)
    return [WHY.format(whole=_percent(whole), coefficient=_percent(coefficient)), ""]


def _summaries(rows: Sequence[Row]) -> Iterator[list[str]]:
    for mark in (*MARKS, "any"):
        chosen = [row for row in rows if mark in (row.verdict, "any")]
        if chosen:
            medians = [
                _percent(statistics.median(getattr(row, name) for row in chosen))
                for name in ("whole", "repeatable", "coefficient_error")
            ]
            times = statistics.median(row.coefficient_error / row.repeatable for row in chosen)
            yield [mark, str(len(chosen)), *medians, f"{rounded(times, 2)} times"]


def _percent(value: float) -> str:
    return f"{rounded(100.0 * value, 2)} %" if math.isfinite(value) else "–"


if __name__ == "__main__":
    run_command(main)
