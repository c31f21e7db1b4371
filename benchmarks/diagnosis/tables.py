"""The outcomes of ``benchmarks.diagnosis`` as Markdown tables."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.common.report import Facts, list_facts, markdown_table
from benchmarks.diagnosis.marks import QUANTITIES, Row, lies

TITLE = "Faults: which numbers are wrong, and which of them are trusted"
MEANING = """\
A *lie* is a number that is wrong by more than three of its printed standard errors, all causes
together, and by more than 5 % (a damping of the *good* and the *hard* bank: 10 %). It is silent
where the verdict is *trust*. The ideal probe moves along three random sines for 7 s, after a
time in free air, on materials of n = 1 to 2.1; the robot is the laboratory's. The truth of a
material that changes is its last state; of one with memory, its equivalent linear response.
*Listed* counts runs in which the right check is significant or costs a mark, or the selected
law has that memory or damper.

The *good* and the *hard* bank have faults of sensors, clocks, mounts, files and materials, for
most of which palpate has no check. *Good* recordings have noise below 0.6 % of the largest
force, 100 Hz or more, and several cycles; *hard* ones have noise of 0.5 to 2.5 %, or a single
press, or 50 to 80 Hz. A file *can show* a fault unless another material gives the same file: a
wrong scale, a probe off the normal, a spring between sensor and probe. In the *clean* bank
nothing is wrong but the noise is not always white. S and C are stiffness and damping at the
working depth."""
Rows = list[Row]
Test = Callable[[Row], bool]
DESCRIBED = ("ball", "sponge", "pvc", "inclusion")
UNSTEADY = ("change", "slow change")
COVERED = ("K", "B", "n", "S", "C")
PROBES = {"ideal": "ideal probe", "robot": "robot"}


def page(rows: Rows, facts: Facts) -> list[str]:
    """All tables, and how they were measured."""
    of = _grouped(rows, "bank")
    lines = [MEANING, "", *list_facts(facts)]
    banks = {bank: of[bank] for bank in ("good", "hard") if of[bank]}
    sections: tuple[tuple[str, object, Callable[[], list[str]]], ...] = (
        ("Silent lies", of["ideal"], lambda: _silent(of)),
        ("Rates and errors", of["ideal"], lambda: _rates(of)),
        ("By fault, ideal probe", of["ideal"], lambda: _faults(of["ideal"])),
        ("By fault, robot", of["robot"], lambda: _faults(of["robot"])),
        ("Materials and motions of the laboratory, robot", of["pair"], lambda: _pairs(of["pair"])),
        ("Real recordings", of["recording"], lambda: _recordings(of["recording"])),
        ("Repeats of one object", of["repeats"], lambda: _repeats(of["repeats"])),
        ("Recordings without a fault", of["clean"], lambda: _clean(of["clean"])),
        ("Coverage of 95 % bars", of["clean"], lambda: _coverage(of["clean"])),
        ("Lies by fault", banks, lambda: _by_fault(banks)),
    )
    for title, measured, table in sections:
        if measured:
            lines += ["", f"## {title}", "", *table()]
    return lines


def _grouped(rows: Rows, *names: str) -> dict[Any, Rows]:
    groups: dict[Any, Rows] = defaultdict(list)
    for row in rows:
        key = tuple(row[name] for name in names)
        groups[key if len(names) > 1 else key[0]].append(row)
    return groups


def part(count: int, of: int) -> str:
    """A count, its whole, and per cent."""
    return f"{count} of {of} ({100.0 * count / of:.1f} %)" if of else "–"


def _where(rows: Rows, *tests: Test) -> Rows:
    return [row for row in rows if all(test(row) for test in tests)]


def _share(rows: Rows, test: Test) -> str:
    return part(len(_where(rows, test)), len(rows))


def _percent(rows: Rows, test: Test) -> str:
    return f"{100.0 * np.mean([test(row) for row in rows]):.0f} %"


def _first_findings(rows: Rows, none: str = "–") -> str:
    first = Counter(row["named"][0] if row["named"] else none for row in rows)
    del first[""]
    return ", ".join(f"{name} {count}" for name, count in first.most_common(3)) or "–"


# ---- what a row says


def _lie(row: Row) -> bool:
    return (row["stops"] and _identified(row)) or any(lies(row, name) for name in QUANTITIES)


def _parameters_lie(row: Row) -> bool:
    """Whether K, B or n is wrong, of a material that the law describes."""
    errors = zip(row["deviations"], row["relative"], strict=True)
    return row["described"] and any(
        not (abs(bars) <= 3.0 or abs(part) <= 0.05) for bars, part in errors
    )


def _trusted(row: Row) -> bool:
    return bool(row["overall"] == "trust")


def _doubted(row: Row) -> bool:
    return not _trusted(row)


def _identified(row: Row) -> bool:
    return bool(row["overall"] != "refused")


def _listed(row: Row) -> bool:
    """Whether a right check is among the findings."""
    return bool(set(row["names"]) & set(row["named"]))


def _faulty(row: Row) -> bool:
    return row["kind"] not in ("clean", "none")


def _changed(row: Row) -> bool:
    return "change" in row["named"]


def _size(row: Row) -> float:
    """Return the number at the start of a severity."""
    return abs(float(row["severity"].split()[0]))


def _of_kind(kind: str, *sizes: float) -> Test:
    return lambda row: row["kind"] == kind and (not sizes or _size(row) in sizes)


# ---- faults that the diagnosis looks for


def _silent(of: dict[str, Rows]) -> list[str]:
    lines = []
    for bank, title in PROBES.items():
        faulty = _where(of[bank], _faulty)
        cells: list[object] = [title, len(faulty)]
        for test in (_lie, _parameters_lie):
            false = _where(faulty, test)
            unflagged = _share(false, lambda row: not row["flagged"])
            cells += [len(false), unflagged, _share(false, _trusted)]
        cells.append(_share(_where(of[bank], _of_kind("clean")), _doubted))
        lines.append(cells)
    headings = ("bank", "faulty", "lies in S, C", "without a flag", "verdict *trust*")
    more = ("lies in K, B, n", "without a flag", "verdict *trust*", "clean not *trust*")
    return markdown_table((*headings, *more), lines)


def _rates(of: dict[str, Rows]) -> list[str]:
    """Return each rate for the ideal probe and for the robot, and its limit."""

    def share(chosen: Test, counted: Test) -> Callable[[Rows], str]:
        return lambda rows: _share(_where(rows, chosen), counted)

    figures: list[tuple[str, Callable[[Rows], str], str]] = [
        ("clean, not *trust*", share(_of_kind("clean"), _doubted), "≤ 1 %"),
        ("change of 5 % and more found", share(_of_kind("change"), _changed), "≥ 98 %"),
        ("… its time, largest error", _times, "–"),
        (
            "change named where there is none",
            share(lambda row: row["kind"] not in UNSTEADY, _changed),
            "≤ 1 %",
        ),
        ("delay of 2 ms seen", share(_of_kind("delay", 2.0), _listed), "≥ 80 %"),
        ("delay of 3 ms and more seen", share(_of_kind("delay", 3.0, 5.0, 10.0), _listed), "100 %"),
        ("delay, error of those seen, rms; 95 %", _delays, "≤ 0.5 ms"),
        (
            "surface off 0.35 mm and more, seen",
            share(_of_kind("surface", 0.35, 0.7, 1.5), _listed),
            "≥ 90 %",
        ),
        ("surface off 0.2 mm, seen", share(_of_kind("surface", 0.2), _listed), "–"),
        ("clean: S, C in printed standard errors, rms", _clean_errors, "1"),
    ]
    rows = [
        [name, *(of_rows(of[bank]) for bank in PROBES), limit] for name, of_rows, limit in figures
    ]
    return markdown_table(("figure", "ideal probe", "robot", "limit"), rows)


def _delays(rows: Rows) -> str:
    """Of delays of 1 ms and more."""
    delays = _where(rows, _of_kind("delay"), lambda row: not math.isnan(row["delay"]))
    off = [
        1e3 * row["delay"] - float(row["severity"].split()[0])
        for row in delays
        if _size(row) >= 1.0
    ]
    if not off:
        return "–"
    return f"{np.sqrt(np.mean(np.square(off))):.2f}; {np.percentile(np.abs(off), 95):.2f} ms"


def _times(rows: Rows) -> str:
    off = [
        min((abs(time - 4.0) for time in row["changes"]), default=math.nan)
        for row in _where(rows, _of_kind("change"))
    ]
    return f"{1e3 * np.nanmax(off):.2g} ms" if off else "–"


def _clean_errors(rows: Rows) -> str:
    clean = _where(rows, _of_kind("clean"), _identified)
    squares = [[(row["errors"][q] / row["bars"][q]) ** 2 for q in QUANTITIES] for row in clean]
    return ", ".join(f"{each:.2f}" for each in np.sqrt(np.mean(squares, axis=0))) if clean else "–"


def _faults(rows: Rows) -> list[str]:
    lines = []
    for (kind, severity), group in _grouped(rows, "kind", "severity").items():
        false = _where(group, _lie)
        lines.append(
            [
                f"{kind} {severity}".strip(),
                len(group),
                _percent(group, _doubted),
                _percent(group, _listed) if group[0]["names"] else "–",
                f"{len(_where(false, _trusted))} of {len(false)}",
                _first_findings(group),
            ]
        )
    headings = ("fault", "runs", "not *trust*", "listed", "silent lies", "first finding")
    return markdown_table(headings, lines)


def _pairs(rows: Rows) -> list[str]:
    motions = list(dict.fromkeys(row["motion"] for row in rows))
    verdicts = {(row["material"], row["motion"]): row["overall"] for row in rows}
    materials = list(dict.fromkeys(row["material"] for row in rows))
    right = sum((row["overall"] == "trust") == (row["material"] in DESCRIBED) for row in rows)
    grid = markdown_table(
        ("material", *motions), [[m, *(verdicts[m, each] for each in motions)] for m in materials]
    )
    words = (
        f"{right} of {len(rows)} right: {', '.join(DESCRIBED)} follow Hunt–Crossley and should "
        "be trusted, the others should not."
    )
    return [words, "", *grid]


def _recordings(rows: Rows) -> list[str]:
    lines = []
    for row in rows:
        errors = row.get("errors")
        bars = ["± {:.2g} ± {:.2g} %".format(*errors[k : k + 2]) if errors else "–" for k in (0, 2)]
        marks = [row.get("stiffness", "–"), row.get("damping", "–")]
        lines.append([row["name"], row["overall"], *marks, *bars, row["reason"]])
    return markdown_table(
        ("recording", "verdict", "S", "C", "S, statistical and systematic", "C", "reason"), lines
    )


def _repeats(rows: Rows) -> list[str]:
    words = (
        "Blocks of one recording (set A: recordings of one muscle under four loads), at one depth. "
        "The factor, reduced χ, is how much too narrow the uncertainty is: the statistical part "
        "alone, and with the systematic one, which should be at most 2."
    )
    lines = []
    for row in rows:
        cells = [f"{each:.2g}" for key in ("stiffness", "damping") for each in row[key]]
        lines.append([row["name"], row["repeats"], f"{1e3 * row['depth']:.3g} mm", *cells])
    headings = [
        f"{quantity}{what}"
        for quantity in ("S", "C")
        for what in (" scatters, %", ", statistical", " and systematic")
    ]
    return [words, "", *markdown_table(("recording", "repeats", "depth", *headings), lines)]


# ---- faults that it does not look for, and recordings without one


def _marked(name: str, *marks: str) -> Test:
    return lambda row: row[name] in marks


def _width(rows: Rows, name: str) -> str:
    widths = [row["bars"][name] for row in rows if row["overall"] != "refused"]
    return f"{100.0 * np.nanmedian(widths):.2g} %" if widths else "–"


def _clean(rows: Rows) -> list[str]:
    lines = []
    for kind, group in _grouped(rows, "kind").items():
        found = _where(group, _identified)
        lines.append(
            [
                kind,
                len(group),
                len(group) - len(found),
                _share(found, _doubted),
                *(_share(found, _marked(q, "with-care", "do-not-trust")) for q in QUANTITIES),
                *(_width(found, name) for name in QUANTITIES),
                f"{1e3 * np.median([row['seconds'] for row in found]):.0f} ms",
                _first_findings(found, ""),
            ]
        )
    headings = ("noise", "runs", "refused", "not *trust*", "S not *trust*", "C not *trust*")
    return markdown_table((*headings, "bars of S, median", "of C", "CPU", "first finding"), lines)


def _coverage(rows: Rows) -> list[str]:
    groups = _grouped(rows, "kind", "motion")
    pooled = {key: _held(group) for key, group in groups.items()}
    cells = [
        (share, f"{name}, {', '.join(key)}")
        for key, group in _grouped(rows, "kind", "motion", "length").items()
        for name, share in _held(group).items()
    ]
    shares = [share for share, _ in cells]
    touched = [share for share, cell in cells if "multi-sine" not in cell]
    least, where = min(
        (share, f"{name}, {', '.join(key)}")
        for key, held in pooled.items()
        for name, share in held.items()
    )
    smallest, there = min(cells)
    words = (
        f"Runs with the truth within 1.96 bars, %. On average {100.0 * np.mean(shares):.1f}, "
        f"of touches and presses {100.0 * np.mean(touched):.1f}; "
        f"least of the cells below {100 * least:.0f} % ({where}); "
        f"least of one length {100 * smallest:.0f} % ({there})."
    )
    lines = [
        [", ".join(key), len(groups[key]), *(f"{100 * share:.0f}" for share in held.values())]
        for key, held in pooled.items()
    ]
    return [words, "", *markdown_table(("noise, motion", "runs", *COVERED), lines)]


def _held(rows: Rows) -> dict[str, float]:
    """Return the share of runs in which the truth is within 1.96 bars, by quantity.

    Runs with another law, whose parameters are other numbers, count as not within for K, B and n.
    """
    found = [row for row in rows if row["overall"] != "refused"]
    other = (np.inf, np.inf, np.inf)
    off = [
        [
            *np.abs(row["deviations"] or other),
            *(abs(row["errors"][q]) / row["bars"][q] for q in QUANTITIES),
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
            lying = [(row, name) for name in QUANTITIES for row in rows if lies(row, name)]
            cells += [
                len(rows),
                ", ".join(str(sum(name == q for _, name in lying)) for q in QUANTITIES),
                sum(row[name] == "trust" for row, name in lying),
                len(_where(rows, _trusted, _lie)),
                _percent(rows, _doubted),
            ]
        lines.append([*cells, _first_findings(group, "")])
    headings = ["fault"]
    for bank in banks:
        headings += [f"{bank}: runs", "lies of S, C", "marked *trust*", "silent", "not *trust*"]
    return markdown_table([*headings, "first finding"], lines)
