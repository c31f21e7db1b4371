"""A law's numbers and what follows from them, in words: a line, and a page of text."""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.diagnosis import Quantity
from palpate.diagnosis.data import in_words
from palpate.digits import interval, parameter, rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.quantities.derived import band_of, in_hertz
from palpate.quantities.energy import EnergyLoss, Passivity
from palpate.quantities.restitution import Restitution

if TYPE_CHECKING:
    from palpate.identification.identified import Identified
    from palpate.quantities.elastic_modulus import ElasticModulus, Tip


NOT_ESTIMATED = "as offered, not estimated"
#: Name of the row of a spectrum's relaxation times.
OFFERED = "relaxation_times"


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """A parameter of a law, in words.

    Attributes
    ----------
    index : int
        Where it stands among the law's parameters.
    name, symbol, unit : str
        By the law; the unit as the law's exponents make it.
    words : str
        The number and its standard error, without a unit; or what it is bound to, such as ``n``.
    interval : str
        That of 95 %; a dash of what was not estimated.
    estimated : bool
        Whether it is a number of its own, which was looked for.
    """

    index: int
    name: str
    symbol: str
    unit: str
    words: str
    interval: str
    estimated: bool

    @property
    def with_unit(self) -> str:
        """The words, and the unit."""
        return f"{self.words} {self.unit}".rstrip()

    def __str__(self) -> str:
        return f"{self.symbol} = {self.with_unit}"


def parameter_rows(result: "Identified") -> list[ParameterRow]:
    """Return the parameters that the law has, in its order."""
    if result.law.relaxes:
        return list(_generalised(result, result.law))
    return [_number(result, k) for k in range(len(result.law.symbols))]


def law_in_words(result: "Identified") -> str:
    """Return the law that was chosen; the kind of law of a method that has but one."""
    verdict = result.estimator.verdict()
    return str(result.law.kind if verdict is None else verdict.candidate)


def growth_of(law: GeneralisedHuntCrossley) -> str | None:
    """Return how the damper goes with the spring: ``n`` or ``n − 1``; None where by neither."""
    if law.damping_exponent == law.exponent:
        return "n"
    return "n − 1" if law.damping_exponent == law.exponent - 1.0 else None


def _number(result: "Identified", k: int, unit: str | None = None) -> ParameterRow:
    law, name = result.law, result.law.names()[k]
    value, error = float(law.parameters[k]), float(result.standard_errors[k])
    fixed = name in result.fixed
    return ParameterRow(
        k,
        name,
        law.symbols[k],
        law.units[k] if unit is None else unit,
        parameter(value, error, fixed=fixed),
        "–" if fixed else interval(value, error),
        not fixed,
    )


def _generalised(result: "Identified", law: GeneralisedHuntCrossley) -> Iterator[ParameterRow]:
    stiffness, n, damping, p, relaxing, alpha, shortest, longest = range(len(law.symbols))
    verdict, growth = result.estimator.verdict(), growth_of(law)
    chosen = None if verdict is None else verdict.candidate
    linear = chosen is not None and chosen.linear
    yield _number(result, stiffness, "N/m" if linear else None)
    yield _bound(law, n, "1") if linear else _number(result, n)
    if chosen is None or chosen.damping != "none":
        units = {"n": "N·s/mⁿ⁺¹", "n − 1": "N·s/m" if linear else "N·s/mⁿ"}
        yield _number(result, damping, units.get(growth or ""))
        yield _number(result, p) if growth is None else _bound(law, p, growth)
    if not law.remembers:
        if chosen is not None and chosen.memory != "none":
            yield _bound(law, relaxing, "0, no memory is better")
        return
    yield _number(result, relaxing, "N/m" if linear else None)
    if law.relaxation_time is not None:
        own = _number(result, longest)
        yield ParameterRow(longest, "relaxation_time", "τ", own.unit, own.words, own.interval, True)
        return
    if law.spectrum_exponent:
        yield _number(result, alpha)
    ends = " to ".join(_time(each) for each in (law.shortest_time, law.longest_time))
    words = f"{ends} ({NOT_ESTIMATED})"
    yield ParameterRow(shortest, OFFERED, "τ", "", words, "–", False)


def _time(seconds: float) -> str:
    """Thousands of seconds are seconds still."""
    return in_words(seconds, "s") if seconds < 1.0 else f"{rounded(seconds, 3)} s"


def _bound(law: ForceLaw, k: int, words: str) -> ParameterRow:
    return ParameterRow(k, law.names()[k], law.symbols[k], "", words, "–", False)


def correlated(result: "Identified") -> list[tuple[int, str]]:
    """Return index and symbol of the parameters that can correlate: those that were estimated."""
    rows = [row for row in parameter_rows(result) if row.estimated]
    known = np.isfinite(np.diag(result.correlations))
    return [(row.index, row.symbol) for row in rows if known[row.index]]


# What follows from an identified law, in words: rebound, energy lost, pulling, elastic modulus.

MANY = 0.01  # of the samples in contact; fewer may be the noise of a light touch
_PREFIXES = dict(zip("GMk mµnpfa", range(9, -19, -3), strict=True))


@dataclass(frozen=True, slots=True)
class Line:
    """A number in words.

    Attributes
    ----------
    name : str
        What it is of.
    words : str
        The number, or why there is none.
    remarks : tuple of str
        What a reader should know of it.
    """

    name: str
    words: str
    remarks: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.name}: {'; '.join((self.words, *self.remarks))}"


def following(result: "Identified", *, whole: bool = False) -> list[Line]:
    """Return a line each; the modulus where a tip is wanted.

    Parameters
    ----------
    result : Identification
        What was identified.
    whole : bool
        With every approximation of the restitution, which otherwise are there where a speed of
        impact is wanted.
    """
    rebound = result.restitution()
    lines = [_rebound(rebound)]
    if rebound.approximations and (whole or result.wanted.impact_speed is not None):
        lines.append(_approximations(rebound))
    if whole or result.law.remembers or result.wanted.frequency is not None:
        lines += _felt(result)
    lines += [_energy(result.energy), _passivity(result.passivity)]
    if result.wanted.tip is not None:
        for part in (result, *(each for each in result.stretches if each.place is None)):
            time = part.contact.time
            when = "" if part is result else f"{time[0]:.4g} s to {time[-1]:.4g} s, "
            lines.append(_modulus(part.elastic_modulus(), when))
    return lines


def with_prefix(quantity: Quantity, unit: str, *, as_of: float | None = None) -> str:
    """A quantity with its errors and a prefix to the unit: 12.3 ± 0.2 kPa.

    Parameters
    ----------
    quantity : Quantity
        SI.
    unit : str
        Without a prefix.
    as_of : float, optional
        The number whose prefix it takes; its own value's unless given.
    """
    value = quantity.value if as_of is None else as_of
    size = abs(value) if math.isfinite(value) and value else 1.0
    prefix, power = next(
        ((prefix, power) for prefix, power in _PREFIXES.items() if size >= 10.0**power), ("a", -18)
    )
    numbers = (quantity.value, quantity.standard_error, quantity.systematic)
    scaled = [number / 10.0**power for number in numbers]
    return with_error(*scaled, unit=f"{prefix.strip()}{unit}")


def _felt(result: "Identified") -> list[Line]:
    """What a small oscillation feels; nothing of a probe that was held still."""
    with suppress(InvalidParameterError):
        felt = result.dynamic_stiffness(result.wanted.frequency)
        words = (
            f"K′ = {_digits_of(felt.stiffness)} N/m, B′ = {_digits_of(felt.damping)} N·s/m, "
            f"tan δ = {_digits_of(felt.loss_tangent)}"
        )
        name = f"a small oscillation of {in_hertz(felt.frequency)} at {in_words(felt.depth, 'm')}"
        low, high = band_of(result)
        said = () if result.law.remembers else ("without memory at any frequency",)
        return [
            Line(name, words, (*said, f"band of the motion {in_hertz(low)} to {in_hertz(high)}"))
        ]
    return []


def _rebound(found: Restitution) -> Line:
    e = found.coefficient
    if not math.isfinite(e.value):
        return Line("restitution", "; ".join(found.remarks))
    fastest = ", the fastest approach" if found.speed == found.fastest_approach else ""
    near = [each for each in found.approximations.values() if math.isfinite(each)]
    words = _digits_of(e)
    if near:
        words += f" (approximations say {rounded(min(near), 3)} to {rounded(max(near), 3)})"
    return Line(f"restitution from {rounded(found.speed, 3)} m/s{fastest}", words, found.remarks)


def _approximations(found: Restitution) -> Line:
    parts = (
        f"{name} {rounded(e, 4) if math.isfinite(e) else 'none'}"
        for name, e in found.approximations.items()
    )
    return Line("restitution by approximations", ", ".join(parts))


def _energy(found: EnergyLoss) -> Line:
    if found.kind == "none":
        return Line("energy lost", "; ".join(found.remarks))
    part = found.fraction
    parts = (part.value, part.standard_error, part.systematic)
    percent = Quantity(*(100.0 * each for each in parts))
    words = (
        f"{with_prefix(found.measured, 'J')}, {_digits_of(percent)} % of what went in; by the law "
        f"{with_prefix(found.predicted, 'J', as_of=found.measured.value)}"
    )
    return Line(f"energy lost a {found.kind}", words, found.remarks)


def _passivity(found: Passivity) -> Line:
    words = "the law never pulls"
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
    remarks = []
    if found.measured_fraction > MANY:
        remarks.append(
            f"the recorded force is below 0 in {rounded(100.0 * found.measured_fraction, 2)} % "
            "of the contact: adhesion, or its zero or the surface is wrong"
        )
    return Line("passivity", words, tuple(remarks))


def _modulus(found: "ElasticModulus", when: str) -> Line:
    name = f"{when}elastic modulus for {_tip(found.tip)}"
    if found.refused:
        return Line(name, f"none, for {found.refused}")
    ratio = f"{'an assumed' if found.assumed else 'a'} Poisson's ratio of {found.poisson_ratio:g}"
    words = f"{with_prefix(found.value, 'Pa')} with {ratio}"
    return Line(name, words, found.remarks)


def _tip(tip: "Tip") -> str:
    size = tip.as_dict()
    if "half_angle" in size:
        return f"a cone of {rounded(math.degrees(size['half_angle']), 4)}° between axis and side"
    return f"a {tip.kind} of {_plain(size['radius'], 'm')} radius"


def _plain(value: float, unit: str) -> str:
    return with_prefix(Quantity(value, 0.0, 0.0), unit)


def _digits_of(quantity: Quantity) -> str:
    return with_error(quantity.value, quantity.standard_error, quantity.systematic)


# An identification in words: a line, and a page of text.


def line(result: "Identified") -> str:
    """What was identified, in a line: verdict, stiffness and damping at the working depth."""
    there = result.diagnosis.working_depth
    name = Path(result.contact.source).name or "a contact"
    return (
        f"<Identification of {name} by {whose(result)}: {result.diagnosis.verdict.overall}; at "
        f"{depth_in_words(there.depth)} stiffness {number(there.stiffness)} N/m, damping "
        f"{number(there.damping)} N·s/m>"
    )


def summary(result: "Identified") -> str:
    """What was identified, how well, and how far to trust it, as text."""
    lines = [*_head(result), "", *_depths(result), "", *_law(result), ""]
    return "\n".join([*lines, *map(str, following(result)), *_findings(result)])


def whose(result: "Identified") -> str:
    """The method, and the law that it chose where it chooses one."""
    chosen = result.estimator.chooses_law
    return f"{result.method}, {law_in_words(result)}" if chosen else result.method


def number(quantity: Quantity) -> str:
    """A number with both error bars as one; where one is not known that is said."""
    return with_error(quantity.value, quantity.whole_error)


def both(quantity: Quantity) -> str:
    """A number with both error bars: what repeats, and what the findings would move."""
    return with_error(quantity.value, quantity.standard_error, quantity.systematic)


def felt(result: "Identified") -> tuple[Quantity, Quantity]:
    """Stiffness and damping at the working depth; K′ and B′ there of a law that remembers."""
    if result.law.remembers:
        with suppress(InvalidParameterError):  # of a probe that was held still
            told = result.dynamic_stiffness()
            return told.stiffness, told.damping
    there = result.working_depths[0]
    return there.stiffness, there.damping


def felt_at(results: "Sequence[Identified]") -> str:
    """At which frequency the numbers of laws that remember are; nothing where none does."""
    for result in results:
        if result.law.remembers:
            with suppress(InvalidParameterError):
                at = in_hertz(result.dynamic_stiffness().frequency)
                return f"{result.method}: K′ and B′ at {at}, as its law remembers"
    return ""


def whose_fit(result: "Identified") -> str:
    """Of which laws the fit's residual is: where there are stretches, not that of the whole."""
    return "the stretches' own laws fit" if result.stretches else "the law fits"


def depth_in_words(depth: float) -> str:
    """A depth, in mm; in µm or nm where it is small."""
    for unit, size, least in (("mm", 1e-3, 1e-4), ("µm", 1e-6, 1e-6)):
        if depth >= least:
            return f"{rounded(depth / size, 4)} {unit}"
    return f"{rounded(1e9 * depth, 4)} nm" if math.isfinite(depth) else "an unknown depth"


def _head(result: "Identified") -> list[str]:
    found, contact = result.diagnosis, result.contact
    marks = found.verdict
    lines = [
        f"{contact.source or 'contact'}, by {result.method}",
        f"{marks.overall} (stiffness: {marks.stiffness}, damping: {marks.damping}): {found.reason}",
    ]
    if found.remedy:
        lines.append(f"  → {found.remedy}")
    taken, rejected = result.trace.taken.sum(), result.trace.rejected.sum()
    lines.append(
        f"{len(contact)} samples, {taken} in contact, {rejected} left out as outliers; "
        f"{whose_fit(result)} to {rounded(result.fit_rmse_percent, 2)} %"
    )
    return lines


def _depths(result: "Identified") -> list[str]:
    rows = [("at depth", "force, N", "stiffness, N/m", "damping, N·s/m")]
    rows += [
        (depth_in_words(each.depth), both(each.force), both(each.stiffness), both(each.damping))
        for each in result.working_depths
    ]
    return [*_aligned(rows), "(± what repeats ± what the findings would move)"]


def _law(result: "Identified") -> list[str]:
    matrix, own = result.correlations, [k for k, _ in correlated(result)]
    header = (law_in_words(result), "estimate", "95 % interval", "unit")
    rows = [(*header, *(symbol for _, symbol in correlated(result)))]
    for row in parameter_rows(result):
        found = (matrix[row.index, k] if row.index in own else math.nan for k in own)
        correlations = (f"{each:+.3f}" if math.isfinite(each) else "–" for each in found)
        rows.append((row.symbol, row.words, row.interval, row.unit, *correlations))
    lines = [*_aligned(rows), "(the last columns are correlations)"]
    return [*lines, str(result.law_verdict)] if result.law_verdict is not None else lines


def _findings(result: "Identified") -> list[str]:
    lines = [""]
    for finding in result.diagnosis.findings:
        lines.append(f"{finding.severity}: {finding.check}: {finding.message}")
        lines += [f"  → {finding.remedy}"] if finding.remedy else []
    return lines


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
