"""Where the paper's methods start, and how soon they have forgotten it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import (
    ContactEstimator,
    RecursiveLeastSquaresEstimator,
    SingleStageRLS,
)
from palpate.force_laws import ExtendedKelvinVoigt, ForceLaw, HuntCrossley, KelvinVoigt
from palpate.identification import Identification
from palpate.paper.sessions import identified
from palpate.validation import Floats

#: Small values by footnote 1: a stiffness of 0 has no logarithm.
SMALL = 0.1
#: The paper's high starts are "two or three times" the steady state.
HIGH = 2.5
#: Starts that differ by less than this have converged, footnote 3.
AGREED = 0.05

Starts = Mapping[str, ForceLaw]


def starts_of(contact: Contact, kind: type[RecursiveLeastSquaresEstimator]) -> Starts:
    """Return the starts of Tables I, III and V for a method, from the contact itself.

    Set I is small values, set II the same with n = 2, set III 2.5 times the stiffness and damping
    in the steady state from set I; both Hunt–Crossley methods start alike, from the steady state
    of the single stage. The linear models start low and high.

    Parameters
    ----------
    contact : Contact
        The data that the starts are for.
    kind : type
        A class of recursive estimator.
    """
    if kind.law_type is HuntCrossley:
        small = HuntCrossley(SMALL, SMALL, 1.0)
        stiffness, damping, _ = steady_state(identified(contact, SingleStageRLS(initial=small)))
        return {
            "I": small,
            "II": HuntCrossley(SMALL, SMALL, 2.0),
            "III": HuntCrossley(HIGH * stiffness, HIGH * damping, 1.0),
        }
    low: ForceLaw = KelvinVoigt(SMALL, SMALL)
    if kind.law_type is ExtendedKelvinVoigt:
        low = ExtendedKelvinVoigt(SMALL, SMALL, SMALL)
    steady = steady_state(identified(contact, kind(initial=low)))
    return {"low": low, "high": kind.law_type(*(HIGH * steady).tolist())}


def names_of_starts(kind: type[ContactEstimator]) -> tuple[str, ...]:
    """Return what :func:`starts_of` calls the starts of a method."""
    return ("I", "II", "III") if kind.law_type is HuntCrossley else ("low", "high")


def steady_state(result: Identification) -> Floats:
    """Average of each parameter over the second half of the contact, SI."""
    known = result.trace.parameters[result.trace.taken]
    average: Floats = known[len(known) // 2 :].mean(axis=0)
    return average


def from_starts(
    contact: Contact,
    kind: type[RecursiveLeastSquaresEstimator],
    starts: Starts,
    **settings: Any,
) -> dict[str, Identification]:
    """Identify one contact from each start."""
    return {
        name: identified(contact, kind(initial=law, **settings)) for name, law in starts.items()
    }


def spread(results: Sequence[Identification]) -> Floats:
    """Largest difference between starts over their mean size, sample by sample in contact."""
    taken = results[0].trace.taken
    every = np.stack([result.trace.parameters[taken] for result in results])
    size = np.abs(every.mean(axis=0))
    apart: Floats = np.ptp(every, axis=0)
    return np.asarray(apart / np.maximum(size, 1e-300), dtype=np.float64)


def convergence_times(results: Sequence[Identification]) -> Floats:
    """Seconds of contact until all starts agree on a parameter within 5 %, and stay so.

    Footnote 3 of the paper; NaN for a parameter on which they never do. That starts agree does not
    make them right.
    """
    apart = spread(results) > AGREED
    return settling_times(apart, results[0])


def settling_times(outside: Any, result: Identification) -> Floats:
    """Seconds of contact after which no sample of a column is outside; NaN where the last is."""
    steps = result.contact.time_steps[result.trace.taken]
    elapsed = np.cumsum(steps)
    last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)
    times = np.where(outside.any(axis=0), elapsed[last], 0.0)
    times[outside[-1]] = np.nan
    return np.asarray(times, dtype=np.float64)


def times_to(result: Identification, target: Any, within: float = AGREED) -> Floats:
    """Seconds of contact until each parameter is within a share of ``target`` for good."""
    known = result.trace.parameters[result.trace.taken]
    return settling_times(np.abs(known / np.asarray(target) - 1.0) > within, result)
