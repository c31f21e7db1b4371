"""The verdict on faulty samples, and whether palpate warns."""

from dataclasses import dataclass

import numpy as np

from benchmarks.law_truths import DT, GATE, UNITS, law_of, motion, noise
from benchmarks.report import Row, Section
from palpate import Contact, Identification, ViscoelasticContact, identify

PERCENT = 100.0
# A diagnosis takes a third of a second.
MOST_SEEDS = 20


@dataclass(frozen=True)
class Trap:
    """A fault of the samples."""

    name: str
    late: float = 0.0  # of the force, s
    surface: float = 0.0  # above the true surface, m
    samples: int | None = None  # only the first ones


TRAPS = (
    Trap("nothing wrong"),
    Trap("force late by 1 ms", late=1e-3),
    Trap("force late by 5 ms", late=5e-3),
    Trap("surface 0.1 mm too high", surface=0.1e-3),
    Trap("surface 0.5 mm too high", surface=0.5e-3),
    Trap("surface 0.5 mm too low", surface=-0.5e-3),
    Trap("surface 30 mm too high: n at the edge", surface=30e-3),
    Trap("approach alone, at one speed", samples=395),
)


def trapped(trap: Trap, damping: str, seed: int) -> Identification:
    """Identify a motion with a fault, at 40 dB."""
    x, v = motion(seed)
    force = law_of(damping, 0.0).force_along(x, v, DT)
    deviation = float(np.sqrt(np.mean(force[x > 0.0] ** 2))) / 100.0
    force = np.roll(force, round(trap.late / DT)) + deviation * noise(seed, x.size, 0.0)
    some = slice(trap.samples)
    contact = Contact(
        DT * np.arange(x.size)[some],
        penetration=x[some] + trap.surface,
        velocity=v[some],
        force=force[some],
    )
    return identify(contact, ViscoelasticContact(gate=GATE, scale=UNITS))


def warned_of(result: Identification) -> bool:
    """Return whether palpate warns: by the diagnosis, or by a flag of law, estimate or verdict."""
    flags = [flag for flag in result.flags if "outlier" not in flag]
    return result.diagnosis.verdict.overall != "trust" or bool(flags)


def measure_traps(seeds: range) -> Section:
    """Measure how often memory is selected, errors of K′ and B′ at 11 rad/s, and warnings."""
    some = seeds[:MOST_SEEDS]
    rows = []
    for damping in ("hunt-crossley", "half-space"):
        exact = law_of(damping, 0.0).dynamic_stiffness(10e-3, 11.0)
        for trap in TRAPS:
            results = [trapped(trap, damping, seed) for seed in some]
            laws = [result.estimate.law for result in results]
            dynamic = np.array([law.dynamic_stiffness(10e-3, 11.0) for law in laws])
            stiffness = float(np.sqrt(np.mean((dynamic.real / exact.real - 1.0) ** 2)))
            damper = float(np.sqrt(np.mean((dynamic.imag / exact.imag - 1.0) ** 2)))
            name = f"{damping}, {trap.name}"
            called = float(np.mean([law.remembers for law in laws]))
            warned = float(np.mean([warned_of(each) for each in results]))
            rows += [
                Row(f"{name}: memory", PERCENT * called, "%"),
                Row(f"{name}: K′, rms error", PERCENT * stiffness, "%"),
                Row(f"{name}: B′, rms error", PERCENT * damper, "%"),
                Row(f"{name}: warned", PERCENT * warned, "%"),
            ]
    return Section(f"Traps, 40 dB, {len(some)} seeds", rows)
