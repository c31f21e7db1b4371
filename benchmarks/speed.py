"""``python -m benchmarks.speed``: all results of speed and memory, with their limits.

All are ratios to something measured in the same run, or bounds that any recent machine keeps.
Needs the ``develop`` extra.
"""

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.console import Console

from benchmarks import machine, report
from benchmarks.allocations import count_allocations
from benchmarks.calls import measure_calls
from benchmarks.memory import measure_memory
from benchmarks.native_programs import BuildError, native_programs
from benchmarks.online_preparation import measure_preparation
from benchmarks.replays import measure_replays
from benchmarks.side_by_side import compare_with_peers
from benchmarks.startup import measure_startup
from benchmarks.timing import Effort, clock
from benchmarks.traces import measure_traces
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.speed", help_format="plaintext", version_flags=[])


@app.default
def main(
    *,
    quick: Annotated[bool, Parameter(negative="")] = False,
    as_json: Annotated[Path | None, Parameter(name="--json")] = None,
    markdown: Path | None = None,
) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    quick
        A short run, for a first look: fewer rounds, shorter recordings.
    as_json
        Write everything to this file as JSON.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([path for path in (as_json, markdown) if path is not None])
    effort = Effort.quick() if quick else Effort()
    where = machine.describe(_compiler())
    with clock() as running:
        sections = [
            measure_calls(running, effort),
            measure_preparation(running, effort),
            count_allocations(),
            measure_replays(running, effort),
            measure_traces(running, effort),
            compare_with_peers(running, effort),
            measure_startup(running, effort),
            measure_memory(effort),
        ]
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=140)
    report.print_sections(sections, where, console)
    if as_json is not None:
        content = json.dumps(report.as_dict(sections, where), indent=1, ensure_ascii=False)
        write_text(as_json, content + "\n")
    if markdown is not None:
        write_text(
            markdown,
            report.page(
                "Speed and memory, compared with other packages",
                "benchmarks.speed",
                sections,
                where,
            ),
        )


def _compiler() -> str:
    try:
        return native_programs().compiler
    except BuildError as error:
        print(f"without the C++ program: {error}", file=sys.stderr)
        return f"none ({error})"


if __name__ == "__main__":
    app()
