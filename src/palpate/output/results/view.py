"""A result as text: sections of rows and lines, composed once for terminal, report and notebook.

Each output renders the sections in its own loop. Sections are generated one by one, so a section
that is not rendered is not computed.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from palpate.digits import (
    format_hertz,
    format_quantity,
    format_time,
    interval,
    percent,
    rounded,
    with_error,
)
from palpate.errors import InvalidParameterError
from palpate.findings import MARKS, Check, Mark, spoken
from palpate.identification.diagnosis import Quantity
from palpate.identification.diagnosis.fit import DEEP
from palpate.identification.quantities.derived import motion_band
from palpate.input.preparation.touch import find_touches
from palpate.input.recordings.recording import read_truth
from palpate.method.estimators import VariableProjection
from palpate.method.rows import count_true
from palpate.output.results.parameters import (
    RELAXATION,
    felt_times,
    format_signed,
    law_name,
    parameter_rows,
    parameter_terms,
)
from palpate.output.results.truth import against_truth, stated_truth, truths

if TYPE_CHECKING:
    from palpate.identification.identified import Identified
    from palpate.identification.quantities.elastic_modulus import ElasticModulus, Tip
    from palpate.identification.quantities.restitution import Restitution
    from palpate.identification.quantities.specimen import CompressionModulus
    from palpate.method.estimators.estimate import Estimate


class Styled(NamedTuple):
    """Text in the colour of a verdict or a severity, with plain text around it."""

    text: str
    mark: str
    before: str = ""
    after: str = ""
    #: Address of a page about it.
    link: str = ""

    def __str__(self) -> str:
        return f"{self.before}{self.text}{self.after}"


#: A cell of a table; it may have several lines.
Cell: TypeAlias = str | Styled
_NOTHING = {"", "–"}


class Line(NamedTuple):
    """A sentence with an optional name, mark, remarks and remedy."""

    text: str
    #: Name of the subject, before the text.
    name: str = ""
    #: Verdict, between name and text.
    mark: str = ""
    #: Additional remarks, and the next step.
    remarks: tuple[str, ...] = ()
    remedy: str | None = None
    #: ``soft`` for the explanation of a table, ``warning``, ``strong``, or empty.
    tone: str = ""

    def __str__(self) -> str:
        head = f"{self.name}: " * bool(self.name) + f"{self.mark} " * bool(self.mark)
        tail = f" ({self.remedy})" if self.remedy else ""
        return head + "; ".join((self.text, *self.remarks)) + tail


class ViewSection(NamedTuple):
    """A table, if any, and the lines below it."""

    #: Title of the table, for outputs that print titles.
    title: str
    lines: Sequence[Line] = ()
    #: Headings of the columns; ``>`` marks a column of numbers.
    headings: Sequence[str] = ()
    rows: Sequence[Sequence[Cell]] = ()
    #: Column whose text may be wrapped.
    prose: int | None = None

    def table(self) -> tuple[list[str], list[list[Cell]]]:
        """Return headings and rows without columns whose cells are all empty."""
        kept = [k for k, _ in enumerate(self.headings) if {str(r[k]) for r in self.rows} - _NOTHING]
        return [self.headings[k] for k in kept], [[row[k] for k in kept] for row in self.rows]


# Sections of an identification, a diagnosis and a comparison.


def short_answer(result: "Identified", names: Sequence[str]) -> Iterator[ViewSection]:
    """Compose the short answer of ``palpate identify``: a line per number, the next step, the law.

    Parameters
    ----------
    result : Identified
        The identification.
    names : sequence of str
        Names of the files, quoted for a shell, for the commands that show more.
    """
    places = [segment for segment in result.segments if segment.place is not None]
    yield verdict_section(result)
    # The worst three places, or every segment between changes.
    shown = sort_by_verdict(places)[:3] or list(result.segments)
    yield from segment_table(replace(result, segments=tuple(shown)))
    deciding = result.diagnosis.deciding
    others = f"palpate explain {deciding.check}" if deciding else "or -v, -o report/"
    more = ("more", f"palpate diagnose {' '.join(names)}, {others}")
    yield ViewSection("", headings=("", ""), rows=[*fit_rows(result), more], prose=1)


def identification_sections(
    result: "Identified",
    *,
    with_findings: bool = False,
) -> Iterator[ViewSection]:
    """Compose the output of ``palpate identify -v``, optionally with all findings."""
    yield verdict_section(result)
    yield depth_table(result)
    yield from segment_table(result, whole=True)
    yield law_section(result, whole=True)
    yield derived_section(result, whole=True)
    yield preparation_section([result], whole=with_findings)
    if with_findings:
        yield findings_section(result)


def summary(result: "Identified") -> str:
    """Return everything as text, with all findings and 95 % intervals."""
    text = as_text(identification_sections(result, with_findings=True))
    return f"{result.contact.source or 'contact'}, by {result.method}\n{text}"


def diagnosis_sections(result: "Identified") -> Iterator[ViewSection]:
    """Compose the output of ``palpate diagnose``."""
    yield verdict_section(result)
    yield depth_table(result)
    yield findings_section(result)


def comparison_sections(results: "Sequence[Identified]") -> Iterator[ViewSection]:
    """Compose the output of ``palpate compare``: the methods and their laws."""
    from palpate.identification.ranking import rank

    by_name = {result.method: result for result in results}
    ranking = rank(by_name)
    ordered = [by_name[name] for name in ranking.order]
    text = f"recommended method: {ranking.recommended or 'none'}"
    yield ViewSection("Methods", [Line(text, tone="strong")])
    yield number_table(ordered, ranking.exclusions)
    yield model_table(ordered)


# The sections.

_BARS = "± statistical ± systematic standard error"
#: Meaning of *trust*.
TRUST = (
    "trust: the standard error, all causes together, is at most 10 % (damping 20 %); do not trust: "
    "it is more than 25 % (damping 60 %), or the recording has a fault"
)
_LEGEND = "σ: distance from the truth stated in the file, in standard errors"
_ROWS = (("stiffness", "N/m"), ("damping", "N·s/m"), ("force", "N"))
_MARKS = ("stiffness", "damping")
_MODULUS = "Young's modulus"
_NUMBERS = (">stiffness\nN/m", ">damping\nN·s/m")
_QUALITY = (
    "prediction: one-step prediction error after 0.2 s; fit: error of the final law; both as % rms "
    "of the force. |v| ≥ 0.1 K/B: part of the contact in which the single-stage method is biased"
)
_CHECKS = (
    "z: significance in standard errors; S, C: stiffness and damping at working depth; palpate "
    "explain CHECK says what a finding means"
)
_FOLD = 69, 73  # columns of text next to the labels of two tables, which together fit in 80


class NumberLine(NamedTuple):
    """Stiffness or damping with its mark and what limits it."""

    name: str
    #: Value ± one standard error with unit, or the reason why there is no value.
    value: str
    #: Depth and, where it matters, frequency.
    at: str
    #: None if there is no value.
    mark: Mark | None
    #: Reason of the error bar or the mark; empty for *trust*.
    reason: str = ""

    def text(self, *, reasons: bool = True) -> str:
        """Return it as one line, with its mark, and with ``why`` if ``reasons``."""
        text = " ".join(filter(None, (self.name, self.value, self.at)))
        if self.mark is None:
            return text
        why = self.reason if reasons else ""
        return f"{text} ({': '.join(filter(None, (spoken(self.mark), why)))})"


def describe_place(depth: float, frequency: float = math.nan, speed: float = 0.0) -> str:
    """Describe where a number holds: ``at 8.8 mm, 1.81 Hz``, or the depth only."""
    often = f", {format_hertz(frequency)}" if math.isfinite(frequency) else ""
    fast = f", {format_quantity(speed, 'm/s', digits=2)}" if speed else ""
    return f"at {format_quantity(depth, 'm')}{often}{fast}"


def number_lines(result: "Identified") -> list[NumberLine]:
    """Return stiffness and damping at the working depth and the motion's frequency."""
    at_depth = result.diagnosis.working_depth
    lines = list[NumberLine]()
    for name, unit in _ROWS[:2]:
        quantity: Quantity = getattr(at_depth, name)
        if math.isnan(quantity.value) and lines:
            lines.append(NumberLine(name, f"not given: {quantity.reason}", "", None))
            continue
        where = quantity.at
        at = "" if where is None else describe_place(where.depth, where.frequency, where.speed)
        same = lines and quantity.reason and quantity.reason == lines[0].reason
        reason = "for the same reason" if same else quantity.reason
        value = _format_with_unit(quantity, unit)
        lines.append(NumberLine(name, value, at, quantity.mark, reason))
    return lines


def verdict_section(result: "Identified") -> ViewSection:
    """Compose a line per number with depth, frequency, mark and reason; then the next step."""
    if result.segments:
        return ViewSection("Verdict", [*_count_verdicts(result.segments)])
    numbers = number_lines(result)
    rows = list[tuple[Cell, ...]]()
    if result.query.tip is not None or result.query.specimen is not None:  # what was asked
        modulus = _describe_modulus(result, whole=False)
        rows.append((modulus.name, _fold_sentence("; ".join((modulus.text, *modulus.remarks)))))
    values = max(len(number.value) for number in numbers if number.mark is not None)
    places = max(len(each.at) for each in numbers)
    for each in numbers:
        if each.mark is None:
            rows.append((each.name, _fold_sentence(each.value)))
            continue
        before = f"{each.value.ljust(values)}  {each.at.ljust(places)}  "
        beside = len(before) + len(spoken(each.mark)) + 2 + len(each.reason) <= _FOLD[0]
        after = (
            (f": {each.reason}" if beside else f"\n{_fold_sentence(each.reason)}")
            if each.reason
            else ""
        )
        rows.append((each.name, Styled(spoken(each.mark), each.mark, before, after)))
    if remedy := result.diagnosis.remedy:
        rows.append(("next", _fold_sentence(remedy)))
    return ViewSection("Verdict", (), ("", ""), rows)


def _fold_sentence(text: str) -> str:
    """Wrap a sentence to the width next to the labels of the two numbers."""
    return _fold(text.split(" "), " ", _FOLD[0])


def _count_verdicts(places: "Sequence[Identified]") -> Iterator[Line]:
    """Describe the number of places with each mark, and the next step for the worst place."""
    counts = []
    for number in _MARKS:
        marks = [getattr(place.diagnosis.working_depth, number).mark for place in places]
        each = ", ".join(f"{marks.count(mark)} {spoken(mark)}" for mark in MARKS if mark in marks)
        counts.append(f"{number} {each or 'not given'}")
    what = "segments" if places[0].place is None else "places"
    worst = "; below the worst three" if what == "places" else ""
    yield Line(f"{len(places)} {what}: {'; '.join(counts)}{worst}.")
    if remedy := next((part.diagnosis.remedy for part in sort_by_verdict(places)), None):
        yield Line(_sentence(remedy), "next, for the worst")


def sort_by_verdict(places: "Iterable[Identified]") -> "list[Identified]":
    """Return places, the worst first: by verdict, then by relative error of the stiffness."""

    def badness(part: "Identified") -> tuple[int, float]:
        working_depth = part.diagnosis.working_depth
        stiffness = working_depth.stiffness
        marks = (working_depth.stiffness.mark, working_depth.damping.mark)
        error = stiffness.whole_error / abs(stiffness.value) if stiffness.value else math.inf
        worst = max(MARKS.index(mark) for mark in marks if mark is not None)
        return -worst, -(error if error >= 0.0 else math.inf)

    return sorted(places, key=badness)


def _sentence(text: str) -> str:
    """Begin with a capital letter, unless it is an option, and end with a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '?')) else '.'}"


def fit_rows(result: "Identified") -> list[tuple[str, str]]:
    """Compose the law's parameters, a line on the fit, and the truth if the file states it."""
    rows = []
    derived = derived_section(result).lines
    if not result.segments:
        # K and M of a law that relaxes depend on times that nobody recorded: under -v.
        # The course says what several relaxation times do to the stiffness.
        hidden = ["M", "K"] if result.law.remembers else ["M"]
        if result.law.relaxation_time is None:
            hidden.append(RELAXATION)
        shown = (row for row in parameter_rows(result) if row.name not in hidden)
        terms = (str(row) for row in shown)
        # A wrong surface changes K, B and n by far more than stiffness and damping.
        surface = (f for f in result.diagnosis.findings if f.check == Check.SURFACE)
        doubt = "(surface in doubt: -v)" if any(math.isfinite(f.z) for f in surface) else ""
        parts = f"{law_name(result)}:", *terms, doubt, _describe_course(result)
        rows.append(("law", _fold(filter(None, parts), "  ")))
    offsets = (f for f in result.contact.findings if f.check == Check.CLOCK_OFFSET)
    rows += [("clocks", offset.message) for offset in offsets]
    rows.append(("fit", _describe_fit(result)))
    rows.append(("truth", _describe_truth(result)))
    rows += [
        (each.name, "\n".join((each.text, *each.remarks)))
        for each in derived
        if each.name != _MODULUS or result.segments  # of one contact it is the first line
    ]
    return [(name, words) for name, words in rows if words]


def _fold(parts: Iterable[str], between: str, width: int = _FOLD[1]) -> str:
    """Join parts; a part that does not fit in the line begins the next one."""
    lines = [""]
    for part in parts:
        if lines[-1] and len(lines[-1]) + len(between) + len(part) > width:
            lines.append("")
        lines[-1] += between * bool(lines[-1]) + part
    return "\n".join(lines)


def _describe_fit(result: "Identified") -> str:
    """Describe error, samples and contacts; then the settings that fit in the line."""
    touches = len(find_touches(result.contact))
    estimate = result.estimate
    words = (
        f"{format_percent(result.fit_rmse_percent)} rms, {estimate.samples} samples, {touches} "
        f"contact{'s' * (touches != 1)}"
    )
    parts = []
    if result.method != "variable-projection" and not result.estimator.chooses_law:
        parts.append(f"method {result.method}")
    if rejected := count_true(result.trace.rejected):
        parts.append(f"{rejected} outlier{'s' * (rejected > 1)} excluded")
    settings = () if result.segments else _describe_settings(estimate)  # of one law for all parts
    for part in (*parts, *settings):
        if len(longer := f"{words}; {part}") <= _FOLD[1]:
            words = longer
    return words


def describe_relaxed_stiffness(result: "Identified") -> str:
    """Describe the relaxed stiffness of a relaxing law, and whether it is extrapolated."""
    if not result.law.remembers:
        return ""
    found = result.relaxed_stiffness()
    if found.value < 0.0:
        return "relaxed stiffness not given: it would be negative"
    if found.value == 0.0:  # K is at its bound, where its error is unknown
        return "relaxed stiffness not given: it relaxed to the end of the recording"
    checks = (finding.check for finding in result.diagnosis.findings)
    caution = " (extrapolated)" if Check.RELAXED_STIFFNESS in checks else ""
    return f"relaxed stiffness {format_number(found)} N/m{caution}"


def _describe_truth(result: "Identified") -> str:
    """Describe the truth of stiffness and damping at working depth, as stated in the file."""
    at = result.working_depths[0]
    real = {} if result.segments else stated_truth(result, at.depth)
    phrases = (
        f"{name} {against_truth(found.value, real[name], found.whole_error, unit)}"
        for name, unit in _ROWS[:2]
        for found in [getattr(at, name)]
        if name in real and math.isfinite(found.value)
    )
    return _fold(phrases, "; ")


def depth_table(result: "Identified") -> ViewSection:
    """Stiffness, damping and force at both working depths, with both error bars.

    It includes the truth if the file states it.
    """
    names = ["median" if result.depth is None else "--at", f"{DEEP:.0f}th percentile"]
    headings = [""]
    columns = []
    known = [_BARS]
    for each, name in zip(result.working_depths, names, strict=False):
        headings.append(f"at {format_quantity(each.depth, 'm', 4)} ({name})")
        real = stated_truth(result, each.depth)
        cells = []
        known = [_BARS, _LEGEND] if real else known
        for quantity, unit in _ROWS:
            found: Quantity = getattr(each, quantity)
            text = found.format(unit)
            if quantity in real:
                text += f"\ntruth {against_truth(found.value, real[quantity], found.whole_error)}"
            cells.append(text)
        columns.append(cells)
    lines = [Line("; ".join(known), tone="soft"), Line(TRUST, tone="soft")]
    rows = [*zip(dict(_ROWS), *columns, strict=True)]
    return ViewSection("At working depth", lines, headings, rows)


def segment_table(result: "Identified", *, whole: bool = False) -> Iterator[ViewSection]:
    """Compose each segment between changes, or each place; empty for one material.

    With the law and the fit of each segment if ``whole``.
    """
    rows = []
    for segment in result.segments:
        diagnosis = segment.diagnosis
        time = segment.contact.time
        place = segment.place
        working_depth = diagnosis.working_depth
        both_numbers = format_number(working_depth.stiffness), format_number(working_depth.damping)
        if place is None:
            times = ("\nto " if whole else " to ").join(_ends(segment))
            terms = parameter_terms(segment) if whole else ""
            fit = format_percent(segment.fit_rmse_percent) if whole else ""
            cells = (times, "", "", *both_numbers, "", terms, fit)
        else:
            at = ", ".join(f"{1e3 * each:.1f}" for each in place.position)
            depth = rounded(1e3 * working_depth.depth, 4)
            modulus = (
                _format_modulus(segment) if segment.query.tip or segment.query.specimen else ""
            )
            times = f"{time[0]:.1f}–{time[-1]:.1f}" if whole else ""
            cells = (times, at, depth, *both_numbers, modulus, "", "")
        rows.append([*cells, _hertz(segment) if whole else "", *_both_marks(segment)])
    if rows:
        headings = ["time\ns", ">at x, y, z\nmm", ">depth\nmm", *_NUMBERS, ">Young's modulus"]
        headings += ["contact model", ">fit", ">frequency\nHz", *_MARKS]
        yield ViewSection("Each by itself", (), headings, rows)


def law_section(result: "Identified", *, whole: bool = False) -> ViewSection:
    """Compose the law's parameters, with the truth if stated, and the quality of the fit."""
    headings = ["contact model", ""]
    rows = []
    for row, truth in zip(parameter_rows(result), truths(result), strict=True):
        rows.append([str(row), truth])
        if whole:
            value = result.law.parameters[row.index]
            error = result.standard_errors[row.index]
            rows[-1].append(interval(float(value), float(error)) if row.estimated else "–")
    lines = [_describe_course(result), describe_relaxed_stiffness(result)]
    lines += [_describe_correlation(result)]
    lines += [*_describe_settings(result.estimate), describe_model_selection(result)]
    shown = [Line(each) for each in (*lines, _describe_fit_errors(result)) if each]
    title = f"Contact model: {law_name(result)}, by {result.method}"
    return ViewSection(title, shown, headings + ["95 % interval"] * whole, rows)


def _describe_course(result: "Identified") -> str:
    """Describe the stiffness after the shortest and the longest time that a recording shows."""
    if not result.diagnosis.working_depth.depth > 0.0:
        return ""
    course = (
        f"{_format_with_unit(result.stiffness_after(time), 'N/m')} after {format_time(time)}"
        for time in felt_times(result.law, result.frequency)
    )
    text = ", ".join(dict.fromkeys(course))
    return f"stiffness {text}" if text else ""


def derived_section(result: "Identified", *, whole: bool = False) -> ViewSection:
    """Compose quantities derived from the law: those requested; if ``whole``, all that apply.

    Restitution applies if the contact dissipates at least 1 % of an impact's speed, energy if the
    probe moves in and out, passivity if the law is trusted or usable with care.
    """
    lines = [*_surface_notes(result)] if whole else []
    lines += _describe_motion_quantities(result, whole=whole)
    if result.query.tip is not None or result.query.specimen is not None:
        lines.append(_describe_modulus(result, whole=whole))
        segments = [segment for segment in result.segments if segment.place is None]
        spans = (f"{begin} s to {end} s: " for begin, end in map(_ends, segments))
        lines += map(partial(_describe_modulus, whole=whole), segments, spans)
    if result.noticed is not None:  # when a control loop would have noticed
        times = ", ".join(f"{rounded(time, 4)} s" for time in result.changes.tolist())
        alarms = f"an alarm at {times}" if times else "no alarm"
        lines.append(Line(f"the online change detector raises {alarms}", "online"))
    return ViewSection("Derived quantities", lines)


def _surface_notes(result: "Identified") -> Iterator[Line]:
    """An assumption on the surface is not a fault of the stiffness."""
    for finding in result.diagnosis.findings:
        if finding.check == Check.SURFACE and finding.severity == "note":
            yield Line(finding.message, "note")


def _describe_motion_quantities(result: "Identified", *, whole: bool) -> Iterator[Line]:
    """Describe restitution, oscillation, energy and passivity, which need the time."""
    query = result.query
    whole_motion = whole and not result.contact.timeless
    trusted = result.diagnosis.verdict.overall != "do-not-trust"
    if whole_motion or query.impact_speed is not None:
        restitution = result.restitution()
        # Informative neither for a quasi-static press nor for an unknown law.
        informative = 1.0 - restitution.coefficient.value > _QUASI_STATIC
        if query.impact_speed is not None or (trusted and informative):
            yield _describe_restitution(restitution, whole=whole)
    if query.frequency is not None:
        yield from _describe_oscillation(result, whole=whole)
    if whole_motion and result.energy.kind != "none":
        yield _describe_energy(result)
    if whole_motion and trusted:
        yield _describe_passivity(result)


def findings_section(result: "Identified") -> ViewSection:
    """Compose every finding with its next step and its change of the result; each segment's law."""
    rows = []
    for finding in result.diagnosis.findings:
        text = "\n→ ".join(filter(None, (finding.message, finding.remedy)))
        z = "–" if math.isnan(finding.z) else rounded(finding.z, 3)
        moves = _format_changes(finding.moves_stiffness_percent, finding.moves_damping_percent)
        check = Styled(finding.check, finding.severity, link=finding.link)
        rows.append((check, text, z, moves))
    lines = [Line(_CHECKS, tone="soft")]
    for episode in result.diagnosis.episodes:
        terms = (f"{name} = {rounded(v, 4)}" for name, v in episode.law.as_dict().items())
        stiffness = rounded(episode.working_depth.stiffness.value, 4)
        times = f"{rounded(episode.start, 4)} to {rounded(episode.stop, 4)} s"
        lines.append(Line(f"{times}: {', '.join(terms)}; stiffness {stiffness} N/m"))
    headings = ["check", "finding and next step", ">z", ">changes S, C by"]
    return ViewSection("Findings, the most severe first", lines, headings, rows, prose=1)


def number_table(ordered: "Sequence[Identified]", exclusions: Sequence[str]) -> ViewSection:
    """Compose stiffness and damping at each method's working depth, and reasons for low marks."""
    rows: list[tuple[Cell, ...]] = []
    reasons: dict[str, list[str]] = {}
    places = list({(_millimetres(each), _hertz(each)) for each in ordered})
    for result in ordered:
        diagnosis = result.diagnosis
        working_depth = diagnosis.working_depth
        values = format_number(working_depth.stiffness), format_number(working_depth.damping)
        where = (_millimetres(result), _hertz(result)) if places[1:] else ("", "")
        rows.append((result.method, *_both_marks(result), *where, *values))
        for name in _MARKS:
            if reason := getattr(working_depth, name).reason:
                reasons.setdefault(f"{name}: {reason}", []).append(result.method)
    if real := stated_truth(ordered[0], ordered[0].diagnosis.working_depth.depth):
        numbers = (rounded(real[name], 4) for name, _ in _ROWS[:2])
        rows.append(("truth", "", "", _millimetres(ordered[0]) * bool(places[1:]), "", *numbers))
    same = "" if places[1:] else f"at {places[0][0]} mm and {places[0][1]} Hz; "
    text = f"{same}± one standard error, statistical and systematic together"
    lines = [Line(text, tone="soft")]
    lines += (Line(reason, ", ".join(methods)) for reason, methods in reasons.items())
    lines += (Line(exclusion, tone="warning") for exclusion in exclusions)
    headings = ["method", *_MARKS, ">depth\nmm", ">frequency\nHz", *_NUMBERS]
    return ViewSection("Methods on this contact, the best first", lines, headings, rows)


def model_table(ordered: "Sequence[Identified]") -> ViewSection:
    """Compose each method's law, and its errors of prediction and fit."""
    rows = []
    for each in ordered:
        errors = map(format_percent, (each.prediction_rmse_percent, each.fit_rmse_percent))
        share = format_share(each.violated_fraction)
        rows.append((each.method, parameter_terms(each), *errors, share))
    if truth := read_truth(ordered[0].contact.provenance):
        named = zip(truth.symbols, truth.parameters, truth.units, strict=True)
        terms = (f"{name} = {rounded(value, 5)} {unit}".rstrip() for name, value, unit in named)
        rows.append(("truth", "\n".join(terms), "", "", ""))
    headings = ["method", "contact model", ">prediction", ">fit", ">|v| ≥ 0.1 K/B"]
    return ViewSection("Their laws", [Line(_QUALITY, tone="soft")], headings, rows)


def preparation_section(results: "Sequence[Identified]", *, whole: bool = False) -> ViewSection:
    """Compose the samples, the preparation of the contact, and the flags of the methods.

    It omits messages that the verdict also shows or, if ``whole``, the diagnosis.
    """
    first = results[0]
    diagnosis = first.diagnosis
    shown = {
        each.check for each in (diagnosis.findings if whole else (diagnosis.deciding,)) if each
    }
    others = (finding for finding in first.contact.findings if finding.check not in shown)
    lines = [Line(_describe_samples(first))]
    lines += (Line(each.message, each.check, remedy=each.remedy) for each in others)
    for result in results:
        # No motion identifies one law for two materials, so its flags would mislead.
        flags = () if whole or result.diagnosis.episodes else result.flags
        lines += [Line(flag, result.method, tone="warning") for flag in flags]
    return ViewSection("Preparation", lines)


# Formats of one number.


def format_number(quantity: Quantity) -> str:
    """Format a number with both error bars combined."""
    return with_error(quantity.value, quantity.whole_error)


def _format_with_unit(quantity: Quantity, unit: str) -> str:
    """Format a number with both error bars combined; a long one with a prefix: 185 kN/m."""
    size = abs(quantity.value)
    if 1e-2 <= max(size, quantity.whole_error or 0.0) < 1e5 or size == 0.0:
        return f"{format_number(quantity)} {unit}"
    return format_with_prefix(quantity.combined, unit)


def format_percent(value: float) -> str:
    """Format a percentage of the force; a dash if undefined."""
    return "–" if math.isnan(value) else f"{value:.2f} %"


def format_share(value: float) -> str:
    """Format a fraction as a percentage; a dash if undefined."""
    return "–" if math.isnan(value) else percent(value)


def format_with_prefix(quantity: Quantity, unit: str, *, as_of: float | None = None) -> str:
    """Format a quantity, SI, with its errors and the unit prefix of ``as_of`` (or its value)."""
    value = quantity.value if as_of is None else as_of
    size = abs(value) if math.isfinite(value) and value else 1.0
    step = min(max(math.floor(math.log10(size) / 3.0 + 1e-12), -6), 3)
    return quantity.scaled(1e3**-step).format("afpnµm kMG"[step + 6].strip() + unit)


def _plain(value: float, unit: str) -> str:
    return format_with_prefix(Quantity(value, 0.0, 0.0), unit)


def _format_changes(stiffness: float, damping: float) -> str:
    if math.isnan(stiffness) or math.isnan(damping):
        return "–"
    return ", ".join(
        f"{round(value, 1) + 0.0:+.1f} %" if abs(value) < 1000.0 else f"{format_signed(value, 3)} %"
        for value in (stiffness, damping)
    )


# Texts of one result.


def one_line(result: "Identified") -> str:
    """Describe the identification in a line: stiffness and damping, each with its mark."""
    name = Path(result.contact.source).name or "a contact"
    numbers = (number_line.text(reasons=False) for number_line in number_lines(result))
    return f"<Identification of {name} by {law_name(result)}: {', '.join(numbers)}>"


def _millimetres(segment: "Identified") -> str:
    return rounded(1e3 * segment.diagnosis.working_depth.depth, 4)


def _hertz(segment: "Identified") -> str:
    return rounded(segment.frequency / math.tau, 3)


def _both_marks(segment: "Identified") -> tuple[Cell, Cell]:
    """Return the marks of stiffness and damping; a dash for a damping without a value."""
    working_depth = segment.diagnosis.working_depth
    marks = working_depth.stiffness.mark, working_depth.damping.mark
    first, second = ("–" if mark is None else Styled(spoken(mark), mark) for mark in marks)
    return first, second


def _ends(segment: "Identified") -> tuple[str, str]:
    """Return the first and the last time of a segment, s."""
    first, last = segment.contact.time[[0, -1]].tolist()
    return rounded(first, 4), rounded(last, 4)


def _describe_fit_errors(result: "Identified") -> str:
    fit = "fit (each part by its own law)" if result.segments else "fit"
    text = (
        f"method {result.method}; rms error of the force: {fit} "
        f"{format_percent(result.fit_rmse_percent)}, one-step prediction "
        f"{format_percent(result.prediction_rmse_percent)}"
    )
    if result.estimator.needs_condition_10:
        share = format_share(result.violated_fraction)
        text += f"; |v| ≥ 0.1 K/B in {share} of the contact, by each sample's estimate"
    return text


def _describe_samples(result: "Identified") -> str:
    contact = result.contact
    gate = result.gate
    scale = result.scale
    touches = len(find_touches(contact))
    force = f"force > {rounded(gate.make_force, 3)} N"
    if isinstance(result.estimator, VariableProjection) and not gate.make_force:
        force = "selected by the force of their neighbours"
    units = ((scale.penetration, "m"), (scale.velocity, "m/s"), (scale.force, "N"))
    return (
        f"{len(contact)} samples, {touches} {'touch' if touches == 1 else 'touches'}, "
        f"{result.estimate.samples} in contact "
        f"(penetration > {rounded(gate.minimum_penetration, 3)} m, {force}); "
        f"scaled by {', '.join(f'{rounded(size, 3)} {unit}' for size, unit in units)}"
    )


def describe_model_selection(result: "Identified") -> str:
    """Describe the selected law and its comparison; empty if no laws were compared."""
    law_verdict = result.law_verdict
    known = law_verdict is not None and law_verdict.known
    return f"Model selection: {str(law_verdict).removeprefix('law: ')}" if known else ""


def _describe_correlation(result: "Identified") -> str:
    matrix = result.correlations
    phrases = []
    estimated = [row for row in parameter_rows(result) if row.estimated]
    for one, other in itertools.combinations(estimated, 2):
        value = matrix[one.index, other.index]
        if math.isfinite(value):
            # Use enough digits to distinguish it from 1, at most four.
            digits = next((k for k in (2, 3) if abs(round(value, k)) < 1.0), 4)
            phrases.append(f"{one.symbol}–{other.symbol} {value:.{digits}f}")
    return f"correlation {', '.join(phrases)}" if phrases else ""


def _describe_settings(estimate: "Estimate") -> list[str]:
    """Describe offset and surface, if they were estimated together with the law."""
    phrases = []
    if estimate.offset_standard_error > 0.0:
        offset = with_error(estimate.offset, estimate.offset_standard_error, unit="N")
        phrases.append(f"offset {offset}")
    if estimate.surface_standard_error > 0.0:
        error = 1e3 * estimate.surface_standard_error
        phrases.append(f"surface at {with_error(1e3 * estimate.surface, error, unit='mm')}")
    return phrases


# Derived quantities.

_MANY = 0.01  # fraction of the samples in contact; fewer may be noise in shallow contact
_QUASI_STATIC = 0.01  # fraction of the speed; a smaller loss is not shown


def _describe_oscillation(result: "Identified", *, whole: bool) -> list[Line]:
    """Describe stiffness and damping of a small oscillation; empty for a probe held still."""
    with suppress(InvalidParameterError):
        response = result.dynamic_stiffness(result.query.frequency)
        parts = response.stiffness, response.damping, response.loss_tangent
        k, b, tangent = (each if whole else each.combined for each in parts)
        frequency = format_hertz(response.frequency)
        depth = format_quantity(response.depth, "m")
        text = (
            f"at {frequency} and {depth}: K′ = {k.format('N/m')}, B′ = {b.format('N·s/m')}, "
            f"tan δ = {tangent.format()}"
        )
        low, high = motion_band(result)
        band = f"the motion covers {format_hertz(low)} to {format_hertz(high)}"
        without = () if result.law.remembers else ("without relaxation: the same at any frequency",)
        return [Line(text, "oscillation", remarks=(*without, band))]
    return []


def _describe_restitution(restitution: "Restitution", *, whole: bool) -> Line:
    e = restitution.coefficient if whole else restitution.coefficient.combined
    if not math.isfinite(e.value):
        return Line("; ".join(restitution.remarks), "restitution")
    fastest = " (the fastest approach)" if restitution.speed == restitution.fastest_approach else ""
    text = f"{e.format()} at {rounded(restitution.speed, 3)} m/s{fastest}"
    return Line(text, "restitution", remarks=restitution.remarks)


def _describe_energy(result: "Identified") -> Line:
    energy = result.energy
    text = (
        f"{format_with_prefix(energy.measured, 'J')} measured, "
        f"{energy.fraction.scaled(100.0).format()} % of the energy put in; "
        f"{format_with_prefix(energy.predicted, 'J', as_of=energy.measured.value)} by the model"
    )
    return Line(text, f"energy dissipated per {energy.kind}", remarks=energy.remarks)


def _describe_passivity(result: "Identified") -> Line:
    passivity = result.passivity
    text = "the law is never adhesive (its force is never negative)"
    if passivity.fraction > 0.0:
        part = rounded(100.0 * passivity.fraction, 2)
        text = (
            f"the law is adhesive (negative force) in {part} % of the contact, down to "
            f"{_plain(passivity.lowest_force, 'N')}; the mean recorded force there is "
            f"{_plain(passivity.measured_there, 'N')}"
        )
    elif passivity.limit >= 0.0:
        text = "the law is adhesive (negative force) at working depth even at rest"
    elif math.isfinite(passivity.limit):
        text = (
            "the law becomes adhesive (negative force) when withdrawing faster than "
            f"{rounded(-passivity.limit, 3)} m/s"
        )
    if passivity.measured_fraction <= _MANY:
        return Line(text, "passivity")
    share = rounded(100.0 * passivity.measured_fraction, 2)
    remark = (
        f"the recorded force is negative in {share} % of the contact: adhesion, a wrong force "
        "offset, or a wrong surface"
    )
    return Line(text, "passivity", remarks=(remark,))


def _describe_modulus(segment: "Identified", when: str = "", *, whole: bool) -> Line:
    found: ElasticModulus | CompressionModulus
    mark = ""
    if segment.query.specimen is None:
        found = segment.elastic_modulus()
        mark = "" if found.refused else f" ({spoken(found.mark)})"
        ratio = f"{'assumed ' if found.assumed else ''}Poisson's ratio {found.poisson_ratio:g}"
        body = f"{_describe_tip(found.tip)}, {ratio}"
    else:
        found = segment.compression_modulus()
        area = rounded(1e6 * found.specimen.area, 4)
        height = _plain(found.specimen.height, "m")
        strain = rounded(found.strain, 2)
        body = f"a specimen of {area} mm² and {height} height, at a strain of {strain}"
    if found.refused:
        return Line(f"{when}not determined: {found.refused}", _MODULUS)
    value = format_with_prefix(found.value if whole else found.value.combined, "Pa")
    return Line(f"{when}{value}{mark} for {body}", _MODULUS, remarks=found.remarks)


def _describe_tip(tip: "Tip") -> str:
    size = tip.as_dict()
    if "half_angle" in size:
        angle = rounded(math.degrees(size["half_angle"]), 4)
        return f"a {tip.kind} of {angle}° between axis and side"
    sample = f" on {_plain(size['thickness'], 'm')} of sample" if "thickness" in size else ""
    return f"a {tip.kind} of {_plain(size['radius'], 'm')} radius{sample}"


def _format_modulus(segment: "Identified") -> str:
    """Format the modulus with its whole error; the JSON has the reason of a refusal."""
    found = segment.compression_modulus() if segment.query.specimen else segment.elastic_modulus()
    return "refused" if found.refused else format_with_prefix(found.value.combined, "Pa")


# Sections as plain text.


def as_text(sections: Iterable[ViewSection], *, width: int = 100) -> str:
    """Return sections as text: tables in columns, lines wrapped, an empty line between sections."""
    text = []
    for section in sections:
        headings, rows = section.table()
        table: list[tuple[str, ...]] = []
        top: list[Cell] = [heading.removeprefix(">") for heading in headings]
        for row in (top, *rows):
            cells = [[p for w in _plain_cell(c).split("\n") for p in wrap(w, 70)] for c in row]
            table += itertools.zip_longest(*cells, fillvalue="")
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        for each in table:
            padded = (cell.ljust(size) for cell, size in zip(each, widths, strict=True))
            text.append("  ".join(padded).rstrip())
        for line in section.lines:
            text += wrap(str(line), width, subsequent_indent="  ")
        text.append("")
    return "\n".join(text[:-1])


def _plain_cell(cell: Cell) -> str:
    """Return the text of a cell with its severity, which has no colour here."""
    if isinstance(cell, str) or spoken(cell.mark) == spoken(cell.text):
        return str(cell)
    return f"{cell.mark}: {cell}"
