"""A drop as an engine steps it whose contact is implicit: its force is that of the step's end.

Drake's discrete plants have, of a body on a contact,

    m (v₁ − v₀) = −h F(x₁, v₁),  x₁ = x₀ + h v₁,

which damps by h ∂F/∂x more than the law says: K h for a spring.
"""

import math

from palpate.exports.errors import Drop, Pointwise, rebound

#: A body that takes so many times as long as it went down is said to stay.
LONGEST = 20.0
# With as many steps on the way down h adds π/20 000 of the critical damping: e falls by 0.05 %.
_FINE = 5000
# As the law's own drops are integrated.
_BY_LAW = 2000
# Some six are needed.
_MOST_TRIES = 60


def time_down(drop: Drop) -> float:
    """How long the way down takes, s, or nearly: a quarter period, π/2 x/v₀ of a spring."""
    return 0.5 * math.pi * drop.depth / drop.speed


def steps_down(drop: Drop, step: float) -> float:
    """How many steps the way down takes, or nearly; without steps it is without bound."""
    return time_down(drop) / step if step > 0.0 else math.inf


def rebound_by_steps(force: Pointwise, drop: Drop, step: float) -> float:
    """Restitution of a body that enters the surface at x = 0, by steps [s].

    Of steps so fine that what they add does not matter, by the law alone.

    Parameters
    ----------
    force : callable
        N, ≥ 0, at a penetration [m] and a velocity [m/s]; must not fall with either.
    drop : Drop
        What falls, and how fast.
    step : float
        h, s; 0 of an engine without steps.
    """
    steps = steps_down(drop, step)
    if steps > _FINE:
        return rebound(force, drop.mass, drop.speed, time_down(drop) / _BY_LAW)
    x, v = 0.0, drop.speed
    for _ in range(math.ceil(LONGEST * steps) + 10):
        v = _after(force, drop.mass, step, x, v)
        x += step * v
        if x <= 0.0:
            return -v / drop.speed
    return 0.0


def _after(force: Pointwise, mass: float, step: float, x: float, v: float) -> float:
    """v₁, where m (v₁ − v₀) + h F(x₀ + h v₁, v₁), which rises with v₁, is 0: by false position.

    It is not below 0 at v₀, and not above at what the force there would make of v₀. Of an end that
    stays twice, half of the value is taken (the Illinois rule).
    """

    def excess(speed: float) -> float:
        return mass * (speed - v) + step * force(x + step * speed, speed)

    high, above = v, excess(v)
    low = v - above / mass
    below = excess(low)
    side = 0
    for _ in range(_MOST_TRIES):
        if above <= 0.0 or below >= 0.0 or high - low <= 1e-15 * abs(v):
            break
        middle = low + (high - low) * below / (below - above)
        value = excess(middle)
        if abs(value) <= 1e-14 * mass * abs(v):
            return middle
        if value > 0.0:
            high, above, below = middle, value, 0.5 * below if side > 0 else below
            side = 1
        else:
            low, below, above = middle, value, 0.5 * above if side < 0 else above
            side = -1
    return high if above <= 0.0 else low
