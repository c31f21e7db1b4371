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

import numpy as np

from palpate._core import __version__
from palpate.diagnosis import Quantity, WorkingDepth
from palpate.diagnosis.data import in_words
from palpate.digits import rounded
from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.estimators import LawVerdict, ViscoelasticContact
from palpate.identification.identified import Identified, rank
from palpate.quantities.derived import band_of
from palpate.recordings.opening import has_parquet, write_columns
from palpate.recordings.recording import truth_of
from palpate.reports import html
from palpate.reports.html import DRAWINGS, GENERATOR, REPORT_STYLE, SIGNS, STYLE, drawing
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
from palpate.results.summary import (
    both,
    correlated,
    depth_in_words,
    felt,
    felt_at,
    following,
    law_in_words,
    number,
    parameter_rows,
    whose_fit,
)
from palpate.stages import timed
from palpate.writing import check_own, check_writable, make_folder, write_text

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
        + _law_on_card(result)
        + f'<div style="opacity:0.7">{escape(name)}, by {escape(result.method)}; '
        "± what repeats ± what the findings would move</div></div>"
    )


def _depths(result: Identified) -> str:
    rows = [
        [depth_in_words(each.depth), both(each.force), both(each.stiffness), both(each.damping)]
        for each in result.working_depths
    ]
    return _table(["depth", "force, N", "stiffness, N/m", "damping, N·s/m"], rows)


def _law_on_card(result: Identified) -> str:
    rows = [[row.symbol, row.words, row.unit] for row in parameter_rows(result)]
    table = _table([law_in_words(result), "± standard error", "unit"], rows)
    verdict = result.law_verdict
    if verdict is None or not result.estimator.chooses_law:
        return table
    return f"{table}<div>{escape(str(verdict))}</div>"


def _table(header: list[str], rows: list[list[str]]) -> str:
    heads = "".join(f'<th style="{_CELL}">{escape(each)}</th>' for each in header)
    body = "".join(
        "<tr>" + "".join(f'<td style="{_CELL}">{escape(each)}</td>' for each in row) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"


# The sections of an identification's report: verdict, numbers, findings and the rest, as HTML.


def verdict(result: Identified) -> Iterator[str]:
    """The verdict, its reason and the remedy, and what each number is worth."""
    found = result.diagnosis
    marks = found.verdict
    sentence = found.reason[:1].upper() + found.reason[1:]
    yield f'<div class="verdict {html.colour_of(marks.overall)}">'
    yield html.badge(marks.overall)
    yield f"<p>{escape(sentence)}.</p>"
    if found.remedy:
        yield f"<p><strong>What to do:</strong> {escape(found.remedy)}.</p>"
    yield "</div>"


def tiles(result: Identified) -> Iterator[str]:
    """Stiffness, damping and force at the working depth, large."""
    found, there = result.diagnosis, result.diagnosis.working_depth
    marks = {"stiffness": found.verdict.stiffness, "damping": found.verdict.damping}
    yield '<div class="tiles">'
    for name, unit in (("stiffness", "N/m"), ("damping", "N·s/m"), ("force", "N")):
        quantity: Quantity = getattr(there, name)
        words = f"{number(quantity)} {unit}"
        mark = f" · {html.badge(marks[name])}" if name in marks else ""
        name = f"relaxed {name}" if result.law.remembers else name
        yield (
            f'<div class="tile"><small>{name} at {depth_in_words(there.depth)}{mark}</small>'
            f"<b>{escape(words)}</b></div>"
        )
    if result.law.remembers and (at := felt_at([result])):
        stiffness, damping = felt(result)
        words = f"{number(stiffness)} N/m, {number(damping)} N·s/m"
        name = escape(at.partition(": ")[2])
        yield f'<div class="tile"><small>{name}</small><b>{escape(words)}</b></div>'
    yield "</div>"


def numbers(result: Identified) -> Iterator[str]:
    """Numbers at the working depths, then the law's parameters and their correlations."""
    header = ("depth", "force, N", "stiffness, N/m", "damping, N·s/m")
    rows = [_depth_row(there) for there in result.working_depths]
    yield from html.table("At working depth, and at the 90th percentile of depth", header, rows)
    yield (
        '<p class="soft">± what repeats ± what the findings would move. Stiffness is ∂F/∂x and '
        "damping ∂F/∂v, at rest: what a small motion there feels.</p>"
    )
    yield from _law(result)
    yield from _correlations(result)


def _depth_row(there: WorkingDepth) -> list[str]:
    quantities = (there.force, there.stiffness, there.damping)
    return [depth_in_words(there.depth), *(escape(both(each)) for each in quantities)]


def _law(result: Identified) -> Iterator[str]:
    law, errors = result.law, result.standard_errors
    truth = truth_of(result.contact.provenance)
    known = truth is not None and type(truth) is type(law)
    header = ["parameter", "estimate", "95 % interval", "unit"]
    header += ["truth, by the file", "off by"] if known else []
    rows = []
    values = law.as_dict()
    for each in parameter_rows(result):
        row = [f"{each.symbol}, {each.name.replace('_', ' ')}", each.words, each.interval]
        row += [each.unit]
        if known and truth is not None:
            true = truth.as_dict().get(each.name, math.nan)
            apart = values.get(each.name, math.nan) - true
            row += [rounded(true, 5), _apart(apart, float(errors[each.index]))]
        rows.append([escape(cell) for cell in row])
    yield from html.table(
        f"Contact model: {law_in_words(result)}, by {result.method}", header, rows
    )
    fits = whose_fit(result)
    measures = f"{fits[:1].upper()}{fits[1:]} the force to {rounded(result.fit_rmse_percent, 2)} %"
    predicted = result.prediction_rmse_percent
    if math.isfinite(predicted):
        measures += f"; predicted a priori, after 0.2 s of contact, to {rounded(predicted, 2)} %"
    yield f'<p class="soft">{escape(measures)} (RMS).</p>'


def _apart(difference: float, error: float) -> str:
    return f"{difference / error:+.1f} s.e." if error > 0.0 else "–"


def _correlations(result: Identified) -> Iterator[str]:
    own = [index for index, _ in correlated(result)]
    symbols = [symbol for _, symbol in correlated(result)]
    matrix = result.correlations[np.ix_(own, own)]
    if not (own and np.isfinite(matrix).all()):
        return
    rows = [
        [escape(symbol), *(f"{value:+.4g}" for value in matrix[k])]
        for k, symbol in enumerate(symbols)
    ]
    yield from html.table("Correlations", ["", *symbols], rows)


def follows(result: Identified) -> Iterator[str]:
    """Rebound, energy lost, pulling and elastic modulus."""
    rows = []
    for line in following(result, whole=True):
        remarks = "".join(f'<p class="soft">{escape(remark)}</p>' for remark in line.remarks)
        rows.append([escape(line.name), f"<p>{escape(line.words)}</p>{remarks}"])
    yield from html.table("Of a free impact, of the loops, and of the tip", ("", ""), rows)


def findings(result: Identified) -> Iterator[str]:
    """Every finding with its remedy, and how far it moves the numbers."""
    rows = []
    for finding in result.diagnosis.findings:
        words = f"<p>{escape(finding.message)}</p>"
        if finding.remedy:
            words += f'<p class="soft">→ {escape(finding.remedy)}</p>'
        moves = (finding.moves_stiffness_percent, finding.moves_damping_percent)
        rows.append(
            [
                html.badge(finding.severity, finding.check),
                words,
                "–" if math.isnan(finding.z) else rounded(finding.z, 3),
                *("–" if math.isnan(each) else f"{each:+.1f} %" for each in moves),
            ]
        )
    header = ("check", "what was found", "z", "moves stiffness", "moves damping")
    yield from html.table("What was found, the gravest first", header, rows)


def sections_of(result: Identified) -> Iterator[str]:
    """Each stretch between changes, or each place, by itself."""
    header = ("time, s", "depth", "stiffness, N/m", "damping, N·s/m", "verdict")
    rows = []
    for part in result.stretches:
        there, time = part.diagnosis.working_depth, part.contact.time
        when = f"{time[0]:.4g} – {time[-1]:.4g}"
        if part.place is not None:
            x, y, z = (1e3 * part.place.position).tolist()
            when += f'<br><small class="soft">at {x:.1f}, {y:.1f}, {z:.1f} mm</small>'
        rows.append(
            [
                when,
                depth_in_words(there.depth),
                *(escape(number(q)) for q in (there.stiffness, there.damping)),
                html.badge(part.diagnosis.verdict.overall),
            ]
        )
    if not rows:
        for episode in result.diagnosis.episodes:
            there = episode.working_depth
            rows.append(
                [
                    f"{episode.start:.4g} – {episode.stop:.4g}",
                    depth_in_words(there.depth),
                    *(rounded(q.value, 4) for q in (there.stiffness, there.damping)),
                    "not identified by itself: --changes",
                ]
            )
    if rows:
        yield from html.table("Each by itself", header, rows)
    if result.changes.size:
        times = ", ".join(f"{time:.4g} s" for time in result.changes)
        yield f"<p>A change detector, in a control loop, alarms at {times}.</p>"


def comparison(compared: Mapping[str, Identified]) -> Iterator[str]:
    """Every method on the same contact, the best first."""
    if not compared:
        return
    ranking = rank(compared)
    header = ("method", "law", "verdict", "stiffness, N/m", "damping, N·s/m", "fit", "parameters")
    rows = []
    for name in ranking.order:
        other = compared[name]
        words = "<br>".join(escape(str(row)) for row in parameter_rows(other))
        rows.append(
            [
                escape(name),
                escape(law_in_words(other)),
                html.badge(other.diagnosis.verdict.overall),
                *(escape(number(q)) for q in felt(other)),
                f"{rounded(other.fit_rmse_percent, 2)} %",
                words,
            ]
        )
    yield from html.table("Every method on this contact, the best first", header, rows)
    if words := felt_at(list(compared.values())):
        yield f'<p class="soft">{escape(words)}.</p>'
    yield f"<p>Recommended: {escape(ranking.recommended or 'none of them')}.</p>"
    for sentence in ranking.exclusions:
        yield f'<p class="soft">{escape(sentence)}.</p>'


def preparation(result: Identified) -> Iterator[str]:
    """What was done on the way from the recording."""
    contact = result.contact
    taken, left = int(result.trace.taken.sum()), int(result.trace.rejected.sum())
    yield (
        f"<p>{len(contact)} samples, {taken} of them in contact; {left} left out as outliers.</p>"
    )
    rows = [
        [
            escape(finding.check),
            f"<p>{escape(finding.message)}</p>"
            + (f'<p class="soft">→ {escape(finding.remedy)}</p>' if finding.remedy else ""),
        ]
        for finding in contact.findings
    ]
    if rows:
        yield from html.table("What was found, assumed or left out", ("step", ""), rows)
    made = [[escape(name), escape(words)] for name, words in contact.provenance.items()]
    if made:
        yield from html.table("How each channel was made", ("channel", ""), made)


# The section of a report that says which law it is: the verdict, all laws, and K′ and B′.

_TITLE = "Laws by the same samples, the best first"
_HEADER = ("law", "", "score", "rms error", "numbers")


def which_law(
    result: Identified, compared: Mapping[str, Identified] | None = None
) -> Iterator[str]:
    """Which law it is, by what evidence, and what a small oscillation feels by it.

    Parameters
    ----------
    result : Identification
        What the report is about.
    compared : mapping, optional
        Every method on the same contact: the one that chooses a law is drawn beside the result.
    """
    verdict = result.law_verdict
    if verdict is None or not verdict.known:
        return
    yield f"<p>{escape(_sentence(result, verdict))}</p>"
    yield from _standings(verdict)
    yield from (f'<p class="note">{escape(flag)}</p>' for flag in verdict.flags)
    chosen = (compared or {}).get(ViscoelasticContact.method)
    both = [result]
    if chosen is not None and not result.estimator.chooses_law:
        both.append(chosen)
    yield from _oscillations(both)


def _sentence(result: Identified, verdict: LawVerdict) -> str:
    own = result.estimator.chooses_law
    if len(verdict.standings) == 1:
        return f"{verdict.candidate}: the law that was asked for, so nothing was chosen."
    best, second = verdict.standings[0], verdict.standings[1]
    best_law = str(best.candidate)
    words = "is the law that was chosen" if own else "explains these samples best"
    return (
        f"{best_law[:1].upper()}{best_law[1:]} {words}, before {second.candidate} by a score of "
        f"{rounded(second.score, 3)}; from 10 on that is strong evidence. "
        f"{rounded(verdict.samples, 4)} samples say as much as "
        f"{rounded(verdict.effective_samples, 3)} independent ones."
    )


def _standings(verdict: LawVerdict) -> Iterator[str]:
    rows = [
        [
            escape(str(each.candidate)),
            escape(each.words),
            rounded(each.score, 3),
            in_words(each.rms_error, "N"),
            str(each.candidate.parameters),
        ]
        for each in verdict.standings
    ]
    yield from html.table(_TITLE, _HEADER, rows)
    yield (
        '<p class="soft">Score: N<sub>eff</sub> ln(RSS/N) + 2 p ln N<sub>eff</sub> over that of '
        "the best, by p numbers, the offset among them; the less the better.</p>"
    )


def _oscillations(results: list[Identified]) -> Iterator[str]:
    """K′ and B′ where one of them remembers; nothing of a probe that was held still."""
    if not any(result.law.remembers for result in results):
        return  # the same at any frequency
    try:
        results[0].dynamic_stiffness()
    except InvalidParameterError:
        return
    low, high = (f"{each / (2.0 * math.pi):.3g}" for each in band_of(results[0]))
    words = (
        "K′ and B′: the stiffness and the damping that a small oscillation feels at working depth, "
        f"from {low} to {high} Hz, which this motion contained. Laws of any kind have them in "
        "common."
    )
    from palpate import figures

    yield from drawing("oscillations", lambda: figures.draw_oscillations(results), words)


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
    parts = [
        "<header>",
        f"<h1>{escape(name)}</h1>",
        *verdict(result),
        *tiles(result),
        "</header>",
        "<main>",
        *html.section("numbers", "What was identified", numbers(result)),
        *html.section("law", "Which law it is", which_law(result, compared)),
        *html.section("following", "What follows from the law", follows(result)),
        *html.section("figure", "Figure", _figure(result)),
        *html.section("residuals", "What the law leaves", _residuals(result)),
        *html.section("findings", "Findings", findings(result)),
        *html.section("parts", "Stretches and places", sections_of(result)),
        *html.section("comparison", "Other laws and methods", comparison(compared or {})),
        *html.section("contact", "How the contact was prepared", preparation(result)),
        *html.section("again", "To do it again", _again(circumstances)),
        "</main>",
    ]
    return html.document(f"{name}: what was identified", STYLE + DRAWINGS + REPORT_STYLE, parts)


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
