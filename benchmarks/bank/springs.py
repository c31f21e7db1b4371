"""Simulated touches of springs, and of what is none."""

from collections.abc import Sequence

import numpy as np

import palpate
from benchmarks.bank.trials import rise

OVERSAMPLED = 10


def touch(
    seed: int,
    *,
    late: float | None = None,
    friction: float = 0.0,
    loss: float = 0.0,
    relaxing: Sequence[tuple[float, float]] = (),
    damping: float = 0.0,
    slow: float = 1.0,
    quick: float = 4.0,
    rate: int = 1000,
    cycles: int = 4,
) -> tuple[palpate.Contact, float]:
    """A press of some millimetres, strokes at two speeds, and a withdrawal; and the true delay.

    The force is computed at ten times the rate. A loss factor turns the phase of every frequency;
    ``relaxing`` are parts of the stiffness and their relaxation times.
    """
    random = np.random.default_rng(seed)
    late = random.uniform(-6e-3, 6e-3) if late is None else late
    stiffness = random.choice([1e3, 3e3, 1e4])
    slowly, quickly = cycles / slow, 2 * cycles / quick
    begins = np.cumsum([1.8, slowly, 0.3, quickly])
    samples = int((begins[-1] + 1.8) * rate) * OVERSAMPLED
    time = np.arange(samples) / (rate * OVERSAMPLED)
    depth = -1e-3 + 4e-3 * rise((time - 1.0) / 0.8) * (1.0 - rise((time - begins[3]) / 0.8))
    for frequency, start, stop in ((slow, *begins[:2]), (quick, *begins[2:])):
        swing = np.sin(2.0 * np.pi * frequency * (time - start))
        depth += np.where((time > start) & (time < stop), 1.8e-3 * swing, 0.0)
    velocity = np.gradient(depth, time)
    inside = np.maximum(depth, 0.0)
    force = stiffness * inside
    if loss:
        turned = np.fft.rfft(force)
        turned[1:] *= 1.0 + 1j * loss
        force = np.fft.irfft(turned, samples)
    for part, seconds in relaxing:
        branch = palpate.GeneralisedHuntCrossley(
            K=0.0,
            n=1.0,
            B=0.0,
            p=1.0,
            M=part * stiffness,
            relaxation=palpate.SingleRelaxation(seconds),
        )
        force += branch.force_along(depth, velocity, time[1])
    force *= 1.0 + friction * np.tanh(velocity / 1e-5)
    force += damping * stiffness * inside * velocity
    force = np.where(depth > 0.0, force, 0.0)
    recorded = np.interp(time - late, time, force)[::OVERSAMPLED]
    noise = 1e-3 * recorded.max() * random.normal(size=recorded.size)
    depth = depth[::OVERSAMPLED] + 2e-6 * random.normal(size=recorded.size)
    arrays = {"time": time[::OVERSAMPLED], "penetration": depth, "force": recorded + noise + 0.02}
    return palpate.prepare(**arrays), late


def imperfect(seed: int) -> tuple[palpate.Contact, float]:
    """A spring with up to 1 % of friction and a loss factor of up to .001."""
    random = np.random.default_rng(1000 + seed)
    return touch(seed, friction=random.uniform(0.0, 0.01), loss=random.uniform(0.0, 1e-3))
