"""Reports of whole recordings: their size, their time, and whether they read back exactly.

``python -m benchmarks.reports``: the examples, and others' recordings if there are any, in
``PALPATE_DATA`` or ``../shared/data`` next to the checkout.
"""

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.common.recordings import recorded
from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
)
from palpate import RecordingError, compare, identify, load_result
from palpate.reports.identification import Destination

EXAMPLES = Path(__file__).parents[1] / "examples" / "recordings"


def main() -> None:
    """Write a report of each recording, and print its size and time."""
    sizes, ratios, exact, names = [], [], 0, []
    for file in [*sorted(EXAMPLES.glob("*.csv")), *recorded()]:
        try:
            size, ratio, same = measure(file)
        except RecordingError as error:
            print(f"{file.name}: skipped, {error}")
            continue
        print(f"{file.stem}: {size / 1e3:.0f} kB, {ratio:.2f} of the numbers' time")
        sizes.append(size / 1e3)
        ratios.append(ratio)
        names.append(file.stem)
        exact += same
    largest = int(np.argmax(sizes))
    median = statistics.median(ratios)
    reference = "identifying by every method, with a diagnosis each"
    rows = [
        Row(f"largest page: {names[largest]}", sizes[largest], "kB", limit=Limit(1000.0)),
        Row("median page", statistics.median(sizes), "kB"),
        Row("writing, median", median, "", median, reference),
        Row("results read back to the last bit", exact / len(sizes), "", limit=at_least(1.0)),
    ]
    publish([Section(f"{len(sizes)} recordings", rows)], describe_machine())


def measure(file: Path) -> tuple[int, float, bool]:
    """Return the bytes of a page, its time over the numbers', and whether it reads back."""
    began = time.perf_counter()
    result = identify(file)
    compared = compare(result.contact)
    for each in compared.values():
        _ = each.diagnosis
    numbers = time.perf_counter() - began
    with tempfile.TemporaryDirectory() as folder:
        destination = Destination(Path(folder))
        began = time.perf_counter()
        destination.save(result, compared=compared)
        writing = time.perf_counter() - began
        found = load_result(folder)
        same = found.law == result.law and np.array_equal(
            found.trace.parameters, result.trace.parameters, equal_nan=True
        )
        return (Path(folder) / "report.html").stat().st_size, writing / numbers, same


if __name__ == "__main__":
    run_command(main)
