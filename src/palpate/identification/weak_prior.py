"""The estimate under a weak prior, for a motion that does not determine exponent and damping."""

import math

from palpate.diagnosis.causes import CARE
from palpate.estimators.estimate import Estimate
from palpate.estimators.variable_projection import EXPONENTS
from palpate.findings import Check, Finding, Mark

# Relative change of the stiffness above which the estimate is not trusted; chosen by judgement.
STOP = 0.20


def prior_finding(own: Estimate, bounded: Estimate, depth: float) -> Finding:
    """Report that the estimate uses the weak prior, and the least squares without it."""
    moved = bounded.law.stiffness_at(depth) / own.law.stiffness_at(depth) - 1.0
    sign = "negative" if own.law.damping < 0.0 else "positive"
    mark: Mark = "trust" if abs(moved) <= CARE else "with-care"
    return Check.WEAK_PRIOR.finding(
        "the probe moves one way at nearly one speed, which leaves n and B open: the answer is the "
        f"least squares with B ≥ 0 and n from {EXPONENTS[0]:g} to {EXPONENTS[1]:g}; without this "
        f"prior n is {own.law.exponent:.2f} and B {sign}",
        "press and release, at several speeds; without the prior: --no-weak-prior",
        stiffness="do-not-trust" if abs(moved) > STOP else mark,
        damping="do-not-trust",
        moves_percent=(100.0 * moved, math.nan),
    )
