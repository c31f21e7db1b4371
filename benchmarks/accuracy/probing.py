"""What is probed and how: the materials and motions of the paper's experiments, and the sensor."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from palpate import Estimate, HuntCrossley
from palpate.estimators import ContactEstimator

Floats = NDArray[np.float64]

NOISE = 0.05  # N, standard deviation of the force
SAMPLE_TIME = 1e-3  # s
SYMBOLS = ("K", "B", "n")

BALL = HuntCrossley(2000.0, 2000.0, 1.0)
PVC = HuntCrossley(1e5, 2e5, 2.0)
SPONGE = HuntCrossley(300.0, 3000.0, 1.0)
INCLUSION = HuntCrossley(3e5, 3e5, 2.0)
MATERIALS = {"ball": BALL, "PVC": PVC, "sponge": SPONGE}

# (amplitude [m], angular frequency [rad/s]) about a mean depth of 10 mm.
THREE_SINES = ((1e-3, 4.0), (1.8e-3, 11.0), (1.8e-3, 15.0))
ONE_SINE = ((1.8e-3, 11.0),)
MEAN_DEPTH = 10e-3


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Time [s], penetration [m] and velocity [m/s] of the probe, as they truly are."""

    time: Floats
    penetration: Floats
    velocity: Floats


@lru_cache(maxsize=8)
def sines(
    duration: float,
    parts: tuple[tuple[float, float], ...] = THREE_SINES,
    start: float = 0.0,
) -> Motion:
    """Sines about the mean depth, at 1 kHz from ``start`` [s] on."""
    t = start + _clock(duration)
    x = sum((a * np.sin(w * t) for a, w in parts), np.full_like(t, MEAN_DEPTH))
    v = sum((a * w * np.cos(w * t) for a, w in parts), np.zeros_like(t))
    return Motion(t, x, v)


@lru_cache(maxsize=2)
def approach_and_probe(duration: float, free: float = 3e-3) -> Motion:
    """A second from ``free`` [m] above the surface to the mean depth, then the three sines."""
    t = _clock(duration)
    ramp = np.clip(t, 0.0, 1.0)
    travel = MEAN_DEPTH + free
    on = np.where(t >= 1.0, 1.0, 0.0)
    x = -free + travel * ramp**2 * (3.0 - 2.0 * ramp)
    v = travel * 6.0 * ramp * (1.0 - ramp)
    for amplitude, rate in THREE_SINES:
        x = x + on * amplitude * np.sin(rate * (t - 1.0))
        v = v + on * amplitude * rate * np.cos(rate * (t - 1.0))
    return Motion(t, x, v)


def _clock(duration: float) -> Floats:
    clock: Floats = np.arange(round(duration / SAMPLE_TIME), dtype=np.float64) * SAMPLE_TIME
    return clock


def noise(rng: np.random.Generator, samples: int) -> Floats:
    """White force noise, N."""
    return rng.normal(0.0, NOISE, samples)


def feed(
    estimator: ContactEstimator, x: Floats, v: Floats, f: Floats, ends: Sequence[int]
) -> Iterator[Estimate]:
    """Give samples one by one; yield what is known after each of these numbers of samples."""
    update, start = estimator.update, 0
    for end in ends:
        part = slice(start, end)
        for sample in zip(x[part].tolist(), v[part].tolist(), f[part].tolist(), strict=True):
            update(*sample)
        start = end
        yield estimator.estimate()
