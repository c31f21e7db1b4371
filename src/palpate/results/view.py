"""One result in words: sections of rows and lines, composed once for whoever shows them.

The terminal, a report, a notebook and plain text show the same sections, each by a loop of its own
over their rows and lines. A section that is not shown is not composed.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from palpate.diagnosis import Quantity
from palpate.diagnosis.fit import DEEP
from palpate.digits import format_quantity, interval, rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.identification.identified import rank
from palpate.preparation.gates import touches_of
from palpate.quantities.derived import band_of, in_hertz
from palpate.recordings.recording import truth_of
from palpate.results.parameters import (
    beside_truth,
    felt_beside_truth,
    law_name,
    parameter_rows,
    signed,
    terms_of,
    truth_at_rest,
    truths,
)

if TYPE_CHECKING:
    from palpate.identification.identified import Identified
    from palpate.quantities.restitution import Restitution


class Marked(NamedTuple):
    """Words in the colour of a verdict or a severity."""

    text: str
    mark: str

    def __str__(self) -> str:
        return self.text


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


# Which sections there are of an identification, of a diagnosis, and of several methods.


def of_identification(result: "Identified", *, whole: bool = False) -> Iterator[ViewSection]:
    """Compose what ``palpate identify`` says; whole, with 95 % intervals and all that follows."""
    yield verdict(result)
    yield depths(result)
    yield from parts(result)
    yield law(result, whole=whole)
    yield follows(result, whole=whole)
    yield preparation([result], whole=whole)


def summary(result: "Identified") -> str:
    """Return the whole of it as text: with every finding, and the 95 % intervals."""
    sections = [*of_identification(result, whole=True), findings(result)]
    return f"{result.contact.source or 'contact'}, by {result.method}\n{as_text(sections)}"


def of_diagnosis(result: "Identified") -> Iterator[ViewSection]:
    """Compose what ``palpate diagnose`` says."""
    yield verdict(result)
    yield depths(result)
    yield findings(result)


def of_comparison(results: "Sequence[Identified]", *, ranked: bool = True) -> Iterator[ViewSection]:
    """Compose what ``palpate compare`` says: several methods, and the laws unless not ranked."""
    by_name = {result.method: result for result in results}
    ranking = rank(by_name)
    ordered = [by_name[name] for name in ranking.order]
    yield ViewSection(
        "Methods", [Line(f"recommended: {ranking.recommended or 'none of them'}", tone="strong")]
    )
    yield numbers(ordered, ranking.exclusions)
    if ranked:
        yield from which_law(results)
    yield laws(ordered)


# The sections.

_BARS = "± repeatable ± what the findings would move"
_RELAXED = "once the material has relaxed"
_LEGEND = "σ: distance from the truth that the file states, in standard errors"
_ROWS = (("force", "N"), ("stiffness", "N/m"), ("damping", "N·s/m"))
_SCORE = (
    "score: N_eff ln(RSS/N) + 2 p ln N_eff over the best, p numbers; from 10 on strong evidence"
)
_NUMBERS = (">stiffness\nN/m", ">damping\nN·s/m")
_QUALITY = (
    "predicted, fit: RMSE% of force, a priori after 0.2 s and of the final law; "
    "cond. 10: contact in which |v| < 0.1 K/B does not hold"
)
_CHECKS = "z: standard errors; S, C: stiffness and damping at working depth"


def verdict(result: "Identified") -> ViewSection:
    """The verdict, its reason and what to do about it; of stretches between changes theirs too."""
    segments = between(result)
    return ViewSection(
        "Verdict", [_verdict(result), *map(_verdict, segments, map(_when, segments))]
    )


def _verdict(result: "Identified", name: str = "") -> Line:
    found = result.diagnosis
    marks = found.verdict
    words = f"(stiffness: {marks.stiffness}, damping: {marks.damping}): {found.reason}"
    return Line(words, name, marks.overall, remedy=found.remedy)


def depths(result: "Identified") -> ViewSection:
    """Force, stiffness and damping at the working depths, with the truth where the file has it."""
    truth, there = truth_at_rest(result), result.working_depths
    names = ["median" if result.depth is None else "as asked", f"{DEEP:.0f}th percentile"]
    headings, columns = [""], []
    for each, name in zip(there, names, strict=False):
        headings.append(f"at {depth_of(each.depth)}\n{name}")
        real = None if truth is None else truth.at_rest(each.depth)
        cells = []
        for k, (quantity, unit) in enumerate(_ROWS):
            found: Quantity = getattr(each, quantity)
            words = f"{found.format(unit)}"
            if real is not None:
                words += f"\n{beside_truth(found.value, real[k], found.whole_error)}"
            cells.append(words)
        columns.append(cells)
    known = [_BARS, *([_RELAXED] if result.law.remembers else []), *([_LEGEND] if truth else [])]
    rows = list(zip(dict(_ROWS), *columns, strict=True))
    return ViewSection("At working depth", [Line("; ".join(known), tone="soft")], headings, rows)


def parts(result: "Identified") -> Iterator[ViewSection]:
    """Each stretch between changes with its law, or each place; none of one material."""
    rows: list[list[Cell]] = []
    for part in result.segments:
        found, time, place = part.diagnosis, part.contact.time, part.place
        there, marks = found.working_depth, found.verdict
        both_numbers = number(there.stiffness), number(there.damping)
        if place is None:
            times, terms = _when(part).replace(" s to ", "\nto ").removesuffix(" s"), terms_of(part)
            fit = percent(part.fit_rmse_percent)
            cells = (times, "", "", *both_numbers, "", terms, fit)
        else:
            at = ", ".join(f"{1e3 * each:.1f}" for each in place.position)
            depth = rounded(1e3 * there.depth, 4)
            modulus = _modulus_alone(part) if part.query.tip else ""
            times = f"{time[0]:.1f}–{time[-1]:.1f}"
            cells = (times, at, depth, *both_numbers, modulus, "", "")
        rows.append([*cells, Marked(marks.overall, marks.overall)])
    if rows:
        headings = ["time\ns", ">at x, y, z\nmm", ">depth\nmm", *_NUMBERS, ">Young's modulus"]
        yield ViewSection(
            "Each by itself", (), [*headings, "contact model", ">fit", "verdict"], rows
        )


def law(result: "Identified", *, whole: bool = False) -> ViewSection:
    """The law's parameters, with the truth where the file has it, and how well it fits."""
    headings, rows = ["contact model", ""], []
    for row, truth in zip(parameter_rows(result), truths(result), strict=True):
        rows.append([str(row), truth])
        if whole:
            value, error = result.law.parameters[row.index], result.standard_errors[row.index]
            rows[-1].append(interval(float(value), float(error)) if row.estimated else "–")
            rows[-1].append(row.name.replace("_", " "))
    lines = [_correlation(result), *_beside(result), _law_verdict(result), _quality(result)]
    shown = [Line(each) for each in lines if each]
    title = f"Contact model: {law_name(result)}, by {result.method}"
    return ViewSection(title, shown, headings + ["95 % interval", "parameter"] * whole, rows)


def which_law(results: "Iterable[Identified]") -> Iterator[ViewSection]:
    """How the laws stand that the samples were asked about; none where they were not."""
    # That of the method which chooses a law, else of any.
    ordered = sorted(results, key=lambda each: not each.estimator.chooses_law)
    found = next(filter(None, (each.law_verdict for each in ordered)), None)
    if found is None or not found.known:
        return
    rows = [
        (
            str(each.candidate),
            rounded(each.score, 3),
            format_quantity(each.rms_error, "N"),
            str(each.candidate.parameters),
            each.meaning,
        )
        for each in found.model_ranking
    ]
    samples = rounded(found.effective_samples, 3), rounded(found.samples, 4)
    score = "{}; {} independent samples of {}".format(_SCORE, *samples)
    flags = (Line(f"{found.candidate}: {flag}", tone="soft") for flag in found.flags)
    headings = ["which law", ">score", ">rms error", ">numbers", "which means"]
    yield ViewSection(
        "Laws by the same samples, the best first",
        [Line(score, tone="soft"), *flags],
        headings,
        rows,
    )


def follows(result: "Identified", *, whole: bool = False) -> ViewSection:
    """What follows from the law: rebound, energy lost, pulling; the modulus where a tip is wanted.

    Approximations of the restitution and what a small oscillation feels are there where a speed of
    impact or a frequency is wanted, or all is.
    """
    query, rebound = result.query, result.restitution()
    lines = [_describe_restitution(rebound)]
    if rebound.approximations and (whole or query.impact_speed is not None):
        near = (
            f"{name} {rounded(e, 4) if math.isfinite(e) else 'none'}"
            for name, e in rebound.approximations.items()
        )
        lines.append(Line(", ".join(near), "restitution by approximations"))
    if whole or result.law.remembers or query.frequency is not None:
        lines += _oscillation(result)
    lines += [_energy(result), _passivity(result)]
    if query.tip is not None:
        lines += [_modulus(result), *(_modulus(part, _when(part)) for part in between(result))]
    if result.noticed is not None:  # when a control loop would have known of the changes
        times = ", ".join(f"{rounded(time, 4)} s" for time in result.changes.tolist())
        words = f"the change detector, in a control loop, alarms at {times or 'no time'}"
        lines.append(Line(words))
    for finding in result.diagnosis.findings:  # an assumption, and no fault of the stiffness
        if finding.check == "surface" and finding.severity == "note":
            lines.insert(0, Line(finding.message, "note"))
    return ViewSection("Of a free impact, of the loops, and of the tip", lines)


def findings(result: "Identified") -> ViewSection:
    """Every finding with its remedy, and how far it moves the numbers; each stretch's own law."""
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
    headings = ["check", "what was found", ">z", ">moves S, C"]
    return ViewSection("What was found, the gravest first", lines, headings, rows, prose=1)


def numbers(ordered: "Sequence[Identified]", exclusions: Sequence[str]) -> ViewSection:
    """Stiffness and damping at each method's working depth; what is not to be trusted, and why."""
    rows: list[tuple[Cell, ...]] = []
    lines = [
        Line("± all of the error: what repeats, and what the findings would move", tone="soft")
    ]
    remembered, verdicts = "", []
    for result in ordered:
        mark, depth = result.diagnosis.verdict.overall, result.diagnosis.working_depth.depth
        values = (number(each) for each in felt(result))
        rows.append((result.method, Marked(mark, mark), rounded(1e3 * depth, 4), *values))
        remembered = remembered or felt_at(result)
        if mark != "trust":
            verdicts.append(_verdict(result, result.method))
    if truth := truth_of(ordered[0].contact.provenance):
        at = ordered[0].diagnosis.working_depth.depth
        real = (rounded(each, 4) for each in (1e3 * at, *truth.at_rest(at)[1:]))
        rows.append(("truth", "", *real))
    if remembered:
        lines.append(Line(remembered, tone="soft"))
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
    headings = ["method", "contact model", ">predicted", ">fit", ">cond. 10"]
    return ViewSection("Their laws", [Line(_QUALITY, tone="soft")], headings, rows)


def preparation(results: "Sequence[Identified]", *, whole: bool = False) -> ViewSection:
    """The samples, what was assumed on the way from the recording, and flags of the methods.

    Without what the verdict says too, or, of the whole, a finding of the diagnosis.
    """
    first = results[0]
    found = first.diagnosis
    said = "\n".join(each.message for each in found.findings) if whole else found.reason
    lines = [Line(_samples(first))]
    lines += (
        Line(each.message, each.check, remedy=each.remedy)
        for each in first.contact.findings
        if each.message not in said
    )
    for result in results:
        # One law for two materials is not identifiable by any motion: its flags would mislead.
        flags = () if whole or result.diagnosis.episodes else result.flags
        lines += [Line(flag, result.method, tone="warning") for flag in flags]
    return ViewSection("What was found, assumed or left out", lines)


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
        f"{value:+.1f} %" if abs(value) < 1000.0 else f"{signed(value, 3)} %"
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
    """Return the stretches between changes of the material."""
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


def felt_at(result: "Identified") -> str:
    """At which frequency the numbers of a law that remembers are; nothing of another."""
    if result.law.remembers:
        with suppress(InvalidParameterError):
            at = in_hertz(result.dynamic_stiffness().frequency)
            return f"{result.method}: K′ and B′ at {at}, as its law remembers"
    return ""


def _quality(result: "Identified") -> str:
    fit = "fit by the laws of each part" if result.segments else "fit"
    words = (
        f"by {result.method}; RMSE of force: {fit} {percent(result.fit_rmse_percent)}, "
        f"predicted a priori {percent(result.prediction_rmse_percent)}"
    )
    if result.law.has_condition_10:
        words += f"; |v| < 0.1 K/B (eq. 10) fails in {share(result.violated_fraction)} of contact"
    return words


def _samples(result: "Identified") -> str:
    contact, gate, scale = result.contact, result.gate, result.scale
    touches = len(touches_of(contact))
    force = f"force > {rounded(gate.make_force, 3)} N"
    if result.estimator.chooses_samples and not gate.make_force:
        force = "chosen by the force around each"
    units = ((scale.penetration, "m"), (scale.velocity, "m/s"), (scale.force, "N"))
    return (
        f"{len(contact)} samples, {touches} {'touch' if touches == 1 else 'touches'}, "
        f"{result.estimate.samples} in contact "
        f"(penetration > {rounded(gate.minimum_penetration, 3)} m, {force}); "
        f"computed in units of {', '.join(f'{rounded(size, 3)} {unit}' for size, unit in units)}"
    )


def _law_verdict(result: "Identified") -> str:
    found = result.law_verdict
    if found is None or not found.known:
        return ""
    if result.estimator.chooses_law:
        return str(found)
    return f"of the everyday laws, by the same samples: {str(found).removeprefix('law: ')}"


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


def _beside(result: "Identified") -> list[str]:
    """What was estimated beside the law, and what a small oscillation feels beside the truth."""
    estimate, words = result.estimate, []
    if estimate.offset_standard_error > 0.0:
        offset = with_error(estimate.offset, estimate.offset_standard_error, unit="N")
        words.append(f"force offset {offset}")
    if estimate.surface_standard_error > 0.0:
        error = 1e3 * estimate.surface_standard_error
        words.append(f"surface at {with_error(1e3 * estimate.surface, error, unit='mm')}")
    return [*words, felt_beside_truth(result)]


# What follows from an identified law.

_MANY = 0.01  # of the samples in contact; fewer may be the noise of a light touch


def _oscillation(result: "Identified") -> list[Line]:
    """What a small oscillation feels; nothing of a probe that was held still."""
    with suppress(InvalidParameterError):
        felt = result.dynamic_stiffness(result.query.frequency)
        words = (
            f"K′ = {felt.stiffness.format('N/m')}, B′ = {felt.damping.format('N·s/m')}, "
            f"tan δ = {felt.loss_tangent.format()}"
        )
        often, depth = in_hertz(felt.frequency), format_quantity(felt.depth, "m")
        name = f"a small oscillation of {often} at {depth}"
        low, high = band_of(result)
        band = f"band of the motion {in_hertz(low)} to {in_hertz(high)}"
        alike = () if result.law.remembers else ("without memory at any frequency",)
        return [Line(words, name, remarks=(*alike, band))]
    return []


def _describe_restitution(found: "Restitution") -> Line:
    e = found.coefficient
    if not math.isfinite(e.value):
        return Line("; ".join(found.remarks), "restitution")
    fastest = ", the fastest approach" if found.speed == found.fastest_approach else ""
    near = [each for each in found.approximations.values() if math.isfinite(each)]
    words = e.format()
    if near:
        words += f" (approximations say {rounded(min(near), 3)} to {rounded(max(near), 3)})"
    name = f"restitution from {rounded(found.speed, 3)} m/s{fastest}"
    return Line(words, name, remarks=found.remarks)


def _energy(result: "Identified") -> Line:
    found = result.energy
    if found.kind == "none":
        return Line("; ".join(found.remarks), "energy lost")
    words = (
        f"{with_prefix(found.measured, 'J')}, {found.fraction.scaled(100.0).format()} % of what "
        f"went in; by the law {with_prefix(found.predicted, 'J', as_of=found.measured.value)}"
    )
    return Line(words, f"energy lost a {found.kind}", remarks=found.remarks)


def _passivity(result: "Identified") -> Line:
    found, words = result.passivity, "the law never pulls"
    if found.fraction > 0.0:
        words = (
            f"the law pulls in {rounded(100.0 * found.fraction, 2)} % of the contact, with up to "
            f"{_plain(-found.lowest_force, 'N')}, where {_plain(found.measured_there, 'N')} were "
            "recorded on average"
        )
    elif found.limit >= 0.0:
        words = "the law pulls at working depth even where the probe rests"
    elif math.isfinite(found.limit):
        words = f"the law would pull on withdrawals faster than {rounded(-found.limit, 3)} m/s"
    if found.measured_fraction <= _MANY:
        return Line(words, "passivity")
    remark = (
        f"the recorded force is below 0 in {rounded(100.0 * found.measured_fraction, 2)} % of the "
        "contact: adhesion, or its zero or the surface is wrong"
    )
    return Line(words, "passivity", remarks=(remark,))


def _modulus(part: "Identified", when: str = "") -> Line:
    found = part.elastic_modulus()
    size = found.tip.as_dict()
    tip = f"a {found.tip.kind} of {_plain(size.get('radius', math.nan), 'm')} radius"
    if "half_angle" in size:
        angle = rounded(math.degrees(size["half_angle"]), 4)
        tip = f"a cone of {angle}° between axis and side"
    name = f"{when}{', ' * bool(when)}elastic modulus for {tip}"
    if found.refused:
        return Line(f"none, for {found.refused}", name)
    ratio = f"{'an assumed' if found.assumed else 'a'} Poisson's ratio of {found.poisson_ratio:g}"
    return Line(f"{with_prefix(found.value, 'Pa')} with {ratio}", name, remarks=found.remarks)


def _modulus_alone(part: "Identified") -> str:
    """With its whole error; the JSON says why there is none."""
    found = part.elastic_modulus()
    whole = Quantity(found.value.value, found.value.whole_error, 0.0)
    return "refused" if found.refused else with_prefix(whole, "Pa")


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
