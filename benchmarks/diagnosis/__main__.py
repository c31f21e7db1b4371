"""``python -m benchmarks.diagnosis``: undetected errors, their causes, and real recordings."""

import json
import operator
import sys
from pathlib import Path

from benchmarks.common.report import describe_machine, run_command, show
from benchmarks.common.workers import Workers
from benchmarks.diagnosis.marks import Jobs, Row, recordings_of
from benchmarks.diagnosis.tables import TITLE, page
from palpate.writing import check_writable

BANKS = ("known", "good", "hard", "clean")


def main(
    *,
    seeds: int = 30,
    robot_seeds: int = 5,
    first: int = 500,
    banks: str = ",".join(BANKS),
    workers: int = 2,
    store: Path = Path("build/diagnosis.jsonl"),
    markdown: Path | None = None,
) -> None:
    """Put one fault on each of many recordings; count wrong numbers and how many are reported.

    Results in the store are not computed again, so an interrupted run continues where it stopped.

    Parameters
    ----------
    seeds
        Recordings of each fault with an ideal probe.
    robot_seeds
        Runs of the robot for each of three materials.
    first
        The first seed.
    banks
        Which of *known* (faults that the diagnosis looks for; the robot; the recordings of
        ``PALPATE_DATA``), *good* and *hard* (faults that it does not; good recordings, and noisy,
        slow or short ones), and *clean* (noise of many kinds).
    workers
        Processes.
    store
        File with every outcome as a line of JSON; remove it after a change of the code.
    markdown
        Write the page to this file, such as ``docs/validation/diagnosis.md``.
    """
    if markdown is not None:
        check_writable(markdown)
    store.parent.mkdir(parents=True, exist_ok=True)
    names = banks.split(",")
    if unknown := set(names) - set(BANKS):
        sys.exit(f"--banks has {', '.join(sorted(unknown))}: use {', '.join(BANKS)}")
    jobs: Jobs = {}
    for bank in names:
        jobs |= recordings_of(bank, range(first, first + seeds), range(first, first + robot_seeds))
    facts = describe_machine(seeds=seeds)
    rows = done(store, jobs, workers)
    show(page(rows, facts), TITLE, markdown)


def done(store: Path, jobs: Jobs, workers: int) -> list[Row]:
    """Run the jobs that are not in the store yet, and return the rows of all."""
    known: dict[str, list[Row]] = {}
    if store.is_file():
        lines = (json.loads(line) for line in store.read_text().splitlines())
        known = {line["key"]: line["rows"] for line in lines}
    todo = {key: job for key, job in jobs.items() if key not in known}
    results = Workers(workers).each("recordings", operator.call, list(todo.values()))
    with store.open("a") as file:
        for key, rows in zip(todo, results, strict=True):
            known[key] = rows
            print(json.dumps({"key": key, "rows": rows}), file=file, flush=True)
    return [row for key in jobs for row in known[key]]


if __name__ == "__main__":
    run_command(main)
