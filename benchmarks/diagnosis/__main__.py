"""``python -m benchmarks.diagnosis``: undetected errors, their causes, and real recordings."""

import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from benchmarks.common.report import command_line, describe_machine, run_command
from benchmarks.diagnosis.marks import Jobs, Row, recordings_of
from benchmarks.diagnosis.tables import TITLE, page
from palpate.writing import check_writable, write_text

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
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
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
    text = page(done(store, jobs, workers), facts)
    print(text)
    if markdown is not None:
        write_text(markdown, f"<!-- Written by {command_line()} -->\n\n# {TITLE}\n\n{text}")


def done(store: Path, jobs: Jobs, workers: int) -> list[Row]:
    """Run the jobs that are not in the store yet, and return the rows of all."""
    known: dict[str, list[Row]] = {}
    if store.is_file():
        lines = (json.loads(line) for line in store.read_text().splitlines())
        known = {line["key"]: line["rows"] for line in lines}
    todo = [key for key in jobs if key not in known]
    with (
        ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool,
        store.open("a") as file,
    ):
        futures = {pool.submit(jobs[key][0], jobs[key][1]): key for key in todo}
        for count, future in enumerate(as_completed(futures)):
            key = futures[future]
            known[key] = future.result()
            file.write(json.dumps({"key": key, "rows": known[key]}) + "\n")
            file.flush()
            if count % 200 == 0:
                print(f"{count} of {len(todo)}", file=sys.stderr)
    return [row for key in jobs for row in known[key]]


if __name__ == "__main__":
    run_command(main)
