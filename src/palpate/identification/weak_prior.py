"""The estimate under a weak prior, for a motion that does not determine exponent and damping."""

import math

from palpate.findings import Check, Finding, Mark, NextStep, Remedy
from palpate.force_laws import HuntCrossley
from palpate.identification.diagnosis.causes import CARE
from palpate.method.contact import Contact
from palpate.method.estimators import ContactEstimator
from palpate.method.estimators.estimate import Estimate, Trace
from palpate.method.estimators.variable_projection import EXPONENTS, solve_in_box

# Relative change of the stiffness above which the estimate is not trusted; chosen by hand.
STOP = 0.20
#: Settings that determine the exponent or the damping, so that no prior is needed.
EXCLUDING = ("exponent", "forgetting", "change_detector", "surface")


def weak_prior(
    contact: Contact,
    trace: Trace,
    estimator: ContactEstimator,
    depth: float | None,
) -> tuple[Estimate, Finding] | None:
    """Return the least squares with B ≥ 0 and 1 ≤ n ≤ 2, and its finding; None if not needed.

    It is needed if the probe moves one way at nearly one speed, and the estimate violates the
    prior.

    Parameters
    ----------
    contact : Contact
        The samples.
    trace : Trace
        Which of them were taken.
    estimator : ContactEstimator
        The estimator after all samples.
    depth : float or None
        The working depth, m.
    """
    if depth is None or any(estimator.settings[name] is not None for name in EXCLUDING):
        return None
    least_squares = estimator.estimate()
    bounded = solve_in_box(contact, trace, least_squares)
    if bounded is None:
        return None
    return bounded, _finding(least_squares.law, bounded.law, depth)


def _finding(least_squares: HuntCrossley, bounded: HuntCrossley, depth: float) -> Finding:
    """Report that the estimate uses the weak prior, and the least squares without it."""
    moved = float(bounded.stiffness_at(depth) / least_squares.stiffness_at(depth)) - 1.0
    sign = "negative" if least_squares.B < 0.0 else "positive"
    mark: Mark = "trust" if abs(moved) <= CARE else "with-care"
    return Check.WEAK_PRIOR.finding(
        "the probe moves one way at nearly one speed, which leaves n and B open: the answer is the "
        f"least squares with B ≥ 0 and n from {EXPONENTS[0]:g} to {EXPONENTS[1]:g}; without this "
        f"prior n is {least_squares.n:.2f} and B {sign}",
        Remedy(NextStep.WITHOUT_PRIOR),
        stiffness="do-not-trust" if abs(moved) > STOP else mark,
        damping="do-not-trust",
        moves_percent=(100.0 * moved, math.nan),
    )
