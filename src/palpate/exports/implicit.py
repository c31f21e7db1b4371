"""A drop as an engine steps it whose contact is implicit: its force is that of the step's end.

Drake's discrete plants and PyBullet have, of a body on a contact,

    m (v₁ − v₀) = −h F(x₁, v₁),  x₁ = x₀ + h v₁,

which damps by h ∂F/∂x more than the law says: K h for a spring.
"""

from palpate.exports.errors import Drop, Pointwise

# An impact takes some tens of milliseconds, of steps of a microsecond and more.
_MOST_STEPS = 100_000
# By halves: to 10⁻¹⁵ of the speed.
_HALVES = 50


def rebound_by_steps(force: Pointwise, drop: Drop, step: float) -> float:
    """Restitution of a body that enters the surface at x = 0, by steps [s].

    Parameters
    ----------
    force : callable
        N, ≥ 0, at a penetration [m] and a velocity [m/s]; must not fall with either.
    drop : Drop
        What falls, and how fast.
    step : float
        h, s, > 0.
    """
    x, v = 0.0, drop.speed
    for _ in range(_MOST_STEPS):
        v = _after(force, drop.mass, step, x, v)
        x += step * v
        if x <= 0.0:
            return -v / drop.speed
    return 0.0


def _after(force: Pointwise, mass: float, step: float, x: float, v: float) -> float:
    """v₁: m (v₁ − v₀) + h F(x₀ + h v₁, v₁) rises with v₁, and is not below 0 at v₀."""
    high = v
    low = v - step * force(x + step * v, v) / mass
    for _ in range(_HALVES):
        middle = 0.5 * (low + high)
        if mass * (middle - v) + step * force(x + step * middle, middle) > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)
