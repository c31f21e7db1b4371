"""Errors of an engine's force along a motion, and of the restitution after a drop."""

import math
from collections.abc import Iterable, Iterator

import numpy as np

from palpate.exports.motion import Pointwise, ProbeMotion
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.identification.quantities.restitution import restitution
from palpate.validation import Floats, Mask, frozen

# Steps per half period of the spring alone: restitution e is accurate to 10⁻⁶.
_STEPS = 1000
# Half periods after which a body counts as at rest in the material.
_LONGEST = 40


def force_error(force: Floats, reference: Floats, judged: Mask) -> float:
    """Return 100 rms(F − F_reference)/rms(F_reference) over the judged samples, %."""
    expected = reference[judged]
    error = expected - force[judged]
    energy = float(expected @ expected)
    return 100.0 * math.sqrt(float(error @ error) / energy) if energy > 0.0 else math.nan


@frozen
class Drop:
    """An impact of a free, weightless body on the surface.

    Attributes
    ----------
    mass : float
        Mass of the body, kg.
    speed : float
        Speed at first touch, m/s.
    depth : float
        Largest depth, m.
    restitution : float
        e = speed after/speed before; 0 if the body does not rebound.
    """

    mass: float
    speed: float
    depth: float
    restitution: float


def drop_to(law: GeneralisedHuntCrossley, mass: float, depth: float) -> Drop:
    """Return the impact that reaches a depth [m] by a law, with its restitution.

    For p = n from the exact relation of :mod:`palpate.identification.quantities.restitution`, else
    by integration.
    """
    force = law.force
    step = half_period(law, mass, depth) / _STEPS
    speed = abs(_until_surface(force, mass, depth, 0.0, -step))
    if law.p == law.n or law.B == 0.0:
        e = restitution(law.B / law.K, speed)
    else:
        e = drop_restitution(force, mass, speed, step)
    return Drop(mass, speed, depth, e)


def drop_restitution(force: Pointwise, mass: float, speed: float, step: float) -> float:
    """Return the restitution of an impact on a material that cannot pull, by RK4.

    Parameters
    ----------
    force : callable
        Force, N, at a penetration [m] and a velocity [m/s]; below 0 it counts as 0.
    mass, speed, step : float
        Mass, kg; speed at first touch, m/s, > 0; time step, s.
    """

    def pushing(penetration: float, velocity: float) -> float:
        return max(force(penetration, velocity), 0.0)

    return abs(min(_until_surface(pushing, mass, 0.0, speed, step), 0.0)) / speed


def came_back(states: Iterable[tuple[float, float]], drop: Drop) -> float:
    """Return the restitution from (penetration, velocity) after each step; 0 without a rebound."""
    for x, v in states:
        if x <= 0.0 and v < 0.0:
            return -v / drop.speed
        if not math.isfinite(v):
            break
    return 0.0


def state_by_state(motion: ProbeMotion, force: Pointwise) -> Floats:
    """Return the force at every state of a motion, N."""
    states = zip(motion.penetration.tolist(), motion.velocity.tolist(), strict=True)
    return np.array([force(x, v) for x, v in states], dtype=np.float64)


def restitution_by(law: GeneralisedHuntCrossley, drop: Drop) -> float:
    """Return the restitution of the drop's body at the same speed with another law."""
    step = half_period(law, drop.mass, drop.depth) / _STEPS
    return drop_restitution(law.force, drop.mass, drop.speed, step)


def half_period(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Return the half period, s, of a body on a spring of the law's secant stiffness at depth."""
    return math.pi * math.sqrt(mass / (law.K * depth ** (law.n - 1.0)))


def course(
    force: Pointwise,
    mass: float,
    x: float,
    v: float,
    step: float,
) -> Iterator[tuple[float, float]]:
    """Yield position and velocity of a free body, m ẍ = −F(x, ẋ), until it leaves the surface.

    By RK4. A negative step integrates back in time, from the greatest depth to first touch.
    """

    def slope(depth: float, speed: float) -> float:
        return -force(max(depth, 0.0), speed) / mass

    for _ in range(_STEPS * _LONGEST):
        a1 = slope(x, v)
        v2 = v + 0.5 * step * a1
        a2 = slope(x + 0.5 * step * v, v2)
        v3 = v + 0.5 * step * a2
        a3 = slope(x + 0.5 * step * v2, v3)
        v4 = v + step * a3
        a4 = slope(x + step * v3, v4)
        x += step * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
        v += step * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        yield x, v
        if x <= 0.0 or not math.isfinite(v):
            return


def _until_surface(force: Pointwise, mass: float, x: float, v: float, step: float) -> float:
    """Return the velocity of :func:`course` at the surface; 0 if it does not return in time."""
    for nearer, faster in course(force, mass, x, v, step):
        if nearer <= 0.0:
            # Interpolate linearly to x = 0 within the step.
            return v + (faster - v) * x / (x - nearer) if x > nearer else faster
        x = nearer
        v = faster
    return 0.0
