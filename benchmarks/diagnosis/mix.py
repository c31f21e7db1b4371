"""``python -m benchmarks.diagnosis.mix``: how right marks and bars are, of one mix of recordings.

A third has no fault, the others one fault of a sensor each; two of three have little noise and
several cycles, the others noise, few samples or one press. The material is Hunt and Crossley's in
all, and the faults that another material would show as well are left out. ``--chosen`` more
recordings without a fault show which law is selected, and whether its digits are those of variable
projection. ``--docs`` writes the table to ``docs/validation/mix.md``, and its sentence between the
markers ``<!-- mix -->`` of the pages that quote it.
"""

import math
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.bank.sensor_faults import SENSOR_FAULTS
from benchmarks.bank.trials import spoil
from benchmarks.common.report import markdown_table, run_command, show
from benchmarks.common.workers import Workers
from benchmarks.diagnosis.marks import BANKS, NONE, Row, marked
from palpate import PalpateError, identify
from palpate.writing import write_text

Rows = list[Row]
FAULTS = [fault for fault in SENSOR_FAULTS if fault.shown]
#: Up to which a number may be trusted, of its size: the bar, and the error.
LIMITS = {"stiffness": 0.10, "damping": 0.20}
STOPS = {"stiffness": 0.25, "damping": 0.60}
ROOT = Path(__file__).parents[2]
PAGE, QUOTING = "docs/validation/mix.md", ("README.md", "docs/explain/marks.md")
MARKED = re.compile(r"(?<=<!-- mix -->\n).*?(?=<!-- /mix -->)", re.DOTALL)


def judged(job: tuple[str, int], first: int) -> Row:
    """Draw a recording, and return what palpate says of it."""
    kind, number = job
    bank = "hard" if number % 3 == 2 else "good"
    # A walk through the faults that meets all before it meets one again.
    fault = NONE[0] if kind != "faulty" else FAULTS[37 * (number + first) % len(FAULTS)]
    made = BANKS[bank](first + number, f"mix/{kind}/{fault.kind}/{fault.severity}")
    row = {"set": kind, **vars(marked(spoil(made, fault)))}
    if kind == "faulty":
        return row
    try:
        result, plain = identify(made.contact), identify(made.contact, law="hunt-crossley")
    except PalpateError:
        return row
    verdict = result.law_verdict
    row["law"] = "none" if verdict is None else str(verdict.candidate)
    row["digits"] = bool(np.array_equal(result.law.parameters, plain.law.parameters))
    return row


def _share(each: list[bool]) -> str:
    return f"{100.0 * float(np.mean(each)):.1f}" if each else "–"


def _off(row: Row, name: str) -> float:
    """The relative error; NaN where no number is given."""
    return abs(float(row["errors"].get(name, math.nan)))


def _relative(row: Row, name: str) -> float:
    """The whole bar over the printed number."""
    if name not in row["errors"]:
        return math.nan
    return float(row["bars"][name]) / abs(1.0 + float(row["errors"][name]))


def _against(row: Row, name: str) -> bool:
    """Whether a mark is better than its bar."""
    limit = {"trust": LIMITS, "with-care": STOPS}.get(row[name])
    return limit is not None and _relative(row, name) > limit[name] * (1.0 + 1e-9)


def shares_of(rows: Rows, name: str) -> tuple[list[bool], list[bool], list[bool]]:
    """Return which are trusted and wrong, which are trusted, and which are within two bars."""
    mix = [row for row in rows if row["set"] != "chosen"]
    trusted = [row[name] == "trust" for row in mix]
    wrong = [row[name] == "trust" and _off(row, name) > LIMITS[name] for row in mix]
    given = [row for row in mix if math.isfinite(_off(row, name))]
    return wrong, trusted, [_off(row, name) <= 2.0 * row["bars"][name] for row in given]


def sentence_of(rows: Rows) -> str:
    """Return the three figures that matter, in words."""
    of = {name: shares_of(rows, name) for name in LIMITS}
    wrong, trusted, within = ([_share(of[name][k]) for name in LIMITS] for k in range(3))
    clean = sum(row["set"] == "clean" for row in rows)
    return (
        f"Of {len(of['stiffness'][0])} simulated recordings of Hunt–Crossley materials, {clean} of "
        f"them without a fault, {wrong[0]} % have a\nstiffness that is marked *trust* and more "
        f"than 10 % off, and {wrong[1]} % a damping that is marked *trust* and more\nthan 20 % "
        f"off. *Trust* is on "
        f"{trusted[0]} % of the stiffnesses and {trusted[1]} % of the dampings; {within[0]} % and "
        f"{within[1]} % of them are within two standard\nerrors of the truth.\n"
    )


def lines_of(rows: Rows) -> Iterator[list[object]]:
    """A row of the table for each claim."""
    mix = [row for row in rows if row["set"] != "chosen"]
    for name, limit in LIMITS.items():
        given = [row for row in mix if math.isfinite(_off(row, name))]
        wrong, trusted, within = shares_of(rows, name)
        yield [f"{name}: trusted and off by > {limit:.0%}, %", _share(wrong)]
        yield [f"{name}: mark better than its bar, %", _share([_against(r, name) for r in mix])]
        yield [f"{name}: trusted, %", _share(trusted)]
        yield [f"{name}: within two bars, %", _share(within)]
        for kind in ("clean", "faulty"):
            pairs = [(r["bars"][name], _off(r, name)) for r in given if r["set"] == kind]
            bars, errors = np.median(pairs, axis=0) if pairs else (math.nan, math.nan)
            yield [f"{name}, {kind}: median bar over median error", f"{bars / errors:.2f}"]
    named = [largest for row in mix for largest in row["largest_named"]]
    yield [f"reasons that name a part of a bar, {len(named)}: the largest, %", _share(named)]
    plain = [row for row in rows if "digits" in row]
    chosen = [row for row in plain if row["law"] == "Hunt–Crossley"]
    selected = [row in chosen for row in plain]
    yield [f"Hunt–Crossley chosen, of {len(plain)}, %", _share(selected)]
    digits = [row["digits"] for row in chosen]
    yield ["of these: digits of variable projection, %", _share(digits)]


def main(
    *,
    clean: int = 100,
    faulty: int = 200,
    chosen: int = 100,
    first: int = 0,
    workers: int | None = None,
    docs: bool = False,
) -> None:
    """Measure, and print the table.

    Parameters
    ----------
    clean, faulty, chosen
        Recordings of each kind.
    first
        The first seed.
    workers
        Worker processes. Default: one per core.
    docs
        Write ``docs/validation/mix.md``, and the sentence of the pages that quote it.
    """
    counts = {"clean": clean, "faulty": faulty, "chosen": chosen}
    todo = [(kind, k + (kind == "chosen") * clean) for kind, n in counts.items() for k in range(n)]
    rows = Workers(workers).map("recordings", partial(judged, first=first), todo)
    about = " ".join((__doc__ or "").split(":", 1)[1].split("``--chosen``")[0].split())
    table = markdown_table(["what", "share"], list(lines_of(rows)))
    lines = [f"{about[0].upper()}{about[1:]}", "", sentence_of(rows), *table]
    show(lines, "Marks and bars of a mix of recordings", ROOT / PAGE if docs else None)
    for page in QUOTING if docs else ():
        text = (ROOT / page).read_text("utf-8")
        write_text(ROOT / page, MARKED.sub(sentence_of(rows), text))


if __name__ == "__main__":
    run_command(main)
