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
from palpate.estimators.least_squares import least_squares, robust_covariance
from palpate.force_laws import HuntCrossley
from palpate.validation import Floats

EXPONENTS = (1.0, 2.0)
# Times the noise that the least squares leaves in means over a fortieth of the samples: below it
# the shape of the law determines n, as in a simulation.
MISFIT, BLOCKS = 3.0, 40


class ConstrainedEstimate(Estimate):
    """An estimate under the prior; its covariance is that of the least squares without bounds."""

    __slots__ = ()


def constrained(contact: Contact, trace: Trace, estimate: Estimate) -> ConstrainedEstimate | None:
    """Return the least squares in the box, with the offset as it is; None where that is not needed.

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
    x = contact.penetration[taken] - estimate.surface
    v, force = contact.velocity[taken], contact.force[taken] - estimate.offset
    one_way = abs(float(v.mean())) > ONE_WAY * math.sqrt(float(np.mean(v**2)))
    if not one_way or (low <= law.exponent <= high and law.damping >= 0.0):
        return None
    width = max(x.size // BLOCKS, 1)
    left = (force - law.force(x, v))[: x.size // width * width].reshape(-1, width).mean(axis=1)
    if not math.sqrt(width * float(np.mean(left**2))) > MISFIT * noise_of(force):
        return None
    deep, fast = float(x.max()), float(np.abs(v).max())
    local = HuntCrossley(float(force.max()), 0.0, float(np.clip(law.exponent, low, high)))

    def model(p: Floats) -> tuple[Floats, Floats]:
        predicted, slopes = local.force_and_gradient(p, x / deep, v / fast)
        return force - predicted, slopes

    bounds = np.array([-np.inf, 0.0, low]), np.array([np.inf, np.inf, high])
    found = least_squares(model, local.parameters, bounds)
    law = HuntCrossley(*found.parameters).scaled(1.0 / deep, 1.0 / fast)
    # From local units to SI: K = k/x_rⁿ, B = c/(V x_rⁿ).
    to_si = np.diag([deep**-law.exponent, deep**-law.exponent / fast, 1.0])
    to_si[:2, 2] = -law.parameters[:2] * math.log(deep)
    joint = np.zeros((4, 4))
    joint[:3, :3] = to_si @ robust_covariance(found.jacobian, found.residual) @ to_si.T
    joint[3, 3] = estimate.offset_standard_error**2
    counts = estimate.status, estimate.samples, 1.0, 0, 0, estimate.rejected
    value = EstimateValue(law.parameters, joint.reshape(-1), *counts, offset=estimate.offset)
    return ConstrainedEstimate(value, HuntCrossley)
