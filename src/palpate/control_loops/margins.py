"""Which gains are safe: the margin of a loop on a contact, with its bound, and the gains for it."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from palpate.control_loops.answer import SAFETY, SLOWEST, GainMargin, Gains, Refusal, Safety
from palpate.control_loops.laws import ContactKnowledge, LawDraws
from palpate.control_loops.loop import ControlLoop
from palpate.control_loops.response import Onset, find_onset
from palpate.control_loops.touching import find_limits, observation_time, simulate_touches
from palpate.validation import Floats, Mask, frozen

_CONFIDENCE = 0.05  # of the draws may have a lower onset than the bound
_DRAWS = 64
_TRIED = 24  # draws with which a recommendation is simulated
# Beyond this multiple of the recorded force, or of the highest recorded frequency, nothing is said.
_FARTHEST = 4.0
# A law with memory, or a damping that falls with the frequency, has its own stiffness and damping
# at each frequency: the onset is where the frequency of the swing is that of the law.
_ITERATIONS = 6
# Loss tangent that stands for none: with an undamped pole on the circle, the sign of the response
# there is that of rounding errors. Steel has more.
_LEAST_LOSS = 1e-3
_DELAYS = (0.0, 2e-3, 4e-3, 8e-3)
# Approach speeds that are tried, m/s, a sixth apart.
_SPEEDS = np.geomspace(SLOWEST, 1.0, 40)
# A gain that bounces on a draw is lowered by steps of 2 dB, down to a tenth.
_LOWERED = 0.8 ** np.arange(1.0, 11.0)


def gains_for(knowledge: ContactKnowledge, loop: ControlLoop) -> Gains:
    """Return whether the gains of a loop are safe on a known contact, and those that are.

    It reads no file and takes some tenths of a second.

    Parameters
    ----------
    knowledge : ContactKnowledge
        The laws with their errors, and the recorded frequencies and forces.
    loop : ControlLoop
        The loop, with its gains.

    Returns
    -------
    Gains
        Verdict, margin, and recommended gains.

    Examples
    --------
    >>> import palpate
    >>> from palpate import control_loops
    >>> estimate = palpate.identify("examples/recordings/ball.csv").estimate
    >>> loop = control_loops.ImpedanceControl(
    ...     stiffness=500.0, damping=60.0, mass=4.0, sample_rate=1000.0, delay=2e-3,
    ...     wanted_force=10.0, approach_speed=0.02,
    ... )
    >>> knowledge = control_loops.ContactKnowledge.of(estimate, largest_force=30.0)
    >>> control_loops.gains_for(knowledge, loop).verdict
    'safe'
    """
    if knowledge.stiffness_mark == "do-not-trust":
        return Gains(loop, knowledge, "refused", Refusal.STIFFNESS)
    if loop.wanted_force > _FARTHEST * knowledge.largest_force:
        return Gains(loop, knowledge, "refused", Refusal.FORCE)
    laws = [known.draws(_DRAWS, knowledge.lowest_frequency) for known in knowledge.laws]
    if loop.delay is None:
        margins = {
            delay: _Assessment(loop.with_delay(delay), knowledge, laws).linear_margin
            for delay in _DELAYS
        }
        return Gains(loop, knowledge, "refused", Refusal.DELAY, by_delay=margins)
    return _Assessment(loop, knowledge, laws).gains()


@frozen(eq=False)
class _LawMargin:
    """The onset of a loop on one law: linear for each draw, simulated for the law itself.

    Attributes
    ----------
    draws : LawDraws
        The draws, the law itself first.
    onset : Onset
        Linear, the least over what the damping may be beyond the recorded frequencies.
    identified : Onset
        Linear, of the law as identified.
    duration : float
        Time in which a swing shows, s.
    """

    draws: LawDraws
    onset: Onset
    identified: Onset
    duration: float

    @classmethod
    def of(cls, loop: ControlLoop, draws: LawDraws, highest: float) -> "_LawMargin":
        """Return the linear part, for laws that hold up to a frequency [rad/s]."""
        depth = draws.depth(loop.wanted_force)
        identified = _consistent_onset(loop, draws, depth, highest, _as_identified)
        onset = identified
        for beyond in (_constant_loss, _undamped):
            other = _consistent_onset(loop, draws, depth, highest, beyond)
            # Within the recorded frequencies the law itself holds.
            faster = (identified.frequency > highest) | (other.frequency > highest)
            gain = np.where(faster, other.gain, np.inf)
            onset = onset.lowest(Onset(gain, other.frequency))
        frequency = identified.frequency[0]
        duration = observation_time(loop, float(depth[0]), float(np.nan_to_num(frequency)))
        return cls(draws, onset, identified, duration)

    @property
    def bound(self) -> float:
        """The linear onset that 95 % of the draws exceed."""
        return _lower_quantile(self.onset.gain)


def _lower_quantile(gains: Floats) -> float:
    return float(np.sort(gains)[int(_CONFIDENCE * len(gains))])


def _as_identified(
    draws: LawDraws, depth: Floats, frequency: Floats, _: float
) -> tuple[Floats, Floats]:
    return draws.stiffness_and_damping(depth, frequency)


def _constant_loss(
    draws: LawDraws, depth: Floats, frequency: Floats, highest: float
) -> tuple[Floats, Floats]:
    """Beyond the recorded frequencies the loss per cycle stays: the damping falls as 1/ω."""
    stiffness, damping = draws.stiffness_and_damping(depth, np.minimum(frequency, highest))
    return stiffness, damping * highest / np.maximum(frequency, highest)


def _undamped(
    draws: LawDraws, depth: Floats, frequency: Floats, highest: float
) -> tuple[Floats, Floats]:
    stiffness, damping = draws.stiffness_and_damping(depth, np.full_like(frequency, highest))
    return stiffness, np.zeros_like(damping)


def _consistent_onset(
    loop: ControlLoop, draws: LawDraws, depth: Floats, highest: float, law: Any
) -> Onset:
    """Return the onset at whose frequency the law has the stiffness and damping that give it."""

    def onset_at(frequency: Floats) -> Onset:
        stiffness, damping = law(draws, depth, frequency, highest)
        least = _LEAST_LOSS * stiffness / highest
        return find_onset(loop, stiffness, np.maximum(damping, least))

    frequency = np.full_like(depth, highest)
    onset = onset_at(frequency)
    changes = draws.remembers if law is _as_identified else law is _constant_loss
    for _ in range(_ITERATIONS if changes else 0):
        swing = np.where(np.isfinite(onset.frequency), onset.frequency, frequency)
        frequency = np.sqrt(frequency * swing)
        onset = onset_at(frequency)
    return onset


class _Assessment:
    """The margins of a loop on all laws, and what follows from them."""

    def __init__(
        self, loop: ControlLoop, knowledge: ContactKnowledge, laws: list[LawDraws]
    ) -> None:
        self.loop = loop
        self.knowledge = knowledge
        limit = knowledge.damping_limit
        self.laws = [_LawMargin.of(loop, draws, limit) for draws in laws]

    @property
    def linear_margin(self) -> GainMargin:
        """The margin without the first touch."""
        bound = min(law.bound for law in self.laws)
        return GainMargin(float(self.laws[0].onset.gain[0]), bound)

    def gains(self) -> Gains:
        """Return the answer."""
        least = min(self.laws, key=lambda law: law.bound)
        frequency = float(least.onset.frequency[0])
        swings = []
        fails = []
        for law in self.laws:
            settles, stays = self._simulated_ratios(law)
            onset = float(law.onset.gain[0])
            swings.append((settles * onset, settles * law.bound))
            fails.append((stays * onset, stays * law.bound))
        bounces_always = min(bound for _, bound in fails) <= 0.0
        margins = swings if bounces_always else fails
        margin = GainMargin(margins[0][0], min(bound for _, bound in margins))
        (peak, settling), bounce_speed = self._first_touch(self.loop, 1.0, _SPEEDS)
        refused = Gains(
            self.loop,
            self.knowledge,
            "refused",
            Refusal.FREQUENCY,
            gain_margin=margin,
            frequency=frequency,
            bounce_speed=bounce_speed,
            peak_force=peak,
            settling_time=settling,
        )
        too_fast = frequency > _FARTHEST * self.knowledge.recorded_frequency
        if self.loop.needs_frequency and too_fast:
            return refused
        bounces = bounce_speed <= self.loop.approach_speed
        factor, recommended = self._recommend(margin.lower_bound)
        (peak, settling), _ = self._first_touch(recommended, factor, _SPEEDS[:0])
        return replace(
            refused,
            verdict=_verdict(margin.lower_bound, bounces=bounces),
            refusal=None,
            recommended=recommended.scaled(factor),
            recommended_factor=factor,
            recommended_peak=peak,
            recommended_settling=settling,
        )

    def _simulated_ratios(self, law: _LawMargin) -> tuple[float, float]:
        """Return the simulated limits of a law over its linear onset: swing, and swing or bounce.

        One simulation serves all draws: the ratio differs by 1 % between them.
        """
        onset = float(law.identified.gain[0])
        if not math.isfinite(onset):
            return 1.0, 1.0
        first = law.draws.first(1)
        limits = find_limits(self.loop, first, onset, law.duration)
        return min(1.0, limits[0] / onset), min(1.0, limits[1] / onset)

    def _first_touch(
        self, loop: ControlLoop, factor: float, speeds: Floats
    ) -> tuple[tuple[float, float], float]:
        """Return peak force and settling time of the identified law, and the bounce speed.

        The bounce speed is the lowest of these speeds, and of the loop's, at which it bounces.
        """
        law = self.laws[0]
        tried = np.append(speeds, loop.approach_speed)
        factors = np.full(len(tried), factor)
        first = law.draws.first(1)
        touches = simulate_touches(loop, first, factors, law.duration, speeds=tried)
        settling = float(touches.settling_time[-1])
        settled = not touches.swings[-1] and settling < law.duration
        bounce_speed = float(tried[touches.bounces].min(initial=math.inf))
        touch = float(touches.peak_force[-1]), settling if settled else math.nan
        return touch, bounce_speed

    def _recommend(self, bound: float) -> tuple[float, ControlLoop]:
        """Return the largest safe factor on the gain, and the loop with an approach speed for it.

        6 dB below the bound, and lower where a draw of a law loses the contact; if no lower gain
        avoids that, a lower speed does.
        """
        factor = bound / SAFETY if math.isfinite(bound) else 1.0
        speed = self.loop.approach_speed
        if not self._fails(np.array([factor]), np.array([speed]), _TRIED)[0]:
            return factor, self.loop
        slower = _SPEEDS[_SPEEDS < speed][::-1]
        factors = np.append(factor * _LOWERED, np.full(len(slower), factor))
        speeds = np.append(np.full(len(_LOWERED), speed), slower)
        for k in np.flatnonzero(~self._fails(factors, speeds, 1)).tolist():
            if not self._fails(factors[k : k + 1], speeds[k : k + 1], _TRIED)[0]:
                return float(factors[k]), replace(self.loop, approach_speed=float(speeds[k]))
        return factor, replace(self.loop, approach_speed=float(_SPEEDS[0]))

    def _fails(self, factors: Floats, speeds: Floats, count: int) -> Mask:
        """Return whether one of the first draws of a law fails, by factor and approach speed."""
        fails = np.zeros(len(factors), dtype=bool)
        for law in self.laws:
            draws = law.draws.first(max(count // len(self.laws), 1))
            for k in range(len(draws.K)):
                one = draws.some(slice(k, k + 1))
                touches = simulate_touches(self.loop, one, factors, law.duration, speeds=speeds)
                fails |= touches.fails
        return fails


def _verdict(bound: float, *, bounces: bool) -> Safety:
    if bounces or bound <= 1.0:
        return "not-safe"
    return "safe" if bound >= SAFETY else "little-margin"
