"""Building blocks of HTML pages: style, tables, verdict badges, and inline figures."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.findings import spoken
from palpate.output.results.colours import DARK, LIGHT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from palpate.output.results.view import Cell, Line, ViewSection


_HOME = Path(__file__).parent
#: CSS of every page, and additional CSS of the identification report.
STYLE, REPORT_STYLE = (
    (_HOME / f"{name}.css").read_text(encoding="utf-8") for name in ("page", "report")
)

_LIGHT, _DARK = (
    " ".join(f"{name}: {colour};" for name, colour in theme.variables().items())
    for theme in (LIGHT, DARK)
)
#: CSS variables for the colours of figures, so that one SVG serves the light and dark theme.
DRAWINGS = f":root {{ {_LIGHT} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {_DARK} }} }}\n"


# The parts of a page.

#: Sign of each verdict, so that it can be read without colour.
SIGNS = {"trust": "✓", "with-care": "◐", "do-not-trust": "✗", "note": "·"}
#: Marks a page as written by palpate, which may therefore replace it.
GENERATOR = '<meta name="generator" content="palpate">'
_TONES = {"warning": "note"}
_CLASSES = {"trust": "yes", "with-care": "partly", "do-not-trust": "no", "note": "open"}


def document(title: str, style: str, parts: Iterable[str]) -> str:
    """Return a complete HTML document.

    Parameters
    ----------
    title : str
        Title in the browser's tab.
    style : str
        CSS in addition to that of every page and of its figures.
    parts : iterable of str
        HTML of the body, joined by newlines.
    """
    body = "\n".join(parts)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
{GENERATOR}
<title>{escape(title)}</title>
<style>{STYLE}{DRAWINGS}{style}</style>
</head>
<body>
{body}
</body>
</html>
"""


def badge(mark: str, text: str = "") -> str:
    """Return a verdict as HTML, with its sign and colour."""
    sign = f'<span aria-hidden="true">{SIGNS[mark]}</span>'
    return f'<span class="badge {_CLASSES[mark]}">{sign} {escape(text or spoken(mark))}</span>'


def definitions(pairs: Mapping[str, str]) -> Iterator[str]:
    """Yield a list of names with their values, one line each."""
    yield '<dl class="made">'
    for name, value in pairs.items():
        yield f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>"
    yield "</dl>"


def table_start(title: str, header: Sequence[str]) -> Iterator[str]:
    """Yield the start of a table that scrolls sideways on a narrow page."""
    yield f'<div class="wide" role="region" tabindex="0" aria-label="{escape(title)}">'
    yield f"<table><caption>{escape(title)}</caption>"
    heads = "".join(f'<th scope="col">{escape(name)}</th>' for name in header)
    yield f"<thead><tr>{heads}</tr></thead><tbody>"


def table_end() -> Iterator[str]:
    """Yield the end of a table."""
    yield "</tbody></table></div>"


def table(title: str, header: Sequence[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """Yield a complete table; the first cell of each row is its heading.

    Parameters
    ----------
    title : str
        Caption above the table.
    header : sequence of str
        Column headings.
    rows : iterable of sequence of str
        Cells as HTML; the caller escapes text.
    """
    yield from table_start(title, header)
    for first, *others in rows:
        yield f'<tr><th scope="row">{first}</th>{cells(others)}</tr>'
    yield from table_end()


def cells(contents: Iterable[str]) -> str:
    """Return table cells; each content is HTML."""
    return "".join(f"<td>{cell}</td>" for cell in contents)


def render_sections(sections: "Iterable[ViewSection]") -> Iterator[str]:
    """Yield each section's table, then its lines; named lines become a second table."""
    for each in sections:
        headings, rows = each.table()
        if rows:
            prose = [] if each.prose is None else [each.headings[each.prose]]
            folds = [name in prose for name in headings]
            names = [name.removeprefix(">").replace("\n", ", ") for name in headings]
            yield from table(each.title, names, (map(_cell, row, folds) for row in rows))
        for named, lines in groupby(each.lines, lambda line: bool(line.name and not line.mark)):
            if named:
                yield from table(each.title, ("", ""), map(_definition, lines))
            else:
                yield from map(_line, lines)


def _cell(cell: "Cell", folds: bool) -> str:
    if not isinstance(cell, str):
        before, after = (escape(part).replace("\n", "<br>") for part in (cell.before, cell.after))
        shown = badge(cell.mark, cell.text)
        if cell.link:
            shown = f'<a href="{escape(cell.link)}">{shown}</a>'
        return f"{before}{shown}{after}"
    sentence = escape(cell).replace("\n", "<br>")
    return f"<p>{sentence}</p>" if folds else sentence


def _definition(line: "Line") -> tuple[str, str]:
    remarks = [*line.remarks, *([f"→ {line.remedy}"] if line.remedy else [])]
    sentence = "".join(f'<p class="soft">{escape(remark)}</p>' for remark in remarks)
    return escape(line.name), f"<p>{escape(line.text)}</p>{sentence}"


def _line(line: "Line") -> str:
    if not line.mark:
        return f'<p class="{_TONES.get(line.tone, line.tone)}">{escape(str(line))}.</p>'
    name = f"{escape(line.name)}: " if line.name else ""
    remedy = f"<p><strong>What to do:</strong> {escape(line.remedy)}.</p>" if line.remedy else ""
    sentence = f"<p>{escape(line.text)}.</p>{remedy}"
    return f'<div class="verdict {_CLASSES[line.mark]}">{name}{badge(line.mark)}{sentence}</div>'


def section(name: str, title: str, parts: Iterable[str]) -> Iterator[str]:
    """Yield a section with a heading; nothing if it has no content."""
    inside = list(parts)
    if inside:
        yield f'<section id="{name}"><h2>{escape(title)}</h2>'
        yield from inside
        yield "</section>"


# Inline figures that follow the colour theme of the page.


def drawing(name: str, draw: Callable[[], "Figure"], caption: str) -> Iterator[str]:
    """Yield a figure with its caption; it scrolls sideways on a narrow page.

    Parameters
    ----------
    name : str
        Name in letters, unique within the page.
    draw : callable
        Returns the figure.
    caption : str
        Caption, also the text for screen readers.
    """
    from palpate.output.figures.style import as_svg  # not needed for a notebook card

    inside = inline(as_svg(draw()), f"{name}-drawing", caption)
    yield f'<figure><div class="drawing" role="region" tabindex="0" aria-label="{name}">{inside}'
    yield f"</div><figcaption>{escape(caption)}</figcaption></figure>"


def inline(svg: str, name: str, caption: str) -> str:
    """Return an SVG for the body of a page, with unique ids and colours that follow the theme.

    Parameters
    ----------
    svg : str
        SVG drawn for a light background.
    name : str
        Name in letters and digits, unique within the page.
    caption : str
        Text for screen readers.
    """
    svg = svg[svg.index("<svg") : svg.rindex("</svg>") + len("</svg>")]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    # The page sets the size; styles are limited to this SVG, else they would affect the others.
    head, rest = svg.split(">", 1)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    svg = f'{head} id="{name}" role="img" aria-label="{escape(caption)}">{rest}'
    svg = re.sub(
        r"<style[^>]*>(.*?)</style>",
        lambda s: _limit_to_figure(s, name),
        svg,
        flags=re.DOTALL,
    )
    svg = re.sub(r'\bid="(?!' + re.escape(name) + r'")', f'id="{name}-', svg)
    svg = svg.replace('href="#', f'href="#{name}-').replace("url(#", f"url(#{name}-")
    for variable, colour in LIGHT.variables().items():
        svg = re.sub(re.escape(colour), f"var({variable})", svg, flags=re.IGNORECASE)
    return svg


def _limit_to_figure(style: re.Match[str], name: str) -> str:
    rules = re.findall(r"([^{}]+)\{([^{}]*)\}", style[1])
    return (
        "<style>"
        + "".join(f"#{name} {selector.strip()}{{{body.strip()}}}" for selector, body in rules)
        + "</style>"
    )
