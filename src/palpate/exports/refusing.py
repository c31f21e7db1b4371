"""When an export is refused, and what it warns of, whichever the engine."""

import math

from palpate.digits import rounded
from palpate.exports.comparing import Compared
from palpate.exports.engine import Fragment
from palpate.exports.nearest import Nearest
from palpate.exports.source import Source
from palpate.exports.text import length, percent

#: Beyond it, %, an engine has another contact than the one that was identified.
MOST_PERCENT = 5.0
#: Beyond it, %, a rebound is another too, which a force that is right does not show.
REBOUND_PERCENT = 5.0
# The same number in another arithmetic differs by less, percentage points.
_AS_PREDICTED = 1.0


def refusals(
    source: Source, nearest: Nearest, fragment: Fragment, compared: Compared
) -> tuple[str, ...]:
    """Return why an export should not be used; nothing where it may be."""
    return (*_of_the_result(source, nearest), *fragment.refusals, *_of_engine(fragment, compared))


def warnings(
    source: Source, nearest: Nearest, fragment: Fragment, compared: Compared
) -> tuple[str, ...]:
    """Return what a user of an export should know."""
    return (
        *_warnings_of_the_result(source, nearest),
        *fragment.warnings,
        *_warnings_of_engine(source, fragment, compared),
    )


def _of_the_result(source: Source, nearest: Nearest) -> list[str]:
    found = []
    if source.verdict is not None and source.verdict.overall == "do-not-trust":
        found.append(f"the diagnosis says do not trust{_because(source)}")
    if not source.law.remembers and any(each < 0.0 for each in _strengths(source)):
        found.append(
            f"the law has a negative stiffness or damping, and makes energy: {nearest.which} it is "
            f"another, by {percent(nearest.error_percent)} of force"
        )
    return found


def _of_engine(fragment: Fragment, compared: Compared) -> list[str]:
    found = []
    if not compared.percent <= MOST_PERCENT:  # which NaN is not either
        found.append(
            f"the force of the engine is off by {percent(compared.percent)}, more than "
            f"{MOST_PERCENT:g} %, {'replayed' if compared.replayed else 'as predicted'}"
        )
    limit, step = fragment.largest_step, fragment.asked.time_step
    if limit is not None and step >= limit:
        found.append(
            f"the simulation is unstable at a time step of {_ms(step)}: it has to be below "
            f"{_ms(limit)}"
        )
    return found


def _warnings_of_the_result(source: Source, nearest: Nearest) -> list[str]:
    found = []
    verdict = source.verdict
    if verdict is None:
        found.append("a law alone: no recording says how far it is to be trusted")
    elif verdict.overall == "with-care":
        found.append(f"the diagnosis says with care{_because(source)}")
    if verdict is not None and verdict.overall == "trust" and verdict.damping != "trust":
        found.append(f"the damping alone is {verdict.damping}: so are impacts")
    found += [f"flagged: {flag}" for flag in source.flags]
    if nearest.which and source.law.remembers:
        found.append(
            f"the law remembers, which no engine does: this is {nearest.which}, "
            f"{percent(nearest.error_percent)} of force from it on this motion, and more at "
            "other speeds; restitution is that of this one"
        )
    elif nearest.which:
        found.append(
            f"the law is none that engines have: this is {nearest.which}, "
            f"{percent(nearest.error_percent)} of force from it"
        )
    return found


def _warnings_of_engine(source: Source, fragment: Fragment, compared: Compared) -> list[str]:
    found = []
    if abs(compared.rebound_percent) > REBOUND_PERCENT:
        found.append(
            f"impacts will be wrong: a restitution of {rounded(compared.rebound, 3)}, where the "
            f"law has {rounded(compared.drop.restitution, 3)}"
        )
    if compared.drop.speed > source.motion.fastest and source.verdict is not None:
        found.append(
            f"the law was identified at speeds to {length(source.motion.fastest, 2)}/s: an "
            f"impact at {rounded(compared.drop.speed, 2)} m/s is beyond the recording"
        )
    limit, step = fragment.largest_step, fragment.asked.time_step
    if limit is not None and 0.5 * limit < step < limit:
        found.append(
            f"a time step of {_ms(step)} is above half of the {_ms(limit)} from which on the "
            "simulation is unstable"
        )
    if compared.replayed and abs(compared.percent - compared.predicted_percent) > _AS_PREDICTED:
        found.append(
            f"the engine was off by {percent(compared.percent)}, and predicted was "
            f"{percent(compared.predicted_percent)}: its version may differ from those known"
        )
    return found


def _because(source: Source) -> str:
    return f": {source.reason}" if source.reason else ""


def _strengths(source: Source) -> list[float]:
    """Which of the law's parameters must not be below 0; of two springs one may."""
    values = source.law.as_dict()
    springs = [] if "quadratic_stiffness" in values else ["stiffness"]
    return [values[name] for name in (*springs, "damping") if name in values]


def _ms(seconds: float) -> str:
    return f"{rounded(1e3 * seconds, 2)} ms" if math.isfinite(seconds) else "any"
