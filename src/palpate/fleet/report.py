"""The report of a fleet: one HTML page of distributions, repeats, findings and failures."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from html import escape
from pathlib import Path

import numpy as np

from palpate.digits import rounded, with_error
from palpate.findings import MARKS
from palpate.fleet import maps
from palpate.fleet.figures import draw_distributions, draw_map, draw_repeats
from palpate.fleet.files import REPORT, read_manifest, read_results, read_seconds
from palpate.fleet.maps import map_of
from palpate.fleet.tasks import Table
from palpate.output.reports import html
from palpate.writing import write_text

#: Most rows of a table on the page; the dataset has all of them.
MOST = 20
# Least number of contacts for the histograms.
_FEWEST = 5
# Least share of the longest side that a map's axis must span: a smaller span is surface roughness.
_FLAT = 0.05
_FINDINGS = "Findings by kind (without notes)"
_REASONS = ("reason", "rows", "first row")
_TIMES = ("source", "time", "rows")
_OWN = """
.wide td { overflow-wrap: anywhere; }
.wide td:last-child { overflow-wrap: normal; }
"""


def save_report(folder: Path) -> Path:
    """Write the report of a fleet into its folder of results.

    Parameters
    ----------
    folder : Path
        Folder of the results.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    FleetError
        The folder holds no results, or some are missing.
    MissingExtraError
        matplotlib is not installed.
    RecordingError
        The page cannot be written.
    """
    path = folder / REPORT
    write_text(path, fleet_page(folder))
    return path


def fleet_page(folder: Path) -> str:
    """Return the report of a fleet as HTML."""
    table = read_results(folder)
    times = maps.slowest(read_seconds(folder))
    flags, findings = (table.column(name).to_pylist() for name in ("flags", "findings"))
    problems = [[f for f in row or () if f["severity"] != "note"] for row in findings]
    flag_kinds = maps.kinds_of(flags, maps.describe_flag)
    problem_kinds = maps.kinds_of(problems, maps.describe_finding)
    reasons = [[escape(k), f"{n}", escape(name)] for k, n, name in maps.reasons_of(table)]
    slowest = [[escape(name), f"{rounded(s, 3)} s", f"{count}"] for name, s, count in times]
    slowest = slowest if len(slowest) > 1 else []
    count = table.num_rows
    name = folder.resolve().name or "fleet"
    sections = (
        ("distributions", "Identified values", _distributions(table)),
        ("map", "Map of the material", _map(table)),
        ("repeats", "Repeats", _repeats(table)),
        (
            "flags",
            "Flags",
            _kinds("Flags by kind", flag_kinds, count),
        ),
        (
            "findings",
            "Findings",
            _kinds(_FINDINGS, problem_kinds, count),
        ),
        ("outliers", "Outliers", _outliers(table)),
        ("failures", "Failures", _list("Errors by kind", _REASONS, reasons)),
        ("slowest", "Run time", _list("Slowest sources", _TIMES, slowest)),
        ("made", "Settings", _render_settings(folder)),
    )
    rendered = [line for section in sections for line in html.section(*section)]
    header = [f"<h1>{escape(name)}</h1>", *_tiles(table)]
    parts = ["<header>", *header, "</header>", "<main>", *rendered, "</main>"]
    return html.document(f"{name}: fleet report", html.REPORT_STYLE + _OWN, parts)


def _tiles(table: Table) -> Iterator[str]:
    count = table.num_rows
    failed = sum(error is not None for error in table.column("error").to_pylist())
    parts = any(part is not None for part in table.column("part").to_pylist())
    tiles = [
        ("rows", f"{count}", "one per place" if parts else "one per contact"),
        ("identified", f"{count - failed}", _percent(count - failed, count)),
        ("failed", f"{failed}", "errors listed below"),
    ]
    for quantity in maps.list_quantities(table):
        value = maps.numbers(table, quantity)
        known = value[np.isfinite(value)]
        if known.size:
            low, middle, high = (rounded(v, 3) for v in np.percentile(known, (5, 50, 95)).tolist())
            words = (
                f"median, {maps.quantity_unit(quantity)}; 5th to 95th percentile: {low} to {high}"
            )
            heading = "Young's modulus" if quantity == "modulus" else f"{quantity} at depth"
            tiles.append((heading, middle, words))
    yield '<div class="tiles">'
    for heading, number, words in tiles:
        about = f"<small>{heading}</small><b>{number}</b><small>{words}</small>"
        yield f'<div class="tile">{about}</div>'
    yield "</div>"
    judged = False
    for quantity in maps.list_quantities(table):
        counts = Counter(table.column(f"verdict_{quantity}").to_pylist())
        words = ", ".join(f"{html.badge(mark)} {counts[mark]}" for mark in MARKS if counts[mark])
        if words:
            judged = True
            yield f"<p>{maps.quantity_name(quantity).capitalize()}: {words}.</p>"
    if judged:
        return
    if (checked := {*table.column("checked").to_pylist()}) <= {*maps.NO_VERDICT}:
        badge = f"{html.badge('with-care', 'not checked')} " * (checked == {"none"})
        words = maps.NO_VERDICT["none" if checked == {"none"} else "input"]
        yield f'<p class="soft">{badge}{words}.</p>'


def _percent(count: int, of: int) -> str:
    return f"{100.0 * count / max(of, 1):.3g}\N{NO-BREAK SPACE}%"


def _distributions(table: Table) -> Iterator[str]:
    if (lag := maps.rig_lag_of(table)) is not None:
        yield f"<p>{escape(str(lag))}.</p>"
    known = np.isfinite(maps.numbers(table, "stiffness"))
    if np.count_nonzero(known) < _FEWEST:
        return
    text = (
        "Distributions of stiffness and damping at working depth (and of an identified exponent), "
        "and below each its relative standard error."
    )
    yield from html.drawing("distributions", partial(draw_distributions, table), text)


def _map(table: Table) -> Iterator[str]:
    """Draw the map over the first two coordinates that vary; nothing with fewer."""
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
    text = f"{found.summary[0].upper()}{found.summary[1:]}."
    yield from html.drawing("over-place", partial(draw_map, found), text)


def _repeats(table: Table) -> Iterator[str]:
    for quantity in maps.list_quantities(table):
        if not (found := maps.repeats_of(table, quantity)):
            continue
        apart = sorted((each for each in found if not each.agree), key=lambda each: -each.z)
        agreeing = len(found) - len(apart)
        yield (
            f"<p>{quantity.capitalize()} at depth: {agreeing} of {len(found)} groups of repeats "
            "scatter consistently with their standard errors (χ² within 3 σ).</p>"
        )
        if len(found) > 1:
            text = (
                f"Scatter of the {quantity} in each group of repeats, relative to the standard "
                "errors: 1 if the errors are right."
            )
            yield from html.drawing(
                f"repeats-{quantity}",
                partial(draw_repeats, found, quantity),
                text,
            )
        unit = maps.quantity_unit(quantity)
        header = ["repeats of", "identified", "weighted mean", "scatter / errors", ""]
        rows = []
        for each in [*apart, *(e for e in found if e.agree)]:
            count = f"{each.count}" if each.count == each.total else f"{each.count} of {each.total}"
            text = "agree" if each.agree else f"do not agree, {rounded(each.z, 2)} σ"
            badge = html.badge("trust" if each.agree else "with-care", text)
            mean = escape(with_error(each.mean, each.error, unit=unit))
            rows.append([escape(each.name), count, mean, rounded(each.ratio, 3), badge])
        yield from _list(f"Repeats of the {quantity}", header, rows)


def _kinds(title: str, kinds: Iterable[tuple[str, int, str]], count: int) -> Iterator[str]:
    rows = [
        [escape(example if number == 1 else kind), f"{number}", _percent(number, count)]
        for kind, number, example in kinds
    ]
    yield from _list(title, ["message", "rows", "share"], rows)


def _outliers(table: Table) -> Iterator[str]:
    found = maps.outliers_of(table)
    if found:
        yield (
            "<p>Values farther from the median than five robust standard deviations of the "
            "logarithm, including their own errors.</p>"
        )
    rows = []
    for each in found:
        number = escape(with_error(each.value, each.error, unit=maps.quantity_unit(each.quantity)))
        rows.append([escape(each.name), each.quantity, number, rounded(each.distance, 2)])
    yield from _list("Outliers", ["contact", "quantity", "at working depth", "robust σ"], rows)


def _render_settings(folder: Path) -> Iterator[str]:
    about = read_manifest(folder)
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
    """Yield a table of the first rows; nothing without rows."""
    if rows:
        title = title if len(rows) <= MOST else f"{title}: the first {MOST} of {len(rows)}"
        yield from html.table(title, header, rows[:MOST])
