"""Simulated recordings, identification with the paper's settings, initial values, convergence.

Every identification keeps its full trace, with the parameters after each sample.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

import palpate
from palpate import lab
from paper.choices import Choice, chosen
from paper.experiment import Floats

#: Time at which the motion begins, s; in the paper contact is made at 2 s.
START = 2.0
GATE = Choice().gate
#: The paper computes in SI.
SI = palpate.Scale()
#: Initial covariances, equal for all methods, for the comparison of convergence.
SAME_COVARIANCES = (10.0, 1e3, 1e6)
#: Small initial values as in footnote 1: a stiffness of 0 has no logarithm.
SMALL = 0.1
#: The paper's high initial values are "two or three times" the steady state.
HIGH = 2.5
#: Results from different initial values that differ by less have converged (footnote 3).
AGREED = 0.05
NO_START = "no start"
BALL_LAW: palpate.HuntCrossley = lab.BALL.law  # type: ignore[assignment]  # its law is Hunt–Crossley

Starts = Mapping[str, palpate.ForceLaw]
Results = Mapping[str, palpate.Identification]
Method = type[palpate.ContactEstimator]


def session(
    material: str, trajectory: str | lab.Trajectory, seed: int, seconds: float = 12.0
) -> lab.Measurement:
    """Press a material of the lab with the twin pantograph; cached, since experiments share it."""
    motion = lab.TRAJECTORIES[trajectory] if isinstance(trajectory, str) else trajectory
    return _measurement(material, motion, seed, seconds)  # type: ignore[arg-type]  # hashable


# The number of recordings that all experiments need in one seed; each takes megabytes.
@lru_cache(maxsize=32)
def _measurement(
    material: str, motion: lab.Trajectory, seed: int, seconds: float
) -> lab.Measurement:
    return lab.Bench(lab.MATERIALS[material], motion).run(seed, seconds=seconds)


def simulated_contact(
    material: str, trajectory: str | lab.Trajectory, seed: int, seconds: float | None = None
) -> palpate.Contact:
    """Return the recorded contact after the pause; default: as long as is chosen."""
    length, used = chosen().recorded(seconds, one_sine=trajectory == "one-sine")
    return _after_pause(session(material, trajectory, seed, length).contact, used)


def ideal_contact(
    material: lab.Material, motion: lab.Trajectory, seed: int, seconds: float | None = None
) -> palpate.Contact:
    """Press a material with an ideal probe, and return the contact after the pause."""
    _, used = chosen().recorded(seconds, one_sine=False)
    run = lab.Bench(material, motion, lab.IdealProbe()).run(seed, seconds=used)
    return _after_pause(run.contact, used)


def _after_pause(recorded: palpate.Contact, end: float) -> palpate.Contact:
    velocity = chosen().velocity(recorded)
    contact = recorded if velocity is recorded.velocity else replace(recorded, velocity=velocity)
    return contact.window(START, end)


def identified(contact: palpate.Contact, kind: Method, **settings: Any) -> palpate.Identification:
    """Identify from samples above the noise, including outliers; the paper's methods in SI."""
    paper = {"gate": chosen().gate, "outlier_rejection": False, **chosen().settings_of(kind)}
    if issubclass(kind, palpate.RecursiveLeastSquaresEstimator):
        paper["scale"] = SI
    return palpate.identify(contact, kind(**{**paper, **settings}), trace="full")


def off(values: Any, truth: Any) -> Floats:
    """Return the errors of values, in percent of the truth."""
    return np.asarray(100.0 * np.abs(np.asarray(values) / truth - 1.0), dtype=np.float64)


def truth_of(material: str) -> Floats:
    """Return the true K, B and n of a Hunt–Crossley material of the lab."""
    truth = lab.MATERIALS[material].describe()
    return np.array([truth[name] for name in palpate.HuntCrossley.names()])


def taken(result: palpate.Identification) -> Floats:
    """Return the parameters after every sample used; shape (k, p)."""
    return result.trace.parameters[result.trace.taken]


def starts_of(contact: palpate.Contact, kind: Method, **settings: Any) -> Starts:
    """Return the initial values of Tables I, III and V for a method, from the contact itself.

    Set I has small values, set II the same with n = 2, set III 2.5 times the stiffness and damping
    in the steady state of the single stage from set I, for both Hunt–Crossley methods. The linear
    models have a low and a high set.
    """
    if kind.law_type is not palpate.HuntCrossley:
        low = kind.law_type.from_parameters([SMALL] * len(kind.law_type.symbols))
        return {
            "low": low,
            "high": kind.law_type.from_parameters(_high(contact, kind, low, **settings)),
        }
    small = palpate.HuntCrossley(K=SMALL, B=SMALL, n=1.0)
    stiffness, damping, _ = _high(contact, palpate.SingleStageRLS, small, **settings)
    third = palpate.HuntCrossley(K=stiffness, B=damping, n=1.0)
    return {"I": small, "II": palpate.HuntCrossley(K=SMALL, B=SMALL, n=2.0), "III": third}


def _high(
    contact: palpate.Contact, kind: Method, start: palpate.ForceLaw, **settings: Any
) -> list[float]:
    """Return 2.5 times the mean of each parameter over the second half of the contact."""
    known = taken(identified(contact, kind, initial=start, **settings))
    return [float(each) for each in HIGH * known[len(known) // 2 :].mean(axis=0)]


def names_of_starts(kind: Method) -> tuple[str, ...]:
    """Return the names of a method's initial values in :func:`starts_of`."""
    if kind is palpate.VariableProjection:
        return (NO_START,)
    return ("I", "II", "III") if kind.law_type is palpate.HuntCrossley else ("low", "high")


def from_starts(
    contact: palpate.Contact, kind: Method, starts: Starts, **settings: Any
) -> dict[str, palpate.Identification]:
    """Identify one contact from each set of initial values."""
    return {
        name: identified(contact, kind, initial=law, **settings) for name, law in starts.items()
    }


def spread(results: Iterable[palpate.Identification]) -> Floats:
    """Return the relative range over the initial values, after each sample in contact."""
    every = np.stack([taken(result) for result in results])
    size = np.abs(every.mean(axis=0))
    return np.asarray(np.ptp(every, axis=0) / np.maximum(size, 1e-300), dtype=np.float64)


def convergence_times(results: Iterable[palpate.Identification]) -> Floats:
    """Return the time, s, until all initial values give a parameter within 5 %, and stay so.

    As in footnote 3 of the paper; NaN if they never do. Agreement does not imply accuracy.
    """
    every: Sequence[palpate.Identification] = list(results)
    return _settling_times(spread(every) > AGREED, every[0])


def times_to(result: palpate.Identification, target: Any) -> Floats:
    """Return the time in contact, s, until each parameter stays within 5 % of ``target``."""
    return _settling_times(np.abs(taken(result) / np.asarray(target) - 1.0) > AGREED, result)


def _settling_times(outside: Any, result: palpate.Identification) -> Floats:
    """Return the time in contact, s, after which no sample is outside; NaN if the last one is."""
    elapsed = np.cumsum(result.contact.time_steps[result.trace.taken])
    last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)
    times = np.where(outside.any(axis=0), elapsed[last], 0.0)
    times[outside[-1]] = np.nan
    return np.asarray(times, dtype=np.float64)
