"""``python -m benchmarks.laws``: the law that palpate selects, against simulated materials.

Each part has its own contacts (``benchmarks.law_contacts``), identified by ``palpate.identify``
from time, penetration and force: **a** materials of the family, **b** little motion, **c** no
memory, four kinds of noise, **f** late forces, **g** outside of the family, **h** changes; **m** is
others' microrheology, from ``PALPATE_DATA`` or ``../shared/data`` next to the checkout. The tables
*d* and *e* are of the contacts of a to c.
"""

import json
import math
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import App, Parameter
from rich.console import Console
from rich.progress import track

from benchmarks import machine, report
from benchmarks.external_recordings import folder_of_recordings, fourier_rows
from benchmarks.law_contacts import BEGINNINGS, LATE, MEMORIES, NOISES, SLS, Case, cases, press
from benchmarks.law_cost import measure_cost
from benchmarks.report import Limit, Row, Section
from palpate import (
    ChangeDetector,
    GeneralisedHuntCrossley,
    PalpateError,
    ViscoelasticContact,
    identify,
    prepare,
)
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.laws", help_format="plaintext", version_flags=[])

Outcomes = list[dict[str, Any]]
NUMBERS = {"K′": "stiffness", "B′": "damping"}
SENSOR = (
    "4 to 10 s, at most 4000 samples, at 100 to 1000 Hz, h and short motions of b from 500 Hz; "
    "noise of 0.2 to 2 % of the peak force, in c from 0.1 %, white but where stated."
)


def measure(case: Case, seed: int, law: str) -> dict[str, Any]:
    """Identify one contact; return what is known of it and of its truth, as plain numbers."""
    pressed, begun = press(case, seed), time.process_time()
    size = pressed.time.size
    outcome = {"key": case.key, "seed": seed, **asdict(case), "rate": pressed.rate}
    outcome |= {"noise_level": pressed.noise, "samples": size}
    try:
        contact = prepare(time=pressed.time, penetration=pressed.penetration, force=pressed.force)
        if case.part == "h":
            watching = ViscoelasticContact(change_detector=ChangeDetector())
            changes = identify(contact, watching, trace=False).changes * pressed.rate / size
            return outcome | {"changes": changes.tolist()}  # parts of the recording
        result = identify(contact, law=law, trace=False)
        response, diagnosis = result.dynamic_stiffness(), result.diagnosis
    except PalpateError as error:
        return outcome | {"error": str(error)}
    outcome["cpu"] = time.process_time() - begun
    surface, omega = result.estimate.surface, pressed.frequency
    by_law = GeneralisedHuntCrossley.of(result.law).dynamic_stiffness(
        pressed.depth - surface, omega
    )
    here = pressed.material.response(response.depth + surface, response.frequency)
    moving = pressed.material.response(pressed.depth, omega)
    for k, name in enumerate(NUMBERS.values()):
        value = getattr(response, name)
        if isinstance(value, float):
            bar = getattr(response, f"{name}_error")
        else:
            value, bar = value.value, math.hypot(value.standard_error, value.systematic)
        outcome |= {name: value, f"{name}_bar": bar, f"true_{name}": here[k]}
        found = (by_law.real, by_law.imag / omega)[k]  # at the motion's own depth and frequency
        outcome |= {f"moving_{name}": found, f"true_moving_{name}": moving[k]}
    verdict = result.law_verdict
    return outcome | {
        "depth": response.depth,
        "frequency": response.frequency,
        "moving_frequency": omega,
        "found": verdict and [verdict.candidate.damping, verdict.candidate.memory],
        "remembers": bool(getattr(result.law, "remembers", False)),
        "law": repr(result.law),
        "verdict": diagnosis.verdict.overall,
        "findings": [
            # A finding that only widens a bar is a note.
            [each.check, each.severity != "note" or math.isfinite(each.z), each.message]
            for each in diagnosis.findings
        ],
    }


def _where(outcomes: Outcomes, **kinds: str) -> Outcomes:
    return [o for o in outcomes if all(o[name] == kind for name, kind in kinds.items())]


def _relaxing(outcomes: Outcomes) -> Outcomes:
    return [o for o in outcomes if o["memory"] != "none"]


def _off(outcomes: Outcomes, name: str) -> list[float]:
    """Relative errors, percent; 100 where palpate has no answer."""
    return [
        100.0 * abs(o[name] / o[f"true_{name}"] - 1.0) if name in o else 100.0 for o in outcomes
    ]


def _share(title: str, each: list[Any], limit: Limit | None = None) -> Row:
    """How many are true."""
    part = 100.0 * sum(map(bool, each)) / max(len(each), 1)
    return Row(f"{title}, {len(each)}", part, "%", limit=limit)


def _least(bound: float) -> Limit:
    return Limit(bound, at_least=True)


def _errors(
    title: str, outcomes: Outcomes, limits: tuple[float | None, ...] = (None, None), at: str = ""
) -> Iterator[Row]:
    for k, (symbol, name) in enumerate(NUMBERS.items()):
        middle, high, worst = np.percentile(_off(outcomes, at + name), [50.0, 90.0, 100.0])
        words = f"median {middle:.3g}, worst {worst:.3g}"
        bound = limits[k]
        limit = None if bound is None else Limit(bound)
        row = f"{title}, {len(outcomes)}: {symbol} off, 90 %"
        yield Row(row, float(high), "%", reference=words, limit=limit)


def _within(outcomes: Outcomes, name: str) -> list[bool]:
    return [
        name in o and abs(o[name] - o[f"true_{name}"]) <= 2.0 * o[f"{name}_bar"] for o in outcomes
    ]


def _bars(title: str, outcomes: Outcomes, limit: Limit | None = None) -> Iterator[Row]:
    for symbol, name in NUMBERS.items():
        yield _share(f"{title}: {symbol} within two bars", _within(outcomes, name), limit)
        known = [o for o in outcomes if name in o]
        bars = [100.0 * o[f"{name}_bar"] / abs(o[name] or math.nan) for o in known]
        ratio = float(np.nanmedian(bars) / np.median(_off(known, name)))
        bound = Limit(5.0) if limit and name == "damping" else None
        yield Row(f"{title}: {symbol}, median bar over median error", ratio, "", limit=bound)


def _family(a: Outcomes) -> Iterator[Row]:
    yield from _errors("family", a, (1.0, 6.0))
    for memory in MEMORIES:
        yield from _errors(memory, _where(a, memory=memory))


def _little_motion(b: Outcomes) -> Iterator[Row]:
    for motion, limit in zip(BEGINNINGS, (15.0, 8.0, None, None), strict=True):
        some = _where(b, motion=motion)
        yield from _errors(motion, some, (None, limit))
        yield from _errors(f"{motion}, at its own depth and frequency", some, at="moving_")


def _memoryless(c: Outcomes) -> Iterator[Row]:
    yield Row(
        "no memory: B′ off, median", float(np.median(_off(c, "damping"))), "%", limit=Limit(0.5)
    )
    yield from _errors("no memory", c, (None, 3.2))
    named = [o.get("found") == ["hunt-crossley", "none"] for o in _where(c, damper="hunt-crossley")]
    yield _share("Hunt–Crossley named", named, _least(97.0))
    for field, kinds in (("noise", NOISES), ("damper", ("hunt-crossley", "half-space"))):
        for kind in kinds:
            false = [o.get("remembers") for o in _where(c, **{field: kind})]
            yield _share(f"{kind}: memory named", false, Limit(2.0))
    kelvin = _where(c, damper="kelvin-voigt")
    ramps = _where(kelvin, motion="ramps")
    yield _share("kelvin-voigt, ramps: memory named", [o.get("remembers") for o in ramps])
    others = [o.get("remembers") for o in kelvin if o not in ramps]
    yield _share("kelvin-voigt, other motions: memory named", others)


def _memory_named(a: Outcomes) -> Iterator[Row]:
    yield _share("memory named", [o.get("remembers") for o in _relaxing(a)], _least(95.0))
    for memory in list(MEMORIES)[1:]:
        yield _share(memory, [o.get("remembers") for o in _where(a, memory=memory)])


def _covered(abc: Outcomes) -> Iterator[Row]:
    family = _where(abc, part="a")
    yield from _bars("a", family, _least(93.0))
    for noise in NOISES:
        yield from _bars(f"c, {noise}", _where(abc, part="c", noise=noise), _least(93.0))
    for motion in BEGINNINGS:
        yield from _bars(f"b, {motion}", _where(abc, part="b", motion=motion))
    classes = sorted({(o["damper"], o["memory"]) for o in _relaxing(family)})
    for symbol, name in NUMBERS.items():
        parts = [_within(_where(family, damper=d, memory=m), name) for d, m in classes]
        worst = min(parts, key=sum)
        yield _share(
            f"a, worst of 15 classes that relax: {symbol} within two bars", worst, _least(90)
        )


def _late(f: Outcomes, lag: list[str]) -> Iterator[Row]:
    limits = (Limit(2.0), _least(50.0), _least(90.0), None)
    groups = {fault: _relaxing(_where(f, fault=fault)) for fault in LATE}
    groups[f"no memory, {LATE[2]}"] = _where(f, memory="none")
    for (title, some), limit in zip(groups.items(), (*limits, None), strict=True):
        named = [any(c in lag and seen for c, seen, _ in o.get("findings", ())) for o in some]
        yield _share(f"{title}: a lag is named", named, limit)
        yield from _errors(title, some)


def _outside(g: Outcomes) -> Iterator[Row]:
    for title, some in ((SLS, _where(g, memory=SLS)), ("friction", _where(g, fault="friction"))):
        yield from _errors(title, some)
        yield from _bars(title, some)


def _changes(h: Outcomes) -> Iterator[Row]:
    changed = _where(h, fault="K + 10 %")
    quiet = {noise: _where(h, fault="clean", noise=noise) for noise in NOISES[:2]}
    for noise, some in quiet.items():
        yield _share(f"{noise}: false alarms", [o["changes"] for o in some])
    found = [any(part > 0.5 for part in o["changes"]) for o in changed]
    yield _share("K + 10 % at half time: found", found, _least(95.0))
    for memory in ("none", "one time"):
        each = [right for right, o in zip(found, changed, strict=True) if o["memory"] == memory]
        yield _share(f"K + 10 % at half time: found, memory: {memory}", each)


def sections_of(outcomes: Outcomes, lag: list[str]) -> Iterator[Section]:
    """Yield the table of each part that was measured."""
    for parts, title, rows in (
        ("a", "a: materials of the family", _family),
        ("b", "b: little motion, materials that relax", _little_motion),
        ("c", "c: materials without memory", _memoryless),
        ("a", "d: memory named where there is some, of part a", _memory_named),
        ("abc", "e: bars, of parts a to c", _covered),
        ("f", "f: late forces", partial(_late, lag=lag)),
        ("g", "g: outside of the family", _outside),
        ("h", "h: alarms of ViscoelasticContact(change_detector=ChangeDetector())", _changes),
    ):
        own = [o for o in outcomes if o["part"] in parts]
        if {o["part"] for o in own} == set(parts):
            refused = sum("error" in o for o in own)
            notes = SENSOR, f"{len(own)} contacts, {refused} refused, which count as 100 % off."
            yield Section(title, list(rows(own)), notes)


@app.default
def main(
    *,
    part: str = "abcfghm",
    seed: int = 0,
    law: str = "auto",
    lag: str = "delay,late force",
    cost: Annotated[bool, Parameter(negative="")] = False,
    jobs: int = 1,
    keep: Path | None = None,
    kept: Path | None = None,
    markdown: Path | None = None,
) -> None:
    """Measure, and print the tables.

    Parameters
    ----------
    part
        Letters of the parts to measure.
    seed
        Another seed draws other contacts.
    law
        The law that is requested of palpate.
    lag
        Checks whose finding, if it is significant, names a late force; with commas.
    cost
        Measure time and allocations of one update instead.
    jobs
        Worker processes.
    keep
        Write what was found in each contact to this file, a line of JSON each.
    kept
        Make the tables from such a file instead of measuring.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([path for path in (keep, markdown) if path is not None])
    todo = [case for each in part for case in cases(each)]
    if cost:
        sections = measure_cost()
    else:
        if kept is not None:
            outcomes = [json.loads(line) for line in kept.read_text("utf-8").splitlines()]
        else:
            outcomes = _run(todo, seed, law, jobs)
        if keep is not None:
            write_text(keep, "".join(json.dumps(o, ensure_ascii=False) + "\n" for o in outcomes))
        sections = list(sections_of(outcomes, lag.split(",")))
        folder = folder_of_recordings()
        if "m" in part and kept is None and folder is not None:
            rows = list(fourier_rows(folder, law))
            sections.append(Section("m: AFM microrheology against its Fourier analysis", rows))
    where, console = machine.describe(""), Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=140)
    report.print_sections(sections, where, console)
    if markdown is not None:
        write_text(markdown, report.page("Laws with memory", "benchmarks.laws", sections, where))


def _run(todo: list[Case], seed: int, law: str, jobs: int) -> Outcomes:
    """Measure each contact, in this process or in some."""
    one, console = partial(measure, seed=seed, law=law), Console(stderr=True)
    if jobs == 1:
        return [one(case) for case in track(todo, "contacts", console=console)]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        done = pool.map(one, todo, chunksize=8)
        return list(track(done, "contacts", total=len(todo), console=console))


if __name__ == "__main__":
    app()
