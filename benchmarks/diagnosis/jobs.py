"""The work for each recording, in worker processes, and the store of its outcomes."""

import json
import os
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.diagnosis.faults import FAULTS, Fault
from benchmarks.diagnosis.marks import BANKS, UNSEEN, clean_keys, unseen, without_fault
from benchmarks.diagnosis.outcome import Outcome, outcome
from benchmarks.diagnosis.recordings import verdict_of
from benchmarks.diagnosis.repeats import factors, repeats_of
from benchmarks.diagnosis.robot import PROBED, outcomes, pair
from palpate import lab

Rows = list[dict[str, Any]]
Jobs = dict[str, tuple[Callable[[Any], Rows], Any]]


def jobs_of(seeds: range, robot: range, banks: Iterable[str]) -> Jobs:
    """Return every job of the banks by its key in the store."""
    jobs: Jobs = {}
    for bank in banks:
        if bank in BANKS:
            jobs |= _of_unseen(bank, seeds)
        elif bank == "clean":
            jobs |= _of_clean(seeds)
        else:
            jobs |= _of_known(seeds, robot)
    return jobs


def _of_unseen(bank: str, seeds: range) -> Jobs:
    return {
        f"{bank}/{fault.kind}/{fault.severity}/{seed}": (unseen, (bank, place, seed))
        for seed in seeds
        for place, fault in enumerate(UNSEEN)
    }


def _of_clean(seeds: range) -> Jobs:
    return {
        f"clean/{'/'.join(key)}/{seed}": (without_fault, (*key, seed))
        for seed in seeds
        for key in clean_keys()
    }


def _of_known(ideal: range, robot: range) -> Jobs:
    """The faults that the diagnosis looks for, and real recordings."""
    jobs: Jobs = {}
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
    for name, paths in repeats_of(Path(folder)).items() if folder else []:
        jobs[f"repeats/{name}"] = (_repeats, (name, paths))
    return jobs


def _ideal(job: tuple[int, int]) -> Rows:
    fault = FAULTS[job[0]]
    return [_row("ideal", fault, outcome(fault, job[1]))]


def _robot(job: tuple[str, int]) -> Rows:
    return [_row("robot", fault, each) for fault, each in outcomes(job)]


def _row(bank: str, fault: Fault, found: Outcome) -> dict[str, Any]:
    head = {"bank": bank, "kind": fault.kind, "severity": fault.severity, "names": fault.names}
    return {**head, **asdict(found)}


def _pair(job: tuple[str, str, int]) -> Rows:
    return [{"bank": "pair", "material": job[0], "motion": job[1], "overall": pair(job)}]


def _recording(path: Path) -> Rows:
    return [{"bank": "recording", **verdict_of(path)}]


def _repeats(job: tuple[str, list[Path]]) -> Rows:
    return [{"bank": "repeats", **factors(job)}]


def done(store: Path, jobs: Jobs, workers: int) -> Rows:
    """Run the jobs that are not in the store yet, and return the rows of all."""
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
