"""Whether the sums give the residual of the samples, for all candidates between nodes."""

import subprocess

from benchmarks.native_programs import BuildError, native_programs
from benchmarks.report import Limit, Row, Section

TITLE = "|RSS of the sums − RSS of the samples|/ΣF²"
KINDS = (
    "common, n = 1.1 to 3.2",
    "full, n = 1.1 to 3.2",
    "common, n = 0.53 and 0.61",
    "full, n = 0.53 and 0.61",
)
HOW = (
    "Each law of the tier at exponents, relaxation times and slopes between the nodes, compared "
    "with a direct sum over the samples at that exponent. From 2 % of the peak penetration on."
)


def measure_sums() -> Section:
    """Measure the largest of all candidates at exponents between the nodes.

    Without a compiler the section has a note and no rows.
    """
    try:
        program = native_programs().law_sums
    except BuildError as error:
        return Section(TITLE, [], (f"Not measured: {error}",))
    done = subprocess.run([str(program)], capture_output=True, text=True, check=True)
    rows = []
    for line in done.stdout.splitlines():
        *numbers, name = line.split(maxsplit=len(KINDS))
        for kind, number in zip(KINDS, numbers, strict=True):
            rows.append(Row(f"{name}: {kind}", float(number), "", limit=Limit(1e-6)))
    return Section(TITLE, rows, (HOW,))
