"""Which gains are safe: the margin of a loop on a contact, with its bound, and the gains for it."""

import enum
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal, TypeAlias

import numpy as np

from palpate.control_loops.laws import ContactKnowledge, LawDraws
from palpate.control_loops.loop import ControlLoop
from palpate.control_loops.response import Onset, find_onset
from palpate.control_loops.touching import find_limits, observation_time, simulate_touches
from palpate.errors import InvalidParameterError
from palpate.validation import Floats, finite_or_none, frozen

Safety: TypeAlias = Literal["safe", "little-margin", "not-safe", "refused"]

#: 6 dB, which covers what the laws leave out: on 428 poor recordings of materials without memory a
#: gain this far below the bound neither swung nor bounced, 2 dB below it 2 did.
SAFETY = 10.0 ** (6.0 / 20.0)
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
_SPEEDS = np.geomspace(2e-3, 1.0, 40)
# A gain that bounces on a draw is lowered by steps of 2 dB, down to a tenth.
_LOWERED = 0.8 ** np.arange(1.0, 11.0)


class Refusal(enum.StrEnum):
    """Why no gain is recommended."""

    DELAY = "delay"
    STIFFNESS = "stiffness"
    FORCE = "force"
    FREQUENCY = "frequency"


@frozen
class GainMargin:
    """Factor on the gain at which a loop begins to swing or to bounce.

    Attributes
    ----------
    value : float
        With the identified law; ∞ if no gain does.
    lower_bound : float
        With 95 % confidence, the least over all laws that the recording does not exclude.
    """

    value: float
    lower_bound: float

    def as_dict(self) -> dict[str, float | None]:
        """Return both numbers; None for an infinite one."""
        return {
            "value": finite_or_none(self.value),
            "lower_bound": finite_or_none(self.lower_bound),
        }


@frozen(eq=False)
class Gains:
    """Whether gains are safe on a contact, and those that are.

    Attributes
    ----------
    loop : ControlLoop
        The loop that was asked about.
    knowledge : ContactKnowledge
        What is known of the contact.
    verdict : "safe", "little-margin", "not-safe" or "refused"
        Safe: the bound of the gain margin is at least 6 dB, and the loop does not bounce at its
        approach speed. Little margin: 0 to 6 dB. Not safe: less, or it bounces.
    refusal : Refusal, optional
        Why no gain is recommended; None unless the verdict is "refused".
    gain_margin : GainMargin, optional
        None if refused before it was computed.
    frequency : float
        Of the swing at the margin, rad/s; NaN if no gain swings.
    bounce_speed : float
        Lowest approach speed at which the contact is lost, m/s; ∞ if not up to 1 m/s.
    peak_force : float
        At the approach speed, N.
    settling_time : float
        Until the force stays within 5 % of the wanted one, s; NaN if it does not.
    recommended : ControlLoop, optional
        The loop with the largest gains for which 6 dB remain and no law bounces, and with a lower
        approach speed if no gain avoids the bounce; None if refused.
    recommended_factor : float
        Factor on the gain of the recommended loop; NaN if refused.
    recommended_peak, recommended_settling : float
        Peak force [N] and settling time [s] of the recommended loop.
    by_delay : dict of float to GainMargin
        Margins for delays [s], if the delay is unknown.

    Examples
    --------
    >>> import palpate
    >>> from palpate import control_loops
    >>> loop = control_loops.AdmittanceControl(
    ...     virtual_mass=2.0, virtual_damping=80.0, mass=10.0, sample_rate=500.0, delay=4e-3,
    ...     bandwidth=60.0, force_filter=100.0, wanted_force=10.0, approach_speed=0.02,
    ... )
    >>> gains = palpate.gains(palpate.identify("examples/recordings/ball.csv"), loop)
    >>> gains.verdict, round(gains.recommended.virtual_damping, -1)
    ('little-margin', 110.0)
    """

    loop: ControlLoop
    knowledge: ContactKnowledge
    verdict: Safety
    refusal: Refusal | None = None
    gain_margin: GainMargin | None = None
    frequency: float = math.nan
    bounce_speed: float = math.nan
    peak_force: float = math.nan
    settling_time: float = math.nan
    recommended: ControlLoop | None = None
    recommended_factor: float = math.nan
    recommended_peak: float = math.nan
    recommended_settling: float = math.nan
    by_delay: dict[float, GainMargin] | None = None

    @property
    def extrapolated_frequency(self) -> bool:
        """Whether the loop would swing faster than recorded: its damping there is not known."""
        return self.frequency > self.knowledge.damping_limit

    def __str__(self) -> str:
        return "\n".join(self.describe())

    def describe(self) -> list[str]:
        """Return the answer as a sentence and at most ten lines.

        Returns
        -------
        list of str
            The sentence first.
        """
        from palpate.control_loops.texts import describe_gains

        return describe_gains(self)

    def parameters(self) -> str:
        """Return the recommended gains as parameters of ROS 2 controllers, YAML.

        Returns
        -------
        str
            YAML, with the versions of the controllers in its comments.

        Raises
        ------
        InvalidParameterError
            No gain is recommended.
        """
        if self.recommended is None:
            raise InvalidParameterError(f"no gain is recommended: {self.describe()[0]}")
        return self.recommended.parameters()

    def plot(self, *, dark: bool = False, width: float | None = None) -> Any:
        """Draw the answer with :func:`palpate.control_loops.figures.draw_gains`.

        Parameters
        ----------
        dark : bool
            Draw for a dark background. Default: False.
        width : float, optional
            Printed width, m. Default: a page of 11 inches.

        Returns
        -------
        matplotlib.figure.Figure
            Two panels: the onset over the stiffness, and the force after first touch.
        """
        from palpate.control_loops.figures import draw_gains

        return draw_gains(self, dark=dark, width=width)

    def as_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers and text; ``docs/reference/results.md`` has the keys.

        Returns
        -------
        dict
            None for numbers that are not finite.
        """
        by_delay = self.by_delay or {}
        return {
            "controller": self.loop.name,
            "verdict": self.verdict,
            "refusal": self.refusal,
            "sentence": self.describe()[0],
            "recommended": self.recommended and self.recommended.as_dict(),
            "recommended_factor": finite_or_none(self.recommended_factor),
            "gain_margin": self.gain_margin and self.gain_margin.as_dict(),
            "frequency": finite_or_none(self.frequency),
            "recorded_frequency": finite_or_none(self.knowledge.recorded_frequency),
            "recorded_force": finite_or_none(self.knowledge.largest_force),
            "bounce_speed": finite_or_none(self.bounce_speed),
            "peak_force": finite_or_none(self.peak_force),
            "settling_time": finite_or_none(self.settling_time),
            "by_delay": {f"{1e3 * each:g}ms": by_delay[each].as_dict() for each in by_delay},
        }


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
    stiffness, _ = draws.stiffness_and_damping(depth, np.full_like(frequency, highest))
    return stiffness, _LEAST_LOSS * stiffness / highest


def _consistent_onset(
    loop: ControlLoop, draws: LawDraws, depth: Floats, highest: float, law: Any
) -> Onset:
    """Return the onset at whose frequency the law has the stiffness and damping that give it."""
    frequency = np.full_like(depth, highest)
    onset = find_onset(loop, *law(draws, depth, frequency, highest))
    changes = draws.remembers if law is _as_identified else law is _constant_loss
    for _ in range(_ITERATIONS if changes else 0):
        swing = np.where(np.isfinite(onset.frequency), onset.frequency, frequency)
        frequency = np.sqrt(frequency * swing)
        onset = find_onset(loop, *law(draws, depth, frequency, highest))
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
            swings.append((settles * law.onset.gain[0], settles * law.bound))
            fails.append((stays * law.onset.gain[0], stays * law.bound))
        bounces_always = min(bound for _, bound in fails) <= 0.0
        margins = swings if bounces_always else fails
        margin = GainMargin(margins[0][0], min(bound for _, bound in margins))
        touch, bounce_speed = self._first_touch(1.0)
        too_fast = frequency > _FARTHEST * self.knowledge.recorded_frequency
        common = {
            "gain_margin": margin,
            "frequency": frequency,
            "bounce_speed": bounce_speed,
            "peak_force": touch[0],
            "settling_time": touch[1],
        }
        if self.loop.needs_frequency and too_fast:
            return Gains(self.loop, self.knowledge, "refused", Refusal.FREQUENCY, **common)
        bounces = bounce_speed <= self.loop.approach_speed
        factor, recommended = self._recommend(margin.lower_bound)
        after, _ = _Assessment._first_touch(self, factor, recommended, speeds=False)
        return Gains(
            self.loop,
            self.knowledge,
            _verdict(margin.lower_bound, bounces=bounces),
            **common,
            recommended=recommended.scaled(factor),
            recommended_factor=factor,
            recommended_peak=after[0],
            recommended_settling=after[1],
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
        self, factor: float, loop: ControlLoop | None = None, *, speeds: bool = True
    ) -> tuple[tuple[float, float], float]:
        """Return peak force and settling time of the identified law, and the bounce speed."""
        loop = self.loop if loop is None else loop
        law = self.laws[0]
        first = law.draws.first(1)
        tried = np.append(_SPEEDS if speeds else [], loop.approach_speed)
        factors = np.full(len(tried), factor)
        touches = simulate_touches(loop, first, factors, law.duration, speeds=tried)
        settling = float(touches.settling_time[-1])
        settled = not touches.swings[-1] and settling < law.duration
        bouncing = np.sort(tried[touches.bounces])
        speed = float(bouncing[0]) if len(bouncing) else math.inf
        return (float(touches.peak_force[-1]), settling if settled else math.nan), speed

    def _recommend(self, bound: float) -> tuple[float, ControlLoop]:
        """Return the largest safe factor on the gain, and the loop with an approach speed for it.

        6 dB below the bound, and lower where a draw of a law loses the contact; if no lower gain
        avoids that, a lower speed does.
        """
        factor = bound / SAFETY if math.isfinite(bound) else 1.0
        if not any(self._bounces(self.loop, factor)):
            return factor, self.loop
        for lower in (factor * _LOWERED).tolist():
            if not any(self._bounces(self.loop, lower)):
                return lower, self.loop
        slower = _SPEEDS[_SPEEDS < self.loop.approach_speed]
        for speed in slower[::-1].tolist():
            loop = replace(self.loop, approach_speed=speed)
            if not any(self._bounces(loop, factor)):
                return factor, loop
        return factor, replace(self.loop, approach_speed=float(_SPEEDS[0]))

    def _bounces(self, loop: ControlLoop, factor: float) -> Iterator[bool]:
        """Yield for each law whether one of its draws fails at a factor on the gain."""
        count = max(_TRIED // len(self.laws), 1)
        for law in self.laws:
            some = law.draws.first(count)
            touches = simulate_touches(loop, some, np.full(count, factor), law.duration)
            yield bool(touches.fails.any())


def _verdict(bound: float, *, bounces: bool) -> Safety:
    if bounces or bound <= 1.0:
        return "not-safe"
    return "safe" if bound >= SAFETY else "little-margin"
