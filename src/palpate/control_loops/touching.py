"""The first touch by simulation: whether a loop settles, swings or loses the contact.

Near the surface a law is softer and less damped than at rest, and a loop that is stable there may
still bounce. ``include/palpate/touching_loop.hpp`` has the equations.
"""

import os

import numpy as np

import palpate._core as _core
from palpate.control_loops.laws import LawDraws
from palpate.control_loops.loop import ControlLoop
from palpate.validation import Floats, Mask, frozen

# A swing that keeps this share from one quarter of the time to the next does not die away; below
# this share of the wanted force it does not count.
_KEPT = 0.8
_VISIBLE = 0.02
# The time shows 40 periods of the onset's frequency, and the rest after the approach; s.
_PERIODS = 40.0
_SHORTEST, _LONGEST = 1.0, 5.0
_THREADS = min(os.cpu_count() or 1, 8)


@frozen(eq=False)
class Touches:
    """Outcomes of simulated touches, arrays of shape (touches,).

    Attributes
    ----------
    losses : numpy.ndarray
        How often the contact is lost.
    swings : numpy.ndarray of bool
        Whether the force swings on.
    peak_force : numpy.ndarray
        N.
    settling_time : numpy.ndarray
        Time after which the force stays within 5 % of the wanted one, s; the whole time if never.
    forces : numpy.ndarray, shape (touches, samples)
        N, at each sample; without samples unless they were requested.
    """

    losses: Floats
    swings: Mask
    peak_force: Floats
    settling_time: Floats
    forces: Floats

    @property
    def bounces(self) -> Mask:
        """Whether the contact is lost."""
        return self.losses > 0.0

    @property
    def fails(self) -> Mask:
        """Whether the loop swings or loses the contact."""
        return self.swings | self.bounces


def observation_time(loop: ControlLoop, depth: float, frequency: float) -> float:
    """Return the time in which a swing of a frequency [rad/s] has died away or not, s."""
    swing = _PERIODS * 2.0 * np.pi / frequency if frequency > 0.0 else _SHORTEST
    approach = 2.5 * depth / loop.approach_speed
    return float(np.clip(max(swing, approach), _SHORTEST, _LONGEST))


def simulate_touches(
    loop: ControlLoop,
    laws: LawDraws,
    factors: Floats,
    duration: float,
    *,
    speeds: Floats | None = None,
    with_forces: bool = False,
) -> Touches:
    """Simulate one touch for each factor on the gain.

    Parameters
    ----------
    loop : ControlLoop
        The loop at gain 1.
    laws : LawDraws
        One law for all touches, or one for each.
    factors : numpy.ndarray, shape (touches,)
        Factors on the gain.
    duration : float
        s.
    speeds : numpy.ndarray, shape (touches,), optional
        Approach speeds, m/s. Default: that of the loop.
    with_forces : bool
        Keep the forces.
    """
    columns = [laws.K, laws.n, laws.B, laws.p, laws.M, *loop.numbers(factors)]
    if speeds is not None:
        columns[-1] = speeds
    columns += [laws.depth(loop.wanted_force), duration]
    rows = np.column_stack([np.broadcast_to(column, factors.shape) for column in columns])
    outcomes = np.empty((len(rows), 5))
    samples = int(duration * loop.sample_rate) + 1 if with_forces else 0
    forces = np.full((len(rows), samples), np.nan)
    _core.simulate_touches(
        np.ascontiguousarray(rows), laws.times, laws.weights, outcomes, forces, _THREADS
    )
    losses, third, last, peak, settling = outcomes.T
    swings = (last > _VISIBLE * loop.wanted_force) & (last > _KEPT * third)
    return Touches(losses, swings, peak, settling, forces)


# Factors at which a loop is tried, over its linear onset: the simulated one lies from a tenth of it
# (bounces of stiff contacts) to a few per cent above.
_TRIED = np.geomspace(0.1, 1.4, 16)
_HALVINGS = 5  # of a cell of 19 %, to 0.6 %


def find_limits(
    loop: ControlLoop, law: LawDraws, onset: float, duration: float
) -> tuple[float, float]:
    """Return the factors at which a loop begins to swing, and to swing or bounce, by simulation.

    The lowest failing factor of a coarse grid is refined, as a loop may settle again above it. The
    limit is the highest factor that was tried if none fails, and 0 if all fail.

    Parameters
    ----------
    loop : ControlLoop
        The loop at gain 1.
    law : LawDraws
        A single law.
    onset : float
        The factor at which the linear loop begins to swing.
    duration : float
        s.
    """
    factors = onset * _TRIED
    touches = simulate_touches(loop, law, factors, duration)
    low = np.empty(2)
    high = np.empty(2)
    for k, fails in enumerate((touches.swings, touches.fails)):
        first = int(np.argmax(fails)) if fails.any() else len(factors)
        low[k] = factors[first - 1] if first else 0.0
        high[k] = factors[first] if first < len(factors) else factors[-1]
    for _ in range(_HALVINGS):
        middle = np.where(low > 0.0, np.sqrt(low * high), high)
        touches = simulate_touches(loop, law, middle, duration)
        fails = np.array([touches.swings[0], touches.fails[1]])
        known = (low > 0.0) & (low < high)
        low = np.where(known & ~fails, middle, low)
        high = np.where(known & fails, middle, high)
    return float(low[0]), float(low[1])
