"""``python -m benchmarks.reading_text``: time and memory of reading long tables of text.

Every case runs in a separate process, after the packages are imported; memory is its peak above the
start, relative to the resulting arrays.
"""

import tempfile
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from benchmarks.common.report import Limit, Row, Section, describe_machine, publish, run_command
from benchmarks.common.timing import resident
from benchmarks.common.workers import in_new_process
from palpate.input.recordings import open_recording

WRITTEN = 100_000  # rows at once
LIMIT = 15.0  # s for 1e7 rows of four numbers


def write_table(path: Path, rows: int, label: bool = False) -> None:
    """Write time, three columns of 17 digits, and optionally a word."""
    generator = np.random.default_rng(0)
    names = ["time_s", "penetration_m", "velocity_m_s", "force_N"] + ["phase"] * label
    end = ",load\n" if label else "\n"
    with path.open("w") as file:
        file.write(",".join(names) + "\n")
        for first in range(0, rows, WRITTEN):
            time = np.arange(first, min(first + WRITTEN, rows)) * 1e-3
            values = generator.standard_normal((time.size, 3))
            file.writelines(
                f"{t:.6f},{x!r},{v!r},{f!r}{end}"
                for t, (x, v, f) in zip(time.tolist(), values.tolist(), strict=True)
            )


def measured(path: Path) -> tuple[float, float, float, float]:
    """Read a file; return seconds, those of the processor, bytes of the peak and of the arrays."""
    before, start, busy = resident("VmRSS"), perf_counter(), process_time()
    recording = open_recording(path)
    seconds, busy = perf_counter() - start, process_time() - busy
    extra = resident("VmHWM") - before
    size = sum(values.nbytes for values in recording.channels.values())
    return seconds, busy, extra, size


def main(*, rows: int = 10_000_000, markdown: Path | None = None) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    rows
        Rows of the table.
    markdown
        Write the table to this file as Markdown.
    """
    facts = describe_machine()
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for label in (False, True):
            path = Path(folder) / "table.csv"
            write_table(path, rows, label)
            what = "four numbers" + " and a word" * label
            seconds, busy, extra, size = in_new_process(measured, path)
            bound = None if label else Limit(LIMIT * rows / 1e7)
            found += [
                Row(f"{rows} rows of {what}", seconds, "s", limit=bound),
                Row("of that, processor time", busy, "s"),
                Row("memory at the peak", extra / 1e6, "MB", extra / size, "the arrays",
                    Limit(3.0)),
            ]  # fmt: skip
    section = Section("Reading text", found, ["One run each, in a separate process."])
    publish([section], facts, "Reading text", markdown)


if __name__ == "__main__":
    run_command(main)
