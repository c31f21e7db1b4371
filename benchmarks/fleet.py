"""Many contacts at once: speed and safety.

``python -m benchmarks.fleet`` takes some ten minutes, 6 GB of disk and two cores; ``--short`` a
minute, with fewer of everything. ``--only`` chooses among arrays, balance, kills, files,
force-curves, nanite; for the last, ``--nanite`` names the Python of an environment that has it.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from benchmarks.fleets import arrays, balance, files, force_curves, kills, nanite
from benchmarks.machine import describe
from benchmarks.report import Section, page, print_sections


def parts(options: argparse.Namespace) -> dict[str, Callable[[], Section]]:
    """The measurements, by name."""
    short, folder = options.short, options.folder
    return {
        "arrays": lambda: arrays.measure(2_000 if short else 100_000, folder),
        "balance": lambda: balance.measure(2_000, folder),
        "kills": lambda: kills.measure(6_000 if short else 40_000, 2 if short else 20, folder),
        "files": lambda: files.measure(40 if short else 10_000, 4 if short else 100, folder),
        "force-curves": force_curves.measure,
        "nanite": lambda: nanite.measure(options.nanite),
    }


def main() -> None:
    """Measure the requested parts, and print them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--short", action="store_true", help="fewer of everything")
    parser.add_argument("--only", nargs="+", help="some of the parts")
    parser.add_argument("--nanite", default="python", help="Python that has nanite")
    parser.add_argument("--folder", type=Path, help="for scratch files; else a temporary one")
    parser.add_argument("--markdown", type=Path, help="write the tables to this file too")
    options = parser.parse_args()
    known = parts(options)
    for name in options.only or ():
        if name not in known:
            parser.error(f"--only must name some of {', '.join(known)}, not {name}")
    sections = [measure() for name, measure in known.items() if name in (options.only or known)]
    machine = describe("none")
    print_sections(sections, machine, Console())
    if options.markdown is not None:
        options.markdown.write_text(
            page("Fleets", "benchmarks.fleet", sections, machine), encoding="utf-8"
        )


if __name__ == "__main__":
    main()
