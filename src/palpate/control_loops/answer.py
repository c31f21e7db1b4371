"""The answer about gains: verdict, margin, recommended gains, and how they read."""

import enum
import math
from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

from palpate.control_loops.laws import ContactKnowledge
from palpate.control_loops.loop import ControlLoop
from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.validation import finite_or_none, frozen

Safety: TypeAlias = Literal["safe", "little-margin", "not-safe", "refused"]

#: 6 dB, which covers what the laws leave out: on 428 poor recordings of materials without memory a
#: gain this far below the bound neither swung nor bounced, 2 dB below it 2 did.
SAFETY = 10.0 ** (6.0 / 20.0)
#: Slowest approach that is tried, m/s.
SLOWEST = 2e-3


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
    ('little-margin', 80.0)
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
        sentence = _refusal(self) if self.refusal else _sentence(self)
        return [sentence, *_lines(self)]

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

    def as_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers and text; ``docs/reference/formats.md`` has the keys.

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


# The answer in words.

_VERDICTS: Mapping[Safety, str] = {
    "safe": "Safe",
    "little-margin": "Little margin",
    "not-safe": "Not safe",
}


def decibels(factor: float) -> str:
    """Return a factor on the gain in decibels."""
    return f"{20.0 * math.log10(factor):.1f} dB".replace("-", "−")


def format_gains(loop: ControlLoop) -> str:
    """Return the gains with their units."""
    pairs = zip(loop.gain_values().items(), loop.gains.values(), strict=True)
    return ", ".join(
        f"{name.replace('_', ' ')} {rounded(value, 3)} {unit}".rstrip()
        for (name, value), unit in pairs
    )


def _hertz(frequency: float) -> str:
    return f"{rounded(frequency / math.tau, 2)} Hz"


def _speed(speed: float) -> str:
    return f"{rounded(1e3 * speed, 3)} mm/s" if speed < 1.0 else f"{rounded(speed, 3)} m/s"


def _margin(margin: GainMargin) -> str:
    if not math.isfinite(margin.lower_bound):
        return "no gain makes it swing or bounce"
    value = "no limit" if not math.isfinite(margin.value) else decibels(margin.value)
    return f"gain margin {value}, at least {decibels(margin.lower_bound)} with 95 % confidence"


def _sentence(gains: Gains) -> str:
    assert gains.gain_margin is not None
    words = _VERDICTS[gains.verdict]
    if gains.gain_margin.lower_bound <= 0.0:
        return f"{words}: the loop bounces or swings at any gain"
    text = f"{words}: {_margin(gains.gain_margin)}"
    if math.isfinite(gains.frequency):
        recorded = _hertz(gains.knowledge.recorded_frequency)
        text += f"; it would swing at {_hertz(gains.frequency)}, recorded to {recorded}"
    if gains.bounce_speed <= gains.loop.approach_speed:
        text += f"; at {_speed(gains.loop.approach_speed)} it bounces"
    return text


def _refusal(gains: Gains) -> str:
    loop = gains.loop
    knowledge = gains.knowledge
    match gains.refusal:
        case Refusal.STIFFNESS:
            why = "the stiffness is not to be trusted: palpate diagnose says what to record"
        case Refusal.FORCE:
            largest = rounded(knowledge.largest_force, 3)
            why = (
                f"the wanted force is {rounded(loop.wanted_force, 3)} N, and only {largest} N were "
                "recorded: press at least a quarter as hard"
            )
        case Refusal.FREQUENCY:
            why = (
                f"it would swing at {_hertz(gains.frequency)}, and the motion was recorded to "
                f"{_hertz(knowledge.recorded_frequency)}: record a faster motion"
            )
        case _:
            why = "the delay from measurement to command is needed: pass --delay, or --command"
    return f"Refused: {why}"


def _lines(gains: Gains) -> list[str]:
    loop = gains.loop
    if gains.by_delay:
        return [
            f"with a delay of {1e3 * delay:g} ms: {_margin(margin)}"
            for delay, margin in gains.by_delay.items()
        ]
    lines = [f"{loop.title}: {format_gains(loop)}"]
    if gains.gain_margin is None:
        return lines
    lines += [_touch(loop.approach_speed, gains.peak_force, gains.settling_time)]
    if gains.bounce_speed <= SLOWEST:
        lines.append("contact is lost at any speed of approach")
    elif math.isfinite(gains.bounce_speed):
        lines.append(f"contact is first lost at an approach of {_speed(gains.bounce_speed)}")
    else:
        lines.append("contact is not lost up to 1 m/s")
    if gains.extrapolated_frequency:
        lines.append(
            "the damping beyond the recorded frequencies is not known; the bound is the least of "
            "the identified one, one that falls with the frequency, and none"
        )
    if len(gains.knowledge.laws) > 1:
        lines.append(f"the bound is the least over {len(gains.knowledge.laws)} laws")
    if loop.wanted_force > 1.25 * gains.knowledge.largest_force:
        lines.append("with care: the wanted force is above the recorded ones")
    if gains.recommended is None:
        return lines
    best = gains.recommended
    lines.append(
        f"recommended (6 dB, no bounce): {format_gains(best)}; "
        f"{rounded(gains.recommended_factor, 3)} × the gain"
    )
    if best.approach_speed < loop.approach_speed:
        lines.append(f"no gain avoids the bounce: approach at {_speed(best.approach_speed)}")
    lines.append(
        "then " + _touch(best.approach_speed, gains.recommended_peak, gains.recommended_settling)
    )
    return lines


def _touch(speed: float, peak: float, settling: float) -> str:
    text = f"touching at {_speed(speed)}: peak force {rounded(peak, 3)} N"
    if math.isfinite(settling):
        return f"{text}, settled after {rounded(settling, 2)} s"
    return f"{text}, and the force does not stay within 5 % of the wanted one"
