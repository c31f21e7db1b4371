"""Random robots, loops and materials, and recordings of them, each by its seed."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import palpate
from palpate import control_loops, lab
from palpate.lab.design import Motion

Random = np.random.Generator
#: Materials: the law, and the depths at which a loop rests, m.
MATERIALS = {
    "ball": ((2000.0, 1.0, 2000.0, 1.0), (2e-3, 8e-3)),
    "sponge": ((300.0, 1.0, 3000.0, 1.0), (3e-3, 15e-3)),
    "PVC": ((1e5, 2.0, 2e5, 2.0), (3e-3, 12e-3)),
    "inclusion": ((3e5, 2.0, 3e5, 2.0), (3e-3, 10e-3)),
    "gel": ((2e4, 1.5, 4e4, 1.5), (2e-3, 10e-3)),
    "rubber pad": ((1.5e4, 1.0, 40.0, 0.0), (0.5e-3, 2e-3)),
    "tissue": ((2e4, 1.5, 300.0, 0.75), (2e-3, 10e-3)),
}
#: Steps of time, s, that every delay is a multiple of.
STEP = 2.5e-4
_FIRST = 8_100_000  # of the seeds


@dataclass(frozen=True)
class Case:
    """A loop and the material that it touches."""

    seed: int
    material: str
    law: palpate.GeneralisedHuntCrossley
    loop: Any  # its fields are those of its class
    depth: float

    @property
    def duration(self) -> float:
        """Time in which the loop settles or not, s."""
        return float(np.clip(2.5 * self.depth / self.loop.approach_speed, 2.5, 5.0))


def log_uniform(random: Random, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


def _loop(
    random: Random, kind: int, force: float, speed: float, delay: float
) -> control_loops.ControlLoop:
    mass = log_uniform(random, 0.3, 10.0)
    corner = float(random.choice([20.0, 50.0, 100.0, 200.0]))
    common = {
        "mass": mass,
        "sample_rate": float(random.choice([125.0, 250.0, 500.0, 1000.0])),
        "delay": delay,
        "tool_mass": float(random.choice([0.0, 0.05, 0.2])) * mass,
        "wanted_force": force,
        "approach_speed": speed,
    }
    if kind == 0:
        virtual = log_uniform(random, 0.5, 10.0)
        return control_loops.AdmittanceControl(
            **common,
            virtual_mass=virtual,
            virtual_damping=virtual * random.uniform(8.0, 50.0),
            bandwidth=2.0 * math.pi * log_uniform(random, 3.0, 20.0),
            force_filter=corner,
        )
    if kind == 1:
        damping = 2.0 * random.uniform(0.5, 1.0) * math.sqrt(500.0 * mass)
        friction = mass * random.uniform(0.0, 4.0)
        return control_loops.ImpedanceControl(
            **common, stiffness=500.0, damping=damping, friction=friction
        )
    return control_loops.ForceControl(
        **common,
        proportional=0.5,
        integral=0.5 * log_uniform(random, 2.0, 10.0),
        force_filter=corner,
        friction=mass * random.uniform(5.0, 20.0),
    )


def soft_case(seed: int, *, relaxing: bool = False) -> Case:
    """Draw a case with a material of the laboratory, its coefficients within a factor of 1.5."""
    random = np.random.default_rng(_FIRST + seed + (500_000 if relaxing else 0))
    name = str(random.choice(list(MATERIALS)))
    (spring, n, damper, p), depths = MATERIALS[name]
    spring *= log_uniform(random, 1 / 1.5, 1.5)
    damper *= log_uniform(random, 1 / 1.5, 1.5)
    law = palpate.GeneralisedHuntCrossley(K=spring, n=n, B=damper, p=p)
    depth = log_uniform(random, *depths)
    if relaxing:  # a flat spectrum, or one time, beside a weak damper
        share = log_uniform(random, 0.4, 3.0)
        spectrum: palpate.FlatSpectrum | palpate.SingleRelaxation
        if random.uniform() < 0.7:
            shortest = log_uniform(random, 1e-3, 2e-2)
            spectrum = palpate.FlatSpectrum(shortest, log_uniform(random, 1.0, 10.0))
        else:
            spectrum = palpate.SingleRelaxation(log_uniform(random, 0.05, 2.0))
        damper *= random.uniform(0.0, 0.3)
        law = palpate.GeneralisedHuntCrossley(
            K=spring, n=n, B=damper, p=p, M=share * spring, relaxation=spectrum
        )
        name = f"{name}, relaxing"
    slow = law.relaxed() if relaxing else law
    delay = STEP * int(random.integers(0, 33))
    speed = log_uniform(random, 5e-3, 40e-3)
    loop = _loop(random, seed % 3, float(slow.force(depth, 0.0)), speed, delay)
    return Case(seed, name, law, loop, depth)


def stiff_case(seed: int) -> Case:
    """Draw a table or metal: Kelvin–Voigt, lightly damped; admittance or force control."""
    random = np.random.default_rng(_FIRST + 250_000 + seed)
    stiffness = log_uniform(random, 2e4, 5e5)
    delay = 5e-4 * int(random.integers(0, 17))
    force = log_uniform(random, 3.0, 30.0)
    loop = _loop(random, 2 * (seed % 2), force, log_uniform(random, 5e-3, 40e-3), delay)
    damping = 2.0 * log_uniform(random, 0.02, 0.2) * math.sqrt(stiffness * loop.mass)
    law = palpate.GeneralisedHuntCrossley(K=stiffness, n=1.0, B=damping, p=0.0)
    loop = replace(loop, tool_mass=0.0)
    return Case(seed, "stiff", law, loop, force / stiffness)


def poor_recording(case: Case, random: Random) -> palpate.Contact:
    """Record a case in the paper's slow motion: short, noisy, mostly too shallow.

    The force at the top of the motion is .25 to 1.2 times the wanted one, noise .5 to 5 % of it,
    steps of 10 µm, the surface off by 10 to 200 µm (its deviation is given), 1 to 6 s.
    """
    part = log_uniform(random, 0.25, 1.2) ** (1.0 / case.law.n)
    off = log_uniform(random, 1e-5, 2e-4)
    contact = _record(
        case,
        part * case.depth,
        (0.1, 0.18, 0.18),
        (4.0, 11.0, 15.0),
        noise=log_uniform(random, 0.005, 0.05),
        step=1e-5,
        seconds=log_uniform(random, 1.0, 6.0),
        random=random,
    )
    moved = contact.penetration + off * random.standard_normal()
    return replace(contact, penetration=moved, surface_deviation=off)


def good_recording(case: Case, random: Random) -> palpate.Contact:
    """Record a case for 5 s in a motion up to 15 Hz, at the depth of the loop."""
    return _record(
        case,
        case.depth,
        (0.1, 0.12, 0.1, 0.08),
        (4.0, 20.0, 50.0, 94.0),
        noise=0.003,
        step=1e-6,
        seconds=5.0,
        random=random,
    )


def _record(
    case: Case,
    top: float,
    amplitudes: tuple[float, ...],
    frequencies: tuple[float, ...],
    *,
    noise: float,
    step: float,
    seconds: float,
    random: Random,
) -> palpate.Contact:
    mean = top / (1.0 + sum(amplitudes))
    motion = Motion(mean, tuple(mean * a for a in amplitudes), frequencies)
    force = float(case.law.instantaneous().force(top, 0.0))
    sensors = lab.Sensors(noise * force, 0.0, 0.5, step)
    probing = lab.Probing(motion, clearance=0.3e-3, pause=0.5, approach=0.417)
    bench = lab.Bench(lab.Homogeneous(case.law), probing, lab.IdealProbe(), sensors)
    seed = int(random.integers(2**31))
    return bench.run(seed, seconds=1.0 + seconds).contact
