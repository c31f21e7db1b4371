"""What a small oscillation about a depth feels: numbers that laws of any kind have in common."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.finding import Quantity, WorkingDepth
from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.estimators import ViscoelasticContact
from palpate.estimators.law_verdicts import band_about
from palpate.force_laws import GeneralisedHuntCrossley, SingleRelaxation
from palpate.quantities.wanted import Derivable
from palpate.validation import Plain, number, number_in

_TURN = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class SmallOscillation(Plain):
    """Dynamic stiffness K′ + iωB′ about a depth.

    Attributes
    ----------
    depth, frequency : float
        Below the surface, m, and ω, rad/s.
    stiffness, damping : Quantity
        K′, N/m, and B′, N·s/m. Of a law without memory those at rest, whatever the frequency.
    loss_tangent : Quantity
        tan δ = ωB′/K′.
    """

    depth: float
    frequency: float
    stiffness: Quantity
    damping: Quantity
    loss_tangent: Quantity


def oscillation_of(
    result: Derivable, frequency: float | None, depth: float | None
) -> SmallOscillation:
    """Return what :meth:`Identification.dynamic_stiffness` says."""
    omega = _in_band(result, frequency)
    x = result.diagnosis.working_depth.depth if depth is None else depth
    x = number_in("depth", x, 0.0, 1e100, open_low=True)
    there = _at(result, x)
    if isinstance(result.law, GeneralisedHuntCrossley):

        def slope(law: GeneralisedHuntCrossley, at: float) -> complex:
            return complex(law.dynamic_stiffness(at, omega))

        real = _by_law(result, x, lambda law, at: slope(law, at).real)
        imaginary = _by_law(result, x, lambda law, at: slope(law, at).imag / omega)
        stiffness = Quantity(*real, there.stiffness.systematic)
        damping = Quantity(*imaginary, there.damping.systematic)
    else:
        stiffness, damping = there.stiffness, there.damping
    return SmallOscillation(x, omega, stiffness, damping, _tangent(omega, stiffness, damping))


def static_of(result: Derivable, depth: float | None, *, relaxed: bool) -> Quantity:
    """Return the stiffness ∂F/∂x at a depth before, or after, everything has relaxed, N/m."""
    x = result.diagnosis.working_depth.depth if depth is None else depth
    there = _at(result, number_in("depth", x, 0.0, 1e100, open_low=True)).stiffness
    if relaxed or not isinstance(result.law, GeneralisedHuntCrossley):
        return there
    found = _by_law(result, x, lambda law, at: float(law.instantaneous().stiffness_at(at)))
    return Quantity(*found, there.systematic)


def relaxation_time_of(result: Derivable) -> Quantity | None:
    """Return the relaxation time, s; None of a law that has none, or many."""
    law = result.law
    if not isinstance(law, GeneralisedHuntCrossley) or not law.remembers:
        return None
    if not isinstance(law.relaxation, SingleRelaxation):
        return None
    error = float(result.standard_errors[law.names().index("longest_time")])
    return Quantity(law.relaxation.time, error, 0.0)


def band_of(result: Derivable) -> tuple[float, float]:
    """Return the frequencies that the motion contained, rad/s: half to twice its own."""
    return band_about(_own_frequency(result))


def in_hertz(frequency: float) -> str:
    """A frequency in words."""
    return f"{rounded(frequency / _TURN, 3)} Hz"


def _own_frequency(result: Derivable) -> float:
    """Rms speed over that of the way from the mean depth, rad/s; NaN of a probe held still."""
    if isinstance(result.estimator, ViscoelasticContact):
        verdict = result.estimator.verdict()
        return verdict.frequency if verdict.known else math.nan
    taken, contact = result.trace.taken, result.contact
    x, v = contact.penetration[taken], contact.velocity[taken]
    way = float(np.std(x)) if x.size else 0.0
    return float(np.sqrt(np.mean(v**2))) / way if way > 0.0 else math.nan


def _in_band(result: Derivable, frequency: float | None) -> float:
    low, high = band_of(result)
    if not (low > 0.0 and math.isfinite(high)):
        raise InvalidParameterError(
            "frequency must be one of the motion, which has none: the probe was held still, or "
            "there are too few samples"
        )
    if frequency is None:
        return _own_frequency(result)
    omega = number("frequency", frequency)
    if not low <= omega <= high:
        raise InvalidParameterError(
            f"frequency must be in the band of the motion, {in_hertz(low)} to {in_hertz(high)} "
            f"({rounded(low, 3)} to {rounded(high, 3)} rad/s), not {in_hertz(omega)}: what the "
            "probe did not do, its recording does not say"
        )
    return omega


def _by_law(
    result: Derivable, depth: float, value: Callable[[Any, float], float]
) -> tuple[float, float]:
    """A number by the law at a depth, with its own error and that of the surface."""
    found, error = result.estimate.with_error(lambda law: value(law, depth))
    off = min(result.contact.surface_deviation or 0.0, 0.5 * depth)
    moved = value(result.law, depth + off) - value(result.law, depth - off) if off else 0.0
    return found, math.hypot(error, 0.5 * moved)


def _at(result: Derivable, depth: float) -> WorkingDepth:
    """The numbers at a depth; at the working depth those that there are."""
    known = result.diagnosis.working_depth
    return known if known.depth == depth else result.at(depth)


def _tangent(omega: float, stiffness: Quantity, damping: Quantity) -> Quantity:
    """ωB′/K′, its errors by those of both as if they were independent."""
    if not stiffness.value:
        return Quantity(math.nan, math.nan, math.nan)
    value = omega * damping.value / stiffness.value

    def error(of_stiffness: float, of_damping: float) -> float:
        return math.hypot(omega * of_damping, value * of_stiffness) / abs(stiffness.value)

    return Quantity(
        value,
        error(stiffness.standard_error, damping.standard_error),
        error(stiffness.systematic, damping.systematic),
    )
