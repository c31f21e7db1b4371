"""Errors of real rigs that a recording may contain: their prior widths, and what is left of each.

The amount a of a nuisance is 0, or with the odds π normal around 0 with the width p of its row in
:data:`NUISANCES`. The recording estimates it as A ± s, the coefficient of its column in the fit.
With w = p²/(p² + s²) the amount, if the nuisance is present, is w A with the variance w s², and

    log P/(1 − P) = log π/(1 − π) + ½ log(1 − w) + ½ w (A/s)²

is the probability P that it is present (spike and slab; Mitchell & Beauchamp 1988). What is left of
it in a number Q is √(P (w² A² + w s²)) ∂Q/∂a: little if the recording excludes the nuisance, and
√π p ∂Q/∂a if the recording does not show it at all.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from palpate.diagnosis.clock import clock_of, shows_skew
from palpate.diagnosis.fit import SIGNIFICANT, Fit
from palpate.findings import Check

# Prior odds of a nuisance. Chosen with the widths by the log score of the bars on seeds 0 to 300 of
# ``benchmarks.diagnosis.mix`` and on a second bank; half or twice of them costs 0.1 nat at most.
ODDS = 0.05
# A force that a sensor bends differs from one that a material bends in no recording, and materials
# of another shape are common.
GAIN_ODDS = 0.002
# Odds of a skew of known clocks: its standard error is that of what shows it, and needs no factor.
CERTAIN = 1.0 - 1e-9
# Factor on what is not detected: it is rarely normal. Chosen with the odds.
FACTOR = 1.3


class Nuisance(NamedTuple):
    """A prior of one nuisance.

    Attributes
    ----------
    width : float
        Standard deviation where it is present, in its unit.
    unit : callable
        One unit of the amount, as a coefficient of the column.
    sentence : str
        End of the sentence *the damping is known to ± 20 %, …* if it may be present.
    odds : float
        Prior probability that it is present.
    """

    width: float
    unit: Callable[[Fit], float]
    sentence: str
    odds: float = ODDS


def _second(fit: Fit) -> float:
    return 1.0


def _elastic_force(fit: Fit) -> float:
    """At the median depth."""
    return abs(float(fit.solution.law.force(fit.reference / fit.units.depth, 0.0)))


def _peak_force(fit: Fit) -> float:
    return fit.data.peak_force


def _gain_at_peak(fit: Fit) -> float:
    """The column's coefficient is the change of the gain up to the working force."""
    force = abs(fit.force_at_depth(fit.solution.law))
    return force / max(fit.data.peak_force, 1e-300)


def _damping_force(fit: Fit) -> float:
    """At the rms speed; at least 2 % of the elastic force."""
    damper = float(fit.solution.law.damping_at(fit.reference / fit.units.depth))
    return max(abs(damper) * fit.speed / fit.units.speed, 0.02 * _elastic_force(fit))


def _mass(fit: Fit) -> float:
    """Its inertia at the rms acceleration is the peak force."""
    acceleration = math.sqrt(float((fit.acceleration**2).mean()))
    return fit.data.peak_force / max(acceleration, 1e-300)


NUISANCES: Mapping[Check, Nuisance] = {
    # s. Two channels of one controller differ by a filter of 50–100 Hz or one cycle of 500 Hz.
    Check.DELAY: Nuisance(2e-3, _second, "a delay between force and position"),
    # Fraction of the elastic force: a tip slides where the motion is not normal.
    Check.FRICTION: Nuisance(0.05, _elastic_force, "friction that grows with the load"),
    # Fraction of the peak force: seals and linear guides between sensor and probe rub.
    Check.GUIDE_FRICTION: Nuisance(0.01, _peak_force, "friction of a guide"),
    # Fraction of the peak force: the tip beyond a sensor is about 1 % of what moves.
    Check.INERTIA: Nuisance(0.02, _mass, "a mass beyond the sensor"),
    # Fraction of the elastic force at the rms speed: fluid is pressed out.
    Check.SQUARE_SPEED: Nuisance(0.05, _elastic_force, "damping that grows with the speed"),
    # Fraction of the peak force during the recording: strain gauges warm up.
    Check.OFFSET_DRIFT: Nuisance(0.03, _peak_force, "drift of the force sensor"),
    # Change of the gain between no and the peak force. A bend of b lies b/4 off the line between
    # its ends: load cells are specified to 0.1 to 1 % of their range.
    Check.SENSOR_GAIN: Nuisance(0.04, _gain_at_peak, "a curved sensor gain", GAIN_ODDS),
    # Change of the gain during the recording: materials soften, or sensors warm up.
    Check.SLOW_CHANGE: Nuisance(0.05, _second, "softening or a drifting gain"),
    # Fraction of the damping force: half-space and Hunt–Crossley damping differ by as much over
    # depths of one to three.
    Check.DAMPING_FORM: Nuisance(0.4, _damping_force, "damping of another form"),
}


def _prior(fit: Fit, check: Check) -> Nuisance | None:
    """Return the prior of a nuisance; that of a skew which the law shows is a known clock's error.

    Beside a law that hides a skew, its column stands for damping of another form.
    """
    prior = NUISANCES.get(check)
    if prior is None or check is not Check.DELAY or not shows_skew(fit):
        return prior
    clock = clock_of(fit)
    return prior._replace(width=clock.error, odds=CERTAIN) if clock.is_known else prior


def remaining_part(fit: Fit, check: Check, amount: float, z: float) -> float:
    """Return the multiple of an estimated amount that may remain: √(P (w² A² + w s²))/|A|.

    :data:`FACTOR` times as much of what is not detected; 0 for a check that is no nuisance. With
    ``z`` = |A|/s.
    """
    prior = _prior(fit, check)
    size = abs(amount) / prior.unit(fit) if prior is not None else 0.0
    if prior is None or not 0.0 < size < math.inf:
        return 0.0
    error = size / max(z, 1e-9)
    shrinkage = prior.width**2 / (prior.width**2 + error**2)
    log_odds = math.log(prior.odds / (1.0 - prior.odds))
    log_odds += 0.5 * math.log(max(1.0 - shrinkage, 1e-300)) + 0.5 * shrinkage * z**2
    present = 1.0 / (1.0 + math.exp(-max(log_odds, -700.0)))
    factor = 1.0 if z > SIGNIFICANT or prior.odds == CERTAIN else FACTOR
    return factor * math.sqrt(present * ((shrinkage * size) ** 2 + shrinkage * error**2)) / size
