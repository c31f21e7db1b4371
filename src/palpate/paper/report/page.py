"""The report as one HTML page that needs nothing beside it."""

import base64
import re
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from palpate.paper.experiment import Experiment, Table
from palpate.paper.outcomes import figures_of
from palpate.paper.report.contents import ABOUT, TITLE, Report, Section, circumstances, settings
from palpate.paper.report.page_style import PAPER
from palpate.paper.report.verdicts import SIGNS, Judgement, Verdict
from palpate.reports import html
from palpate.reports.style import STYLE

CLASSES = {
    Verdict.REPRODUCED: "yes",
    Verdict.PARTLY: "partly",
    Verdict.NOT_REPRODUCED: "no",
    Verdict.UNCHECKED: "open",
}


def page(report: Report, folder: Path) -> str:
    """Return the page; figures are taken from ``folder`` and put into it.

    Parameters
    ----------
    report : Report
        What is finished.
    folder : Path
        Where each section's ``name.svg`` and ``name-dark.svg`` lie.
    """
    parts = [
        *_head(report),
        "<main>",
        *_claims_of_all(report),
        *_settings(),
        *(line for section in report.sections for line in _section(section, folder)),
        "</main>",
    ]
    return html.document(TITLE, STYLE + PAPER, parts)


def _head(report: Report) -> Iterator[str]:
    yield "<header>"
    yield f"<h1>{escape(TITLE)}</h1>"
    yield f"<p>{escape(ABOUT)}</p>"
    yield from html.definitions({**circumstances(), "seeds": f"{report.seeds}, from 0 on"})
    for words, listed in (
        ("Not finished, so not shown", report.unfinished),
        ("Failed", report.failures),
    ):
        if listed:
            yield f'<p class="note"><strong>{words}:</strong> {escape("; ".join(listed))}.</p>'
    yield "</header>"
    yield '<nav aria-label="Contents">'
    yield "<h2>Contents</h2>"
    yield "<ul>"
    yield '<li><a href="#claims">Every claim</a></li>'
    yield '<li><a href="#settings">Settings and materials</a></li>'
    for section in report.sections:
        experiment = section.experiment
        yield f'<li><a href="#{experiment.name}">{_heading(experiment)}</a></li>'
    yield "</ul>"
    yield "</nav>"


def _heading(experiment: Experiment) -> str:
    return f"{escape(_figure(experiment.name))}: {escape(experiment.title)}"


def _figure(name: str) -> str:
    """Return "Fig. 5" of "fig05"."""
    return re.sub(r"^fig0*(?=\d)", "Fig. ", name)


def _claims_of_all(report: Report) -> Iterator[str]:
    yield '<section id="claims">'
    yield "<h2>Every claim of the paper</h2>"
    yield '<ul class="counts">'
    for verdict, count in report.counts.items():
        yield f"<li>{_badge(verdict, f'{count} {verdict.value}')}</li>"
    yield "</ul>"
    yield (
        "<p>Ours is the median over the seeds, with the range in brackets. A claim is reproduced "
        "where it holds in every seed. One that does not reproduce is a result: the column beside "
        "says on what it depends.</p>"
    )
    yield from _claims("Every claim", report.judgements, with_links=True)
    yield "</section>"


def _badge(verdict: Verdict, words: str) -> str:
    sign = f'<span aria-hidden="true">{SIGNS[verdict]}</span>'
    return f'<span class="badge {CLASSES[verdict]}">{sign} {escape(words)}</span>'


def _claims(title: str, judgements: Sequence[Judgement], *, with_links: bool) -> Iterator[str]:
    header = ("figure" if with_links else "where", "the paper's words", "its number", "ours")
    yield from html.table_start(
        title, (*header, "verdict", "what was seen; how it is read, and on what it depends")
    )
    for each in judgements:
        claim, name = each.claim, each.experiment
        where = escape(claim.where)
        if with_links:
            where = f'<a href="#{name}">{escape(_figure(name))}</a><br><small>{where}</small>'
        remarks = [f"<p>{escape(each.words)}</p>"] if each.words else []
        if each.remark:
            remarks.append(f'<p class="hinge">{escape(each.remark)}</p>')
        cells = (
            f"<q>{escape(claim.words)}</q>",
            escape(claim.number) or "–",
            _ours(each),
            _badge(each.verdict, each.verdict_words),
            "".join(remarks),
        )
        yield f'<tr><th scope="row">{where}</th>' + html.cells(cells) + "</tr>"
    yield from html.table_end()


def _ours(each: Judgement) -> str:
    if not each.ours_words:
        return "–"
    what = each.claim.measured
    return escape(each.ours_words) + (f"<br><small>{escape(what)}</small>" if what else "")


def _table(table: Table) -> Iterator[str]:
    rows = ([escape(cell) for cell in row] for row in table.rows)
    yield from html.table(table.title, table.header, rows)
    if table.note:
        yield f'<p class="hinge">{escape(table.note)}</p>'


def _settings() -> Iterator[str]:
    yield '<section id="settings">'
    yield "<h2>Settings and materials</h2>"
    for table in settings():
        yield from _table(table)
    yield "</section>"


def _section(section: Section, folder: Path) -> Iterator[str]:
    experiment = section.experiment
    name, words = experiment.name, experiment.caption or experiment.title
    light, dark = (_as_address(path) for path in figures_of(folder, name))
    yield f'<section id="{name}">'
    yield f"<h2>{_heading(experiment)}</h2>"
    yield "<figure><picture>"
    yield f'<source media="(prefers-color-scheme: dark)" srcset="{dark}">'
    yield f'<img src="{light}" alt="{escape(words)}">'
    yield f"</picture><figcaption>{escape(words)}</figcaption></figure>"
    for table in section.tables:
        yield from _table(table)
    if section.judgements:
        yield from _claims(f"Claims about {_figure(name)}", section.judgements, with_links=False)
    yield "</section>"


def _as_address(path: Path) -> str:
    """Return a picture as an address: several drawings in one page must not share their names."""
    return "data:image/svg+xml;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
