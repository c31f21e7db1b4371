"""The report of a fleet: one page that says what all of it comes to, and what to look at."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from html import escape
from pathlib import Path

import numpy as np

from palpate.digits import rounded, with_error
from palpate.fleet import maps
from palpate.fleet.figures import draw_distributions, draw_map, draw_repeats
from palpate.fleet.files import REPORT, manifest_of, read_results, read_seconds
from palpate.fleet.maps import map_of
from palpate.fleet.rows import AT_DEPTH
from palpate.fleet.tasks import Table
from palpate.reports import html
from palpate.reports.html import DRAWINGS, REPORT_STYLE, STYLE, drawing
from palpate.writing import write_text

#: Rows of a list; a page with more is read by nobody, and the dataset has them all.
MOST = 20
# Fewer contacts make no distribution.
_FEWEST = 5
# Of the longest side: along what is shorter there is no map, but the waviness of a surface.
_FLAT = 0.05
_FINDINGS = "Findings by kind, notes left out"
_REASONS, _TIMES = ("reason", "rows", "the first of them"), ("source", "took", "rows")
_OWN = """
.wide td { overflow-wrap: anywhere; }
.wide td:last-child { overflow-wrap: normal; }
"""


def save_report(folder: Path) -> Path:
    """Write the page of a fleet beside its results.

    Parameters
    ----------
    folder : Path
        Of the results.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    FleetError
        The folder holds no results, or not all.
    MissingExtraError
        matplotlib is not installed.
    RecordingError
        The page cannot be written.
    """
    path = folder / REPORT
    write_text(path, fleet_page(folder))
    return path


def fleet_page(folder: Path) -> str:
    """Return the page of a fleet."""
    table, times = read_results(folder), maps.slowest(read_seconds(folder))
    flags, findings = (table.column(name).to_pylist() for name in ("flags", "findings"))
    notable = [[f for f in row or () if not f.startswith("note:")] for row in findings]
    reasons = [[escape(k), f"{n}", escape(name)] for k, n, name in maps.reasons_of(table)]
    slowest = [[escape(name), f"{rounded(s, 3)} s", f"{count}"] for name, s, count in times]
    slowest = slowest if len(slowest) > 1 else []
    count = table.num_rows
    name = folder.resolve().name or "fleet"
    sections = (
        ("distributions", "What was identified", _distributions(table)),
        ("map", "Over the material", _map(table)),
        ("repeats", "Repeats", _repeats(table)),
        ("flags", "Flags", _kinds("Flags by kind", flags, count)),
        ("findings", "Findings of the diagnosis", _kinds(_FINDINGS, notable, count)),
        ("outliers", "Outliers", _outliers(table)),
        ("failures", "Failures", _list("Why there are no numbers", _REASONS, reasons)),
        ("slowest", "What took longest", _list("The slowest sources", _TIMES, slowest)),
        ("made", "How it was made", _made(folder)),
    )
    rendered = [line for section in sections for line in html.section(*section)]
    header = [f"<h1>{escape(name)}</h1>", *_tiles(table)]
    parts = ["<header>", *header, "</header>", "<main>", *rendered, "</main>"]
    style = STYLE + DRAWINGS + REPORT_STYLE + _OWN
    return html.document(f"{name}: what a fleet found", style, parts)


def _tiles(table: Table) -> Iterator[str]:
    count = table.num_rows
    failed = sum(error is not None for error in table.column("error").to_pylist())
    parts = any(part is not None for part in table.column("part").to_pylist())
    tiles = [
        ("rows", f"{count}", "one a place of a contact" if parts else "one a contact"),
        ("identified", f"{count - failed}", _percent(count - failed, count)),
        ("failed", f"{failed}", "each with its reason"),
    ]
    for quantity in maps.JUDGED:
        value = maps.numbers(table, f"{quantity}_at_depth")
        known = value[np.isfinite(value)]
        if known.size:
            low, middle, high = (rounded(v, 3) for v in np.percentile(known, (5, 50, 95)).tolist())
            words = f"median, {AT_DEPTH[quantity]}; 5 to 95 %: {low} to {high}"
            tiles.append((f"{quantity} at depth", middle, words))
    yield '<div class="tiles">'
    for heading, number, words in tiles:
        about = f"<small>{heading}</small><b>{number}</b><small>{words}</small>"
        yield f'<div class="tile">{about}</div>'
    yield "</div>"
    verdicts = Counter(mark for mark in table.column("verdict").to_pylist() if mark is not None)
    if verdicts:
        words = ", ".join(f"{html.badge(mark)} {count}" for mark, count in sorted(verdicts.items()))
        yield f"<p>Verdicts: {words}.</p>"
    elif set(table.column("checked").to_pylist()) == {"none"}:
        yield (
            f"<p>{html.badge('with-care', 'not checked')} Neither the data nor the fits were "
            "checked: that takes <code>--diagnosis input</code> or <code>full</code>.</p>"
        )
    else:
        yield (
            '<p class="soft">The data were checked, the fits were not, and there are no verdicts: '
            "they take <code>--diagnosis full</code>.</p>"
        )


def _percent(count: int, of: int) -> str:
    return f"{100.0 * count / max(of, 1):.3g}\N{NO-BREAK SPACE}%"


def _distributions(table: Table) -> Iterator[str]:
    known = np.isfinite(maps.numbers(table, "stiffness_at_depth"))
    if np.count_nonzero(known) < _FEWEST:
        return
    words = (
        "How what was identified is distributed, stiffness and damping at the working depth, and "
        "below each how well it is known: its standard error over its value."
    )
    yield from drawing("distributions", partial(draw_distributions, table), words)


def _map(table: Table) -> Iterator[str]:
    """Over the first two coordinates that vary, where there are two."""
    spans = {}
    for axis in "xyz":
        values = maps.numbers(table, axis)
        known = values[np.isfinite(values)]
        spans[axis] = float(np.ptp(known)) if known.size else 0.0
    wide = [axis for axis in "xyz" if spans[axis] > _FLAT * max(spans.values())]
    varying = wide[:2]
    if len(varying) < 2:
        return
    found = map_of(table, varying)
    words = f"{found.summary[0].upper()}{found.summary[1:]}."
    yield from drawing("over-place", partial(draw_map, found), words)


def _repeats(table: Table) -> Iterator[str]:
    for quantity in maps.JUDGED:
        if not (found := maps.repeats_of(table, quantity)):
            continue
        apart = sorted((each for each in found if not each.agree), key=lambda each: -each.z)
        agreeing = len(found) - len(apart)
        yield (
            f"<p>{quantity.capitalize()} at depth: {agreeing} of {len(found)} groups of repeats "
            "scatter as their own errors say (χ² within 3 σ).</p>"
        )
        if len(found) > 1:
            words = (
                f"Scatter of each group of repeats of the {quantity} over what their standard "
                "errors say: 1 where the errors are right."
            )
            yield from drawing(f"repeats-{quantity}", partial(draw_repeats, found, quantity), words)
        unit = AT_DEPTH[quantity]
        header = ["repeats of", "with numbers", "weighted mean", "scatter / errors", ""]
        rows = []
        for each in [*apart, *(e for e in found if e.agree)]:
            count = f"{each.count}" if each.count == each.total else f"{each.count} of {each.total}"
            words = "agree" if each.agree else f"do not agree, {rounded(each.z, 2)} σ"
            badge = html.badge("trust" if each.agree else "with-care", words)
            mean = escape(with_error(each.mean, each.error, unit=unit))
            rows.append([escape(each.name), count, mean, rounded(each.ratio, 3), badge])
        yield from _list(f"Repeats of the {quantity}", header, rows)


def _kinds(title: str, sentences: Iterable[Sequence[str] | None], count: int) -> Iterator[str]:
    rows = [
        [escape(example if number == 1 else kind), f"{number}", _percent(number, count)]
        for kind, number, example in maps.kinds_of(sentences)
    ]
    yield from _list(title, ["what is said", "rows", ""], rows)


def _outliers(table: Table) -> Iterator[str]:
    found = maps.outliers_of(table)
    if found:
        yield (
            "<p>Farther from the median than five robust standard deviations of the logarithm, "
            "their own errors counted.</p>"
        )
    rows = []
    for each in found:
        number = escape(with_error(each.value, each.error, unit=AT_DEPTH[each.quantity]))
        rows.append([escape(each.name), each.quantity, number, rounded(each.distance, 2)])
    yield from _list("Outliers", ["contact", "", "at working depth", "robust σ"], rows)


def _made(folder: Path) -> Iterator[str]:
    about = manifest_of(folder)
    settings = {name: value for name, value in about["settings"].items() if value not in (None, {})}
    yield from html.definitions(
        {
            "palpate": about["palpate"],
            "settings": ", ".join(f"{name} {value}" for name, value in settings.items()),
            "contacts": f"{about['contacts']}",
            "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        }
    )


def _list(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """The first rows of a table; nothing where it has none."""
    if rows:
        title = title if len(rows) <= MOST else f"{title}: the first {MOST} of {len(rows)}"
        yield from html.table(title, header, rows[:MOST])
