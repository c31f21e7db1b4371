"""``python -m benchmarks.diagnosis``: undetected errors, their causes, and real recordings."""

import os
import sys
from pathlib import Path

from cyclopts import App

from benchmarks.accuracy import report
from benchmarks.diagnosis import tables
from benchmarks.diagnosis.jobs import done, jobs_of
from benchmarks.diagnosis.mark_tables import mark_page
from palpate.writing import check_writable, write_text

app = App(name="python -m benchmarks.diagnosis", help_format="plaintext")


@app.default
def diagnosis(
    *,
    seeds: int = 30,
    robot_seeds: int = 5,
    first: int = 500,
    banks: str = "known,good,hard,clean",
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
    if unknown := set(names) - {"known", "good", "hard", "clean"}:
        sys.exit(f"--banks has {', '.join(sorted(unknown))}: use known, good, hard and clean")
    jobs = jobs_of(range(first, first + seeds), range(first, first + robot_seeds), names)
    rows = done(store, jobs, workers)
    facts = report.circumstances(seeds)
    command = " ".join(["python -m benchmarks.diagnosis", *sys.argv[1:]])
    pages = [tables.page(rows, report.words(facts)), *mark_page(rows), ""]
    text = "\n".join(pages)
    print(text)
    if markdown is not None:
        write_text(markdown, f"<!-- Written by {command} -->\n\n# {tables.TITLE}\n\n{text}")


if __name__ == "__main__":
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
