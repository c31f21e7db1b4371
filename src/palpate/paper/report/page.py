"""The report as one HTML page that needs nothing beside it."""

import re
from collections.abc import Iterable, Iterator
from html import escape
from pathlib import Path

from palpate.paper.experiment import Experiment, Table
from palpate.paper.outcomes import figures_of
from palpate.paper.report.abstract import Line, abstract
from palpate.paper.report.contents import ABOUT, TITLE, Report, Section, circumstances, settings
from palpate.paper.report.not_held import not_held
from palpate.paper.report.page_style import PAPER
from palpate.paper.report.verdicts import SIGNS, Judgement, Verdict
from palpate.reports import html
from palpate.reports.drawings import inline
from palpate.reports.style import DRAWINGS, STYLE

CLASSES = dict(zip(Verdict, ("yes", "partly", "no", "open"), strict=True))


def page(report: Report, folder: Path) -> str:
    """Return the page; figures are taken from ``folder`` and put into it.

    Parameters
    ----------
    report : Report
        What is finished.
    folder : Path
        Where each section's ``name.svg`` lies.
    """
    parts = [
        *_head(report),
        *_contents(report),
        "<main>",
        *_claims_of_all(report),
        *_not_held(),
        *_settings(),
        *(line for section in report.sections for line in _section(section, folder)),
        "</main>",
    ]
    return html.document(TITLE, STYLE + DRAWINGS + PAPER, parts)


def _head(report: Report) -> Iterator[str]:
    yield f"<header><h1>{escape(TITLE)}</h1>"
    yield f"<p>{escape(ABOUT)}</p>"
    left = {"Not finished": report.unfinished, "Failed": report.failures}
    for words, listed in left.items():
        if listed:
            yield f'<p class="note"><strong>{words}:</strong> {escape("; ".join(listed))}.</p>'
    if lines := [_sentence(line) for line in abstract(report.judgements)]:
        yield "<h2>What reproduces, and what does not</h2>"
        yield _list(lines, "abstract")
    yield from html.definitions({**circumstances(), "seeds": f"{report.seeds}, from 0 on"})
    yield "</header>"


def _sentence(line: Line) -> str:
    """What reproduces, or does not and why."""
    why = "" if line.verdict is Verdict.REPRODUCED else f" {escape(line.because)}"
    counted = f"({line.held} of {line.checked} claims reproduced in every seed)"
    sign = f'<span class="badge {CLASSES[line.verdict]}">{SIGNS[line.verdict]}</span>'
    words = f"<strong>{escape(line.words)}.</strong>{why}"
    return f'{sign}{words} <span class="soft">{counted}</span>'


def _contents(report: Report) -> Iterator[str]:
    places = {"claims": "Every claim", "not-held": "Not held against anything"}
    places |= {"settings": "Settings and materials"}
    places |= {each.experiment.name: _heading(each.experiment) for each in report.sections}
    yield '<nav aria-label="Contents"><h2>Contents</h2>'
    yield _list(f'<a href="#{name}">{escape(words)}</a>' for name, words in places.items())
    yield "</nav>"


def _list(items: Iterable[str], kind: str = "") -> str:
    named = f' class="{kind}"' if kind else ""
    return f"<ul{named}>\n" + "\n".join(f"<li>{item}</li>" for item in items) + "\n</ul>"


def _heading(experiment: Experiment) -> str:
    figure, title = _figure(experiment.name), experiment.title
    return title if figure == experiment.name else f"{figure}: {title}"


def _figure(name: str) -> str:
    """Return "Fig. 5" of "fig05"."""
    return re.sub(r"^fig0*(?=\d)", "Fig. ", name)


def _claims_of_all(report: Report) -> Iterator[str]:
    yield '<section id="claims"><h2>Every claim of the paper</h2>'
    counts = report.counts.items()
    yield _list((_badge(verdict, f"{n} {verdict.value}") for verdict, n in counts), "counts")
    yield (
        "<p>Ours is the median over the seeds, with the range in brackets. A claim is reproduced "
        "where it holds in every seed. One that does not reproduce is a result: beside its figure "
        "stands how the words are read, what else was seen, and on what it depends.</p>"
    )
    header = ("figure", "the paper's words", "its number", "ours", "verdict")
    yield from html.table_start("Every claim", header)
    for each in report.judgements:
        figure = f'<a href="#{_anchor(each)}">{escape(_figure(each.experiment))}</a>'
        yield (
            f'<tr><th scope="row">{figure}</th><td><q>{escape(each.claim.words)}</q></td>'
            f"{_cell('its number', each.claim.number)}{_cell('ours', each.ours_words)}"
            f"<td>{_badge(each.verdict, each.verdict_words)}</td></tr>"
        )
    yield from html.table_end()
    yield "</section>"


def _not_held() -> Iterator[str]:
    """What the paper says besides, a list for each reason."""
    yield '<section id="not-held"><h2>Not held against anything</h2>'
    yield "<p>What sections II to VIII say besides, and why no number here speaks of it.</p>"
    for why, sentences in not_held().items():
        yield f"<h3>{escape(why)}</h3>"
        yield _list(f"<q>{escape(words)}</q> <small>{escape(w)}</small>" for w, words in sentences)
    yield "</section>"


def _cell(name: str, words: str) -> str:
    """A cell that says its column's name where the table is too narrow for columns."""
    return f'<td data-name="{name}">{escape(words)}</td>' if words else '<td class="none">–</td>'


def _badge(verdict: Verdict, words: str) -> str:
    sign = f'<span aria-hidden="true">{SIGNS[verdict]}</span>'
    return f'<span class="badge {CLASSES[verdict]}">{sign} {escape(words)}</span>'


def _anchor(each: Judgement) -> str:
    return f"{each.experiment}-{each.claim.key}"


def _claim(each: Judgement) -> Iterator[str]:
    """A claim with all that stands behind its verdict."""
    claim = each.claim
    yield f'<div class="claim" id="{_anchor(each)}">'
    yield f"<p><q>{escape(claim.words)}</q> <small>{escape(claim.where)}</small></p>"
    yield f"<p>{_badge(each.verdict, each.verdict_words)}</p>"
    numbers = {"its number": claim.number, claim.measured or "ours": each.ours_words}
    if said := "; ".join(f"{name}: {value}" for name, value in numbers.items() if value):
        yield f"<p>{escape(said)}</p>"
    yield from (f'<p class="soft">{escape(w)}</p>' for w in (each.words, each.remark) if w)
    yield "</div>"


def _table(table: Table) -> Iterator[str]:
    rows = ([escape(cell) for cell in row] for row in table.rows)
    yield from html.table(table.title, table.header, rows)
    if table.note:
        yield f'<p class="soft">{escape(table.note)}</p>'


def _settings() -> Iterator[str]:
    yield '<section id="settings"><h2>Settings and materials</h2>'
    for table in settings():
        yield from _table(table)
    yield "</section>"


def _section(section: Section, folder: Path) -> Iterator[str]:
    name, words = section.experiment.name, section.experiment.caption
    yield f'<section id="{name}"><h2>{escape(_heading(section.experiment))}</h2>'
    if section.drawn:
        drawing = figures_of(folder, name)[0].read_text(encoding="utf-8")
        inside = inline(drawing, f"{name}-drawing", words)
        yield f'<figure><div class="wide" tabindex="0">{inside}</div>'
        yield f"<figcaption>{escape(words)}</figcaption></figure>"
    for each in section.judgements:
        yield from _claim(each)
    for table in section.tables:
        yield from _table(table)
    yield "</section>"
