"""An estimator for a whole contact: what was asked for, what the data choose, and the replay."""

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.estimate import Estimate
from palpate.estimators import (
    ESTIMATORS,
    ContactEstimator,
    VariableProjection,
    estimator_named,
)
from palpate.preparation.resolution import suggest_surface_deviation
from palpate.preparation.suggestions import choose_gate, suggest_scale
from palpate.settings import OutlierRejection
from palpate.stages import timed
from palpate.trace import Trace, Traced, thinned
from palpate.validation import shown

_LOGGER = logging.getLogger(__name__)


def choices(contact: Contact, given: ContactEstimator) -> dict[str, Any]:
    """What an estimator leaves open and the data can choose."""
    settings = given.settings
    ways: dict[str, Callable[[Contact], object]] = {
        "scale": suggest_scale,
        "outlier_rejection": lambda _: OutlierRejection(),
        "sample_time": lambda contact: contact.sample_time,
    }
    if not given.chooses_samples:
        ways["gate"] = choose_gate
    # A search for the surface has the free approach.
    if given.knows_offset and settings.get("surface") is None:
        ways["offset_deviation"] = lambda contact: contact.tare_deviation
        ways["surface_deviation"] = _surface_deviation
    return {
        name: choose(contact)
        for name, choose in ways.items()
        if name in settings and settings[name] is None
    }


def _surface_deviation(contact: Contact) -> float | None:
    """How well the surface is known: as it was found, and as the position is resolved."""
    resolved = suggest_surface_deviation(contact)
    if contact.surface_deviation is None:
        return resolved
    return math.hypot(contact.surface_deviation, resolved or 0.0)


def estimator_of(given: ContactEstimator | str | None) -> ContactEstimator:
    """An estimator as it was asked for: itself, by its name, or the default."""
    if given is None:
        return VariableProjection()
    if isinstance(given, str):
        return estimator_named(given)()
    if not isinstance(given, ContactEstimator):
        raise InvalidParameterError(
            f"estimator must be a ContactEstimator or one of {', '.join(ESTIMATORS)}, "
            f"not {shown(given)}"
        )
    return given


def with_surface_off(contact: Contact, estimator: ContactEstimator, deviation: float) -> Estimate:
    """What an estimator makes of a contact whose surface lies deeper, by a deviation in m."""
    replayed(replace(contact, penetration=contact.penetration - deviation), estimator, trace=False)
    return estimator.estimate()


@timed("replay")
def replayed(contact: Contact, estimator: ContactEstimator, trace: Traced) -> Trace:
    """Replay a contact, a segment at a time; the estimator has then learned all of it.

    The trace has the contact's clock, thinned as requested.
    """
    _LOGGER.debug("settings: %s", _in_words(estimator))
    steps, segments = contact.time_steps, list(contact.segments())
    after = thinned(trace, contact.time, segments)
    traces = []
    for part in segments:
        estimator.leave_contact()
        channels = contact.penetration[part], contact.velocity[part], contact.force[part]
        at = None
        if after is not None:
            first, last = np.searchsorted(after, (part.start, part.stop))
            at = after[first:last] - part.start
        traces.append(estimator.replay(*channels, steps[part], at=at))
    settle = getattr(estimator, "settle", None)
    if settle is not None:  # its answer would be of most of the samples only
        settle()
    one = len(traces) == 1
    whole = traces[0] if one else Trace.joined(traces, len(estimator.law_type.symbols))
    return replace(whole, time=contact.time if after is None else contact.time[after])


def _in_words(estimator: ContactEstimator) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in estimator.settings.items())
