"""Quantities derived from an identification; modulus, energy and restitution have own modules."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from palpate.digits import format_hertz, rounded
from palpate.errors import InvalidParameterError
from palpate.findings import Check
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.identification.diagnosis import Data, Diagnosis
from palpate.identification.diagnosis.outcome import UNKNOWN, Quantity, WorkingDepth
from palpate.method.contact import Contact
from palpate.method.estimators import ContactEstimator
from palpate.method.estimators.estimate import Estimate, Trace
from palpate.method.estimators.law_verdicts import band_about
from palpate.method.estimators.oscillation import Oscillation
from palpate.validation import Floats, Integers, Plain, frozen, instance, number, number_in

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from palpate.identification.quantities.elastic_modulus import ElasticModulus, Tip
    from palpate.identification.quantities.energy import EnergyLoss, Passivity, Path
    from palpate.identification.quantities.restitution import Restitution
    from palpate.identification.quantities.specimen import CompressionModulus, Specimen


@frozen
class QueryOptions:
    """The impact, tip or specimen, and oscillation for which derived numbers are computed.

    Parameters
    ----------
    impact_speed : float, optional
        Impact speed for the restitution, m/s, in (0, 1e6]. Default: the fastest approach recorded
        in contact.
    tip : Tip, optional
        :class:`Sphere`, :class:`FlatPunch`, :class:`Cone` or :class:`Pyramid`. Default: none, and
        no modulus.
    poisson_ratio : float, optional
        Poisson's ratio of the material, in (−1, 0.5]. Default: 0.5, incompressible; soft tissue is
        nearly incompressible.
    frequency : float, optional
        Frequency of a small oscillation, rad/s, > 0. Default: the motion's mean frequency.
    specimen : Specimen, optional
        Size of a specimen compressed between plates; excludes a tip. Default: none.

    Examples
    --------
    >>> import palpate
    >>> query = palpate.QueryOptions(tip=palpate.Sphere(radius=5e-3), impact_speed=0.2)
    >>> result = palpate.identify("examples/recordings/phantom.csv").with_query(query)
    >>> print(result.restitution().coefficient)
    0.7889 ± 0.0006
    """

    impact_speed: float | None = None
    tip: "Tip | None" = None
    poisson_ratio: float | None = None
    frequency: float | None = None
    specimen: "Specimen | None" = None

    def __post_init__(self) -> None:
        if self.tip is not None:
            from palpate.identification.quantities.elastic_modulus import Tip

            instance("tip", self.tip, Tip)
            if self.tip.thinness(1.0) and self.poisson_ratio not in (None, 0.5):
                raise InvalidParameterError(
                    "a thickness needs an incompressible sample: drop Poisson's ratio"
                )
        if self.specimen is not None:
            from palpate.identification.quantities.specimen import Specimen

            instance("specimen", self.specimen, Specimen)
            if self.tip is not None:
                raise InvalidParameterError(
                    "tip and specimen exclude each other: a tip presses into a large body, a "
                    "specimen is compressed between plates; drop one of them"
                )
        ranges = {
            "impact_speed": (0.0, 1e6),
            "poisson_ratio": (-1.0, 0.5),
            "frequency": (0.0, 1e12),
        }
        for name, ends in ranges.items():
            if getattr(self, name) is not None:
                number_in(name, getattr(self, name), *ends, open_low=True)


class Derivable(Protocol):
    """The parts of an identification from which quantities are derived."""

    @property
    def contact(self) -> Contact:
        """The identified contact."""

    @property
    def data(self) -> Data | None:
        """The contact with the checks of its channels."""

    @property
    def trace(self) -> Trace:
        """The trace of all samples."""

    @property
    def estimator(self) -> ContactEstimator:
        """The estimator after the last sample."""

    @property
    def estimate(self) -> Estimate:
        """The estimate after the last sample."""

    @property
    def law(self) -> Any:
        """The contact model, SI."""

    @property
    def covariance(self) -> Floats:
        """Covariance of the law's parameters, SI."""

    @property
    def diagnosis(self) -> Diagnosis:
        """The diagnosis of the identification."""

    @property
    def query(self) -> QueryOptions:
        """The impact, tip and oscillation of the derived numbers."""

    @property
    def frequency(self) -> float:
        """ω of the motion, rad/s."""

    @property
    def oscillation(self) -> Oscillation | None:
        """Small oscillations of the selected law."""

    def at(self, depth: "ArrayLike") -> WorkingDepth:
        """Force, stiffness and damping at a depth, m."""


# Stiffness and damping for small oscillations about a depth, which laws of every kind have.


@frozen
class SmallOscillation(Plain):
    """Dynamic stiffness K′ + iωB′ about a depth.

    Attributes
    ----------
    depth, frequency : float
        Depth below the surface, m, and ω, rad/s.
    stiffness, damping : Quantity
        K′, N/m, and B′, N·s/m. For a law without memory they do not depend on the frequency.
    loss_tangent : Quantity
        tan δ = ωB′/K′.
    """

    depth: float
    frequency: float
    stiffness: Quantity
    damping: Quantity
    loss_tangent: Quantity


def compute_oscillation(
    result: Derivable,
    frequency: float | None = None,
    depth: float | None = None,
) -> SmallOscillation:
    """Dynamic stiffness K′ + iωB′ for small oscillations about a depth, for any law.

    At the motion's frequency these are the numbers of the diagnosis; at another frequency the
    values of the law, with the same relative errors.

    Parameters
    ----------
    result : Identification
        The identification.
    frequency : float, optional
        ω, rad/s. Default: the motion's mean frequency, rms speed over rms displacement.
    depth : float, optional
        Depth below the surface, m, > 0. Default: the working depth.

    Raises
    ------
    InvalidParameterError
        The frequency is outside half to twice the motion's mean frequency, or the depth is out of
        its range.
    """
    _require_time(result)
    omega = _check_frequency(result, frequency)
    there = _evaluate_depth(result, depth)
    stiffness = there.stiffness
    damping = there.damping
    if result.law.relaxes and omega != result.frequency:
        law = result.law
        own = complex(law.dynamic_stiffness(there.depth, result.frequency))
        other = complex(law.dynamic_stiffness(there.depth, omega))
        # The relative errors are known at the motion's frequency only.
        stiffness = stiffness.scaled(other.real / own.real)
        damping = damping.scaled(other.imag * result.frequency / (own.imag * omega))
    tangent = _loss_tangent(omega, stiffness, damping)
    return SmallOscillation(there.depth, omega, stiffness, damping, tangent)


def compute_relaxed_stiffness(result: Derivable, depth: float | None = None) -> Quantity:
    """∂F/∂x of the fully relaxed material, N/m, at a depth [m]; default: the working depth."""
    return _limit_stiffness(result, depth, GeneralisedHuntCrossley.relaxed)


def compute_instantaneous_stiffness(result: Derivable, depth: float | None = None) -> Quantity:
    """∂F/∂x before any relaxation, N/m, at a depth [m]; default: the working depth."""
    return _limit_stiffness(result, depth, GeneralisedHuntCrossley.instantaneous)


def _limit_stiffness(
    result: Derivable,
    depth: float | None,
    limit: Callable[[GeneralisedHuntCrossley], GeneralisedHuntCrossley],
) -> Quantity:
    """∂F/∂x at a depth by the law in a limit of the time, with its error."""
    at_depth = _evaluate_depth(result, depth)
    if not result.law.relaxes:
        return at_depth.stiffness
    value, error = _evaluate(result, at_depth.depth, lambda law, x: limit(law).stiffness_at(x))
    return Quantity(value, error, 0.0)


def compute_stiffness_after(result: Derivable, time: float, depth: float | None = None) -> Quantity:
    """Stiffness a time after a small step of the penetration, N/m, as felt within the recording.

    n xⁿ⁻¹ [K + Σ mᵢ exp(−t/τᵢ)]; its statistical error by the delta method. Its systematic error is
    that of the stiffness at the motion's frequency, relative, the spread over the laws that fit as
    well, and half of what the step from one relaxation time that was offered to the next changes.

    Parameters
    ----------
    result : Identification
        The identification.
    time : float
        t, s, ≥ 0.
    depth : float, optional
        Depth below the surface, m, > 0. Default: the working depth.
    """
    there = _evaluate_depth(result, depth)
    law = result.law
    found = result.oscillation
    if not (isinstance(law, GeneralisedHuntCrossley) and law.remembers):
        return there.stiffness
    own = there.stiffness
    if found is None:  # the relative errors of the stiffness are all that is known
        return own.scaled(law.stiffness_after(there.depth, time) / own.value)
    value, error, spread = found.stiffness_after(there.depth, time)
    assert law.relaxation is not None
    step = law.relaxation.resolution
    ends = law.stiffness_after(there.depth, [time * (1.0 - step), time * (1.0 + step)])
    parts = spread, own.systematic / own.value * value, 0.5 * float(np.ptp(ends))
    return Quantity(value, error, math.hypot(*parts))


def compute_relaxation_time(result: Derivable) -> Quantity | None:
    """The law's relaxation time, s; None for a law without one or with several.

    Its systematic error is half the distance between the relaxation times that were offered.
    """
    law = result.law
    time = result.law.relaxation_time
    return None if time is None else Quantity(time, 0.0, time * law.relaxation.resolution)


def motion_band(result: Derivable) -> tuple[float, float]:
    """Return the frequency band of the motion, rad/s: half to twice its mean frequency."""
    return band_about(result.frequency)


def _require_time(result: Derivable) -> None:
    if result.contact.timeless:
        raise InvalidParameterError(
            "the recording has no time, and without it there is no damping and nothing that "
            "follows from it: record the time of each sample"
        )


def _check_frequency(result: Derivable, frequency: float | None) -> float:
    low, high = motion_band(result)
    if not (low > 0.0 and math.isfinite(high)):
        raise InvalidParameterError(
            "no frequency can be analysed: the probe is held still, or there are too few samples"
        )
    if frequency is None:
        return result.frequency
    omega = number("frequency", frequency)
    if not low <= omega <= high:
        raise InvalidParameterError(
            f"frequency must be in the band of the motion, {format_hertz(low)} to "
            f"{format_hertz(high)} ({rounded(low, 3)} to {rounded(high, 3)} rad/s), not "
            f"{format_hertz(omega)}: the samples "
            "carry no information outside of it"
        )
    return omega


def _evaluate(
    result: Derivable,
    depth: float,
    value: Callable[[Any, float], float],
) -> tuple[float, float]:
    """A function of the law at a depth, with its standard error including the surface's."""
    found, error = result.estimate.with_error(lambda law: value(law, depth))
    off = min(result.contact.surface_deviation or 0.0, 0.5 * depth)
    moved = value(result.law, depth + off) - value(result.law, depth - off) if off else 0.0
    return found, math.hypot(error, 0.5 * moved)


def _evaluate_depth(result: Derivable, depth: float | None) -> WorkingDepth:
    """Return the numbers at a depth; None means the working depth."""
    known = result.diagnosis.working_depth
    if depth is None and not 0.0 < known.depth <= 1e100:
        raise InvalidParameterError(
            f"the working depth of the contact is {known.depth:g} m, where no law holds; "
            "check --surface and the unit of the penetration, or pass a depth"
        )
    x = number_in("depth", known.depth if depth is None else depth, 0.0, 1e100, open_low=True)
    return known if known.depth == x else result.at(x)


def _loss_tangent(omega: float, stiffness: Quantity, damping: Quantity) -> Quantity:
    """ωB′/K′, with the errors of both propagated as independent."""
    if not stiffness.value:
        return UNKNOWN
    value = omega * damping.value / stiffness.value

    def error(of_stiffness: float, of_damping: float) -> float:
        return math.hypot(omega * of_damping, value * of_stiffness) / abs(stiffness.value)

    return Quantity(
        value,
        error(stiffness.standard_error, damping.standard_error),
        error(stiffness.systematic, damping.systematic),
    )


# From an identification to the numbers derived from its law and its motion.

# Multiple of the sample time: over a longer gap the probe's path is unknown.
LONGEST_GAP = 20.0

# Overflows, such as the square of 1e200 N, give undefined numbers without a warning.
_absurd_numbers = np.errstate(all="ignore")


def build_path(result: Derivable) -> "Path":
    """Return the finite samples without the rejected outliers.

    Segments without a gap in time, such as approach and retract of a force curve, are joined, so
    the work continues from one to the next.
    """
    from palpate.identification.quantities.energy import Path

    contact = result.contact
    trace = result.trace
    estimate = result.estimate
    channels = contact.penetration, contact.velocity, contact.force
    kept = np.all(np.isfinite(channels), axis=0) & ~trace.rejected
    return Path(
        contact.time[kept],
        contact.penetration[kept] - estimate.surface,
        contact.velocity[kept],
        contact.force[kept] - estimate.offset,
        _segment_numbers(contact)[kept],
        trace.taken[kept],
    )


def _segment_numbers(contact: Contact) -> Integers:
    """Return each sample's segment number; segments end where the time jumps or goes back."""
    usual = np.empty(len(contact))  # time between samples, which may differ between segments
    for part in contact.segments():
        steps = np.diff(contact.time[part])
        usual[part] = np.median(steps) if steps.size else contact.sample_time
    steps = np.diff(contact.time)
    known = (steps > 0.0) & (steps <= LONGEST_GAP * np.maximum(usual[1:], usual[:-1]))
    return np.concatenate([[0], np.cumsum(~known)])


@_absurd_numbers
def restitution_from(result: Derivable, speed: float | None = None) -> "Restitution":
    """Return the restitution of a free body that hits the material at a speed.

    Parameters
    ----------
    result : Identification
        The identification.
    speed : float, optional
        m/s, > 0. Default: the speed in :attr:`query`, or the fastest approach in contact.
    """
    from palpate.identification.quantities.energy import fast_approach_speed
    from palpate.identification.quantities.restitution import (
        compute_dissipation,
        compute_restitution,
    )

    _require_time(result)
    if speed is not None:
        number_in("speed", speed, 0.0, 1e6, open_low=True)
    fastest = fast_approach_speed(result.contact.velocity[result.trace.taken])
    found = result.diagnosis
    v0 = speed or result.query.impact_speed
    law = result.law.simplest()
    own = [result.law.names().index(name) for name in law.names()]
    b = compute_dissipation(law, result.covariance[np.ix_(own, own)], found.working_depth)
    trusted = found.verdict.damping != "do-not-trust"
    return compute_restitution(law, b, fastest, v0, trusted=trusted)


@_absurd_numbers
def energy_from(result: Derivable) -> "EnergyLoss":
    """Energy dissipated per touch, or per cycle in lasting contact: measured and from the law."""
    from palpate.identification.quantities.energy import compute_energy_loss, find_loops

    _require_time(result)
    data = result.data or Data(result.contact)
    path = build_path(result)
    going_on = replace(result.contact, segment=_segment_numbers(result.contact))
    checks = {each.check for each in result.diagnosis.findings}
    return compute_energy_loss(
        path,
        find_loops(going_on, path),
        result.law,
        result.diagnosis.working_depth.damping,
        force_noise=data.force_noise,
        depth_noise=data.penetration_noise,
        skewed=bool({Check.DELAY, Check.SKEW_JUMP} & checks),
        drifting=Check.OFFSET_DRIFT in checks,
    )


@_absurd_numbers
def passivity_from(result: Derivable) -> "Passivity":
    """Whether the law's force, and the recorded force, become negative in the recorded motion."""
    from palpate.identification.quantities.energy import check_passivity

    _require_time(result)
    data = result.data or Data(result.contact)
    there = result.diagnosis.working_depth
    return check_passivity(build_path(result), result.law, there, data.force_noise)


@_absurd_numbers
def elastic_modulus_from(
    result: Derivable,
    tip: "Tip | None" = None,
    poisson_ratio: float | None = None,
) -> "ElasticModulus":
    """Young's modulus from the force at working depth and the shape of the tip.

    For a force curve it is that of
    :func:`palpate.identification.quantities.indentation.fit_approach`.

    Parameters
    ----------
    result : Identification
        The identification.
    tip : Tip, optional
        For example ``Sphere(radius=5e-3)``. Default: the tip in :attr:`query`.
    poisson_ratio : float, optional
        Poisson's ratio of the material, in (−1, 0.5]. Default: the ratio in :attr:`query`, or 0.5.

    Raises
    ------
    InvalidParameterError
        There is no tip, or Poisson's ratio is out of its range.
    """
    from palpate.identification.quantities.elastic_modulus import compute_elastic_modulus
    from palpate.identification.quantities.indentation import find_force_curve, fit_force_curve

    tip = tip or result.query.tip
    ratio = result.query.poisson_ratio if poisson_ratio is None else poisson_ratio
    if tip is None:
        raise InvalidParameterError("tip is missing: pass one, such as tip=Sphere(radius=5e-3)")
    QueryOptions(tip=tip, poisson_ratio=ratio)  # which checks them
    if (curve := find_force_curve(result.contact)) is not None:
        return fit_force_curve(curve, tip, ratio).modulus
    depth = result.contact.penetration[result.trace.taken] - result.estimate.surface
    inside = depth[depth > 0.0]
    low, high = np.percentile(inside, (10.0, 90.0)).tolist() if inside.size else (math.nan,) * 2
    found = compute_elastic_modulus(result.law, result.diagnosis, (low, high), tip, ratio)
    if found.refused or not result.estimate.fixed:
        return found
    unchecked = "the exponent was fixed, so it does not confirm the shape of the tip"
    return replace(found, remarks=(*found.remarks, unchecked))


def compression_modulus_from(
    result: Derivable,
    specimen: "Specimen | None" = None,
) -> "CompressionModulus":
    """Young's modulus E = S h/A of a specimen that is compressed between plates.

    Parameters
    ----------
    result : Identification
        The identification.
    specimen : Specimen, optional
        Such as ``Specimen(area=3e-4, height=0.02)``. Default: that of :attr:`query`.

    Raises
    ------
    InvalidParameterError
        There is no specimen.
    """
    from palpate.identification.quantities.specimen import compute_compression_modulus

    specimen = specimen or result.query.specimen
    if specimen is None:
        raise InvalidParameterError(
            "specimen is missing: pass one, such as specimen=Specimen(area=3e-4, height=0.02)"
        )
    return compute_compression_modulus(result.diagnosis, specimen)
