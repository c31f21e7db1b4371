"""Many contacts at once: speed and safety.

``python -m benchmarks.fleet`` takes some ten minutes, two cores and 6 GB of disk, in ``TMPDIR``;
``--short`` a minute, with fewer of everything. ``--only`` chooses among arrays, balance, kills,
files, force-curves, nanite; for the last, ``--nanite`` names the Python of an environment that has
it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from benchmarks.common.report import Section, describe_machine, publish, run_command
from benchmarks.fleets import arrays, files, force_curves, nanite

Part = Literal["arrays", "balance", "kills", "files", "force-curves", "nanite"]


def main(
    *,
    short: bool = False,
    only: Annotated[list[Part] | None, Parameter(consume_multiple=True)] = None,
    nanite_python: Annotated[str, Parameter("--nanite")] = "python",
    markdown: Path | None = None,
) -> None:
    """Measure the requested parts, and print them.

    Parameters
    ----------
    short
        Fewer of everything.
    only
        Some of the parts. Default: all.
    nanite_python
        Python that has nanite.
    markdown
        Write the tables to this file too.
    """
    parts: dict[Part, Callable[[], Section]] = {
        "arrays": lambda: arrays.measure_arrays(2_000 if short else 100_000),
        "balance": lambda: arrays.measure_balance(2_000),
        "kills": lambda: arrays.measure_kills(*((6_000, 2) if short else (40_000, 20))),
        "files": lambda: files.measure(*((40, 4) if short else (10_000, 100))),
        "force-curves": force_curves.measure,
        "nanite": lambda: nanite.measure(nanite_python),
    }
    sections = [parts[name]() for name in parts if name in (only or parts)]
    publish(sections, describe_machine(), "Fleets", markdown)


if __name__ == "__main__":
    run_command(main)
