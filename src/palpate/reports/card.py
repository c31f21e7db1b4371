"""What a notebook shows of an identification."""

from html import escape
from pathlib import Path

from palpate.estimators import ViscoelasticContact
from palpate.identification import Identified
from palpate.reports.html import SIGNS
from palpate.results.parameters import law_in_words, parameter_rows
from palpate.results.summary import both, depth_in_words

# A notebook has its own colours, and may be dark: only what both can carry.
_COLOURS = {"trust": "#009e73", "with-care": "#d08a00", "do-not-trust": "#d55e00"}
_CELL = "padding:0.2em 0.9em 0.2em 0;text-align:left"


def card(result: Identified) -> str:
    """Return the verdict, the numbers at working depth and the law, as HTML."""
    found = result.diagnosis
    mark = found.verdict.overall
    name = Path(result.contact.source).name or "contact"
    return (
        f'<div style="border-left:5px solid {_COLOURS[mark]};padding-left:0.8em">'
        f"<div><b>{SIGNS[mark]} {mark}</b>: {escape(found.reason)}"
        + (f" <i>({escape(found.remedy)})</i>" if found.remedy else "")
        + "</div>"
        + _depths(result)
        + _law(result)
        + f'<div style="opacity:0.7">{escape(name)}, by {escape(result.method)}; '
        "± what repeats ± what the findings would move</div></div>"
    )


def _depths(result: Identified) -> str:
    rows = [
        [depth_in_words(each.depth), both(each.force), both(each.stiffness), both(each.damping)]
        for each in result.working_depths
    ]
    return _table(["depth", "force, N", "stiffness, N/m", "damping, N·s/m"], rows)


def _law(result: Identified) -> str:
    rows = [[row.symbol, row.words, row.unit] for row in parameter_rows(result)]
    table = _table([law_in_words(result), "± standard error", "unit"], rows)
    verdict = result.law_verdict
    if verdict is None or not isinstance(result.estimator, ViscoelasticContact):
        return table
    return f"{table}<div>{escape(str(verdict))}</div>"


def _table(header: list[str], rows: list[list[str]]) -> str:
    heads = "".join(f'<th style="{_CELL}">{escape(each)}</th>' for each in header)
    body = "".join(
        "<tr>" + "".join(f'<td style="{_CELL}">{escape(each)}</td>' for each in row) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"
