"""The command ``palpate paper``."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from palpate.cli import complain
from palpate.cli.fleet import require_figures
from palpate.cli.options import names_in
from palpate.cli.printing import Terminal, bar, print_table, say, say_path

if TYPE_CHECKING:
    from palpate.paper import Experiment
    from palpate.paper.report import Report
    from palpate.paper.running import Progress

_ONLY = Parameter(consume_multiple=True, completer=names_in("palpate.paper.EXPERIMENTS"))
Names = Annotated[tuple[str, ...], _ONLY]


def paper(
    *,
    only: Names = (),
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("report"),
    seeds: int = 5,
    workers: int | None = None,
) -> None:
    """Repeat the paper's experiments in simulation, and write a report.

    Repeat the command to continue an interrupted run.

    For example:

        palpate paper --only fig05 fig06 --seeds 2 -o report

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
    """
    from palpate.lab.rig import require_mujoco
    from palpate.paper.running import run_paper
    from palpate.validation import number_in

    require_figures()
    require_mujoco()
    experiments = _chosen(only)
    seeds = int(number_in("--seeds", seeds, 1, 10_000))
    if workers is not None:
        workers = int(number_in("--workers", workers, 1, 1_000))
    try:
        with _progress() as progress:
            report = run_paper(
                experiments,
                seeds=seeds,
                folder=output,
                workers=workers,
                progress=progress,
                begun=_say_what_is_reused,
            )
    except KeyboardInterrupt:
        if (output / "report.html").is_file():
            words = "interrupted; repeat the command to continue"
            complain(f"{words}: {output / 'report.html'}")
        raise
    _print(report, output)


def _chosen(only: tuple[str, ...]) -> "list[Experiment]":
    from palpate.paper import EXPERIMENTS
    from palpate.validation import one_of

    for name in only:
        one_of("--only", name, EXPERIMENTS)
    return [each for name, each in EXPERIMENTS.items() if not only or name in only]


def _say_what_is_reused(report: "Report") -> None:
    if reused := len(report.outcomes):
        words = f"{reused} of {len(report.experiments) * report.seeds} outcomes reused from an"
        print(f"{words} earlier run by the same code", file=sys.stderr)


@contextmanager
def _progress() -> "Iterator[Progress]":
    """Show a bar on a terminal, else print a line for each figure."""
    with bar("simulating") as shown:

        def advance(words: str, done: int, total: int) -> None:
            shown(done, total)
            if words.endswith("figure") and not sys.stderr.isatty():
                print(f"{words}: {done} of {total} tasks", file=sys.stderr)

        yield advance


def _print(report: "Report", folder: Path) -> None:
    from palpate.paper.report import SIGNS

    console = Terminal()
    headings = ["figure", "claim", "paper", "ours", "verdict"]
    rows = []
    for each in report.judgements:
        numbers = (words or "–" for words in (each.claim.number, each.ours_text))
        verdict = f"{SIGNS[each.verdict]} {each.verdict_text}"
        rows.append([each.experiment, each.claim.key, *numbers, verdict])
    print_table(console, headings, rows, prose=headings[2:])
    say(console, report.summary)
    say_path(console, f"page: {folder / 'report.html'}")
