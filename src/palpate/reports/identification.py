"""The report of an identification: one page that says what was found, and how far to trust it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from palpate import figures
from palpate.identification import Identified
from palpate.reports import html, sections
from palpate.reports.drawings import drawing
from palpate.reports.law import which_law
from palpate.reports.style import DRAWINGS, REPORT, STYLE


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What a report says of how it came about.

    Attributes
    ----------
    made : str
        When, in words.
    command : str
        That does it again.
    options : str
        Of that command, as TOML.
    files : tuple of str
        Names of what lies beside the page.
    versions : mapping
        Of the packages that took part.
    """

    made: str
    command: str
    options: str
    files: tuple[str, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)


def page(
    result: Identified,
    circumstances: Circumstances,
    compared: Mapping[str, Identified] | None = None,
) -> str:
    """Return the page.

    Parameters
    ----------
    result : Identification
        What it is about.
    circumstances : Circumstances
        How it came about.
    compared : mapping, optional
        As :func:`palpate.compare` returns it, for a table of all methods.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    name = Path(result.contact.source).name or "contact"
    parts = [
        "<header>",
        f"<h1>{escape(name)}</h1>",
        *sections.verdict(result),
        *sections.tiles(result),
        "</header>",
        "<main>",
        *html.section("numbers", "What was identified", sections.numbers(result)),
        *html.section("law", "Which law it is", which_law(result, compared)),
        *html.section("following", "What follows from the law", sections.follows(result)),
        *html.section("figure", "Figure", _figure(result)),
        *html.section("residuals", "What the law leaves", _residuals(result)),
        *html.section("findings", "Findings", sections.findings(result)),
        *html.section("parts", "Stretches and places", sections.parts(result)),
        *html.section("comparison", "Other laws and methods", sections.comparison(compared or {})),
        *html.section("contact", "How the contact was prepared", sections.preparation(result)),
        *html.section("again", "To do it again", _again(circumstances)),
        "</main>",
    ]
    return html.document(f"{name}: what was identified", STYLE + DRAWINGS + REPORT, parts)


def _figure(result: Identified) -> Iterator[str]:
    words = (
        "Force measured and predicted, the force–penetration loop, and the law's parameters as "
        "they were estimated, with their error bands."
    )
    yield from drawing("figure", lambda **options: figures.draw(result, **options), words)


def _residuals(result: Identified) -> Iterator[str]:
    words = (
        "Measured less final law, over time, depth and velocity: the median, and the band that "
        "holds most of it. Dotted: the noise of the sensors. Beyond them the law lacks something."
    )
    yield from drawing(
        "residuals", lambda **options: figures.draw_residuals(result, **options), words
    )


def _again(circumstances: Circumstances) -> Iterator[str]:
    yield f"<pre><code>{escape(circumstances.command)}</code></pre>"
    if circumstances.options.strip():
        yield f"<pre><code>{escape(circumstances.options.strip())}</code></pre>"
    if circumstances.files:
        links = ", ".join(f'<a href="{escape(n)}">{escape(n)}</a>' for n in circumstances.files)
        yield f"<p>Beside this page: {links}.</p>"
    versions = ", ".join(f"{name} {number}" for name, number in circumstances.versions.items())
    yield from html.definitions({"made": circumstances.made, "versions": versions})
