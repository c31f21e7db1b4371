"""A result as text: sections of rows and lines, composed once for terminal, report and notebook.

Each of them renders the sections by a loop of its own. Sections are generated one by one: one that
is not rendered is not composed.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from palpate.diagnosis import Quantity
from palpate.diagnosis.fit import DEEP
from palpate.digits import format_quantity, interval, rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.estimators import VariableProjection
from palpate.findings import MARKS, spoken
from palpate.identification.identified import rank
from palpate.preparation.gates import touches_of
from palpate.quantities.derived import band_of, in_hertz
from palpate.recordings.recording import truth_of
from palpate.results.parameters import (
    against_truth,
    law_name,
    oscillation_against_truth,
    parameter_rows,
    signed,
    terms_of,
    truth_at_rest,
    truths,
)

if TYPE_CHECKING:
    from palpate.estimators.estimate import Estimate
    from palpate.identification.identified import Identified
    from palpate.quantities.restitution import Restitution


class Marked(NamedTuple):
    """Words in the colour of a verdict or a severity."""

    text: str
    mark: str

    def __str__(self) -> str:
        return self.text


def _marked(mark: str) -> Marked:
    return Marked(spoken(mark), mark)


#: Of a table; it may have several lines.
Cell: TypeAlias = str | Marked
_NOTHING = {"", "–"}


class Line(NamedTuple):
    """A sentence, and what stands around it."""

    text: str
    #: Of what it is, which stands before it.
    name: str = ""
    #: Verdict, which stands between the two.
    mark: str = ""
    #: What a reader should know of it, and do about it.
    remarks: tuple[str, ...] = ()
    remedy: str | None = None
    #: ``soft`` of what explains a table, ``warning``, ``strong``, or none.
    tone: str = ""

    def __str__(self) -> str:
        head = f"{self.name}: " * bool(self.name) + f"{self.mark} " * bool(self.mark)
        tail = f" ({self.remedy})" if self.remedy else ""
        return head + "; ".join((self.text, *self.remarks)) + tail


class ViewSection(NamedTuple):
    """A table, if any, and the lines below it."""

    #: Of the table, where tables have titles.
    title: str
    lines: Sequence[Line] = ()
    #: Of the columns; one that begins with ``>`` stands above numbers.
    headings: Sequence[str] = ()
    rows: Sequence[Sequence[Cell]] = ()
    #: Column whose words may be folded.
    prose: int | None = None

    def table(self) -> tuple[list[str], list[list[Cell]]]:
        """Return headings and rows without columns in which no cell has anything."""
        kept = [k for k, _ in enumerate(self.headings) if {str(r[k]) for r in self.rows} - _NOTHING]
        return [self.headings[k] for k in kept], [[row[k] for k in kept] for row in self.rows]


# Which sections an identification, a diagnosis and a comparison have.


def answer(result: "Identified", names: Sequence[str]) -> Iterator[ViewSection]:
    """Compose the short answer of ``palpate identify``: verdict, next step, numbers, one fit line.

    Parameters
    ----------
    result : Identified
        What was identified.
    names : sequence of str
        Of the files, as a shell takes them, for the commands that show more.
    """
    name = Path(result.contact.source).name or "contact"
    places = [part for part in result.segments if part.place is not None]
    yield ViewSection("Verdict", [*(_verdicts_of(places, name) if places else _lead(result, name))])
    if not places:
        yield depths(result)
    # The worst three places, or every segment between changes.
    shown = by_verdict(places)[:3] or list(result.segments)
    yield from parts(replace(result, segments=tuple(shown)))
    yield ViewSection("", headings=("", ""), rows=_fit_rows(result, names), prose=1)


def of_identification(
    result: "Identified", *, with_findings: bool = False
) -> Iterator[ViewSection]:
    """Compose what ``palpate identify -v`` prints; with the findings of ``diagnose`` if wanted."""
    yield verdict(result)
    yield depths(result, whole=True)
    yield from parts(result, whole=True)
    yield law(result, whole=True)
    yield follows(result, whole=True)
    yield preparation([result], whole=with_findings)
    if with_findings:
        yield findings(result)


def summary(result: "Identified") -> str:
    """Return everything as text: all findings, and 95 % intervals."""
    text = as_text(of_identification(result, with_findings=True))
    return f"{result.contact.source or 'contact'}, by {result.method}\n{text}"


def of_diagnosis(result: "Identified") -> Iterator[ViewSection]:
    """Compose what ``palpate diagnose`` prints."""
    yield verdict(result)
    yield depths(result, whole=True)
    yield findings(result)


def of_comparison(results: "Sequence[Identified]") -> Iterator[ViewSection]:
    """Compose what ``palpate compare`` prints: the methods and their laws."""
    by_name = {result.method: result for result in results}
    ranking = rank(by_name)
    ordered = [by_name[name] for name in ranking.order]
    words = f"recommended method: {ranking.recommended or 'none'}"
    if ranking.recommended and by_name[ranking.recommended].estimator.chooses_law:
        words += " (--law auto)"
    yield ViewSection("Methods", [Line(words, tone="strong")])
    yield numbers(ordered, ranking.exclusions)
    yield laws(ordered)


# The sections.

_BARS = "± statistical ± systematic standard error"
_RELAXED = "after stress relaxation"
_LEGEND = "σ: distance from the truth stated in the file, in standard errors"
_ROWS = (("stiffness", "N/m"), ("damping", "N·s/m"), ("force", "N"))
_NUMBERS = (">stiffness\nN/m", ">damping\nN·s/m")
_QUALITY = (
    "prediction: one-step prediction error after 0.2 s; fit: error of the final law; both as % rms "
    "of the force. |v| ≥ 0.1 K/B: part of the contact in which the single-stage method is biased"
)
_CHECKS = "z: significance in standard errors; S, C: stiffness and damping at working depth"
_FOLD = 65  # columns of what stands beside a label, so that the answer fits 80


def verdict(result: "Identified") -> ViewSection:
    """The verdict, its reason and the next step; those of each segment between changes too."""
    segments = between(result)
    return ViewSection(
        "Verdict", [_verdict(result), *map(_verdict, segments, map(_when, segments))]
    )


def _verdict(result: "Identified", name: str = "") -> Line:
    found = result.diagnosis
    return Line(found.reason, name, found.verdict.overall, remedy=found.remedy)


def _lead(result: "Identified", name: str) -> Iterator[Line]:
    """Verdict and reason; the next step; what another law, clearly preferred, would change."""
    found = result.diagnosis
    yield Line(_sentence(found.reason), name, found.verdict.overall)
    if found.remedy:
        yield Line(_sentence(found.remedy), "next step")
    if found.findings[:1] and found.findings[0].check != "law":
        yield from (Line(_sentence(f.message), "note") for f in found.findings if f.check == "law")


def _verdicts_of(places: "Sequence[Identified]", name: str) -> Iterator[Line]:
    """How many places have each verdict, and the next step for the worst."""
    marks = [part.diagnosis.verdict.overall for part in places]
    counts = ", ".join(f"{marks.count(mark)} {spoken(mark)}" for mark in MARKS if mark in marks)
    yield Line(f"{len(places)} places: {counts}; below the worst three.", name)
    if remedy := next((part.diagnosis.remedy for part in by_verdict(places)), None):
        yield Line(_sentence(remedy), "next step, for the worst place")


def by_verdict(places: "Iterable[Identified]") -> "list[Identified]":
    """Return places, the worst first: by verdict, then by the error of the stiffness."""

    def badness(part: "Identified") -> tuple[int, float]:
        found = part.diagnosis
        stiffness = found.working_depth.stiffness
        error = stiffness.whole_error / abs(stiffness.value) if stiffness.value else math.inf
        return -MARKS.index(found.verdict.overall), -(error if error >= 0.0 else math.inf)

    return sorted(places, key=badness)


def _sentence(words: str) -> str:
    """Begin with a capital, unless it is an option, and end with a full stop."""
    return f"{words[:1].upper()}{words[1:]}{'' if words.endswith(('.', '?')) else '.'}"


def _fit_rows(result: "Identified", names: Sequence[str]) -> list[tuple[str, str]]:
    """The law's parameters, one line on the fit, the truth if stated, and where to read more."""
    rows, law = list[tuple[str, str]](), law_name(result)
    if not result.segments:
        value = _folded(map(str, parameter_rows(result)), "  ")
        rows.append((law, value) if len(law) <= 13 else ("law", f"{law}:\n{value}"))
    if not result.segments and result.query.frequency is None:
        rows.append(("oscillation", dynamic_stiffness_at(result)))
    rows.append(("fit", _fit(result)))
    rows.append(("truth", _truth(result)))
    rows += [(each.name, "\n".join((each.text, *each.remarks))) for each in follows(result).lines]
    rows = [(name, words) for name, words in rows if words]
    return [*rows, ("more", f"palpate diagnose {' '.join(names)}, or -v, -o report/")]


def _folded(parts: Iterable[str], between: str) -> str:
    """Join parts; those that do not fit beside the others begin another line."""
    lines = [""]
    for part in parts:
        if lines[-1] and len(lines[-1]) + len(between) + len(part) > _FOLD:
            lines.append("")
        lines[-1] += between * bool(lines[-1]) + part
    return "\n".join(lines)


def _fit(result: "Identified") -> str:
    touches, estimate = len(touches_of(result.contact)), result.estimate
    parts = [
        f"{percent(result.fit_rmse_percent)} rms, {estimate.samples} samples, {touches} "
        f"contact{'s' * (touches != 1)}"
    ]
    parts += _estimated(estimate)
    if rejected := int(np.count_nonzero(result.trace.rejected)):
        parts.append(f"{rejected} outlier{'s' * (rejected > 1)} excluded")
    if result.method != "variable-projection" and not result.estimator.chooses_law:
        parts.append(f"method {result.method}")
    return _folded(parts, "; ")


def _truth(result: "Identified") -> str:
    """The truth that the file states of stiffness and damping at working depth."""
    truth, at = truth_at_rest(result), result.working_depths[0]
    if truth is None or result.segments:
        return ""
    real = dict(zip(("force", "stiffness", "damping"), truth.at_rest(at.depth), strict=True))
    words = (
        f"{name} {against_truth(found.value, real[name], found.whole_error, unit)[6:]}"
        for name, unit in _ROWS[:2]
        for found in [getattr(at, name)]
    )
    return _folded(words, "; ")


def depths(result: "Identified", *, whole: bool = False) -> ViewSection:
    """Stiffness, damping and force at the working depths, with their marks where not trusted.

    Each with one standard error, hypot(statistical, systematic); both parts, and the truth where
    the file states it, if ``whole``.
    """
    truth, there = truth_at_rest(result) if whole else None, result.working_depths
    names = ["median" if result.depth is None else "--at", f"{DEEP:.0f}th percentile"]
    headings, columns, marks = [result.law.remembers * "relaxed"], [], result.diagnosis.verdict
    for each, name in zip(there, names, strict=False):
        digits = 4 if whole else 3
        headings.append(f"at {format_quantity(each.depth, 'm', digits)} ({name})")
        real = None if truth is None else truth.at_rest(each.depth)
        cells = []
        for quantity, unit in _ROWS:
            found: Quantity = getattr(each, quantity)
            words = found.format(unit) if whole else f"{number(found)} {unit}"
            if real is not None:
                k = ("force", "stiffness", "damping").index(quantity)
                words += f"\n{against_truth(found.value, real[k], found.whole_error)}"
            cells.append(words)
        columns.append(cells)
    said = [_marked(m) if m != "trust" else "" for m in (marks.stiffness, marks.damping)]
    rows = list(zip(dict(_ROWS), *columns, [*said, ""], strict=True))
    known = [_BARS, *([_RELAXED] if result.law.remembers else []), *([_LEGEND] if truth else [])]
    lines = [Line("; ".join(known), tone="soft")] if whole else []
    return ViewSection("At working depth", lines, [*headings, ""], rows)


def parts(result: "Identified", *, whole: bool = False) -> Iterator[ViewSection]:
    """Each segment between changes, or each place; nothing for one material.

    With the law and the fit of each segment if ``whole``.
    """
    rows: list[list[Cell]] = []
    for part in result.segments:
        found, time, place = part.diagnosis, part.contact.time, part.place
        there, marks = found.working_depth, found.verdict
        both_numbers = number(there.stiffness), number(there.damping)
        if place is None:
            times = _when(part).replace(" s to ", "\nto " if whole else " to ").removesuffix(" s")
            terms = terms_of(part) if whole else ""
            fit = percent(part.fit_rmse_percent) if whole else ""
            cells = (times, "", "", *both_numbers, "", terms, fit)
        else:
            at = ", ".join(f"{1e3 * each:.1f}" for each in place.position)
            depth = rounded(1e3 * there.depth, 4)
            modulus = _modulus_alone(part) if part.query.tip else ""
            times = f"{time[0]:.1f}–{time[-1]:.1f}"
            cells = (times, at, depth, *both_numbers, modulus, "", "")
        rows.append([*cells, _marked(marks.overall)])
    if rows:
        headings = ["time\ns", ">at x, y, z\nmm", ">depth\nmm", *_NUMBERS, ">Young's modulus"]
        yield ViewSection(
            "Each by itself", (), [*headings, "contact model", ">fit", "verdict"], rows
        )


def law(result: "Identified", *, whole: bool = False) -> ViewSection:
    """The law's parameters, with the truth where the file states it, and how well it fits."""
    headings, rows = ["contact model", ""], []
    for row, truth in zip(parameter_rows(result), truths(result), strict=True):
        rows.append([str(row), truth])
        if whole:
            value, error = result.law.parameters[row.index], result.standard_errors[row.index]
            rows[-1].append(interval(float(value), float(error)) if row.estimated else "–")
            rows[-1].append(row.name.replace("_", " "))
    lines = [_correlation(result), *_estimated(result.estimate), oscillation_against_truth(result)]
    lines += [law_verdict(result), _quality(result)]
    shown = [Line(each) for each in lines if each]
    title = f"Contact model: {law_name(result)}, by {result.method}"
    return ViewSection(title, shown, headings + ["95 % interval", "parameter"] * whole, rows)


def follows(result: "Identified", *, whole: bool = False) -> ViewSection:
    """Quantities derived from the law: those requested; if ``whole``, all that apply.

    Restitution applies where the contact dissipates at least 1 % of an impact's speed, energy where
    the probe goes in and out, passivity where the law is trusted or fitted with care.
    """
    query, lines, timed = result.query, list[Line](), not result.contact.timeless
    trusted = result.diagnosis.verdict.overall != "do-not-trust"
    if (whole and timed) or query.impact_speed is not None:
        restitution = result.restitution()
        if query.impact_speed is not None or (trusted and _impact(restitution)):
            lines.append(_describe_restitution(restitution, whole=whole))
    if query.frequency is not None or (whole and result.law.remembers):
        lines += _oscillation(result, whole=whole)
    if whole and timed and result.energy.kind != "none":
        lines.append(_energy(result))
    if whole and timed and trusted:
        lines.append(_passivity(result))
    if query.tip is not None:
        parts = [("", result), *((_when(part), part) for part in between(result))]
        lines += [_modulus(part, when, whole=whole) for when, part in parts]
    if result.noticed is not None:  # when a control loop would have known of the changes
        times = ", ".join(f"{rounded(time, 4)} s" for time in result.changes.tolist())
        alarms = f"an alarm at {times}" if times else "no alarm"
        words = f"the online change detector raises {alarms}"
        lines.append(Line(words, "online"))
    if whole:
        for finding in result.diagnosis.findings:  # an assumption, and no fault of the stiffness
            if finding.check == "surface" and finding.severity == "note":
                lines.insert(0, Line(finding.message, "note"))
    return ViewSection("Derived quantities", lines)


def _impact(found: "Restitution") -> bool:
    """Whether a restitution says anything: not of a quasi-static press, nor of an unknown law."""
    return math.isfinite(found.coefficient.value) and 1.0 - found.coefficient.value > _QUASI_STATIC


def findings(result: "Identified") -> ViewSection:
    """Every finding with its next step and how far it moves the result; each segment's own law."""
    rows = []
    for each in result.diagnosis.findings:
        words = "\n→ ".join(filter(None, (each.message, each.remedy)))
        z = "–" if math.isnan(each.z) else rounded(each.z, 3)
        moves = _moves(each.moves_stiffness_percent, each.moves_damping_percent)
        rows.append((Marked(each.check, each.severity), words, z, moves))
    lines = [Line(_CHECKS, tone="soft")]
    for episode in result.diagnosis.episodes:
        terms = (f"{name} = {rounded(v, 4)}" for name, v in episode.law.as_dict().items())
        stiffness = rounded(episode.working_depth.stiffness.value, 4)
        times = f"{rounded(episode.start, 4)} to {rounded(episode.stop, 4)} s"
        lines.append(Line(f"{times}: {', '.join(terms)}; stiffness {stiffness} N/m"))
    headings = ["check", "finding and next step", ">z", ">changes S, C by"]
    return ViewSection("Findings, the most severe first", lines, headings, rows, prose=1)


def numbers(ordered: "Sequence[Identified]", exclusions: Sequence[str]) -> ViewSection:
    """Stiffness and damping at each method's working depth; what is not to be trusted, and why."""
    rows: list[tuple[Cell, ...]] = []
    lines = [Line("± one standard error, statistical and systematic together", tone="soft")]
    relaxed, verdicts = "", []
    for result in ordered:
        mark, depth = result.diagnosis.verdict.overall, result.diagnosis.working_depth.depth
        values = (number(each) for each in felt(result))
        rows.append((result.method, _marked(mark), rounded(1e3 * depth, 4), *values))
        relaxed = relaxed or _relaxed(result)
        if mark != "trust":
            verdicts.append(Line(result.diagnosis.reason, result.method, mark))
    if truth := truth_of(ordered[0].contact.provenance):
        at = ordered[0].diagnosis.working_depth.depth
        real = (rounded(each, 4) for each in (1e3 * at, *truth.at_rest(at)[1:]))
        rows.append(("truth", "", *real))
    if relaxed:
        lines.append(Line(relaxed, tone="soft"))
    lines += [*verdicts, *(Line(words, tone="warning") for words in exclusions)]
    return ViewSection(
        "Methods on this contact, the best first",
        lines,
        ["method", "verdict", ">depth\nmm", *_NUMBERS],
        rows,
    )


def laws(ordered: "Sequence[Identified]") -> ViewSection:
    """Each method's law, and how well it predicts and fits."""
    rows = []
    for each in ordered:
        errors = percent(each.prediction_rmse_percent), percent(each.fit_rmse_percent)
        rows.append((each.method, terms_of(each), *errors, share(each.violated_fraction)))
    if truth := truth_of(ordered[0].contact.provenance):
        named = zip(truth.symbols, truth.parameters, truth.units, strict=True)
        terms = (f"{name} = {rounded(value, 5)} {unit}".rstrip() for name, value, unit in named)
        rows.append(("truth", "\n".join(terms), "", "", ""))
    headings = ["method", "contact model", ">prediction", ">fit", ">|v| ≥ 0.1 K/B"]
    return ViewSection("Their laws", [Line(_QUALITY, tone="soft")], headings, rows)


def preparation(results: "Sequence[Identified]", *, whole: bool = False) -> ViewSection:
    """The samples, how the contact was prepared, and the flags of the methods.

    Without the messages that the verdict shows too or, if ``whole``, the diagnosis.
    """
    first = results[0]
    found = first.diagnosis
    shown = "\n".join(each.message for each in found.findings) if whole else found.reason
    lines = [Line(_samples(first))]
    lines += (
        Line(each.message, each.check, remedy=each.remedy)
        for each in first.contact.findings
        if each.message not in shown
    )
    for result in results:
        # One law for two materials is not identifiable by any motion: its flags would mislead.
        flags = () if whole or result.diagnosis.episodes else result.flags
        lines += [Line(flag, result.method, tone="warning") for flag in flags]
    return ViewSection("Preparation", lines)


# Of one number.


def depth_of(depth: float) -> str:
    """A depth below the surface."""
    return format_quantity(depth, "m", digits=4)


def number(quantity: Quantity) -> str:
    """A number with both error bars as one."""
    return with_error(quantity.value, quantity.whole_error)


def percent(value: float) -> str:
    """Return a percentage of the force; a dash where it is not defined."""
    return "–" if math.isnan(value) else f"{value:.2f} %"


def share(value: float) -> str:
    """Return a fraction as a percentage; a dash where it is not defined."""
    return "–" if math.isnan(value) else f"{value:.1%}"


def with_prefix(quantity: Quantity, unit: str, *, as_of: float | None = None) -> str:
    """A quantity, SI, with its errors and a prefix to the unit, that of a value or its own."""
    value = quantity.value if as_of is None else as_of
    size = abs(value) if math.isfinite(value) and value else 1.0
    step = min(max(math.floor(math.log10(size) / 3.0 + 1e-12), -6), 3)
    return quantity.scaled(1e3**-step).format("afpnµm kMG"[step + 6].strip() + unit)


def _plain(value: float, unit: str) -> str:
    return with_prefix(Quantity(value, 0.0, 0.0), unit)


def _moves(stiffness: float, damping: float) -> str:
    if math.isnan(stiffness) or math.isnan(damping):
        return "–"
    return ", ".join(
        f"{round(value, 1) + 0.0:+.1f} %" if abs(value) < 1000.0 else f"{signed(value, 3)} %"
        for value in (stiffness, damping)
    )


# Of one result.


def line(result: "Identified") -> str:
    """What was identified, in a line: verdict, stiffness and damping at the working depth."""
    there = result.diagnosis.working_depth
    name = Path(result.contact.source).name or "a contact"
    method = (
        f"{result.method}, {law_name(result)}" if result.estimator.chooses_law else result.method
    )
    return (
        f"<Identification of {name} by {method}: {result.diagnosis.verdict.overall}; at "
        f"{depth_of(there.depth)} stiffness {number(there.stiffness)} N/m, damping "
        f"{number(there.damping)} N·s/m>"
    )


def between(result: "Identified") -> "list[Identified]":
    """Return the segments between changes of the material."""
    return [part for part in result.segments if part.place is None]


def _when(part: "Identified") -> str:
    time = part.contact.time
    return f"{rounded(float(time[0]), 4)} s to {rounded(float(time[-1]), 4)} s"


def felt(result: "Identified") -> tuple[Quantity, Quantity]:
    """Stiffness and damping at the working depth; K′ and B′ there of a law that remembers."""
    if result.law.remembers:
        with suppress(InvalidParameterError):  # of a probe that was held still
            told = result.dynamic_stiffness()
            return told.stiffness, told.damping
    there = result.working_depths[0]
    return there.stiffness, there.damping


def _relaxed(result: "Identified") -> str:
    """Why a law that relaxes has other numbers here than by itself; nothing for other laws."""
    if not (result.law.remembers and dynamic_stiffness_at(result)):
        return ""
    at, there = in_hertz(result.dynamic_stiffness().frequency), result.working_depths[0]
    after = f"{number(there.stiffness)} N/m and {number(there.damping)} N·s/m"
    return f"{result.method}: K′ and B′ at {at}, which compare with other laws; relaxed, {after}"


def dynamic_stiffness_at(result: "Identified") -> str:
    """K′ and B′ at the motion's frequency, which other laws' values compare with; or nothing."""
    if result.law.remembers:
        with suppress(InvalidParameterError):
            found = result.dynamic_stiffness()
            both = f"{number(found.stiffness)} N/m and {number(found.damping)} N·s/m"
            return (
                f"K′ and B′ at {in_hertz(found.frequency)}: {both}; compare these with other laws"
            )
    return ""


def _quality(result: "Identified") -> str:
    fit = "fit (each part by its own law)" if result.segments else "fit"
    words = (
        f"method {result.method}; rms error of the force: {fit} "
        f"{percent(result.fit_rmse_percent)}, one-step prediction "
        f"{percent(result.prediction_rmse_percent)}"
    )
    if result.law.has_condition_10:
        words += f"; |v| ≥ 0.1 K/B in {share(result.violated_fraction)} of the contact"
    return words


def _samples(result: "Identified") -> str:
    contact, gate, scale = result.contact, result.gate, result.scale
    touches = len(touches_of(contact))
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


def law_verdict(result: "Identified") -> str:
    """The selected law, and how it compares; empty where no laws were compared."""
    found = result.law_verdict
    known = found is not None and found.known
    return f"Model selection: {str(found).removeprefix('law: ')}" if known else ""


def _correlation(result: "Identified") -> str:
    matrix, words = result.correlations, []
    estimated = [row for row in parameter_rows(result) if row.estimated]
    for one, other in itertools.combinations(estimated, 2):
        value = matrix[one.index, other.index]
        if math.isfinite(value):
            # With as many digits as keep it apart from one, up to four.
            digits = next((k for k in (2, 3) if abs(round(value, k)) < 1.0), 4)
            words.append(f"{one.symbol}–{other.symbol} {value:.{digits}f}")
    return f"correlation {', '.join(words)}" if words else ""


def _estimated(estimate: "Estimate") -> list[str]:
    """Offset and surface, if they were estimated together with the law."""
    words = []
    if estimate.offset_standard_error > 0.0:
        offset = with_error(estimate.offset, estimate.offset_standard_error, unit="N")
        words.append(f"offset {offset}")
    if estimate.surface_standard_error > 0.0:
        error = 1e3 * estimate.surface_standard_error
        words.append(f"surface at {with_error(1e3 * estimate.surface, error, unit='mm')}")
    return words


# Derived quantities.

_MANY = 0.01  # of the samples in contact; fewer may be the noise of a light touch
_QUASI_STATIC = 0.01  # of the speed, below which no impact is worth a line


def _oscillation(result: "Identified", *, whole: bool) -> list[Line]:
    """Dynamic stiffness and damping of a small oscillation; nothing of a probe held still."""
    with suppress(InvalidParameterError):
        felt = result.dynamic_stiffness(result.query.frequency)
        parts = felt.stiffness, felt.damping, felt.loss_tangent
        k, b, tangent = (each if whole else each.combined for each in parts)
        often, depth = in_hertz(felt.frequency), format_quantity(felt.depth, "m")
        words = (
            f"at {often} and {depth}: K′ = {k.format('N/m')}, B′ = {b.format('N·s/m')}, "
            f"tan δ = {tangent.format()}"
        )
        low, high = band_of(result)
        band = f"the motion covers {in_hertz(low)} to {in_hertz(high)}"
        without = () if result.law.remembers else ("without relaxation: the same at any frequency",)
        return [Line(words, "oscillation", remarks=(*without, band))]
    return []


def _describe_restitution(found: "Restitution", *, whole: bool) -> Line:
    e = found.coefficient if whole else found.coefficient.combined
    if not math.isfinite(e.value):
        return Line("; ".join(found.remarks), "restitution")
    fastest = " (the fastest approach)" if found.speed == found.fastest_approach else ""
    near = (
        f"{name} {rounded(value, 3)}"
        for name, value in found.approximations.items()
        if math.isfinite(value)
    )
    words = f"{e.format()} at {rounded(found.speed, 3)} m/s{fastest}"
    approximations = ", ".join(near)
    remarks = [f"approximations: {approximations}"] if approximations else []
    return Line(words, "restitution", remarks=(*remarks, *found.remarks))


def _energy(result: "Identified") -> Line:
    found = result.energy
    words = (
        f"{with_prefix(found.measured, 'J')} measured, "
        f"{found.fraction.scaled(100.0).format()} % of the energy put in; "
        f"{with_prefix(found.predicted, 'J', as_of=found.measured.value)} by the model"
    )
    return Line(words, f"energy dissipated per {found.kind}", remarks=found.remarks)


def _passivity(result: "Identified") -> Line:
    found, words = result.passivity, "the law is never adhesive (its force is never negative)"
    if found.fraction > 0.0:
        part = rounded(100.0 * found.fraction, 2)
        words = (
            f"the law is adhesive (negative force) in {part} % of the contact, down to "
            f"{_plain(found.lowest_force, 'N')}; the mean recorded force there is "
            f"{_plain(found.measured_there, 'N')}"
        )
    elif found.limit >= 0.0:
        words = "the law is adhesive (negative force) at working depth even at rest"
    elif math.isfinite(found.limit):
        words = (
            "the law becomes adhesive (negative force) when withdrawing faster than "
            f"{rounded(-found.limit, 3)} m/s"
        )
    if found.measured_fraction <= _MANY:
        return Line(words, "passivity")
    remark = (
        f"the recorded force is negative in {rounded(100.0 * found.measured_fraction, 2)} % of the "
        "contact: adhesion, a wrong force offset, or a wrong surface"
    )
    return Line(words, "passivity", remarks=(remark,))


def _modulus(part: "Identified", when: str, *, whole: bool) -> Line:
    found = part.elastic_modulus()
    size = found.tip.as_dict()
    tip = f"a {found.tip.kind} of {_plain(size.get('radius', math.nan), 'm')} radius"
    if "half_angle" in size:
        angle = rounded(math.degrees(size["half_angle"]), 4)
        tip = f"a cone of {angle}° between axis and side"
    name, at = "Young's modulus", f"{when}: " * bool(when)
    if found.refused:
        return Line(f"{at}not determined: {found.refused}", name)
    ratio = f"{'assumed ' if found.assumed else ''}Poisson's ratio {found.poisson_ratio:g}"
    value = found.value if whole else found.value.combined
    words = f"{at}{with_prefix(value, 'Pa')} for {tip}, {ratio}"
    return Line(words, name, remarks=found.remarks)


def _modulus_alone(part: "Identified") -> str:
    """With its whole error; the JSON says why there is none."""
    found = part.elastic_modulus()
    return "refused" if found.refused else with_prefix(found.value.combined, "Pa")


# Sections as plain text.


def as_text(sections: Iterable[ViewSection], *, width: int = 100) -> str:
    """Return sections as text: tables in columns, lines folded; an empty line between sections."""
    text = []
    for section in sections:
        headings, rows = section.table()
        table: list[tuple[str, ...]] = []
        top: list[Cell] = [each.removeprefix(">") for each in headings]
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
    """With its severity, which has no colour here."""
    return str(cell) if isinstance(cell, str) or cell.mark == cell.text else f"{cell.mark}: {cell}"
