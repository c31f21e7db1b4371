"""What follows from an identified law, in words: rebound, energy lost, pulling, elastic modulus."""

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from palpate.diagnosis import Quantity
from palpate.diagnosis.data import in_words
from palpate.digits import rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.quantities.elastic_modulus import ElasticModulus
from palpate.quantities.energy import EnergyLoss
from palpate.quantities.oscillation import band_of, in_hertz
from palpate.quantities.passivity import Passivity
from palpate.quantities.restitution import Restitution
from palpate.tips import Cone, Tip

if TYPE_CHECKING:
    from palpate.identification import Identified

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
            f"K′ = {_number(felt.stiffness)} N/m, B′ = {_number(felt.damping)} N·s/m, "
            f"tan δ = {_number(felt.loss_tangent)}"
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
    words = _number(e)
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
        f"{with_prefix(found.measured, 'J')}, {_number(percent)} % of what went in; by the law "
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


def _modulus(found: ElasticModulus, when: str) -> Line:
    name = f"{when}elastic modulus for {_tip(found.tip)}"
    if found.refused:
        return Line(name, f"none, for {found.refused}")
    ratio = f"{'an assumed' if found.assumed else 'a'} Poisson's ratio of {found.poisson_ratio:g}"
    words = f"{with_prefix(found.value, 'Pa')} with {ratio}"
    return Line(name, words, found.remarks)


def _tip(tip: Tip) -> str:
    if isinstance(tip, Cone):
        return f"a cone of {rounded(math.degrees(tip.half_angle), 4)}° between axis and side"
    return f"a {tip.kind} of {_plain(tip.as_dict()['radius'], 'm')} radius"


def _plain(value: float, unit: str) -> str:
    return with_prefix(Quantity(value, 0.0, 0.0), unit)


def _number(quantity: Quantity) -> str:
    return with_error(quantity.value, quantity.standard_error, quantity.systematic)
