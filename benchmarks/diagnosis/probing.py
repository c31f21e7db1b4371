"""A probed material with known truth, without faults."""

from dataclasses import dataclass, field

import numpy as np

from palpate import Contact, HuntCrossley, prepare
from palpate.validation import Floats

SAMPLE_TIME = 1e-3  # s
SECONDS = 7.0
FREE = 0.8  # s before the touch


@dataclass
class Probing:
    """The motion and force of a probe, and the truth at its working depth.

    Attributes
    ----------
    time, penetration, velocity, force : numpy.ndarray, shape (k,)
        s, m, m/s, N; the true motion.
    law : HuntCrossley
        The material.
    random : numpy.random.Generator
        The generator of this recording.
    stiffness, damping : float
        ∂F/∂x and ∂F/∂v at the working depth, by the material.
    noise : float
        Of the force, N.
    recorded_velocity : numpy.ndarray, optional
        A velocity column.
    """

    time: Floats
    penetration: Floats
    velocity: Floats
    force: Floats
    law: HuntCrossley
    random: np.random.Generator
    stiffness: float
    damping: float
    noise: float = 0.05
    recorded_velocity: Floats | None = None
    law_is_true: bool = field(default=True)

    @property
    def depth(self) -> float:
        """The median penetration in contact, m."""
        return float(np.median(self.penetration[self.penetration > 1e-3]))

    @property
    def speed(self) -> float:
        """The rms velocity in contact, m/s."""
        return float(np.sqrt(np.mean(self.velocity[self.penetration > 1e-3] ** 2)))

    @property
    def contact(self) -> Contact:
        """Return the contact as a user prepares it."""
        return prepare(
            time=self.time,
            penetration=self.penetration,
            force=self.force,
            velocity=self.recorded_velocity,
        )


def probing(seed: int) -> Probing:
    """Draw a material and a motion: n of 1 to 2.1, a few newtons, three sines."""
    random = np.random.default_rng([seed, 2026])
    time: Floats = np.arange(float(round(SECONDS / SAMPLE_TIME))) * SAMPLE_TIME
    depth = random.uniform(4e-3, 12e-3)
    exponent = random.uniform(1.0, 2.1)
    stiffness = random.uniform(4.0, 30.0) / depth**exponent
    # Such that a skew of 1 ms between force and position is 5 to 20 % of the damping.
    dissipation = exponent * 1e-3 / depth / random.uniform(0.05, 0.2)
    law = HuntCrossley(stiffness, stiffness * dissipation, exponent)
    x, v = _motion(time, depth, random)
    force = np.where(x > 0.0, law.force(np.maximum(x, 0.0), v), 0.0)
    made = Probing(time, x, v, force, law, random, 0.0, 0.0)
    made.stiffness = law.stiffness_at(made.depth)
    made.damping = law.damping_at(made.depth)
    return made


def _motion(time: Floats, depth: float, random: np.random.Generator) -> tuple[Floats, Floats]:
    """From 3 mm above the surface to a depth, and three sines about it."""
    frequencies = random.uniform([3.0, 8.0, 12.0], [6.0, 12.0, 20.0])
    parts = random.uniform([0.15, 0.1, 0.05], [0.3, 0.25, 0.15]) * depth
    phases = random.uniform(0.0, 2.0 * np.pi, 3)
    rise = np.clip((time - 0.5) / FREE, 0.0, 1.0)
    smooth = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    waves = np.sin(np.outer(time, frequencies) + phases) @ parts
    x = -3e-3 + smooth * (depth + 3e-3 + waves)
    return x, np.gradient(x, time)


def measured(probing: Probing) -> None:
    """Add the sensors' noise: white on the force and a micrometre on the penetration."""
    random = probing.random
    probing.force = probing.force + probing.noise * random.standard_normal(probing.force.size)
    probing.penetration = probing.penetration + 1e-6 * random.standard_normal(probing.time.size)
