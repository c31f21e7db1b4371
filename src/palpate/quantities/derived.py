"""The numbers that follow from an identification: what it needs, and each by its own chapter."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.diagnosis import Data, Diagnosis
from palpate.diagnosis.finding import Quantity, WorkingDepth
from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.estimators import ContactEstimator
from palpate.estimators.estimate import Estimate, Trace
from palpate.estimators.law_verdicts import band_about
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.quantities.energy import (
    EnergyLoss,
    Passivity,
    Path,
    energy_of,
    fastest_of,
    loops_of,
    passivity_of,
)
from palpate.quantities.restitution import Restitution, dissipation_of, restitution_of
from palpate.validation import Floats, Plain, instance, number, number_in

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from palpate.quantities.elastic_modulus import ElasticModulus, Tip


@dataclass(frozen=True, slots=True)
class QueryOptions:
    """For which impact, tip and oscillation the derived numbers are.

    Parameters
    ----------
    impact_speed : float, optional
        Of the restitution, m/s, in (0, 1e6]; the fastest approach recorded in contact unless given.
    tip : Tip, optional
        :class:`Sphere`, :class:`FlatPunch` or :class:`Cone`; without one there is no modulus.
    poisson_ratio : float, optional
        Of the material, in (−1, 0.5]; 0.5, incompressible as soft tissue, assumed unless given.
    frequency : float, optional
        Of a small oscillation, rad/s, > 0; the motion's own unless given.
    """

    impact_speed: float | None = None
    tip: "Tip | None" = None
    poisson_ratio: float | None = None
    frequency: float | None = None

    def __post_init__(self) -> None:
        if self.tip is not None:
            from palpate.quantities.elastic_modulus import Tip

            instance("tip", self.tip, Tip)
        ranges = {
            "impact_speed": (0.0, 1e6),
            "poisson_ratio": (-1.0, 0.5),
            "frequency": (0.0, 1e12),
        }
        for name, ends in ranges.items():
            if getattr(self, name) is not None:
                number_in(name, getattr(self, name), *ends, open_low=True)


class Derivable(Protocol):
    """What a quantity follows from: a contact, its estimator, and what they gave."""

    @property
    def contact(self) -> Contact:
        """What was identified."""

    @property
    def data(self) -> Data | None:
        """With the checks of its channels."""

    @property
    def trace(self) -> Trace:
        """Every sample."""

    @property
    def estimator(self) -> ContactEstimator:
        """As it stood after the last sample."""

    @property
    def estimate(self) -> Estimate:
        """What it knew then."""

    @property
    def law(self) -> Any:
        """The contact model, SI."""

    @property
    def covariance(self) -> Floats:
        """Of the law's parameters, SI."""

    @property
    def diagnosis(self) -> Diagnosis:
        """What may be wrong."""

    @property
    def query(self) -> QueryOptions:
        """For which impact, tip and oscillation."""

    def at(self, depth: "ArrayLike") -> WorkingDepth:
        """Force, stiffness and damping at a depth, m."""


# What a small oscillation about a depth feels: numbers that laws of any kind have in common.

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
    result: Derivable, frequency: float | None = None, depth: float | None = None
) -> SmallOscillation:
    """What a small oscillation about a depth feels, by a law of any kind: K′ + iωB′.

    Of a law without memory the stiffness and the damping of :meth:`at`; of one with memory
    those at the frequency, the repeatable error by the delta method.

    Parameters
    ----------
    result : Identification
        What was identified.
    frequency : float, optional
        ω, rad/s; the motion's own unless given.
    depth : float, optional
        Below the surface, m, > 0; the working depth unless given.

    Raises
    ------
    InvalidParameterError
        The frequency is outside the band of the motion, half to twice its own, rms speed over
        rms way; or the depth is out of its range.
    """
    omega, there = _in_band(result, frequency), _at(result, depth)
    stiffness, damping = there.stiffness, there.damping
    if result.law.relaxes:

        def slope(law: GeneralisedHuntCrossley, at: float) -> complex:
            return complex(law.dynamic_stiffness(at, omega))

        real = _by_law(result, there.depth, lambda law, at: slope(law, at).real)
        imaginary = _by_law(result, there.depth, lambda law, at: slope(law, at).imag / omega)
        stiffness = Quantity(*real, stiffness.systematic)
        damping = Quantity(*imaginary, damping.systematic)
    tangent = _tangent(omega, stiffness, damping)
    return SmallOscillation(there.depth, omega, stiffness, damping, tangent)


def relaxed_stiffness_of(result: Derivable, depth: float | None = None) -> Quantity:
    """∂F/∂x at a depth [m], or at the working depth, once everything has relaxed, N/m."""
    return _at(result, depth).stiffness


def instantaneous_stiffness_of(result: Derivable, depth: float | None = None) -> Quantity:
    """∂F/∂x at a depth [m], or at the working depth, before anything has relaxed, N/m."""
    there = _at(result, depth)
    if not result.law.relaxes:
        return there.stiffness
    found = _by_law(
        result, there.depth, lambda law, at: float(law.instantaneous().stiffness_at(at))
    )
    return Quantity(*found, there.stiffness.systematic)


def relaxation_time_of(result: Derivable) -> Quantity | None:
    """The law's one relaxation time, s; None of a law that has none, or a spectrum of many."""
    law = result.law
    if law.relaxation_time is None:
        return None
    k = law.names().index("longest_time")
    return Quantity(law.relaxation_time, math.sqrt(result.covariance[k, k]), 0.0)


def band_of(result: Derivable) -> tuple[float, float]:
    """Return the frequencies that the motion contained, rad/s: half to twice its own."""
    return band_about(_own_frequency(result))


def in_hertz(frequency: float) -> str:
    """A frequency in words."""
    return f"{rounded(frequency / _TURN, 3)} Hz"


def _own_frequency(result: Derivable) -> float:
    """Rms speed over that of the way from the mean depth, rad/s; NaN of a probe held still."""
    if (verdict := result.estimator.verdict()) is not None:
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


def _at(result: Derivable, depth: float | None) -> WorkingDepth:
    """The numbers at a depth; at the working depth, or of none, those that there are."""
    known = result.diagnosis.working_depth
    x = number_in("depth", known.depth if depth is None else depth, 0.0, 1e100, open_low=True)
    return known if known.depth == x else result.at(x)


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


# From an identification to the numbers that follow from its law and its motion.

# Usual times between samples: the way of a probe over a longer gap is not known.
LONGEST_GAP = 20.0

# What overflows, such as the square of 1e200 N, is not defined.
_absurd_numbers = np.errstate(all="ignore")


def path_of(result: Derivable) -> Path:
    """Return the samples that are finite and were not left out as outliers.

    Where the time goes on from one segment to the next, as from the approach of a force curve to
    its retract, the work does too.
    """
    contact, trace, estimate = result.contact, result.trace, result.estimate
    channels = contact.penetration, contact.velocity, contact.force
    kept = np.all(np.isfinite(channels), axis=0) & ~trace.rejected
    return Path(
        contact.time[kept],
        contact.penetration[kept] - estimate.surface,
        contact.velocity[kept],
        contact.force[kept] - estimate.offset,
        _going_on(contact)[kept],
        trace.taken[kept],
    )


def _going_on(contact: Contact) -> NDArray[np.int64]:
    """Numbers of the stretches between which the time jumps, or begins again."""
    usual = np.empty(len(contact))  # time between samples, which each segment may have its own of
    for part in contact.segments():
        steps = np.diff(contact.time[part])
        usual[part] = np.median(steps) if steps.size else contact.sample_time
    steps = np.diff(contact.time)
    known = (steps > 0.0) & (steps <= LONGEST_GAP * np.maximum(usual[1:], usual[:-1]))
    return np.concatenate([[0], np.cumsum(~known)])


@_absurd_numbers
def restitution_from(result: Derivable, speed: float | None = None) -> Restitution:
    """How a free body would rebound that meets the material at a speed.

    Parameters
    ----------
    result : Identification
        What was identified.
    speed : float, optional
        m/s, > 0; unless given that of :attr:`query`, or the fastest approach in contact.
    """
    if speed is not None:
        number_in("speed", speed, 0.0, 1e6, open_low=True)
    fastest = fastest_of(result.contact.velocity[result.trace.taken])
    found, v0 = result.diagnosis, speed or result.query.impact_speed
    law = result.law.simplest()
    own = [result.law.names().index(name) for name in law.names()]
    b = dissipation_of(law, result.covariance[np.ix_(own, own)], found.working_depth)
    trusted = found.verdict.damping != "do-not-trust"
    return restitution_of(law, b, fastest, v0, trusted=trusted)


@_absurd_numbers
def energy_from(result: Derivable) -> EnergyLoss:
    """Energy lost a touch, or a cycle of a probe that stays in contact; and by the law."""
    data, path = result.data or Data(result.contact), path_of(result)
    going_on = replace(result.contact, segment=_going_on(result.contact))
    checks = {each.check for each in result.diagnosis.findings}
    return energy_of(
        path,
        loops_of(going_on, path),
        result.law,
        result.diagnosis.working_depth.damping,
        force_noise=data.force_noise,
        depth_noise=data.penetration_noise,
        skewed="delay" in checks,
        drifting="offset drift" in checks,
    )


@_absurd_numbers
def passivity_from(result: Derivable) -> Passivity:
    """Whether the law pulls anywhere in the recorded motion, and the recorded force too."""
    data, there = result.data or Data(result.contact), result.diagnosis.working_depth
    return passivity_of(path_of(result), result.law, there, data.force_noise)


@_absurd_numbers
def elastic_modulus_from(
    result: Derivable, tip: "Tip | None" = None, poisson_ratio: float | None = None
) -> "ElasticModulus":
    """Young's modulus by the force at working depth and the shape of the tip.

    Parameters
    ----------
    result : Identification
        What was identified.
    tip : Tip, optional
        Such as ``Sphere(radius=5e-3)``; that of :attr:`query` unless given.
    poisson_ratio : float, optional
        Of the material, in (−1, 0.5]; that of :attr:`query` unless given, or 0.5.

    Raises
    ------
    InvalidParameterError
        No tip is given, or Poisson's ratio is out of its range.
    """
    from palpate.quantities.elastic_modulus import elastic_modulus_of

    tip = tip or result.query.tip
    ratio = result.query.poisson_ratio if poisson_ratio is None else poisson_ratio
    if tip is None:
        raise InvalidParameterError(
            "tip is missing: pass it here, such as Sphere(radius=5e-3), or by "
            "with_query(QueryOptions(tip=…))"
        )
    QueryOptions(tip=tip, poisson_ratio=ratio)  # which checks them
    depth = result.contact.penetration[result.trace.taken] - result.estimate.surface
    inside = depth[depth > 0.0]
    low, high = np.percentile(inside, (10.0, 90.0)).tolist() if inside.size else (math.nan,) * 2
    found = elastic_modulus_of(result.law, result.diagnosis, (low, high), tip, ratio)
    if found.refused or not result.estimate.fixed:
        return found
    given = "the exponent was given: that the tip is of this shape is not checked by it"
    return replace(found, remarks=(*found.remarks, given))
