"""Figures that stand in a page itself, and take its colours."""

import re
from collections.abc import Callable, Iterator
from html import escape
from typing import TYPE_CHECKING

from palpate.figures.slimming import slim
from palpate.figures.style import LIGHT, as_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NARROW = 88e-3  # m: a journal's column, and a phone

Draw = Callable[..., "Figure"]


def drawing(name: str, draw: Draw, caption: str) -> Iterator[str]:
    """A figure twice: as wide as a page, and as narrow as a phone; the page shows one of them.

    Parameters
    ----------
    name : str
        Of the figure within the page, in letters: drawings must not share names.
    draw : callable
        Gives the figure, and with ``width`` in m one of that width.
    caption : str
        Below it, and what a screen reader says.
    """
    yield "<figure>"
    for look, options in (("spread", {}), ("narrow", {"width": NARROW})):
        inside = inline(slim(as_svg(draw(**options))), f"{name}-{look}", caption)
        yield f'<div class="drawing {look}">{inside}</div>'
    yield f"<figcaption>{escape(caption)}</figcaption></figure>"


def inline(svg: str, name: str, caption: str) -> str:
    """Return a slim SVG for a page's body: names of its own, colours that follow the theme.

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
