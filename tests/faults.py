"""A clean probing of known truth, with one fault of the benchmarks' bank at a time."""

import numpy as np
from cases import Floats

import palpate
from benchmarks.bank import material_faults, sensor_faults
from benchmarks.bank.trials import Trial

LAW = palpate.HuntCrossley(K=9000.0, B=15000.0, n=1.4)
NOISE = 0.03  # N
STEP = 1e-3  # s


def motion(seconds: float = 6.0, *, free: bool = True) -> tuple[Floats, Floats, Floats]:
    """Time, penetration and velocity: from 3 mm above the surface to sines about 8 mm."""
    time = STEP * np.arange(round(seconds / STEP))
    rise = np.clip((time - 0.4) / 0.8, 0.0, 1.0) if free else np.ones_like(time)
    smooth = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    waves = sum(a * np.sin(w * time) for a, w in ((1.8e-3, 4.0), (1.5e-3, 11.0), (1e-3, 17.0)))
    x = -3e-3 + smooth * (11e-3 + waves)
    return time, x, np.gradient(x, time)


def pushed(x: Floats, v: Floats, law: palpate.HuntCrossley = LAW) -> Floats:
    """Force without noise, N."""
    return np.where(x > 0.0, law.force(np.maximum(x, 0.0), v), 0.0)


def noisy(force: Floats, seed: int = 0) -> Floats:
    return force + NOISE * np.random.default_rng(seed).standard_normal(force.size)


def contact(time: Floats, x: Floats, force: Floats, **others) -> palpate.Contact:
    jitter = 1e-6 * np.random.default_rng(99).standard_normal(x.size)
    return palpate.prepare(time=time, penetration=x + jitter, force=force, **others)


def clean(seed: int = 0, *, free: bool = True) -> palpate.Contact:
    time, x, v = motion(free=free)
    return contact(time, x, noisy(pushed(x, v), seed))


# The clean motion, its force without noise, and the part of that which is at rest.
TIME, X, V = motion()
FORCE = pushed(X, V)
SPRING = pushed(X, np.zeros_like(X))


def recorded(force: Floats, x: Floats = X, *, noise: bool = True, **others) -> palpate.Contact:
    """That motion, with noise on this force."""
    return contact(TIME, x, noisy(force) if noise else force, **others)


def zeroed(at: float) -> palpate.Contact:
    """The sensor set to zero while the probe presses, at a time, s."""
    first = round(at / STEP)
    return recorded(np.where(TIME[first] <= TIME, FORCE - FORCE[first], FORCE))


def damaged(fault, *size: float, sampled: bool = False) -> palpate.Contact:
    """That recording with a fault of the bank, before its noise or (sampled) after it."""
    force = noisy(FORCE) if sampled else FORCE
    made = Trial(TIME, X, V, force, LAW, np.random.default_rng(0), 1.0 / STEP, NOISE)
    fault(made, *size)
    force = made.force if sampled else noisy(made.force)
    return contact(made.time, made.position, force, velocity=made.recorded_velocity)


def late(seconds: float) -> palpate.Contact:
    return damaged(sensor_faults.skew, 1e3 * seconds)


def surface_off(metres: float) -> palpate.Contact:
    return damaged(sensor_faults.wrong_surface, 1e3 * metres)


def changed(step: float, at: float = 3.5) -> palpate.Contact:
    return damaged(material_faults.change, step, at)


def remembering(part: float, tau: float) -> palpate.Contact:
    return damaged(material_faults.relaxation, part, tau)


def scaled(**factors: float) -> palpate.Contact:
    """A channel in another unit, or of another sign."""

    def fault(made: Trial) -> None:
        for name, factor in factors.items():
            sensor_faults.scaled("position" if name == "penetration" else name, factor)(made)

    return damaged(fault, sampled=True)


def with_velocity(scale: float = 1.0, noise: float = 0.0) -> palpate.Contact:
    """A velocity column that is scaled, or noisy by a part of its rms."""
    random = np.random.default_rng(5)
    rms = np.sqrt(np.mean(V**2))
    return recorded(FORCE, velocity=scale * V + noise * rms * random.standard_normal(V.size))
