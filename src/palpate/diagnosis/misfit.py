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
from palpate.estimators.variable_projection import ConstrainedEstimate
from palpate.findings import Check, Finding, Mark

# Chosen by hand.
UNEXPLAINED, TOO_MUCH_UNEXPLAINED = 0.05, 0.30  # fractions of the force
METHOD_Z = 5.0  # standard errors; a larger distance is at least a note


def fraction_unexplained(fit: Fit) -> float:
    """Fraction of the force that neither law nor noise explains."""
    spread = float(np.std(fit.force))
    square = fit.solution.energy / max(len(fit.windows), 1) - 2.0 * fit.noise_floor**2
    return math.sqrt(max(square, 0.0)) / spread if spread > 0.0 else 0.0


def check_misfit(fit: Fit) -> Finding | None:
    """The law leaves more than 5 % of the force unexplained, or more than three times the noise."""
    unexplained, times = fraction_unexplained(fit), fit.residual_to_noise
    if unexplained <= UNEXPLAINED and not fit.exceeds_noise:
        return None
    remedy = SELECT_LAW if fit.laws is None else deeper_half_remedy(fit)
    mark: Mark = "do-not-trust" if unexplained > TOO_MUCH_UNEXPLAINED else "trust"
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
    exact = fit.method == "variable-projection"
    remedy = deeper_half_remedy(fit) if exact else "run again with --method variable-projection"
    whose = f"{fit.method} fails here: its" if large else "the method's"
    return Check.METHOD.finding(
        f"{whose} stiffness is {percent(off_s, sign=True)} and its damping "
        f"{percent(off_c, sign=True)} off the least-squares fit of its own law ({rounded(z, 2)} "
        "standard errors)",
        remedy,
        z,
        moves_percent=(-100.0 * off_s, -100.0 * off_c),
    )
