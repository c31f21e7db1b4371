"""Sessions at the laboratory's rig, identification as the paper sets it, starts and convergence.

Everything here is sample by sample: each identification asks for the full trace.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

import palpate
from palpate import lab
from palpate.force_laws import Floats

#: When the command leaves its pause, s; the paper's clock, in which contact is made at 2 s.
START = 2.0
#: Force of ten times its noise, which keeps the bias of the logarithm under 0.5 %.
GATE = palpate.ContactGate(minimum_penetration=0.1e-3, make_force=0.5)
#: The paper computes in SI.
SI = palpate.Scale()
#: Initial covariances, the same for every method, by which speeds are compared.
SAME_COVARIANCES = (10.0, 1e3, 1e6)
#: Small values by footnote 1: a stiffness of 0 has no logarithm.
SMALL = 0.1
#: The paper's high starts are "two or three times" the steady state.
HIGH = 2.5
#: Starts that differ by less than this have converged, footnote 3.
AGREED = 0.05
NO_START = "no start"
BALL_LAW: palpate.HuntCrossley = lab.BALL.law  # type: ignore[assignment]  # the ball is one

Starts = Mapping[str, palpate.ForceLaw]
Results = Mapping[str, palpate.Identification]
Method = type[palpate.ContactEstimator]


def session(
    material: str, trajectory: str | lab.Trajectory, seed: int, seconds: float = 12.0
) -> lab.Measurement:
    """Press a material of the lab with the twin pantograph; kept, for experiments share it."""
    motion = lab.TRAJECTORIES[trajectory] if isinstance(trajectory, str) else trajectory
    return _measurement(material, motion, seed, seconds)  # type: ignore[arg-type]  # it is hashable


# As many as the experiments of a group press in one seed, and no more: each is megabytes.
@lru_cache(maxsize=16)
def _measurement(
    material: str, motion: lab.Trajectory, seed: int, seconds: float
) -> lab.Measurement:
    return lab.Bench(lab.MATERIALS[material], motion).run(seed, seconds=seconds)


def simulated_contact(
    material: str, trajectory: str | lab.Trajectory, seed: int, seconds: float = 12.0
) -> palpate.Contact:
    """Return the part of a session after the pause, as recorded."""
    return session(material, trajectory, seed, seconds).contact.window(START)


def ideal_contact(
    material: lab.Material, motion: lab.Trajectory, seed: int, seconds: float = 12.0
) -> palpate.Contact:
    """Press a material with a probe that follows its command, and return the same part."""
    run = lab.Bench(material, motion, lab.IdealProbe()).run(seed, seconds=seconds)
    return run.contact.window(START)


def identified(contact: palpate.Contact, kind: Method, **settings: Any) -> palpate.Identification:
    """Identify on the samples above the noise, outliers too; the paper's methods in SI."""
    paper = {"gate": GATE, "outlier_rejection": False}
    if issubclass(kind, palpate.RecursiveLeastSquaresEstimator):
        paper["scale"] = SI
    return palpate.identify(contact, kind(**{**paper, **settings}), trace="full")


def off(values: Any, truth: Any) -> Floats:
    """How far values are from the truth, in percent of it."""
    return np.asarray(100.0 * np.abs(np.asarray(values) / truth - 1.0), dtype=np.float64)


def truth_of(material: str) -> Floats:
    """Return K, B and n of a material of the lab that follows Hunt and Crossley."""
    truth = lab.MATERIALS[material].describe()
    return np.array([truth[name] for name in palpate.HuntCrossley.names()])


def taken(result: palpate.Identification) -> Floats:
    """Parameters after every sample that was taken; shape (k, p)."""
    return result.trace.parameters[result.trace.taken]


def starts_of(contact: palpate.Contact, kind: Method) -> Starts:
    """Return the starts of Tables I, III and V for a method, from the contact itself.

    Set I is small values, set II the same with n = 2, set III 2.5 times the stiffness and damping
    in the steady state from set I; both Hunt–Crossley methods start alike, from the steady state
    of the single stage. The linear models start low and high.
    """
    if kind.law_type is not palpate.HuntCrossley:
        low = kind.law_type(*[SMALL] * len(kind.law_type.symbols))
        return {"low": low, "high": kind.law_type(*_high(contact, kind, low))}
    small = palpate.HuntCrossley(SMALL, SMALL, 1.0)
    stiffness, damping, _ = _high(contact, palpate.SingleStageRLS, small)
    third = palpate.HuntCrossley(stiffness, damping, 1.0)
    return {"I": small, "II": palpate.HuntCrossley(SMALL, SMALL, 2.0), "III": third}


def _high(contact: palpate.Contact, kind: Method, start: palpate.ForceLaw) -> list[float]:
    """So many times the average of each parameter over the second half of the contact."""
    known = taken(identified(contact, kind, initial=start))
    return [float(each) for each in HIGH * known[len(known) // 2 :].mean(axis=0)]


def names_of_starts(kind: Method) -> tuple[str, ...]:
    """Return what :func:`starts_of` calls the starts of a method, and that one has none."""
    if kind is palpate.VariableProjection:
        return (NO_START,)
    return ("I", "II", "III") if kind.law_type is palpate.HuntCrossley else ("low", "high")


def from_starts(
    contact: palpate.Contact, kind: Method, starts: Starts, **settings: Any
) -> dict[str, palpate.Identification]:
    """Identify one contact from each start."""
    return {
        name: identified(contact, kind, initial=law, **settings) for name, law in starts.items()
    }


def spread(results: Iterable[palpate.Identification]) -> Floats:
    """Largest difference between starts over their mean size, sample by sample in contact."""
    every = np.stack([taken(result) for result in results])
    size = np.abs(every.mean(axis=0))
    return np.asarray(np.ptp(every, axis=0) / np.maximum(size, 1e-300), dtype=np.float64)


def convergence_times(results: Iterable[palpate.Identification]) -> Floats:
    """Seconds of contact until all starts agree on a parameter within 5 %, and stay so.

    Footnote 3 of the paper; NaN for a parameter on which they never do. That starts agree does not
    make them right.
    """
    every: Sequence[palpate.Identification] = list(results)
    return _settling_times(spread(every) > AGREED, every[0])


def times_to(result: palpate.Identification, target: Any) -> Floats:
    """Seconds of contact until each parameter is within 5 % of ``target`` for good."""
    return _settling_times(np.abs(taken(result) / np.asarray(target) - 1.0) > AGREED, result)


def _settling_times(outside: Any, result: palpate.Identification) -> Floats:
    """Seconds of contact after which no sample of a column is outside; NaN where the last is."""
    elapsed = np.cumsum(result.contact.time_steps[result.trace.taken])
    last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)
    times = np.where(outside.any(axis=0), elapsed[last], 0.0)
    times[outside[-1]] = np.nan
    return np.asarray(times, dtype=np.float64)
