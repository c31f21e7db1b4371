"""Least squares in the box B ≥ 0, 1 ≤ n ≤ 2, where the motion leaves n and B open.

At one speed v a spring K xⁿ and a damper B v xⁿ are one function of the depth. What the law does
not describe then goes into B and n: a press alone gave n = 3.6 and B < 0 on a soft sample, and a
force six times too large for the release. Tips have exponents from 1, a flat punch, to 2, a cone,
and no passive material has B < 0.
"""

import math

import numpy as np

from palpate._core import EstimateValue, noise_of
from palpate.contact import Contact
from palpate.estimators.estimate import Estimate, Trace
from palpate.estimators.law_verdicts import ONE_WAY
from palpate.estimators.least_squares import Fitted, least_squares, robust_covariance
from palpate.force_laws import HuntCrossley
from palpate.validation import Floats

EXPONENTS = (1.0, 2.0)
# Times the noise that the least squares leaves in means over a fortieth of the samples: below it
# the shape of the law determines n, as in a simulation.
MISFIT, BLOCKS = 3.0, 40
FEWEST_FREE = 10  # samples above the surface, which inform the offset


class ConstrainedEstimate(Estimate):
    """An estimate under the prior; its covariance is that of the least squares without bounds."""

    __slots__ = ()


def constrained(contact: Contact, trace: Trace, estimate: Estimate) -> ConstrainedEstimate | None:
    """Return the least squares in the box; None where the samples determine n and B, or agree.

    Parameters
    ----------
    contact : Contact
        What was identified.
    trace : Trace
        Which samples were taken.
    estimate : Estimate
        The least squares without bounds, of a Hunt–Crossley law.
    """
    law, taken = estimate.law, trace.taken
    low, high = EXPONENTS
    if low <= law.exponent <= high and law.damping >= 0.0:
        return None
    x = contact.penetration[taken] - estimate.surface
    v, force = contact.velocity[taken], contact.force[taken]
    if not abs(float(v.mean())) > ONE_WAY * math.sqrt(float(np.mean(v**2))):
        return None
    left = force - law.force(x, v) - estimate.offset
    width = max(x.size // BLOCKS, 1)
    means = left[: left.size // width * width].reshape(-1, width).mean(axis=1)
    if not math.sqrt(width * float(np.mean(means**2))) > MISFIT * noise_of(force):
        return None
    free = contact.force[contact.penetration < estimate.surface]
    free = free[np.isfinite(free)] if estimate.offset_standard_error > 0.0 else free[:0]
    # One row for free air, which weighs no more than the contact.
    weight = math.sqrt(min(free.size, x.size)) if free.size >= FEWEST_FREE else 0.0
    zero = weight * float(free.mean()) if weight else 0.0
    deep, fast = float(x.max()), float(np.abs(v).max())
    depth, log, speed = x / deep, np.log(x / deep), v / fast
    unit = float(estimate.offset_standard_error > 0.0)

    def model(p: Floats) -> tuple[Floats, Floats]:
        power = depth ** p[2]
        whole = power * (p[0] + p[1] * speed)
        columns = np.column_stack([power, power * speed, whole * log, np.full_like(x, unit)])
        residual = np.append(force - whole - p[3], zero - weight * p[3])
        return residual, np.vstack([columns, [0.0, 0.0, 0.0, weight]])

    best: Fitted | None = None
    bounds = np.array([-np.inf, 0.0, low, -np.inf]), np.array([np.inf, np.inf, high, np.inf])
    for n in (low, 0.5 * (low + high), high):
        start = np.array([float(force.max()), 0.0, n, estimate.offset])
        found = least_squares(model, start, bounds)
        if best is None or np.sum(found.residual**2) < np.sum(best.residual**2):
            best = found
    assert best is not None
    k, c, n, offset = best.parameters.tolist()
    parameters = np.array([k / deep**n, c / (fast * deep**n), n])
    # From (k, c, n, F₀) to (K, B, n, F₀): K = k/x_rⁿ, B = c/(V x_rⁿ).
    to_si = np.diag([deep**-n, deep**-n / fast, 1.0, 1.0])
    to_si[:2, 2] = -parameters[:2] * math.log(deep)
    joint = to_si @ robust_covariance(best.jacobian, best.residual) @ to_si.T
    counts = estimate.status, estimate.samples, 1.0, 0, estimate.restarts, estimate.rejected
    value = EstimateValue(parameters, joint.reshape(-1), *counts, offset=offset)
    return ConstrainedEstimate(value, HuntCrossley, estimate.fixed)
