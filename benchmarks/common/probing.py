"""The probed materials and motions: the laboratory's, followed exactly."""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from scipy.signal import lfilter

from palpate import Estimate, HuntCrossley, lab
from palpate.lab.design import Motion
from palpate.method.estimators import ContactEstimator
from palpate.validation import Floats

NOISE = lab.Sensors().force_noise  # N, standard deviation
SAMPLE_TIME = lab.Sensors().sample_time  # s
SYMBOLS = ("K", "B", "n")


def truth(name: str) -> HuntCrossley:
    """Return the law of one of the laboratory's materials."""
    material = lab.MATERIALS[name]
    assert isinstance(material, lab.Homogeneous)
    assert isinstance(material.law, HuntCrossley)
    return material.law


BALL, PVC, SPONGE, INCLUSION = map(truth, ("ball", "pvc", "sponge", "inclusion"))
GEL = HuntCrossley(K=5e4, B=1.5e5, n=2.2)
MATERIALS = {"ball": BALL, "PVC": PVC, "sponge": SPONGE}
THREE_SINES, ONE_SINE = lab.THREE_SINES.motion, lab.ONE_SINE.motion
MEAN_DEPTH = THREE_SINES.depth


@lru_cache(maxsize=8)
def sines(
    duration: float, motion: Motion = THREE_SINES, start: float = 0.0
) -> tuple[Floats, Floats]:
    """True penetration [m] and velocity [m/s] of a motion, at 1 kHz from ``start`` [s] on."""
    return motion.at(start + clock(duration))


@lru_cache(maxsize=2)
def approach_and_probe(duration: float) -> tuple[Floats, Floats]:
    """A second from 3 mm above the surface to the mean depth, then the three sines.

    The lab's own approach begins 0.5 mm above it, less than the uncertainty of the surface here.
    """
    t = clock(duration)
    ramp = np.clip(t, 0.0, 1.0)
    free = 3e-3  # m
    travel = MEAN_DEPTH + free
    on = np.where(t >= 1.0, 1.0, 0.0)
    x = -free + travel * ramp**2 * (3.0 - 2.0 * ramp)
    v = travel * 6.0 * ramp * (1.0 - ramp)
    moved, speed = waves(t - 1.0, 0.0, THREE_SINES.amplitudes, THREE_SINES.frequencies)
    return x + on * moved, v + on * speed


def waves(
    t: Floats,
    mean: float,
    amplitudes: Sequence[float],
    rates: Sequence[float] | Floats,
    phases: float | Floats = 0.0,
) -> tuple[Floats, Floats]:
    """Penetration and velocity of sines [m] of angular frequencies [rad/s] about a mean."""
    turns, size = np.array(rates), np.array(amplitudes)
    angles = np.outer(t, turns) + phases
    return mean + np.sin(angles) @ size, np.cos(angles) @ (size * turns)


def taps(t: Floats) -> tuple[Floats, Floats]:
    """Penetration and velocity of 1.3 taps a second, of 8 to 10 mm."""
    return waves(t, -3e-3, (12e-3, 1.5e-3), (8.2, 1.7))


def clock(duration: float) -> Floats:
    """Times of samples at 1 kHz, s."""
    times: Floats = np.arange(round(duration / SAMPLE_TIME), dtype=np.float64) * SAMPLE_TIME
    return times


def noise(rng: np.random.Generator, samples: int) -> Floats:
    """White force noise, N."""
    return rng.normal(0.0, NOISE, samples)


def autoregressive(white: Floats, pole: float) -> Floats:
    """Return noise of the same variance of which each sample contains so much of the last."""
    return np.asarray(lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white))


def switched(before: HuntCrossley, after: HuntCrossley, x: Floats, v: Floats, at: int) -> Floats:
    """Force without noise of a material that is another from sample ``at`` on."""
    return np.where(np.arange(len(x)) < at, before.force(x, v), after.force(x, v))


def change_material(
    rng: np.random.Generator, before: HuntCrossley, after: HuntCrossley, last: int, look: int
) -> tuple[int, Floats, Floats, Floats]:
    """Change a material at random from sample 5000 to ``last``.

    Returns
    -------
    tuple
        The sample of the change, and x, v and the force without noise until ``look`` samples later.
    """
    at = int(rng.integers(5000, last))
    x, v = (signal[: at + look] for signal in sines(SAMPLE_TIME * (last + look)))
    return at, x, v, switched(before, after, x, v, at)


def feed(
    estimator: ContactEstimator, x: Floats, v: Floats, f: Floats, ends: Sequence[int]
) -> Iterator[Estimate]:
    """Pass samples one by one; yield the estimate after each of these numbers of samples."""
    update, start = estimator.update, 0
    for end in ends:
        part = slice(start, end)
        for sample in zip(x[part].tolist(), v[part].tolist(), f[part].tolist(), strict=True):
            update(*sample)
        start = end
        yield estimator.estimate()
