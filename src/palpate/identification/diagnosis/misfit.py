"""Force that the law does not explain, and distance of a method from its law's least squares."""

import math
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from palpate.digits import percent, rounded
from palpate.findings import Check, Finding, Mark, NextStep, Remedy
from palpate.identification.diagnosis.causes import CARE
from palpate.identification.diagnosis.fit import (
    Fit,
    distance_to_least_squares,
    standard_errors,
)
from palpate.method.estimators.least_squares import column_sizes, robust_covariance
from palpate.method.estimators.variable_projection import ConstrainedEstimate
from palpate.method.rows import rms
from palpate.validation import Floats, frozen

# Chosen by hand.
UNEXPLAINED = 0.05
TOO_MUCH_UNEXPLAINED = 0.30  # fractions of the force
# Residual over noise; 2 of 1053 trusted stiffnesses of ``benchmarks.diagnosis.mix`` exceed it, and
# none of the 18 of recordings of others.
FAR_ABOVE_NOISE = 30.0
HALVED = 0.25  # shallowest sample over the working depth: of the deeper half it is 0.3 to 0.5
METHOD_Z = 5.0  # standard errors; a larger distance is at least a note


def fraction_unexplained(fit: Fit) -> float:
    """Fraction of the force that neither law nor noise explains."""
    spread = float(np.std(fit.force))
    square = fit.solution.energy / max(len(fit.windows), 1) - 2.0 * fit.noise_floor**2
    return math.sqrt(max(square, 0.0)) / spread if spread > 0.0 else 0.0


# Chance removes about the sum of the variances of the coefficients; three times it was never
# exceeded by 210 clean recordings with noise of any colour.
BEYOND_CHANCE = 3.0
DISTINCT = 1e-3  # least fraction of a column that the other columns leave


def smooth_misfit(fit: Fit) -> float:
    """Rms of the residual that a smooth function of depth and velocity removes, over the force.

    The function has five polynomials of the depth, and three more times the velocity, its sign and
    its square. Noise of any colour removes as much by chance as its long-run variance says.
    """
    solution = fit.solution
    mean = fit.windows.mean
    x = mean(fit.x)
    v = mean(fit.v)
    place = (x - x.min()) / (float(np.ptp(x)) or 1.0) - 0.5
    speed = v / (rms(v) or 1.0)
    powers = place[:, None] ** np.arange(5.0)
    by_speed = (speed, np.tanh(3.0 * speed), speed**2)
    columns = np.hstack([powers, *(each[:, None] * powers[:, :3] for each in by_speed)])
    columns = solution.orthogonal_part(columns / column_sizes(columns))
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, sizes > DISTINCT]
    if len(basis) <= 2 * basis.shape[1]:
        return 0.0
    removed = basis.T @ solution.residual
    remaining = solution.residual - basis @ removed
    others = solution.jacobian.shape[1]
    by_chance = robust_covariance(basis, remaining, fit.windows.shared, others).trace()
    # A short residual does not show the correlation length of slow noise; free air does.
    rows = (1.0 + len(fit.windows.shared)) * fit.correlated_windows
    by_chance = max(by_chance, fit.noise_floor**2 * rows * basis.shape[1])
    square = max(float(removed @ removed) - BEYOND_CHANCE * by_chance, 0.0) / len(basis)
    return math.sqrt(square) / (float(np.percentile(np.abs(fit.force), 95.0)) or 1.0)


# Largest ratio of the smooth misfits of the deeper half and the whole. Its unexplained force may be
# at most that of the whole, or this fraction. Of 26 recordings of others those in which the deeper
# half was worse have ratios from 0.96, or more unexplained force.
LESS_MISFIT, WELL_EXPLAINED = 0.85, 0.1


@frozen
class DeeperHalf:
    """Predicted changes by identifying the deeper half alone, as ratios to the whole contact.

    Attributes
    ----------
    misfit : float
        Ratio of the force that the law does not follow.
    errors : numpy.ndarray, shape (2,)
        Ratios of the statistical errors of stiffness and damping.
    """

    misfit: float
    errors: Floats


_PREDICTED: WeakKeyDictionary[Fit, DeeperHalf | None] = WeakKeyDictionary()


def predict_deeper_half(fit: Fit) -> DeeperHalf | None:
    """Fit the law to the deeper half of the contact; None if it follows the force no better.

    Once for each fit: several findings may advise it.
    """
    if fit not in _PREDICTED:
        _PREDICTED[fit] = _compare_deeper_half(fit)
    return _PREDICTED[fit]


def _compare_deeper_half(fit: Fit) -> DeeperHalf | None:
    half = fit.deeper_half
    if half is None or not (misfit := smooth_misfit(fit)) > 0.0:
        return None
    ratio = smooth_misfit(half) / misfit
    most_unexplained = max(fraction_unexplained(fit), WELL_EXPLAINED)
    if ratio > LESS_MISFIT or fraction_unexplained(half) > most_unexplained:
        return None
    return DeeperHalf(ratio, (standard_errors(half) / standard_errors(fit))[1:])


def drop_vain_step(fit: Fit, finding: Finding) -> Finding:
    """Return a finding without the deeper half as its next step if the law follows it no better."""
    remedy = finding.remedy
    if remedy is None or not remedy.has(NextStep.DEEPER_HALF):
        return finding
    if predict_deeper_half(fit) is not None:
        return finding
    return replace(finding, remedy=remedy.without(NextStep.DEEPER_HALF))


def deeper_half_remedy(fit: Fit) -> Remedy | None:
    """Remedy for a law that fails over a wide range of depths; :func:`drop_vain_step` judges it.

    None if the deeper half was identified alone: then there is hardly a shallower half.
    """
    if fit.range[0] >= HALVED * fit.depth:
        return None
    from_here = 0.5 * fit.depth + fit.estimate.surface
    return Remedy(NextStep.DEEPER_HALF, f"{1e3 * from_here:.2g}")


def check_misfit(fit: Fit) -> Finding | None:
    """The law leaves more than 5 % of the force unexplained, or more than three times the noise."""
    unexplained = fraction_unexplained(fit)
    times = fit.residual_to_noise
    if unexplained <= UNEXPLAINED and not fit.exceeds_noise:
        return None
    remedy = Remedy(NextStep.SELECT_LAW) if fit.laws is None else deeper_half_remedy(fit)
    mark: Mark = "trust"
    if unexplained > TOO_MUCH_UNEXPLAINED:
        mark = "do-not-trust"
    elif unexplained > UNEXPLAINED and times > FAR_ABOVE_NOISE:
        mark = "with-care"
    return Check.MISFIT.finding(
        f"the law leaves {percent(unexplained)} of the force unexplained ({rounded(times, 2)} "
        "times the noise)",
        remedy,
        z=times,
        mark=mark,
    )


def misfit_without_time(stiffness: Mark) -> Finding:
    """Report a misfit whose cause cannot be found without time."""
    return Check.MISFIT.finding(
        "the force differs from that of a spring, and without time palpate cannot say why",
        Remedy(NextStep.SAMPLE_TIMES),
        stiffness=stiffness,
    )


def check_other_laws(fit: Fit) -> Finding | None:
    """The law was requested, so no other laws were fitted."""
    if fit.laws is not None or fit.data.contact.timeless:
        return None
    return Check.REQUESTED_LAW.finding(
        "the law was requested: the error bars do not include how far other laws that fit as well "
        "differ",
        Remedy(NextStep.SELECT_LAW),
    )


def exact_remedy(fit: Fit) -> Remedy | None:
    """Remedy for a method that is off the least squares of its law."""
    if fit.method in ("variable-projection", "viscoelastic"):
        return deeper_half_remedy(fit)
    return Remedy(NextStep.EXACT_METHOD)


def check_method(fit: Fit) -> Finding | None:
    """The method's estimate is not the least squares of its law on these samples."""
    if isinstance(fit.estimate, ConstrainedEstimate):
        return None  # a prior constrains it, and this is reported
    distance = distance_to_least_squares(fit)[1:]
    z = float(np.max(np.abs(distance) / np.maximum(standard_errors(fit)[1:], 1e-300)))
    if z <= METHOD_Z:
        return None
    off_s, off_c = (distance / fit.reference_scales).tolist()
    large = max(abs(off_s), abs(off_c)) > CARE
    whose = f"{fit.method} fails here: its" if large else "the method's"
    return Check.METHOD.finding(
        f"{whose} stiffness is {percent(off_s, sign=True)} and its damping "
        f"{percent(off_c, sign=True)} off the least-squares fit of its own law ({rounded(z, 2)} "
        "standard errors)",
        exact_remedy(fit),
        z,
        moves_percent=(-100.0 * off_s, -100.0 * off_c),
    )
