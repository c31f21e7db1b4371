"""A better motion than the planned one, within limits of depth and speed."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from palpate.design.motion import Motion
from palpate.design.precision import Measurement

# The probe stays deeper than this fraction of the peak penetration, and where K xⁿ is so many times
# the noise but at most this fraction of its largest: what is less, gates leave out.
MARGIN = 0.1
CLEAR = 10.0
# What gains less is not worth a change.
LEAST_GAIN = 0.02
# A quadratic velocity filter of 15 samples takes 5.57 (ω Δt)² off a sine's speed: here 0.5 %.
FASTEST_PHASE = 0.03
# Four digits are enough to type, and move a depth by less than this fraction of it.
_DIGITS = 4
_SLACK = 1e-3


@dataclass(frozen=True, slots=True)
class Limits:
    """What a motion has to keep to, for all time.

    Parameters
    ----------
    peak_penetration, least_penetration : float
        m, 0 < least_penetration < peak_penetration.
    speed : float
        m/s.
    frequency : float
        rad/s.
    """

    peak_penetration: float
    least_penetration: float
    speed: float
    frequency: float

    def allow(self, motion: Motion) -> bool:
        """Whether the motion keeps to them."""
        return (
            motion.peak_penetration <= self.peak_penetration * (1.0 + 1e-12)
            and motion.least_penetration >= self.least_penetration * (1.0 - 1e-12)
            and motion.top_speed <= self.speed * (1.0 + 1e-12)
            and max(motion.frequencies, default=0.0) <= self.frequency * (1.0 + 1e-12)
        )


def limits_around(
    motion: Motion, measurement: Measurement, max_depth: float | None, max_speed: float | None
) -> Limits:
    """Limits as asked for; what is left open is what the motion itself reaches.

    The speed also stays below K/B, beyond which the law pulls at a probe on its way out, and the
    frequency so low that a velocity filter of 15 samples costs the damping 0.5 %.
    """
    peak_penetration = motion.peak_penetration if max_depth is None else max_depth
    law = measurement.law
    clear = min(
        CLEAR * measurement.effective_noise / law.stiffness, MARGIN * peak_penetration**law.exponent
    )
    least_penetration = max(MARGIN * peak_penetration, clear ** (1.0 / law.exponent))
    if 0.0 < motion.least_penetration < least_penetration:
        least_penetration = motion.least_penetration
    speed = motion.top_speed if max_speed is None else max_speed
    frequency = max([FASTEST_PHASE / measurement.sample_time, *motion.frequencies])
    return Limits(
        peak_penetration, least_penetration, min(speed, law.stiffness / law.damping), frequency
    )


def find_better(
    given: Motion, measurement: Measurement, limits: Limits, duration: float
) -> Motion | None:
    """Return a motion within the limits whose worst error of (K, B, n) is less, or None.

    The worst expected error after the duration is compared over strokes from the peak penetration
    up to 24 heights, then over 9 around the best of them, all at the highest speed: of the planned
    sines in their proportions, of a single sine, and of one with a small second one, which does
    not repeat. Where the planned motion is within the limits, nothing is returned that gains less
    than 2 %.
    """
    if limits.speed == 0.0:
        return None
    top, bottom = (
        limits.peak_penetration * (1.0 - _SLACK),
        limits.least_penetration + limits.peak_penetration * _SLACK,
    )
    heights = np.linspace(bottom, bottom + 0.95 * (top - bottom), 24)
    step = float(heights[1] - heights[0])

    best, least = given, math.inf

    def worst(motion: Motion) -> float:
        # The bound is quick, and no expected error is less.
        bound = float(measurement.relative_errors(motion, duration, quick=True).max())
        if bound >= least:
            return bound
        return float(measurement.expected_errors(motion, duration, quick=True).max())

    for shape in _shapes(given):
        for height in heights:
            candidate = _stroke(shape, top, float(height), limits)
            if (error := worst(candidate)) < least:
                best, least, best_shape = candidate, error, shape
    if math.isinf(least):
        return None
    centre = best.least_penetration
    for height in np.linspace(max(bottom, centre - step), min(heights[-1], centre + step), 9):
        candidate = _stroke(best_shape, top, float(height), limits)
        if (error := worst(candidate)) < least:
            best, least = candidate, error
    exact = measurement.expected_errors(best, duration).max()
    before = measurement.expected_errors(given, duration).max()
    gains = exact < (1.0 - LEAST_GAIN) * before
    return best if gains or not limits.allow(given) else None


def _shapes(given: Motion) -> Iterator[Motion]:
    """Motions to scale: only the proportions of their sines count."""
    if given.top_speed > 0.0:
        yield given
    yield Motion(1.0, (1.0,), (1.0,))
    yield Motion(1.0, (1.0, 0.05), (1.0, 0.5 * (1.0 + math.sqrt(5.0))))


def _stroke(shape: Motion, top: float, bottom: float, limits: Limits) -> Motion:
    """Return the shape's sines between two depths, as fast as the limits allow, in few digits."""
    scale = 0.5 * (top - bottom) / math.fsum(shape.amplitudes)
    faster = min(
        (1.0 - _SLACK) * limits.speed / (scale * shape.top_speed),
        (1.0 - _SLACK) * limits.frequency / max(shape.frequencies),
    )
    return Motion(
        _typed(0.5 * (top + bottom)),
        tuple(_typed(scale * a) for a in shape.amplitudes),
        tuple(_typed(faster * w) for w in shape.frequencies),
    )


def _typed(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
