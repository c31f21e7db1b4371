"""What every page is made of: its look, its pieces, and the figures that stand in it."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape
from itertools import groupby
from typing import TYPE_CHECKING

from palpate.results.colours import DARK, LIGHT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from palpate.results.view import Cell, Line, ViewSection


STYLE = """
:root {
  color-scheme: light dark;
  --back: #ffffff; --ink: #1a1a1a; --soft: #595959; --line: #d4d4d4; --band: #f4f5f6;
  --link: #005a92; --yes: #00553c; --partly: #6b4a00; --no: #9c2f00; --open: #595959;
}
@media (prefers-color-scheme: dark) {
  :root {
    --back: #16181c; --ink: #e8e8e8; --soft: #a8abb2; --line: #3a3d44; --band: #1f2227;
    --link: #7cc4f0; --yes: #4fd6ab; --partly: #e6b84a; --no: #ff9d66; --open: #a8abb2;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0 auto; padding: 1.5rem clamp(1rem, 3vw, 2.5rem) 4rem; max-width: 84rem;
  background: var(--back); color: var(--ink);
  font: 1rem/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
}
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0.5rem 0 1rem; overflow-wrap: anywhere; }
h2 { font-size: 1.35rem; line-height: 1.3; margin: 2.5rem 0 0.75rem; }
p, li { max-width: 46rem; }
a { color: var(--link); }
a:focus-visible, .wide:focus-visible, .drawing:focus-visible {
  outline: 3px solid var(--link); outline-offset: 2px;
}
section { border-top: 1px solid var(--line); margin-top: 2.5rem; }
.made { margin: 1rem 0; color: var(--soft); font-size: 0.92rem; }
.made div { display: flex; gap: 0.75rem; }
.made dt { flex: 0 0 5.5rem; }
.made dd { margin: 0; overflow-wrap: anywhere; min-width: 0; }
.note { border-left: 4px solid var(--no); padding-left: 0.75rem; }
.soft { color: var(--soft); font-size: 0.9em; }
figure { margin: 1rem 0; }
figcaption { color: var(--soft); font-size: 0.92rem; max-width: 46rem; margin-top: 0.5rem; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: 0.88rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: 0.25rem 0; }
th, td { text-align: left; vertical-align: top; padding: 0.4rem 0.8rem 0.4rem 0; }
th, td { border-bottom: 1px solid var(--line); }
thead th { color: var(--soft); font-weight: 600; }
tbody th { font-weight: 500; }
tbody tr:hover { background: var(--band); }
td p { margin: 0 0 0.3rem; min-width: 13rem; }
.badge { font-weight: 600; white-space: nowrap; }
.yes { color: var(--yes); } .partly { color: var(--partly); }
.no { color: var(--no); } .open { color: var(--open); }
@media print { section { break-inside: avoid-page; } .wide { overflow: visible; } }
"""

#: Of drawings that stand in the page itself: one of each serves light and dark.
DRAWINGS = "\n".join(
    [
        ":root {",
        *(f"  {name}: {colour};" for name, colour in LIGHT.variables().items()),
        "}",
        "@media (prefers-color-scheme: dark) {",
        "  :root {",
        *(f"    {name}: {colour};" for name, colour in DARK.variables().items()),
        "  }",
        "}",
        # A phone shows a part of it, in letters that can be read, and scrolls to the rest.
        ".drawing { overflow-x: auto; }",
        ".drawing svg { display: block; width: 100%; height: auto; }",
        ".drawing svg { min-width: 46rem; max-width: 62rem; }",
        "@media print { .drawing svg { min-width: 0; } }",
        "",
    ]
)

#: What the report of an identification has beside that.
REPORT_STYLE = """
.verdict { border-left: 6px solid; padding: 0.2rem 0 0.2rem 1rem; margin: 1rem 0; }
.verdict .badge { font-size: 1.35rem; }
.verdict p { margin: 0.3rem 0; color: var(--ink); }
.tiles { display: flex; flex-wrap: wrap; gap: 1rem; margin: 1.25rem 0; }
.tile { border: 1px solid var(--line); border-radius: 8px; padding: 0.7rem 1rem; min-width: 13rem; }
.tile b { display: block; font-size: 1.45rem; font-weight: 600; line-height: 1.3; }
.tile small { color: var(--soft); display: block; }
/* a number and its error are one */
#numbers td, #findings td, #parts td, #comparison td, #law td { white-space: nowrap; }
td p { white-space: normal; }
#law tbody th { white-space: nowrap; }
pre { background: var(--band); padding: 0.75rem 1rem; overflow-x: auto; font-size: 0.85rem; }
code { overflow-wrap: anywhere; }
@media (max-width: 40rem) { .tile { flex: 1 1 100%; } h1 { font-size: 1.5rem; } }
"""


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
        return badge(cell.mark, cell.words)
    words = escape(cell).replace("\n", "<br>")
    return f"<p>{words}</p>" if folds else words


def _named(line: "Line") -> tuple[str, str]:
    remarks = [*line.remarks, *([f"→ {line.remedy}"] if line.remedy else [])]
    words = "".join(f'<p class="soft">{escape(remark)}</p>' for remark in remarks)
    return escape(line.name), f"<p>{escape(line.words)}</p>{words}"


def _line(line: "Line") -> str:
    if not line.mark:
        return f'<p class="{_TONES.get(line.tone, line.tone)}">{escape(str(line))}.</p>'
    name = f"{escape(line.name)}: " if line.name else ""
    remedy = f"<p><strong>What to do:</strong> {escape(line.remedy)}.</p>" if line.remedy else ""
    words = f"<p>{escape(line.words)}.</p>{remedy}"
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
