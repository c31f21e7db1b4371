"""The report as one HTML page that needs nothing beside it."""

import re
from collections.abc import Iterable, Iterator
from html import escape
from pathlib import Path

from palpate.paper.experiment import Experiment, Table
from palpate.paper.report import (
    SIGNS,
    TITLE,
    Judgement,
    Report,
    Section,
    Verdict,
    abstract,
    circumstances,
    not_held,
    settings,
    verdict_of,
)
from palpate.reports import html
from palpate.reports.drawings import inline
from palpate.reports.style import DRAWINGS, STYLE
from palpate.writing import write_text

CLASSES = dict(zip(Verdict, ("yes", "partly", "no", "open"), strict=True))
ABOUT = (
    "Every experiment of “Real-Time Identification of Hunt–Crossley Dynamic Models of Contact "
    "Environments” (IEEE Transactions on Robotics 28(3), 2012), on a simulated twin pantograph "
    "that presses simulated materials. The paper's tables and the curves of its figures are lost "
    "to us; its words are not. Everything shown here is ours, and each sentence of the paper that "
    "can be held against it is. Each experiment also shows variable projection, which the paper "
    "does not have."
)
# What this page has beside what every page has.
PAPER = """
nav h2 { margin-top: 1.5rem; font-size: 1.1rem; }
nav ul { columns: 20rem; padding-left: 1.2rem; }
.counts { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: 0.4rem 1.5rem; }
.abstract { list-style: none; padding: 0; }
.abstract li { margin: 0.5rem 0; padding-left: 1.6rem; text-indent: -1.6rem; }
.abstract .badge { display: inline-block; width: 1.6rem; text-indent: 0; }
figure svg { display: block; width: 100%; height: auto; max-width: 62rem; }
figure .wide:focus-visible { outline-offset: -2px; }
#claims q { display: block; max-width: 34rem; }
#claims .badge { white-space: normal; }
#not-held h3 { font-size: 1rem; margin-bottom: 0; }
#not-held small { color: var(--soft); white-space: nowrap; }
.claim { border-left: 4px solid var(--line); padding: 0.1rem 0 0.1rem 1rem; margin: 1.25rem 0; }
.claim p { margin: 0.25rem 0; }
.claim small { color: var(--soft); }
@media (max-width: 40rem) {
  figure svg { min-width: 44rem; }
  #claims thead { position: absolute; clip-path: inset(50%); }
  #claims table, #claims tbody, #claims tr, #claims th, #claims td { display: block; }
  #claims caption { display: block; } #claims .none { display: none; }
  #claims tr { border-bottom: 1px solid var(--line); padding: 0.6rem 0; }
  #claims th, #claims td { border: 0; padding: 0.1rem 0; }
  #claims td[data-name]::before { content: attr(data-name) ": "; color: var(--soft); }
}
@media print {
  :root { font-size: 75%; } nav { display: none; } section { break-inside: auto; }
  h2, caption, thead { break-after: avoid; } tr, figure, .claim { break-inside: avoid; }
}
"""


def figures_of(folder: Path, name: str) -> tuple[Path, Path]:
    """Where an experiment's figure lies, for a light and for a dark background."""
    return folder / f"{name}.svg", folder / f"{name}-dark.svg"


def write_page(report: Report, folder: Path) -> None:
    """Write ``report.html``, with the figures that lie in the folder put into it."""
    sections = [line for section in report.sections for line in _section(section, folder)]
    parts = [*_head(report), "<main>", *_claims(report), *_not_held(), *_settings(), *sections]
    page = html.document(TITLE, STYLE + DRAWINGS + PAPER, [*parts, "</main>"])
    write_text(folder / "report.html", page)


def _head(report: Report) -> Iterator[str]:
    yield f"<header><h1>{escape(TITLE)}</h1>"
    yield f"<p>{escape(ABOUT)}</p>"
    for words, left in {"Not finished": report.unfinished, "Failed": report.failures}.items():
        if left:
            yield f'<p class="note"><strong>{words}:</strong> {escape("; ".join(left))}.</p>'
    if lines := [_sentence(*line) for line in abstract(report.judgements)]:
        yield "<h2>What reproduces, and what does not</h2>"
        yield _list(lines, "abstract")
    yield from html.definitions({**circumstances(), "seeds": f"{report.seeds}, from 0 on"})
    yield "</header>"
    places = {"claims": "Every claim", "not-held": "Not held against anything"}
    places |= {"settings": "Settings and materials"}
    places |= {each.experiment.name: _heading(each.experiment) for each in report.sections}
    yield '<nav aria-label="Contents"><h2>Contents</h2>'
    yield _list(f'<a href="#{name}">{escape(words)}</a>' for name, words in places.items())
    yield "</nav>"


def _sentence(words: str, because: str, held: int, checked: int) -> str:
    """What reproduces, or does not and why."""
    verdict = verdict_of(held, checked)
    why = "" if verdict is Verdict.REPRODUCED else f" {escape(because)}"
    sign = f'<span class="badge {CLASSES[verdict]}">{SIGNS[verdict]}</span>'
    counted = f"({held} of {checked} claims reproduced in every seed)"
    return f'{sign}<strong>{escape(words)}.</strong>{why} <span class="soft">{counted}</span>'


def _list(items: Iterable[str], kind: str = "") -> str:
    named = f' class="{kind}"' if kind else ""
    return f"<ul{named}>\n" + "\n".join(f"<li>{item}</li>" for item in items) + "\n</ul>"


def _heading(experiment: Experiment) -> str:
    figure, title = _figure(experiment.name), experiment.title
    return title if figure == experiment.name else f"{figure}: {title}"


def _figure(name: str) -> str:
    """Return "Fig. 5" of "fig05"."""
    return re.sub(r"^fig0*(?=\d)", "Fig. ", name)


def _claims(report: Report) -> Iterator[str]:
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
        yield _list(
            f"<q>{escape(words)}</q> <small>{escape(at)}</small>" for at, words in sentences
        )
    yield "</section>"


def _cell(name: str, words: str) -> str:
    """A cell that says its column's name where the table is too narrow for columns."""
    return f'<td data-name="{name}">{escape(words)}</td>' if words else '<td class="none">–</td>'


def _badge(verdict: Verdict, words: str) -> str:
    sign = f'<span aria-hidden="true">{SIGNS[verdict]}</span>'
    return f'<span class="badge {CLASSES[verdict]}">{sign} {escape(words)}</span>'


def _anchor(each: Judgement) -> str:
    return f"{each.experiment}-{each.claim.key}"


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
    for each in section.judgements:  # with all that stands behind the verdict
        claim = each.claim
        yield f'<div class="claim" id="{_anchor(each)}">'
        yield f"<p><q>{escape(claim.words)}</q> <small>{escape(claim.where)}</small></p>"
        yield f"<p>{_badge(each.verdict, each.verdict_words)}</p>"
        numbers = {"its number": claim.number, claim.measured or "ours": each.ours_words}
        if said := "; ".join(f"{name}: {value}" for name, value in numbers.items() if value):
            yield f"<p>{escape(said)}</p>"
        yield from (f'<p class="soft">{escape(w)}</p>' for w in (each.words, each.remark) if w)
        yield "</div>"
    for table in section.tables:
        yield from _table(table)
    yield "</section>"
