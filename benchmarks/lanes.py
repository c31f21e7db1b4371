"""``python -m benchmarks.lanes``: many contacts at once, beside one contact at a time.

All in one process and in turns, per sample: the compiled recursion over rows of arrays, one contact
at a time as every processor runs it, and in lanes with each instruction set that this one has.
One thread is timed by its own time on the processor, so that others on the machine take little of
it; two by the clock.
"""

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter, thread_time
from typing import Annotated

import numpy as np
from cyclopts import App, Parameter
from rich.console import Console

from benchmarks import machine, report
from benchmarks.motion import Floats
from benchmarks.report import Limit, Row, Section
from benchmarks.timing import Case, Clock, clock
from palpate import (
    Contact,
    ContactEstimator,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    SingleStageRLS,
    identify_many,
    lab,
)
from palpate.lanes import instruction_sets, replay_lanes
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.lanes", help_format="plaintext", version_flags=[])

#: How many times as quick as one contact at a time, single stage.
LIMITS = {"baseline": 2.5, "avx2": 4.5, "avx512": 7.0}
#: Of two threads to one.
TWO_THREADS = 1.85
Arrays = tuple[Floats, Floats, Floats]


@dataclass(frozen=True)
class Size:
    """Contacts, samples of each, and rounds."""

    contacts: int
    samples: int
    rounds: int


def contact_rows(contacts: int, samples: int) -> Arrays:
    """Contacts of the ball, each stiffer or softer, from a place of its own in the three sines."""
    random = np.random.default_rng(1)
    x, v, force = (np.empty((contacts, samples)) for _ in range(3))
    time = 1e-3 * np.arange(samples)
    for contact in range(contacts):
        x[contact], v[contact] = lab.THREE_SINES.motion.at(time + random.uniform(0.0, 6.0))
        clean = random.uniform(0.3, 3.0) * lab.BALL.law.force(x[contact], v[contact])
        force[contact] = clean * (1.0 + 2e-3 * random.standard_normal(samples))
    return x, v, force


def leaving_contact(rows: Arrays) -> Arrays:
    """The same with a third of every row out of contact, at places of its own."""
    x, v, force = (array.copy() for array in rows)
    start = np.random.default_rng(2).integers(0, x.shape[1], size=(len(x), 1))
    free = (np.arange(x.shape[1]) - start) % x.shape[1] < x.shape[1] // 3
    x[free] = -1e-3
    force[free] = 0.0
    return x, v, force


def _seconds(rows: Arrays, estimator: ContactEstimator, name: str) -> float:
    start = thread_time()
    replay_lanes(*rows, estimator, instruction_set=name)
    return (thread_time() - start) / rows[0].size


def _by_the_clock(rows: Arrays, threads: int) -> float:
    start = perf_counter()
    replay_lanes(*rows, SingleStageRLS(), threads=threads)
    return (perf_counter() - start) / rows[0].size


def _cases(rows: Arrays, estimator: ContactEstimator) -> dict[str, Case]:
    return {name: partial(_seconds, rows, estimator, name) for name in instruction_sets()}


def _against_scalar(best: dict[str, float], *, judged: bool) -> list[Row]:
    alone = best["scalar"]
    rows = [Row("one contact at a time", 1e9 * alone, "ns")]
    for name, seconds in best.items():
        if name == "scalar":
            continue
        limit = Limit(LIMITS[name], at_least=True) if judged else None
        rows.append(Row(name, 1e9 * seconds, "ns", alone / seconds, "one at a time / it", limit))
    return rows


def measure_single_stage(running: Clock, rows: Arrays, rounds: int) -> Section:
    """Time the single stage with every instruction set."""
    best = running.best("single stage", _cases(rows, SingleStageRLS()), rounds)
    contacts, samples = rows[0].shape
    notes = [
        f"{contacts} contacts × {samples} samples, always in contact; per sample, least of the "
        "rounds, from arrays to law and covariance, packing and the call from Python included.",
    ]
    return Section("SingleStageRLS in lanes", _against_scalar(best, judged=True), notes)


def measure_others(running: Clock, rows: Arrays, rounds: int) -> list[Section]:
    """Time what has no limit: contacts that end and begin, and the linear laws."""
    sections = []
    for title, estimator, arrays in (
        ("A third of each row out of contact", SingleStageRLS(), leaving_contact(rows)),
        ("KelvinVoigtRLS in lanes", KelvinVoigtRLS(), rows),
        ("ExtendedKelvinVoigtRLS in lanes", ExtendedKelvinVoigtRLS(), rows),
    ):
        best = running.best(title, _cases(arrays, estimator), rounds)
        sections.append(Section(title, _against_scalar(best, judged=False)))
    return sections


def measure_threads(running: Clock, rows: Arrays, rounds: int) -> Section:
    """Time two threads beside one."""
    quickest = instruction_sets()[-1]
    cases: dict[str, Case] = {
        str(threads): partial(_by_the_clock, rows, threads) for threads in (1, 2)
    }
    best = running.best("threads", cases, rounds)
    ratio = best["1"] / best["2"]
    words = f"one thread: {1e9 * best['1']:.3g} ns"
    limit = Limit(TWO_THREADS, at_least=True)
    return Section(
        f"Two threads, {quickest}", [Row("two", 1e9 * best["2"], "ns", ratio, words, limit)]
    )


def _table(rows: Arrays, threads: int) -> None:
    x, v, force = rows
    identify_many(
        penetration=x,
        velocity=v,
        force=force,
        sample_time=1e-3,
        method="single-stage",
        diagnosis="none",
        threads=threads,
    )


def _table_alone(rows: Arrays) -> float:
    start = thread_time()
    _table(rows, 1)
    return (thread_time() - start) / len(rows[0])


def _table_by_the_clock(rows: Arrays, threads: int) -> float:
    start = perf_counter()
    _table(rows, threads)
    return (perf_counter() - start) / len(rows[0])


def _contacts(contacts: list[Contact]) -> float:
    start = thread_time()
    identify_many(contacts, method="single-stage", diagnosis="none")
    return (thread_time() - start) / len(contacts)


def measure_rows(running: Clock, rows: Arrays, rounds: int) -> Section:
    """Time whole rows of a table: gate, scale, outliers, law, errors, depth and flags."""
    time = 1e-3 * np.arange(rows[0].shape[1])
    some = [
        Contact(time, penetration=x, velocity=v, force=force)
        for x, v, force in zip(*(array[:200] for array in rows), strict=True)
    ]
    cases: dict[str, Case] = {
        "contacts": partial(_contacts, some),
        "arrays": partial(_table_alone, rows),
        "one": partial(_table_by_the_clock, rows, 1),
        "two": partial(_table_by_the_clock, rows, 2),
    }
    best = running.best("rows of a table", cases, rounds, passes=1)
    two = best["one"] / best["two"]
    limit = Limit(TWO_THREADS, at_least=True)
    table = [
        Row("a Contact at a time", 1.0 / best["contacts"], "/s"),
        Row("arrays", 1.0 / best["arrays"], "/s", best["contacts"] / best["arrays"], "contacts"),
        Row("arrays, two threads", 1.0 / best["two"], "/s", two, "one, by the clock", limit),
    ]
    return Section('identify_many(…, method="single-stage", diagnosis="none")', table)


def agreement(rows: Arrays) -> Section:
    """Say how far lanes and one at a time are apart, and whether all sets give the same bits."""
    alone = replay_lanes(*rows, SingleStageRLS(), instruction_set="scalar")
    found = [
        replay_lanes(*rows, SingleStageRLS(), instruction_set=name)
        for name in instruction_sets()[1:]
    ]
    apart = np.max(np.abs(found[0].parameters / alone.parameters - 1.0), axis=0)
    errors = np.max(np.abs(found[0].standard_errors / alone.standard_errors - 1.0))
    differing = sum(
        int(np.count_nonzero(other.parameters != found[0].parameters))
        + int(np.count_nonzero(other.covariance != found[0].covariance))
        for other in found[1:]
    )
    names = ("stiffness", "damping", "exponent")
    table = [
        Row(f"{name}, relative", float(value), "", None, "", Limit(1e-12))
        for name, value in zip(names, apart, strict=True)
    ]
    table.append(Row("standard errors, relative", float(errors), "", None, "", Limit(1e-9)))
    table.append(Row("numbers that differ between sets", differing, "", None, "", Limit(0.0)))
    return Section("Lanes and one at a time, largest difference", table)


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
        A short run, for a first look: fewer contacts and rounds.
    as_json
        Write everything to this file as JSON.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([path for path in (as_json, markdown) if path is not None])
    size = Size(1000, 1000, 3) if quick else Size(10_000, 1000, 10)
    where = machine.describe("that of the extension")
    rows = contact_rows(size.contacts, size.samples)
    with clock() as running:
        sections = [
            measure_single_stage(running, rows, size.rounds),
            *measure_others(running, rows, max(size.rounds // 3, 1)),
            measure_threads(running, rows, size.rounds),
            measure_rows(running, rows, max(size.rounds // 3, 1)),
            agreement(rows),
        ]
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=140)
    report.print_sections(sections, where, console)
    if as_json is not None:
        content = json.dumps(report.as_dict(sections, where), indent=1, ensure_ascii=False)
        write_text(as_json, content + "\n")
    if markdown is not None:
        write_text(markdown, report.as_markdown(sections, where))


if __name__ == "__main__":
    app()
