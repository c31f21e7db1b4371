"""The command ``python -m paper``."""

import io
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, Parameter
from cyclopts.validators import Number
from rich.console import Console
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from palpate import InvalidParameterError, PalpateError
from palpate.writing import abandon_output, as_json, make_folder, write_text

if TYPE_CHECKING:
    from paper.experiment import Experiment
    from paper.report import Report
    from paper.running import Progress

app = App(
    name="python -m paper",
    help_format="markdown",
    version_flags=[],
    default_parameter=Parameter(negative_iterable=()),
    exit_on_error=False,
    print_error=False,
    result_action="return_value",
)
Names = Annotated[tuple[str, ...], Parameter(consume_multiple=True, show_default=False)]
#: Columns of what goes to a file or a pipe: no row of the table is folded.
_PIPE = 160


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    It is 2 after an error, 130 after an interrupt, and 141 where the reader of the output is gone.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # signs that the terminal's encoding lacks
    try:
        app(arguments)
    except BrokenPipeError:
        abandon_output()
        return 141  # like a program that SIGPIPE ended
    except (CycloptsError, PalpateError, OSError) as error:
        _complain(str(error))
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


@app.default
def reproduce(
    *,
    only: Names = (),
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("report"),
    seeds: Annotated[int, Parameter(validator=Number(gte=1, lte=10_000))] = 5,
    workers: Annotated[int | None, Parameter(validator=Number(gte=1, lte=1_000))] = None,
    settings: Annotated[int, Parameter(validator=Number(gte=0, lte=10_000))] = 0,
    recording: Annotated[
        tuple[Path, ...], Parameter(consume_multiple=True, show_default=False)
    ] = (),
) -> None:
    """Repeat the paper's experiments in simulation, and write a report.

    Repeat the command to continue an interrupted run.

    For example:

        python -m paper --only fig05 fig06 --seeds 2 -o report

    Parameters
    ----------
    only
        Names of experiments, such as fig05 fig06 (default: all).
    output
        Folder for report.html, report.json, claims.md, figures and outcomes.
    seeds
        Number of repetitions, each with other noise.
    workers
        Number of processes (default: one per core).
    settings
        Instead, judge every claim with so many draws of what the paper leaves open, and write
        settings.json to the folder; the report reads the one in paper/.
    recording
        Instead, compare the paper's methods on these recordings of others, and write
        recordings.json and recordings.md to the folder; the report reads the one in paper/.
    """
    if recording:
        _compare(recording, output)
        return
    from palpate.errors import require_mujoco

    import_module("palpate.output.figures")  # raises before the work if matplotlib is not installed
    require_mujoco()
    from paper.running import judge_draws, run_paper

    experiments = _chosen(only)
    if settings:
        with _progress() as progress:
            answers = judge_draws(
                experiments, count=settings, seeds=seeds, workers=workers, progress=progress
            )
        make_folder(output)
        write_text(output / "settings.json", as_json(answers))
        for name, signs in answers.items():
            print(f"{name}: {signs.count('1')} of {len(signs)}")
        return
    try:
        with _progress() as progress:
            report = run_paper(
                experiments,
                seeds=seeds,
                folder=output,
                workers=workers,
                progress=progress,
                begun=_report_reuse,
            )
    except KeyboardInterrupt:
        if (output / "report.html").is_file():
            words = "interrupted; repeat the command to continue"
            _complain(f"{words}: {output / 'report.html'}")
        raise
    _print(report, output)


def _compare(recordings: tuple[Path, ...], output: Path) -> None:
    """Print the table of methods by recording, and where palpate loses; write both."""
    from paper.recordings import losses, markdown, measure, plain, summary, table

    every = {}
    for path in recordings:
        try:
            every[path.stem] = measure(path)
        except PalpateError as error:
            _complain(f"{path}: skipped: {error}")
    if not every:
        raise PalpateError("no recording left to compare")
    make_folder(output)
    write_text(output / "recordings.json", as_json(plain(every)))
    write_text(output / "recordings.md", markdown(every))
    shown = table(every)
    printed = Table(*shown.header, box=None, pad_edge=False)
    printed.columns[0].no_wrap = True
    for row in shown.rows:
        printed.add_row(*(Text(cell.replace("*", "")) for cell in row))
    Console(highlight=False, width=None if sys.stdout.isatty() else _PIPE).print(printed)
    print("\n".join(summary(every)))
    print("\n".join(["where palpate loses:", *losses(every)]))


def _complain(words: str) -> None:
    """Print one line on standard error."""
    print(f"paper: {' '.join(words.split())}", file=sys.stderr)


def _chosen(only: tuple[str, ...]) -> "list[Experiment]":
    from paper.experiments import EXPERIMENTS

    for name in only:
        if name not in EXPERIMENTS:
            names = ", ".join(EXPERIMENTS)
            raise InvalidParameterError(f"--only must be one of {names}, not {name!r}")
    return [each for name, each in EXPERIMENTS.items() if not only or name in only]


def _report_reuse(report: "Report") -> None:
    if reused := len(report.outcomes):
        words = f"{reused} of {len(report.experiments) * report.seeds} outcomes reused from an"
        print(f"{words} earlier run by the same code", file=sys.stderr)


@contextmanager
def _progress() -> "Iterator[Progress]":
    """Show a bar on a terminal, else print a line for each figure."""
    console = Console(stderr=True)
    with Bar(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("simulating", total=None)

        def advance(words: str, done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)
            if words.endswith(("figure", "draws")) and not console.is_terminal:
                print(f"{words}: {done} of {total} tasks", file=sys.stderr)

        yield advance


def _print(report: "Report", folder: Path) -> None:
    """Print each claim with its verdict, the counts and the page."""
    from paper.report import SIGNS

    console = Console(highlight=False, width=None if sys.stdout.isatty() else _PIPE)
    table = Table("figure", "claim", "paper", "ours", "verdict", box=None, pad_edge=False)
    for each in report.judgements:
        verdict = f"{SIGNS[each.verdict]} {each.verdict_text}"
        numbers = (each.claim.number or "–", each.ours_text or "–")
        table.add_row(*map(Text, (each.experiment, each.claim.key, *numbers, verdict)))
    console.print(table)
    print(report.summary)
    print(f"page: {folder / 'report.html'}")
