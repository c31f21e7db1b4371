"""How a free body rebounds from rows, step by step as in MuJoCo."""

import math

import numpy as np

from palpate.exports.errors import Drop
from palpate.exports.mujoco.rows import Row, Rows

# Points of the table that a drop is integrated with.
_TABLE = 2000
#: A body that has not come back by then stays: a half period is some ten steps that are stable.
MOST_STEPS = 20_000


def rebound(rows: Rows, drop: Drop, step: float) -> float:
    """Restitution that the rows give a free body, by semi-implicit Euler as in MuJoCo.

    Parameters
    ----------
    rows : Rows
        Of the fragment.
    drop : Drop
        Where it enters, how fast and how heavy.
    step : float
        s.
    """
    deepest = 1.5 * drop.depth
    rows_at = [_tables(row, rows, deepest) for row in rows.rows]
    spacing = deepest / _TABLE
    # Where the tip touches, MuJoCo has no contact yet: the first step is free flight.
    x, v = step * drop.speed, drop.speed
    for _ in range(MOST_STEPS):
        place = min(x / spacing, _TABLE - 1.0)
        k = int(place)
        part = place - k
        felt = []
        for push, drag, added, pull in rows_at:
            held = push[k] + part * (push[k + 1] - push[k])
            held += (drag[k] + part * (drag[k + 1] - drag[k])) * v
            felt.append((held, added[k] + part * (added[k + 1] - added[k]), pull))
        v += step * _acceleration(felt, drop.mass)
        x += step * v
        if x <= 0.0:
            return max(-v, 0.0) / drop.speed
        if not math.isfinite(v):
            break
    return 0.0


def _acceleration(felt: list[tuple[float, float, float]], mass: float) -> float:
    """ẍ of a free body, m ẍ = −Σ f, each f = held + m_a ẍ, but not below what it may pull with."""
    clipped: list[bool] = [False] * len(felt)
    while True:
        load = added = 0.0
        for (held, more, pull), off in zip(felt, clipped, strict=True):
            load += -pull if off else held
            added += 0.0 if off else more
        a = -load / (mass + added)
        now = [off or held + more * a < -pull
               for (held, more, pull), off in zip(felt, clipped, strict=True)]  # fmt: skip
        if now == clipped:
            return a
        clipped = now


def _tables(
    row: Row, rows: Rows, deepest: float
) -> tuple[list[float], list[float], list[float], float]:
    """Force at rest, damping and added mass at even depths from just inside; the adhesion."""
    depths = np.linspace(0.0, deepest, _TABLE + 1)
    depths[0] = 1e-6 * depths[1]
    n = rows.contacts
    spring, damper = row.springs_and_dampers(depths, rows.mobility)
    mass = row.added_mass(depths, rows.mobility)
    return (n * spring).tolist(), (n * damper).tolist(), (n * mass).tolist(), n * row.adhesion
