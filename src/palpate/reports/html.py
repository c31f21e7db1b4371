"""What every page is made of: its look, its pieces, and the figures that stand in it."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.results.colours import DARK, LIGHT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from palpate.results.view import Cell, Line, ViewSection


_HOME = Path(__file__).parent
#: Of every page, and what the report of an identification has beside that.
STYLE, REPORT_STYLE = (
    (_HOME / f"{name}.css").read_text(encoding="utf-8") for name in ("page", "report")
)

_LIGHT, _DARK = (
    " ".join(f"{name}: {colour};" for name, colour in theme.variables().items())
    for theme in (LIGHT, DARK)
)
#: Colours of drawings, light and dark: one of each drawing serves both.
DRAWINGS = f":root {{ {_LIGHT} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {_DARK} }} }}\n"


# The pieces that a page is put together from.

#: What stands before each verdict, so that no reader needs the colour.
SIGNS = {"trust": "✓", "with-care": "◐", "do-not-trust": "✗", "note": "·"}
#: In the head of every page: that palpate wrote it, and may replace it.
GENERATOR = '<meta name="generator" content="palpate">'
_TONES = {"warning": "note"}
_CLASSES = {"trust": "yes", "with-care": "partly", "do-not-trust": "no", "note": "open"}


def document(title: str, style: str, parts: Iterable[str]) -> str:
    """Return a whole page.

    Parameters
    ----------
    title : str
        For the browser's tab.
    style : str
        CSS.
    parts : iterable of str
        HTML, one behind the other.
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
<style>{style}</style>
</head>
<body>
{body}
</body>
</html>
"""


def badge(mark: str, words: str = "") -> str:
    """Return a verdict with its sign, in its colour."""
    sign = f'<span aria-hidden="true">{SIGNS[mark]}</span>'
    return f'<span class="badge {_CLASSES[mark]}">{sign} {escape(words or mark)}</span>'


def definitions(pairs: Mapping[str, str]) -> Iterator[str]:
    """Names and what they are, a line each."""
    yield '<dl class="made">'
    for name, value in pairs.items():
        yield f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>"
    yield "</dl>"


def table_start(title: str, header: Sequence[str]) -> Iterator[str]:
    """Open a table that scrolls by itself where the page is too narrow."""
    yield f'<div class="wide" role="region" tabindex="0" aria-label="{escape(title)}">'
    yield f"<table><caption>{escape(title)}</caption>"
    heads = "".join(f'<th scope="col">{escape(name)}</th>' for name in header)
    yield f"<thead><tr>{heads}</tr></thead><tbody>"


def table_end() -> Iterator[str]:
    """Close it."""
    yield "</tbody></table></div>"


def table(title: str, header: Sequence[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """Return a whole table, the first cell of each row its heading.

    Parameters
    ----------
    title : str
        Above it.
    header : sequence of str
        Of the columns.
    rows : iterable of sequence of str
        HTML, a cell each: words are escaped by who makes them.
    """
    yield from table_start(title, header)
    for first, *others in rows:
        yield f'<tr><th scope="row">{first}</th>{cells(others)}</tr>'
    yield from table_end()


def cells(contents: Iterable[str]) -> str:
    """Cells of HTML."""
    return "".join(f"<td>{cell}</td>" for cell in contents)


def composed(sections: "Iterable[ViewSection]") -> Iterator[str]:
    """Each section's table, then its lines: those that have names in a table of their own."""
    for each in sections:
        headings, rows = each.table()
        if rows:
            prose = [] if each.prose is None else [each.headings[each.prose]]
            folds = [name in prose for name in headings]
            names = [name.removeprefix(">").replace("\n", ", ") for name in headings]
            yield from table(each.title, names, (map(_cell, row, folds) for row in rows))
        for named, lines in groupby(each.lines, lambda line: bool(line.name and not line.mark)):
            if named:
                yield from table(each.title, ("", ""), map(_named, lines))
            else:
                yield from map(_line, lines)


def _cell(cell: "Cell", folds: bool) -> str:
    if not isinstance(cell, str):
        return badge(cell.mark, cell.text)
    words = escape(cell).replace("\n", "<br>")
    return f"<p>{words}</p>" if folds else words


def _named(line: "Line") -> tuple[str, str]:
    remarks = [*line.remarks, *([f"→ {line.remedy}"] if line.remedy else [])]
    words = "".join(f'<p class="soft">{escape(remark)}</p>' for remark in remarks)
    return escape(line.name), f"<p>{escape(line.text)}</p>{words}"


def _line(line: "Line") -> str:
    if not line.mark:
        return f'<p class="{_TONES.get(line.tone, line.tone)}">{escape(str(line))}.</p>'
    name = f"{escape(line.name)}: " if line.name else ""
    remedy = f"<p><strong>What to do:</strong> {escape(line.remedy)}.</p>" if line.remedy else ""
    words = f"<p>{escape(line.text)}.</p>{remedy}"
    return f'<div class="verdict {_CLASSES[line.mark]}">{name}{badge(line.mark)}{words}</div>'


def section(name: str, title: str, parts: Iterable[str]) -> Iterator[str]:
    """A section; none where it would be empty."""
    inside = list(parts)
    if inside:
        yield f'<section id="{name}"><h2>{escape(title)}</h2>'
        yield from inside
        yield "</section>"


# Figures that stand in a page itself, and take its colours.


def drawing(name: str, draw: Callable[[], "Figure"], caption: str) -> Iterator[str]:
    """A figure and its caption; where the page is too narrow it scrolls by itself.

    Parameters
    ----------
    name : str
        Of the figure within the page, in letters: drawings must not share names.
    draw : callable
        Gives the figure.
    caption : str
        Below it, and what a screen reader says.
    """
    from palpate.figures.style import as_svg  # a notebook's card has no figure

    inside = inline(as_svg(draw()), f"{name}-drawing", caption)
    yield f'<figure><div class="drawing" role="region" tabindex="0" aria-label="{name}">{inside}'
    yield f"</div><figcaption>{escape(caption)}</figcaption></figure>"


def inline(svg: str, name: str, caption: str) -> str:
    """Return an SVG for a page's body: names of its own, colours that follow the theme.

    Parameters
    ----------
    svg : str
        Drawn for a light background.
    name : str
        Of the figure within the page, in letters and digits: drawings must not share names.
    caption : str
        What a screen reader says.
    """
    svg = svg[svg.index("<svg") : svg.rindex("</svg>") + len("</svg>")]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    # Its size is the page's matter, and its styles would be those of every other drawing too.
    head, rest = svg.split(">", 1)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    svg = f'{head} id="{name}" role="img" aria-label="{escape(caption)}">{rest}'
    svg = re.sub(r"<style[^>]*>(.*?)</style>", lambda s: _scoped(s, name), svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="(?!' + re.escape(name) + r'")', f'id="{name}-', svg)
    svg = svg.replace('href="#', f'href="#{name}-').replace("url(#", f"url(#{name}-")
    for variable, colour in LIGHT.variables().items():
        svg = re.sub(re.escape(colour), f"var({variable})", svg, flags=re.IGNORECASE)
    return svg


def _scoped(style: re.Match[str], name: str) -> str:
    rules = re.findall(r"([^{}]+)\{([^{}]*)\}", style[1])
    return (
        "<style>"
        + "".join(f"#{name} {selector.strip()}{{{body.strip()}}}" for selector, body in rules)
        + "</style>"
    )
