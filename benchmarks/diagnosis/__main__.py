"""``python -m benchmarks.diagnosis``: silent lies, what names them, pairs and recordings."""

import json
import os
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from cyclopts import App

from benchmarks.accuracy import report
from benchmarks.diagnosis import tables
from benchmarks.diagnosis.faults import FAULTS
from benchmarks.diagnosis.outcome import outcome
from benchmarks.diagnosis.recordings import verdict_of
from benchmarks.diagnosis.robot import PROBED, outcomes, pair
from palpate import lab
from palpate.writing import check_writable, write_text

app = App(name="python -m benchmarks.diagnosis", help_format="plaintext")
Rows = list[dict[str, Any]]


@app.default
def diagnosis(
    *,
    seeds: int = 30,
    robot_seeds: int = 5,
    first: int = 500,
    workers: int = 2,
    store: Path = Path("build/diagnosis.jsonl"),
    markdown: Path | None = None,
) -> None:
    """Put one fault on each of many recordings, and count what is wrong and what is said.

    What is in the store is not done again, so that an interrupted run goes on where it was.

    Parameters
    ----------
    seeds
        Recordings of each fault with an ideal probe.
    robot_seeds
        Runs of the robot for each of three materials.
    first
        The first seed.
    workers
        Processes.
    store
        Lines of JSON that hold every outcome; remove it after a change of the code.
    markdown
        Write the tables to this file, after its line ``<!-- measured -->``.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if markdown is not None:
        check_writable(markdown)
    store.parent.mkdir(parents=True, exist_ok=True)
    jobs = _jobs(range(first, first + seeds), range(first, first + robot_seeds))
    rows = _done(store, jobs, workers)
    facts = report.circumstances(seeds)
    command = " ".join(["python -m benchmarks.diagnosis", *sys.argv[1:]])
    text = tables.page(rows, f"`{command}`. {report.words(facts)}")
    print(text)
    if markdown is not None:
        kept = markdown.read_text().partition(tables.MARK)[0]
        write_text(markdown, f"{kept}{tables.MARK}\n\n{text}")


def _jobs(ideal: range, robot: range) -> dict[str, tuple[Callable[[Any], Rows], Any]]:
    """Every job by its key in the store."""
    jobs: dict[str, tuple[Callable[[Any], Rows], Any]] = {}
    for seed in ideal:
        for place, fault in enumerate(FAULTS):
            jobs[f"ideal/{fault.kind}/{fault.severity}/{seed}"] = (_ideal, (place, seed))
    for seed in robot:
        for name in PROBED:
            jobs[f"robot/{name}/{seed}"] = (_robot, (name, seed))
    for material in lab.MATERIALS:
        for motion in lab.TRAJECTORIES:
            jobs[f"pair/{material}/{motion}"] = (_pair, (material, motion, 0))
    folder = os.environ.get("PALPATE_DATA")
    for path in sorted(Path(folder).glob("*.csv")) if folder else []:
        jobs[f"recording/{path.stem}"] = (_recording, path)
    return jobs


def _ideal(job: tuple[int, int]) -> Rows:
    fault = FAULTS[job[0]]
    head = {"bank": "ideal", "kind": fault.kind, "severity": fault.severity}
    return [{**head, "names": fault.names, **asdict(outcome(fault, job[1]))}]


def _robot(job: tuple[str, int]) -> Rows:
    head = {"bank": "robot", "names": ()}
    return [{**head, "kind": k, "severity": s, **asdict(each)} for k, s, each in outcomes(job)]


def _pair(job: tuple[str, str, int]) -> Rows:
    return [{"bank": "pair", "material": job[0], "motion": job[1], "overall": pair(job)}]


def _recording(path: Path) -> Rows:
    return [{"bank": "recording", **verdict_of(path)}]


def _done(store: Path, jobs: dict[str, tuple[Callable[[Any], Rows], Any]], workers: int) -> Rows:
    """Do what is not in the store yet, and return the rows of all jobs."""
    known: dict[str, Rows] = {}
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
    return list(_flat(known[key] for key in jobs))


def _flat(parts: Iterable[Rows]) -> Iterable[dict[str, Any]]:
    for part in parts:
        yield from part


if __name__ == "__main__":
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
