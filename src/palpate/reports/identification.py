"""The report of an identification, what a notebook shows of it, and the folder of a result."""

import json
import math
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any

from palpate._core import __version__
from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.identification.identified import Identified
from palpate.quantities.derived import band_of
from palpate.recordings.opening import has_parquet, write_columns
from palpate.reports import html
from palpate.reports.html import DRAWINGS, GENERATOR, REPORT_STYLE, STYLE, drawing
from palpate.results import view
from palpate.results.saved import (
    RESULT,
    TRACES,
    as_toml,
    described,
    digest_of,
    how_made,
    in_file,
    trace_columns,
)
from palpate.stages import timed
from palpate.writing import check_own, check_writable, make_folder, write_text

# A notebook has its own colours, and may be dark: only what both can carry.
_COLOURS = {"trust": "#009e73", "with-care": "#d08a00", "do-not-trust": "#d55e00"}


def card(result: Identified) -> str:
    """Return the verdict, the numbers at working depth and the law, as HTML."""
    sections = view.verdict(result), view.depths(result), view.law(result)
    colour = _COLOURS[result.diagnosis.verdict.overall]
    name = escape(Path(result.contact.source).name or "contact")
    inside = "".join(html.composed(sections))
    return f'<div style="border-left:5px solid {colour};padding-left:0.8em">{name}{inside}</div>'


# The report of an identification: one page that says what was found, and how far to trust it.


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
    others, made = list((compared or {}).values()), result.contact.provenance.items()
    numbers = [view.depths(result, whole=True), view.law(result, whole=True)]
    follows, findings = view.follows(result, whole=True), view.findings(result)
    prepared = [view.preparation([result], whole=True)]
    prepared.append(view.ViewSection("How each channel was made", [], ("channel", ""), [*made]))
    methods = view.of_comparison(others, ranked=False) if others else ()
    parts = [
        "<header>",
        f"<h1>{escape(name)}</h1>",
        *html.composed([view.verdict(result)]),
        *_tiles(result),
        "</header>",
        "<main>",
        *html.section("numbers", "What was identified", html.composed(numbers)),
        *html.section("law", "Which law it is", _which_law(result, others)),
        *html.section("following", "What follows from the law", html.composed([follows])),
        *html.section("figure", "Figure", _figure(result)),
        *html.section("residuals", "What the law leaves", _residuals(result)),
        *html.section("findings", "Findings", html.composed([findings])),
        *html.section("parts", "Stretches and places", html.composed(view.parts(result))),
        *html.section("comparison", "Other laws and methods", html.composed(methods)),
        *html.section("contact", "How the contact was prepared", html.composed(prepared)),
        *html.section("again", "To do it again", _again(circumstances)),
        "</main>",
    ]
    return html.document(f"{name}: what was identified", STYLE + DRAWINGS + REPORT_STYLE, parts)


def _tiles(result: Identified) -> Iterator[str]:
    """Stiffness, damping and force at the working depth, large."""
    there, marks = result.diagnosis.working_depth, result.diagnosis.verdict
    relaxed = "relaxed " if result.law.remembers else ""
    at = f"at {view.depth_of(there.depth)}"
    tiles = [
        (f"{relaxed}stiffness {at} · {html.badge(marks.stiffness)}", there.stiffness, "N/m"),
        (f"{relaxed}damping {at} · {html.badge(marks.damping)}", there.damping, "N·s/m"),
        (f"{relaxed}force {at}", there.force, "N"),
    ]
    if words := view.dynamic_stiffness_at(result):
        numbers = zip(("K′", "B′"), view.felt(result), ("N/m", "N·s/m"), strict=True)
        tiles += [(f"{symbol}, {escape(words)}", each, unit) for symbol, each, unit in numbers]
    yield '<div class="tiles">'
    for name, quantity, unit in tiles:
        words = escape(f"{view.number(quantity)} {unit}")
        yield f'<div class="tile"><small>{name}</small><b>{words}</b></div>'
    yield "</div>"


def _which_law(result: Identified, others: Sequence[Identified]) -> Iterator[str]:
    """Which law it is, and K′ and B′ by it, beside those of the method that chooses a law."""
    found = list(html.composed(view.which_law([result])))
    yield from found
    chosen = (
        ()
        if result.estimator.chooses_law
        else (each for each in others if each.estimator.chooses_law)
    )
    shown = [result, *chosen]
    if not found or not any(each.law.remembers for each in shown):
        return  # the same at any frequency
    try:
        low, high = (f"{each / (2.0 * math.pi):.3g}" for each in band_of(result))
        result.dynamic_stiffness()
    except InvalidParameterError:  # of a probe that was held still
        return
    words = (
        "K′ and B′: the stiffness and the damping that a small oscillation feels at working depth, "
        f"from {low} to {high} Hz, which this motion contained. Laws of any kind have them in "
        "common."
    )
    from palpate import figures

    yield from drawing("oscillations", lambda: figures.draw_oscillations(shown), words)


def _figure(result: Identified) -> Iterator[str]:
    words = (
        "Force measured and predicted, the force–penetration loop, and the law's parameters as "
        "they were estimated, with their error bands."
    )
    from palpate import figures

    yield from drawing("figure", lambda: figures.draw(result), words)


def _residuals(result: Identified) -> Iterator[str]:
    words = (
        "Measured less final law, over time, depth and velocity: the median, and the band that "
        "holds most of it. Dotted: the noise of the sensors. Beyond them the law lacks something."
    )
    from palpate import figures

    yield from drawing("residuals", lambda: figures.draw_residuals(result), words)


def _again(circumstances: Circumstances) -> Iterator[str]:
    yield f"<pre><code>{escape(circumstances.command)}</code></pre>"
    if circumstances.options.strip():
        yield f"<pre><code>{escape(circumstances.options.strip())}</code></pre>"
    if circumstances.files:
        links = ", ".join(f'<a href="{escape(n)}">{escape(n)}</a>' for n in circumstances.files)
        yield f"<p>Beside this page: {links}.</p>"
    versions = ", ".join(f"{name} {number}" for name, number in circumstances.versions.items())
    yield from html.definitions({"made": circumstances.made, "versions": versions})


# A result on disk: report, numbers, trace and options, each file whole or not at all.

REPORT, OPTIONS = "report.html", "run.toml"
_PACKAGES = ("numpy", "matplotlib", "pyarrow")


@dataclass(frozen=True, slots=True)
class Destination:
    """A folder for a result, of which was checked that it can be written to.

    Parameters
    ----------
    folder : Path
        It is made, with those above it, where it is not there.
    inputs : sequence of Path
        Files that must not be written over.

    Raises
    ------
    RecordingError
        The folder cannot be made or written to, or one of the files would replace an input or a
        file that is none of palpate's.
    MissingExtraError
        matplotlib, which the report needs, is not installed.
    """

    folder: Path
    inputs: Sequence[Path] = ()
    trace: str = field(init=False, default_factory=lambda: TRACES[not has_parquet()])

    def __post_init__(self) -> None:
        try:
            import_module("palpate.figures")
        except MissingExtraError:
            raise MissingExtraError(
                "a report needs matplotlib: pip install 'palpate[report]'"
            ) from None
        make_folder(self.folder)
        for name in self.names:
            check_writable(self.folder / name, self.inputs)
        check_own(self.folder, self.names, lambda _: _has_a_result(self.folder))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the files, in the order in which they are written: the result's own is the last."""
        return (REPORT, self.trace, OPTIONS, RESULT)

    @timed("report")
    def save(
        self,
        result: Identified,
        *,
        options: Mapping[str, Any] | None = None,
        compared: Mapping[str, Identified] | None = None,
    ) -> None:
        """Write a result.

        Parameters
        ----------
        result : Identification
            What was identified.
        options : mapping, optional
            Of the command line that repeats it; the method unless given.
        compared : mapping, optional
            Every method on the same contact, for the report.
        """
        files = list(self.inputs)
        given = {"method": result.method} if options is None else options
        run = as_toml(given, how_made(result.contact, files))
        columns, units = trace_columns(result)
        whole = {**described(files, [result]), "trace": self.trace}
        circumstances = Circumstances(
            made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            command=self._command(files if options is None else files or [Path("-")]),
            options=run,
            files=self.names[1:],
            versions=_versions(),
        )
        write_text(self.folder / REPORT, page(result, circumstances, compared), self.inputs)
        notes = {"made by": f"palpate {__version__}", "source": result.contact.source}
        trace = self.folder / self.trace
        named = in_file(columns)
        write_columns(named, trace, units=in_file(units), notes=notes, inputs=self.inputs)
        write_text(self.folder / OPTIONS, run, self.inputs)
        whole["trace_digest"] = digest_of(trace)
        text = json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1)
        write_text(self.folder / RESULT, text + "\n", self.inputs)

    def _command(self, files: Sequence[Path]) -> str:
        if not files:
            return f"palpate.load_result({str(self.folder)!r})  # identified in Python"
        config = self.folder / OPTIONS
        words = ["palpate", "identify", *map(str, files), "--config", str(config)]
        return shlex.join([*words, "-o", str(self.folder)])


def _has_a_result(folder: Path) -> bool:
    """Whether palpate wrote a result there, or the page of one before it was interrupted."""
    marks = {RESULT: '"palpate_version"', REPORT: GENERATOR}
    there = {name: mark for name, mark in marks.items() if (folder / name).is_file()}
    return any(mark.encode() in (folder / name).read_bytes() for name, mark in there.items())


def _versions() -> dict[str, str]:
    found = {"Python": ".".join(map(str, sys.version_info[:3])), "palpate": __version__}
    took_part = {name: sys.modules[name] for name in _PACKAGES if name in sys.modules}
    return found | {name: module.__version__ for name, module in took_part.items()}
