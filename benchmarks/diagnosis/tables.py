"""The outcomes as Markdown tables."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

from benchmarks.diagnosis.rates import rates

TITLE = "Faults: which numbers are wrong, and which of them are trusted"
MEANING = """\
A *lie* is a number that is wrong by more than three of its printed standard errors, all causes
together, and by more than 5 % (a damping of the *good* and the *hard* bank: 10 %). It is silent
where the verdict is *trust*. The ideal probe moves along three random sines for 7 s, after a
time in free air, on materials of n = 1 to 2.1; the robot is the laboratory's. The truth of a
material that changes is its last state; of one with memory, its response at the motion's
frequency. *Listed* counts runs in which the right check is significant or costs a mark, or the
selected law has that memory or damper.

The *good* and the *hard* bank have faults of sensors, clocks, mounts, files and materials, for
most of which palpate has no check. *Good* recordings have noise below 0.6 % of the largest
force, 100 Hz or more, and several cycles; *hard* ones have noise of 0.5 to 2.5 %, or a single
press, or 50 to 80 Hz. A file *can show* a fault unless another material gives the same file: a
wrong scale, a probe off the normal, a spring between sensor and probe. *Below any test* counts
lies whose fault leaves less than five noises, √Σ(r/σ)², after a fit. In the *clean* bank nothing
is wrong but the noise is not always white. S and C are stiffness and damping at the working
depth."""
Rows = list[dict[str, Any]]
DESCRIBED = ("ball", "sponge", "pvc", "inclusion")


def page(rows: Rows, words: str) -> str:
    """All tables, and how they were measured."""
    of: dict[str, Rows] = defaultdict(list)
    for row in rows:
        of[row["bank"]].append(row)
    parts = [MEANING, "", words]
    if of["ideal"]:
        parts += ["", "## Silent lies", "", *_lies(of)]
        headings = ("figure", "ideal probe", "robot", "limit")
        parts += ["", "## Rates and errors", "", *table(headings, rates(rows))]
        parts += ["", "## By fault, ideal probe", "", *_faults(of["ideal"])]
    if of["robot"]:
        parts += ["", "## By fault, robot", "", *_faults(of["robot"])]
    if of["pair"]:
        parts += ["", "## Materials and motions of the laboratory, robot", "", *_pairs(of["pair"])]
    if of["recording"]:
        parts += ["", "## Real recordings", "", *_recordings(of["recording"])]
    if of["repeats"]:
        parts += ["", "## Repeats of one object", "", *_repeats(of["repeats"])]
    return "\n".join([*parts, ""])


def table(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    marks = ["---", *["--:"] * (len(headings) - 1)]
    cells = [[str(cell).replace("|", "\\|") for cell in row] for row in rows]
    return [f"| {' | '.join(row)} |" for row in (headings, marks, *cells)]


def part(count: int, of: int) -> str:
    return f"{count} of {of} ({100.0 * count / of:.1f} %)" if of else "–"


def _lies(of: dict[str, Rows]) -> list[str]:
    lines = []
    for bank, title in (("ideal", "ideal probe"), ("robot", "robot")):
        faulty = [row for row in of[bank] if row["kind"] != "clean"]
        clean = [row for row in of[bank] if row["kind"] == "clean"]
        cells: list[object] = [title, len(faulty)]
        for name in ("lie", "parameters_lie"):
            wrong = [row for row in faulty if row[name]]
            unflagged = sum(not row["flagged"] for row in wrong)
            silent = sum(row["overall"] == "trust" for row in wrong)
            cells += [len(wrong), part(unflagged, len(wrong)), part(silent, len(wrong))]
        cells.append(part(sum(row["overall"] != "trust" for row in clean), len(clean)))
        lines.append(cells)
    headings = ("bank", "faulty", "lies in S, C", "without a flag", "verdict *trust*")
    more = ("lies in K, B, n", "without a flag", "verdict *trust*", "clean not *trust*")
    return table((*headings, *more), lines)


def _faults(rows: Rows) -> list[str]:
    grouped: dict[tuple[str, str], Rows] = defaultdict(list)
    for row in rows:
        grouped[row["kind"], row["severity"]].append(row)
    lines = []
    for (kind, severity), group in grouped.items():
        count = len(group)
        spoken = sum(row["overall"] != "trust" for row in group)
        silent = sum(row["overall"] == "trust" and row["lie"] for row in group)
        first = Counter(row["named"][0] if row["named"] else "–" for row in group)
        listed = sum(bool(set(row["names"]) & set(row["named"])) for row in group)
        common = ", ".join(f"{name} {number}" for name, number in first.most_common(3))
        lines.append(
            [
                f"{kind} {severity}".strip(),
                count,
                f"{100.0 * spoken / count:.0f} %",
                f"{100.0 * listed / count:.0f} %" if group[0]["names"] else "–",
                f"{silent} of {sum(row['lie'] for row in group)}",
                common,
            ]
        )
    headings = ("fault", "runs", "not *trust*", "listed", "silent lies", "first finding")
    return table(headings, lines)


def _pairs(rows: Rows) -> list[str]:
    motions = list(dict.fromkeys(row["motion"] for row in rows))
    verdicts = {(row["material"], row["motion"]): row["overall"] for row in rows}
    materials = list(dict.fromkeys(row["material"] for row in rows))
    right = sum((row["overall"] == "trust") == (row["material"] in DESCRIBED) for row in rows)
    grid = table(
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
        bars = [f"± {a:.2g} ± {b:.2g} %" for a, b in _pairs_of(errors)] if errors else ["–", "–"]
        marks = [row.get("stiffness", "–"), row.get("damping", "–")]
        lines.append([row["name"], row["overall"], *marks, *bars, row["reason"]])
    return table(
        ("recording", "verdict", "S", "C", "S, statistical and systematic", "C", "reason"), lines
    )


def _pairs_of(errors: list[float]) -> list[tuple[float, float]]:
    return [(errors[0], errors[1]), (errors[2], errors[3])]


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
    return [words, "", *table(("recording", "repeats", "depth", *headings), lines)]
