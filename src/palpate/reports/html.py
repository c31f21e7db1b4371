"""The pieces that a page is put together from."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape

#: What stands before each verdict, so that no reader needs the colour.
SIGNS = {"trust": "✓", "with-care": "◐", "do-not-trust": "✗", "note": "·"}
#: In the head of every page: that palpate wrote it, and may replace it.
GENERATOR = '<meta name="generator" content="palpate">'
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
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            GENERATOR,
            f"<title>{escape(title)}</title>",
            f"<style>{style}</style>",
            "</head>",
            "<body>",
            *parts,
            "</body>",
            "</html>",
            "",
        ]
    )


def colour_of(mark: str) -> str:
    """Return the class of a verdict's colour."""
    return _CLASSES[mark]


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


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
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


def section(name: str, title: str, parts: Iterable[str]) -> Iterator[str]:
    """A section; none where it would be empty."""
    inside = list(parts)
    if inside:
        yield f'<section id="{name}"><h2>{escape(title)}</h2>'
        yield from inside
        yield "</section>"
