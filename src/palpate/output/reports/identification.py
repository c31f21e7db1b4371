"""Identification report, notebook card, and result folder."""

import json
import math
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any

from palpate._core import __version__
from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.identification.identified import Identified
from palpate.identification.quantities.derived import motion_band
from palpate.input.recordings.table_files import has_pyarrow, write_columns
from palpate.output.reports import html
from palpate.output.reports.html import GENERATOR, REPORT_STYLE, drawing
from palpate.output.results import view
from palpate.output.results.saved import (
    RESULT,
    TRACES,
    describe_contact,
    how_made,
    toml_text,
    trace_columns,
    trace_digest,
)
from palpate.stages import log_stage
from palpate.writing import as_toml, check_own, check_writable, make_folder, write_text

# Colours that are readable in light and in dark notebooks.
_COLOURS = {"trust": "#009e73", "with-care": "#d08a00", "do-not-trust": "#d55e00"}


def card(result: Identified) -> str:
    """Return verdict, values at working depth and contact model as HTML."""
    sections = view.verdict_section(result), view.depth_table(result), view.law_section(result)
    colour = _COLOURS.get(result.diagnosis.working_depth.stiffness.mark or "", "#888888")
    name = escape(Path(result.contact.source).name or "contact")
    inside = "".join(html.render_sections(sections))
    return f'<div style="border-left:5px solid {colour};padding-left:0.8em">{name}{inside}</div>'


# The report of an identification: one page.


@dataclass(frozen=True, slots=True)
class Circumstances:
    """How a report was made.

    Attributes
    ----------
    made : str
        Date and time.
    command : str
        Command that reproduces the result.
    options : str
        Options of that command, as TOML.
    files : tuple of str
        Names of the other files in the folder.
    versions : mapping
        Package versions by name.
    """

    made: str
    command: str
    options: str
    files: tuple[str, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)


# Figures as wide as a journal's column fit a phone, with their captions below them; a wider page
# enlarges them.
_COLUMN = 0.1


def page(
    result: Identified,
    circumstances: Circumstances,
    compared: Mapping[str, Identified] | None = None,
) -> str:
    """Return the report page as HTML.

    Parameters
    ----------
    result : Identification
        The result to report.
    circumstances : Circumstances
        How the report was made.
    compared : mapping, optional
        As returned by :func:`palpate.compare`. Default: no table of other methods.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    name = Path(result.contact.source).name or "contact"
    others = list((compared or {}).values())
    made = result.contact.provenance.items()
    numbers = [view.depth_table(result), view.law_section(result, whole=True)]
    follows = view.derived_section(result, whole=True)
    findings = view.findings_section(result)
    prepared = [view.preparation_section([result], whole=True)]
    prepared.append(view.ViewSection("Source of each channel", [], ("channel", ""), [*made]))
    methods = view.comparison_sections(others) if others else ()
    # If the probe travels, the verdict of each place counts, not one verdict for all places.
    travels = any(segment.place is not None for segment in result.segments)
    each = view.segment_table(result, whole=True)
    values, beside = (each, numbers) if travels else (numbers, each)
    beside_title = "One law for all places, an average" if travels else "Segments"
    parts = [
        '<main><div class="first"><header>',
        f"<h1>{escape(name)}</h1>",
        *(_verdicts_of_parts(result) if result.segments else _tiles(result)),
        "</header>",
        *html.section("figure", "Measurement and model", _figures(result)),
        "</div>",
        *html.section("numbers", "Identified values", html.render_sections(values)),
        *html.section("law", "Model selection", _which_law(result, others)),
        *html.section("following", "Derived quantities", html.render_sections([follows])),
        *html.section("courses", "Estimates over time", _courses(result)),
        *html.section("residuals", "Residuals", _residuals(result)),
        *html.section("findings", "Findings", html.render_sections([findings])),
        *html.section("parts", beside_title, html.render_sections(beside)),
        *html.section("comparison", "Other models and methods", html.render_sections(methods)),
        *html.section("contact", "Data preparation", html.render_sections(prepared)),
        *html.section("again", "How to reproduce this result", _again(circumstances)),
        *html.section("paper", "For a paper", _for_a_paper(result)),
        "</main>",
    ]
    return html.document(f"{name}: identification", REPORT_STYLE, parts)


def _verdicts_of_parts(result: Identified) -> Iterator[str]:
    """How many segments or places have each verdict, and the next step."""
    counts, *steps = next(view.short_answer(result, ())).lines
    yield f"<p><strong>{escape(counts.text)}</strong></p>"
    yield from (
        f"<p><strong>{escape(step.name.capitalize())}:</strong> {escape(step.text)}</p>"
        for step in steps
    )


def _tiles(result: Identified) -> Iterator[str]:
    """Stiffness and damping in large letters, each with mark and reason; then the next step."""
    yield '<div class="tiles">'
    for number_line in view.number_lines(result):
        mark = f" · {html.badge(number_line.mark)}" if number_line.mark is not None else ""
        head = escape(f"{number_line.name} {number_line.at}".rstrip())
        below = f"<small>{escape(number_line.reason)}</small>" if number_line.reason else ""
        shown = f"<small>{head}{mark}</small><b>{escape(number_line.value)}</b>{below}"
        yield f'<div class="tile">{shown}</div>'
    yield "</div>"
    if remedy := result.diagnosis.remedy:
        yield f"<p><strong>Next:</strong> {escape(remedy)}.</p>"


def _which_law(result: Identified, others: Sequence[Identified]) -> Iterator[str]:
    """Yield the selected law, and K′ and B′ of the model and of the selected one."""
    words = view.describe_model_selection(result)
    chosen = (
        ()
        if result.estimator.chooses_law
        else (each for each in others if each.estimator.chooses_law)
    )
    shown = [result, *chosen]
    if not words or not any(each.law.remembers for each in shown):
        return  # K′ and B′ do not depend on the frequency
    try:
        low, high = (f"{each / (2.0 * math.pi):.3g}" for each in motion_band(result))
        result.dynamic_stiffness()
    except InvalidParameterError:  # the probe did not move
        return
    words = (
        "K′ and B′: stiffness and damping of a small oscillation at working depth, over the "
        f"frequencies of this motion, {low} to {high} Hz. They are comparable between all models."
    )
    from palpate.output import figures

    yield from drawing("oscillations", lambda: figures.draw_oscillations(shown), words)


def _figures(result: Identified) -> Iterator[str]:
    """Yield the usual figure: of a probe that travels it is the map."""
    from palpate.output.figures import caption, draw

    yield from drawing("figure", lambda: draw(result, width=_COLUMN), caption(result))


def _courses(result: Identified) -> Iterator[str]:
    """Yield how each estimate settled, and what else there is to see of this law."""
    from palpate.output.figures import PANELS, PARAMETERS, caption, draw

    optional = ("stiffness", "damping", "speed", "relaxation")
    names = [name for name in optional if PANELS[name].shows(result)] + [PARAMETERS]
    shown = partial(draw, result, names, width=_COLUMN)
    yield from drawing("panels", shown, caption(result, names))


def _for_a_paper(result: Identified) -> Iterator[str]:
    from palpate.output.figures import CITATION, methods_sentence

    yield f"<p>{escape(methods_sentence(result))}</p><p>{escape(CITATION)}</p>"


def _residuals(result: Identified) -> Iterator[str]:
    text = (
        "Measured force minus that of the final law, over time, depth and velocity: median and "
        "band from the 10th to the 90th percentile. Dotted: sensor noise. A median outside the "
        "dotted lines shows an effect that the model does not contain."
    )
    from palpate.output import figures

    yield from drawing("residuals", lambda: figures.draw_residuals(result), text)


def _again(circumstances: Circumstances) -> Iterator[str]:
    yield f"<pre><code>{escape(circumstances.command)}</code></pre>"
    if circumstances.options.strip():
        yield f"<pre><code>{escape(circumstances.options.strip())}</code></pre>"
    if circumstances.files:
        links = ", ".join(f'<a href="{escape(n)}">{escape(n)}</a>' for n in circumstances.files)
        yield f"<p>Files in this folder: {links}.</p>"
    versions = ", ".join(f"{name} {number}" for name, number in circumstances.versions.items())
    yield from html.definitions({"made": circumstances.made, "versions": versions})


# The result folder: report, numbers, trace and options. Each file is written atomically.

REPORT = "report.html"
OPTIONS = "run.toml"
_PACKAGES = ("numpy", "matplotlib", "pyarrow")


@dataclass(frozen=True, slots=True)
class Destination:
    """A folder for a result, checked to be writable.

    Parameters
    ----------
    folder : Path
        Created, with its parents, if it does not exist.
    inputs : sequence of Path
        Files that must not be overwritten.

    Raises
    ------
    RecordingError
        The folder cannot be created or written, or one of the files would replace an input or a
        file that palpate did not write.
    MissingExtraError
        matplotlib is not installed; the report needs it.
    """

    folder: Path
    inputs: Sequence[Path] = ()
    trace: str = field(init=False, default_factory=lambda: TRACES[not has_pyarrow()])

    def __post_init__(self) -> None:
        try:
            import_module("palpate.output.figures")
        except MissingExtraError:
            raise MissingExtraError.named("a report", "matplotlib", "report") from None
        make_folder(self.folder)
        for name in self.names:
            check_writable(self.folder / name, self.inputs)
        check_own(self.folder, self.names, lambda _: _has_a_result(self.folder))

    @property
    def names(self) -> tuple[str, ...]:
        """File names in the order of writing; the result itself is the last."""
        return (REPORT, self.trace, OPTIONS, RESULT)

    @log_stage("report")
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
            The result to save.
        options : mapping, optional
            Command-line options that reproduce it. Default: the method only.
        compared : mapping, optional
            Results of all methods on the same contact, for the report. Default: none.
        """
        files = list(self.inputs)
        given = {"method": result.method} if options is None else options
        run = as_toml(given, how_made(result.contact, files))
        columns, units = trace_columns(result)
        whole = {**describe_contact(files, [result]), "trace": self.trace}
        circumstances = Circumstances(
            made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            command=self._command(files if options is None else files or [Path("-")]),
            options=run,
            files=self.names[1:],
            versions=_versions(),
        )
        write_text(self.folder / REPORT, page(result, circumstances, compared), self.inputs)
        notes = {"made by": f"palpate {__version__}", "source": result.contact.source}
        if (used := result.contact.velocity_filter) is not None:
            notes |= used.as_note()
        trace = self.folder / self.trace
        named = toml_text(columns)
        write_columns(named, trace, units=toml_text(units), notes=notes, inputs=self.inputs)
        write_text(self.folder / OPTIONS, run, self.inputs)
        whole["trace_digest"] = trace_digest(trace)
        text = json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1)
        write_text(self.folder / RESULT, text + "\n", self.inputs)

    def _command(self, files: Sequence[Path]) -> str:
        if not files:
            return f"palpate.load_result({str(self.folder)!r})  # identified in Python"
        config = self.folder / OPTIONS
        phrases = ["palpate", "identify", *map(str, files), "--config", str(config)]
        return shlex.join(phrases)


def _has_a_result(folder: Path) -> bool:
    """Return whether palpate wrote a result there, or only its report before an interruption."""
    marks = {RESULT: '"palpate_version"', REPORT: GENERATOR}
    there = {name: mark for name, mark in marks.items() if (folder / name).is_file()}
    return any(mark.encode() in (folder / name).read_bytes() for name, mark in there.items())


def _versions() -> dict[str, str]:
    found = {"Python": ".".join(map(str, sys.version_info[:3])), "palpate": __version__}
    took_part = {name: sys.modules[name] for name in _PACKAGES if name in sys.modules}
    return found | {name: module.__version__ for name, module in took_part.items()}
