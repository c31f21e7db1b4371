"""Curves of known laws: common motions, with random laws, surfaces and noise."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Motion = Callable[[Floats], tuple[Floats, Floats]]

DEPTH, SPEED, PUSH = 10e-3, 20e-3, 2.0  # of a curve whose numbers are one, in SI


@dataclass(frozen=True)
class Curves:
    """A set: arrays one row a curve, SI, and the truth by K, B, n, F₀, d."""

    penetration: Floats
    velocity: Floats
    force: Floats
    truth: Floats
    noise: Floats

    def __len__(self) -> int:
        return len(self.force)


def approach_and_retract(time: Floats) -> tuple[Floats, Floats]:
    """One depth above the surface to one below it and back, at constant speed."""
    return 1.0 - 2.0 * np.abs(2.0 * time - 1.0), np.where(time < 0.5, 1.0, -1.0)


def palpation(time: Floats) -> tuple[Floats, Floats]:
    """Two sines, which leave contact."""
    slow, fast = 6.0 * np.pi, 14.6 * np.pi
    depth = 0.45 + 0.4 * np.sin(slow * time) + 0.25 * np.sin(fast * time)
    speed = 0.4 * slow * np.cos(slow * time) + 0.25 * fast * np.cos(fast * time)
    return depth, speed / (0.4 * slow + 0.25 * fast)


def one_way(time: Floats) -> tuple[Floats, Floats]:
    """Going in, slower with depth: v = a − b x, which hardly distinguishes n from n + 1."""
    rate = 3.0
    fall = np.exp(-rate * time)
    return 1.3 * (1.0 - fall) / (1.0 - np.exp(-rate)) - 0.3, fall


MOTIONS: dict[str, Motion] = {
    "approach–retract": approach_and_retract,
    "palpation": palpation,
    "one-way approach": one_way,
}


def random_curves(
    motion: Motion,
    count: int,
    *,
    samples: int = 1000,
    surface: bool = False,
    exponents: tuple[float, float] = (1.0, 2.5),
    seed: int = 0,
) -> Curves:
    """Curves of laws n ~ ``exponents``, c/k in 0 to 0.4, noise 0.1 to 3 % of the peak force.

    With ``surface`` the surface is within ±0.15 of the depth, else at 0.
    """
    chance = np.random.default_rng(seed)
    depth, speed = motion((np.arange(samples) + 0.5) / samples)
    exponent = chance.uniform(*exponents, count)
    dissipation = chance.uniform(0.0, 0.4, count)
    start = chance.uniform(-0.15, 0.15, count) if surface else np.zeros(count)
    offset = 0.03 * chance.standard_normal(count)
    noise = 10.0 ** chance.uniform(-3.0, np.log10(0.03), count)
    # The surface shifts the coordinate; the motion through the material stays the same.
    inside = np.maximum(depth, 0.0) ** exponent[:, None]
    clean = inside * (1.0 + dissipation[:, None] * speed)
    peak = clean.max(axis=1)
    force = clean / peak[:, None] + offset[:, None]
    force += noise[:, None] * chance.standard_normal((count, samples))
    stiffness = PUSH / peak * DEPTH**-exponent
    truth = np.stack(
        [stiffness, stiffness * dissipation / SPEED, exponent, PUSH * offset, DEPTH * start], axis=1
    )
    penetration = DEPTH * (depth + start[:, None])
    velocity = np.broadcast_to(SPEED * speed, penetration.shape).copy()
    return Curves(penetration, velocity, PUSH * force, truth, PUSH * noise)
