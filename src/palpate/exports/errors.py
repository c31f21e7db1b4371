"""How far an engine's force is from a law's, and how differently a body rebounds."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.force_laws import GeneralisedHuntCrossley
from palpate.metrics import rmse_percent
from palpate.quantities.impact import restitution
from palpate.validation import Floats

#: Force [N] at a penetration [m] and a velocity [m/s].
Pointwise: TypeAlias = Callable[[float, float], float]

# Steps to the half period of the spring alone: e to 10⁻⁶, against the exact relation.
_STEPS = 1000
# Half periods after which a body has come to rest in the material.
_LONGEST = 40


def force_error(force: Floats, reference: Floats, judged: NDArray[np.bool_]) -> float:
    """100 rms(F − F_reference)/rms(F_reference) over the judged samples, %."""
    return rmse_percent(reference[judged], force[judged])


@dataclass(frozen=True, slots=True)
class Drop:
    """A free body that meets the surface, without weight: to some depth, and how it rebounds.

    Attributes
    ----------
    mass : float
        kg.
    speed : float
        At first touch, m/s.
    depth : float
        As deep as it goes, m.
    restitution : float
        e = speed after/speed before; 0 of a body that stays.
    """

    mass: float
    speed: float
    depth: float
    restitution: float


def drop_to(law: GeneralisedHuntCrossley, mass: float, depth: float) -> Drop:
    """Return the drop that goes to a depth [m] by a law, and its restitution.

    Where p = n by the exact relation of :mod:`palpate.quantities.impact`; else by integration.
    """
    force = law.force
    step = _half_period(law, mass, depth) / _STEPS
    speed = abs(_until_surface(force, mass, depth, 0.0, -step))
    if law.damping_exponent == law.exponent or law.damping == 0.0:
        e = restitution(law.damping / law.stiffness, speed)
    else:
        e = rebound(force, mass, speed, step)
    return Drop(mass, speed, depth, e)


def rebound(force: Pointwise, mass: float, speed: float, step: float) -> float:
    """Restitution of a body that meets a material which cannot pull, by RK4 with a step [s].

    Parameters
    ----------
    force : callable
        N, at a penetration [m] and a velocity [m/s]; below 0 it counts as 0.
    mass, speed, step : float
        kg; m/s, > 0; s.
    """

    def pushing(penetration: float, velocity: float) -> float:
        return max(force(penetration, velocity), 0.0)

    return abs(min(_until_surface(pushing, mass, 0.0, speed, step), 0.0)) / speed


def rebound_by(law: GeneralisedHuntCrossley, drop: Drop) -> float:
    """Restitution by another law of a body that meets it as a drop does."""
    step = _half_period(law, drop.mass, drop.depth) / _STEPS
    return rebound(law.force, drop.mass, drop.speed, step)


def _half_period(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Of the body on a spring as stiff as the law is, as a secant, at a depth, s."""
    return math.pi * math.sqrt(mass / (law.stiffness * depth ** (law.exponent - 1.0)))


def _until_surface(force: Pointwise, mass: float, x: float, v: float, step: float) -> float:
    """Velocity where m ẍ = −F(x, ẋ) crosses the surface; 0 where it does not in reasonable time.

    A negative step goes back in time, from the greatest depth to first touch.
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
        nearer = x + step * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
        faster = v + step * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        if nearer <= 0.0:
            # Where x is 0 within the step, by a line.
            return v + (faster - v) * x / (x - nearer) if x > nearer else faster
        x, v = nearer, faster
        if not math.isfinite(v):
            break
    return 0.0
