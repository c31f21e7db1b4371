"""Tables of the marks of stiffness and damping."""

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.diagnosis.marks import QUANTITIES, bar, lies, wrong
from benchmarks.diagnosis.tables import part, table

Row = dict[str, Any]
Rows = list[Row]
COVERED = ("K", "B", "n", "S", "C")
CURVED = ("curved gain", "soft saturation")  # a file shows another curve, and its slope
UNSEEABLE = 5.0  # residual over the noise, √Σ(r/σ)², of every Hunt–Crossley law


def mark_page(rows: Rows) -> list[str]:
    """Tables of the banks that were run."""
    of = _grouped(rows, "bank")
    lines: list[str] = []
    banks = [bank for bank in ("good", "hard") if of[bank]]
    if banks:
        lines += ["", "## Marks beside lies", "", *_marks(_parts(of))]
    if of["clean"]:
        lines += ["", "## Recordings without a fault", "", *_clean(of["clean"])]
        lines += ["", "## Coverage of 95 % bars", "", *_coverage(of["clean"])]
    if banks:
        lines += ["", "## Lies by fault", "", *_by_fault({bank: of[bank] for bank in banks})]
    return lines


def _parts(of: dict[str, Rows]) -> dict[str, Rows]:
    """The banks, and the hard one by what makes it hard."""
    hard = of["hard"]
    parts = {
        "good": of["good"],
        "… without curved gains": [row for row in of["good"] if row["kind"] not in CURVED],
        "hard": hard,
        "… noise ≥ 0.5 %": [row for row in hard if row["noise"] > 6e-3],
        "… single press": [row for row in hard if row["motion"] == "press"],
        "… 50–80 Hz": [row for row in hard if row["rate"] < 100.0],
    }
    return {name: rows for name, rows in parts.items() if rows}


def _marks(banks: dict[str, Rows]) -> list[str]:
    lines = []
    for bank, rows in banks.items():
        faulty = [row for row in rows if row["kind"] != "none"]
        shown = [row for row in faulty if row["shown"]]
        hidden = [row for row in faulty if not row["shown"]]
        none = [row for row in rows if row["kind"] == "none"]
        pairs = [(row, name) for row in shown for name in QUANTITIES]
        off = [pair for pair in pairs if wrong(*pair, pair[0]["statistical"].get(pair[1], 0.0))]
        lying = [(row, name) for row, name in off if lies(row, name)]
        lying_runs = [row for row in shown if _lie(row)]
        trusted = [row for row, name in lying if row[name] == "trust"]
        lines.append(
            [
                bank,
                len(shown),
                len(lying_runs),
                part(_count(lying_runs, _trusted), len(lying_runs)),
                len(lying),
                part(len(trusted), len(lying)),
                part(len(trusted), len(off)),
                _count(trusted, lambda row: row.get("shows", np.inf) < UNSEEABLE),
                *(_width(shown, name) for name in QUANTITIES),
                *(_share_trusted(shown, name) for name in QUANTITIES),
                part(_count(hidden, _lie), len(hidden)),
                part(_count(none, lambda row: not _trusted(row)), len(none)),
            ]
        )
    headings = (
        "bank",
        "runs that a file can show",
        "with a lie",
        "… overall *trust*",
        "lies of S, C",
        "… marked *trust*",
        "… of all beyond 3 statistical bars",
        "… below any test",
        "bars of S, median",
        "of C",
        "marks *trust* of S",
        "of C",
        "lies no file can show",
        "no fault: not *trust*",
    )
    return table(headings, lines)


def _lie(row: Row) -> bool:
    return any(lies(row, name) for name in QUANTITIES)


def _share_trusted(rows: Rows, name: str) -> str:
    return f"{100.0 * np.mean([row[name] == 'trust' for row in rows]):.0f} %"


def _trusted(row: Row) -> bool:
    return bool(row["overall"] == "trust")


def _count(rows: Rows, counted: Callable[[Row], bool]) -> int:
    return sum(counted(row) for row in rows)


def _width(rows: Rows, name: str) -> str:
    widths = [bar(row, name) for row in rows if row["overall"] != "refused"]
    return f"{100.0 * np.nanmedian(widths):.2g} %" if widths else "–"


def _clean(rows: Rows) -> list[str]:
    lines = []
    for kind, group in _grouped(rows, "kind").items():
        found = [row for row in group if row["overall"] != "refused"]
        lines.append(
            [
                kind,
                len(group),
                len(group) - len(found),
                part(_count(found, lambda row: not _trusted(row)), len(found)),
                *(
                    part(_count(found, lambda row, name=name: row[name] != "trust"), len(found))  # type: ignore[misc]
                    for name in QUANTITIES
                ),
                *(_width(found, name) for name in QUANTITIES),
                f"{1e3 * np.median([row['seconds'] for row in found]):.0f} ms",
                _named(found),
            ]
        )
    headings = ("noise", "runs", "refused", "not *trust*", "S not *trust*", "C not *trust*")
    return table((*headings, "bars of S, median", "of C", "CPU", "first finding"), lines)


def _named(rows: Rows) -> str:
    counts: dict[str, int] = defaultdict(int)
    for row in rows:
        if row["named"]:
            counts[row["named"][0]] += 1
    first = sorted(counts.items(), key=lambda item: -item[1])[:3]
    return ", ".join(f"{name} {count}" for name, count in first) or "–"


def _coverage(rows: Rows) -> list[str]:
    lines, cells = [], []
    for (kind, motion), group in _grouped(rows, "kind", "motion").items():
        for length, part_ in _grouped(group, "length").items():
            held = _held(part_)
            cells += [
                (share, f"{name}, {kind}, {motion}, {length}") for name, share in held.items()
            ]
    for (kind, motion), group in _grouped(rows, "kind", "motion").items():
        held = _held(group)
        lines.append(
            [f"{kind}, {motion}", len(group), *(f"{100 * held[name]:.0f}" for name in held)]
        )
    shares = [share for share, _ in cells]
    pooled = [
        (share, f"{name}, {kind}, {motion}")
        for (kind, motion), group in _grouped(rows, "kind", "motion").items()
        for name, share in _held(group).items()
    ]
    least, where = min(pooled)
    smallest, there = min(cells)
    touched = [share for share, cell in cells if "multi-sine" not in cell]
    words = (
        f"Runs with the truth within 1.96 bars, %. On average {100.0 * np.mean(shares):.1f}, "
        f"of touches and presses {100.0 * np.mean(touched):.1f}; "
        f"least of the cells below {100 * least:.0f} % ({where}); "
        f"least of one length {100 * smallest:.0f} % ({there})."
    )
    return [words, "", *table(("noise, motion", "runs", *COVERED), lines)]


def _held(rows: Rows) -> dict[str, float]:
    """Return the share of runs in which the truth is within 1.96 bars, by quantity.

    Runs with another law, whose parameters are other numbers, count as not within for K, B and n.
    """
    found = [row for row in rows if row["overall"] != "refused"]
    other = (np.inf, np.inf, np.inf)
    off = [
        [
            *np.abs(row["deviations"] or other),
            *(abs(row["errors"][q]) / bar(row, q) for q in QUANTITIES),
        ]
        for row in found
    ]
    return dict(zip(COVERED, np.mean(np.array(off) <= 1.96, axis=0).tolist(), strict=True))


def _by_fault(banks: dict[str, Rows]) -> list[str]:
    """Of each bank: lies of S and of C, those marked *trust*, and runs that stay silent."""
    kinds = {bank: _grouped(rows, "kind") for bank, rows in banks.items()}
    lines = []
    for kind, group in next(iter(kinds.values())).items():
        sizes = ", ".join(dict.fromkeys(row["severity"] for row in group))
        hidden = "" if group[0]["shown"] else "; no file can show"
        cells: list[object] = [kind if kind == "none" else f"{kind} ({sizes}{hidden})"]
        for bank in banks:
            rows = kinds[bank][kind]
            lying = {name: [row for row in rows if lies(row, name)] for name in QUANTITIES}
            trusted = sum(row[name] == "trust" for name, told in lying.items() for row in told)
            cells += [
                len(rows),
                ", ".join(str(len(told)) for told in lying.values()),
                trusted,
                _count(rows, lambda row: _trusted(row) and _lie(row)),
                f"{100.0 * np.mean([not _trusted(row) for row in rows]):.0f} %",
            ]
        lines.append([*cells, _named(group)])
    headings = ["fault"]
    for bank in banks:
        headings += [f"{bank}: runs", "lies of S, C", "marked *trust*", "silent", "not *trust*"]
    return table([*headings, "first finding"], lines)


def _grouped(rows: Rows, *names: str) -> dict[Any, Rows]:
    groups: dict[Any, Rows] = defaultdict(list)
    for row in rows:
        key = tuple(row[name] for name in names)
        groups[key if len(names) > 1 else key[0]].append(row)
    return groups
