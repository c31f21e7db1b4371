"""What section VII says of the gain, of β and γ, and of the force from which contact counts."""

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from palpate.contact import Contact
from palpate.estimators import SingleStageRLS
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import (
    PALPATION,
    PVC,
    TAPPING,
    Bench,
    Homogeneous,
    IdealProbe,
    SpaceVaryingMaterial,
)
from palpate.paper.experiment import by_symbol
from palpate.paper.sessions import GATE, START, identified
from palpate.paper.starts import AGREED
from palpate.settings import ContactGate, SelfPerturbation
from palpate.validation import Floats

#: How long the probe stays in a zone, and when it crosses to the other, s.
STAY = PALPATION.dwell
CHANGES = tuple(START + k * STAY for k in (1, 2, 3, 4))
#: The paper's γ, N⁻², by the reading that works.
SENSITIVITY = 2.5
#: β, and how much stiffer the hard zone is, where the one is asked about by the other.
GAINS = (0.005, 0.05, 0.5, 5.0)
#: The stays are shorter there, s, for as much is asked: two of them, and one before.
SHORT = 2.0
CONTRASTS: Mapping[str, float] = {"1.3 times": 0.3, "twice": 1.0, "ten times": 9.0}


def stiffer(by: float) -> Homogeneous:
    """A phantom whose spring and damper are stiffer by a fraction."""
    stiffness, damping, exponent = PVC.law.parameters.tolist()
    return Homogeneous(HuntCrossley((1.0 + by) * stiffness, (1.0 + by) * damping, exponent))


def palpated(by: float, seed: int, seconds: float, stay: float = STAY) -> Contact:
    """An ideal probe on the phantom, whose other zone is stiffer by a fraction."""
    zones = SpaceVaryingMaterial((PVC, stiffer(by)), (0.0,))
    motion = replace(PALPATION, dwell=stay)
    run = Bench(zones, motion, IdealProbe()).run(seed, seconds=seconds)
    return run.contact.window(START)


def correction(result: Identification) -> tuple[Floats, Floats]:
    """Times, and the percentage of its own error that a sample corrects: φᵀΔθ/e = φᵀL.

    Of the single stage, of eqs. 12 and 13: no more than P in the direction of the regressor, for
    φᵀL = φᵀPφ/(λ + φᵀPφ).
    """
    taken, contact = result.trace.taken, result.contact
    stiffness, damping, exponent = result.trace.parameters[taken].T
    known = np.stack([np.log(stiffness), damping / stiffness, exponent])
    depth, speed = contact.penetration[taken][1:], contact.velocity[taken][1:]
    regressor = np.stack([np.ones_like(depth), speed, np.log(depth)])
    error = np.log(contact.force[taken][1:]) - np.sum(regressor * known[:, :-1], axis=0)
    corrected = 100.0 * np.sum(regressor * np.diff(known), axis=0) / error
    return contact.time[taken][1:], corrected


def corrected(name: str, result: Identification) -> dict[str, float]:
    """What is corrected at first, in the half second before the first change, and after each."""
    time, share = correction(result)

    def most(start: float, seconds: float) -> float:
        return float(share[(time >= start) & (time < start + seconds)].max())

    numbers = {
        f"corrected at first {name} [%]": share[:5].max(),
        f"corrected before a change {name} [%]": most(CHANGES[0] - 0.5, 0.5),
    }
    for k, change in enumerate(CHANGES, 1):
        numbers[f"corrected after a change {name} {k} [%]"] = most(change, 0.01)
    return numbers


def time_of_stiffness(
    result: Identification, hard: Homogeneous, changes: tuple[float, ...] = CHANGES
) -> float:
    """Milliseconds until K is within 5 % for the rest of a stay, mean of the changes."""
    time, times = result.contact.time, []
    for k, (start, end) in enumerate(itertools.pairwise((*changes, np.inf)), 1):
        there = result.trace.parameters[(time >= start) & (time < end), 0]
        outside = np.abs(there / (PVC, hard)[k % 2].law.parameters[0] - 1.0) > AGREED
        last = np.flatnonzero(outside)
        times.append(np.nan if outside[-1] else 1.0 + (last[-1] if last.size else -1.0))
    return 1e3 * result.contact.sample_time * float(np.mean(times))


def times_by_gain(seed: int) -> dict[str, float]:
    """How soon K is back, by β and by how much the zones differ."""
    numbers: dict[str, float] = {}
    first, second, end = (START + k * SHORT for k in (1, 2, 3))
    for words, by in CONTRASTS.items():
        contact, hard = palpated(by, seed, end, SHORT), stiffer(by)
        for gain in GAINS:
            perturbed = SingleStageRLS(perturbation=SelfPerturbation(gain, SENSITIVITY))
            time = time_of_stiffness(identified(contact, perturbed), hard, (first, second))
            numbers[f"K back with β = {gain:g}, {words} [ms]"] = time
    return numbers


def thresholds(seed: int) -> dict[str, float]:
    """Tap a phantom, and take for contact what shows any force, or more than ours."""
    run = Bench(PVC, TAPPING, IdealProbe()).run(seed, seconds=12.0)
    contact, inside = run.contact.window(START), run.truth.window(START).penetration > 0.0
    numbers: dict[str, float] = {}
    for least in (0.0, GATE.make_force):
        what, taken = f"force above {least:g} N", contact.force > least
        gate = ContactGate(make_force=least)
        law = identified(contact, SingleStageRLS(), gate=gate).law
        error = 100.0 * np.abs(law.parameters / PVC.law.parameters - 1.0)
        numbers[f"free, but {what} [%]"] = 100.0 * float(np.mean(taken[~inside]))
        numbers[f"contact misjudged by {what} [%]"] = 100.0 * float(np.mean(taken != inside))
        numbers |= by_symbol(f"error by {what}", error, "%")
    return numbers
