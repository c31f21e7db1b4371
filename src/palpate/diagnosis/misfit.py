"""Force that the law does not explain, and distance of a method from its law's least squares."""

import math

import numpy as np

from palpate.diagnosis.causes import CARE
from palpate.diagnosis.fit import (
    Fit,
    deeper_half_remedy,
    distance_to_least_squares,
    standard_errors,
)
from palpate.diagnosis.outcome import SELECT_LAW
from palpate.digits import percent, rounded
from palpate.estimators.least_squares import column_sizes, robust_covariance
from palpate.estimators.variable_projection import ConstrainedEstimate
from palpate.findings import Check, Finding, Mark

# Chosen by hand.
UNEXPLAINED = 0.05
TOO_MUCH_UNEXPLAINED = 0.30  # fractions of the force
# Residual over noise; 2 of 1053 trusted stiffnesses of ``benchmarks.diagnosis.mix`` exceed it, and
# none of the 18 of recordings of others.
FAR_ABOVE_NOISE = 30.0
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
    speed = v / (float(np.sqrt(np.mean(v**2))) or 1.0)
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


def check_misfit(fit: Fit) -> Finding | None:
    """The law leaves more than 5 % of the force unexplained, or more than three times the noise."""
    unexplained = fraction_unexplained(fit)
    times = fit.residual_to_noise
    if unexplained <= UNEXPLAINED and not fit.exceeds_noise:
        return None
    remedy = SELECT_LAW if fit.laws is None else deeper_half_remedy(fit)
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
        "record the time of each sample",
        stiffness=stiffness,
    )


def check_other_laws(fit: Fit) -> Finding | None:
    """The law was requested, so no other laws were fitted."""
    if fit.laws is not None or fit.data.contact.timeless:
        return None
    return Check.REQUESTED_LAW.finding(
        "the law was requested: the error bars do not include how far other laws that fit as well "
        "differ",
        SELECT_LAW,
    )


def exact_remedy(fit: Fit) -> str | None:
    """Remedy for a method that is off the least squares of its law."""
    if fit.method in ("variable-projection", "viscoelastic"):
        return deeper_half_remedy(fit)
    return "run again with --method variable-projection"


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
