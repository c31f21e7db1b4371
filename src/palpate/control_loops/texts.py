"""The answer in words: one sentence and at most ten lines."""

import math
from collections.abc import Mapping

from palpate.control_loops.loop import ControlLoop
from palpate.control_loops.margins import GainMargin, Gains, Refusal, Safety
from palpate.digits import rounded

_VERDICTS: Mapping[Safety, str] = {
    "safe": "Safe",
    "little-margin": "Little margin",
    "not-safe": "Not safe",
}
_LABELS = {"virtual_mass": "M", "virtual_damping": "D", "stiffness": "K", "damping": "D"}


def decibels(factor: float) -> str:
    """Return a factor on the gain in decibels."""
    return f"{20.0 * math.log10(factor):.1f} dB"


def describe_gains(gains: Gains) -> list[str]:
    """Return the answer as a sentence and at most ten lines."""
    sentence = _refusal(gains) if gains.refusal else _sentence(gains)
    return [sentence, *_lines(gains)]


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
    if math.isfinite(gains.bounce_speed):
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
    return f"{text}, it does not settle"
