"""A clean probing of known truth, and one fault at a time, for the tests of the diagnosis."""

import numpy as np
from cases import Floats

import palpate

LAW = palpate.HuntCrossley(9000.0, 15000.0, 1.4)
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


def late(seconds: float) -> palpate.Contact:
    time, x, v = motion()
    return contact(time, x, noisy(np.interp(time - seconds, time, pushed(x, v))))


def surface_off(metres: float) -> palpate.Contact:
    time, x, v = motion()
    return contact(time, x + metres, noisy(pushed(x, v)))


def changed(step: float, at: float = 3.5) -> palpate.Contact:
    time, x, v = motion()
    force = pushed(x, v)
    return contact(time, x, noisy(np.where(time > at, (1.0 + step) * force, force)))


def drifting(part: float) -> palpate.Contact:
    time, x, v = motion()
    return contact(time, x, noisy(pushed(x, v) * (1.0 - part * time / time[-1])))


def zero_drifting(newtons: float) -> palpate.Contact:
    time, x, v = motion()
    return contact(time, x, noisy(pushed(x, v) + newtons * time / time[-1]))


def remembering(part: float, tau: float) -> palpate.Contact:
    time, x, v = motion()
    spring, state = pushed(x, np.zeros_like(x)), 0.0
    branch, decay = np.zeros_like(x), np.exp(-STEP / tau)
    for k in range(1, x.size):
        branch[k] = state = decay * state + spring[k] - spring[k - 1]
    return contact(time, x, noisy(pushed(x, v) + part * branch))


def rubbing(part: float) -> palpate.Contact:
    time, x, v = motion()
    rest = pushed(x, np.zeros_like(x))
    return contact(time, x, noisy(pushed(x, v) + part * rest * np.tanh(1e3 * v)))


def square(part: float) -> palpate.Contact:
    time, x, v = motion()
    rest, w = pushed(x, np.zeros_like(x)), v / 20e-3
    return contact(time, x, noisy(pushed(x, v) + part * rest * w * np.abs(w)))


def damped_otherwise() -> palpate.Contact:
    """Damping in proportion to the slope of the spring."""
    time, x, v = motion()
    depth = np.maximum(x, 0.0)
    form = np.where(x > 0.0, depth ** (LAW.exponent - 1.0), 0.0) * 9e-3
    force = pushed(x, np.zeros_like(x)) + LAW.damping * form * v
    return contact(time, x, noisy(force))


def shaped() -> palpate.Contact:
    """F in proportion to sinh: no power of depth."""
    time, x, v = motion()
    return contact(time, x, noisy(6.0 * np.sinh(np.maximum(x, 0.0) / 5e-3) * (1.0 + v)))


def heavy(mass: float) -> palpate.Contact:
    time, x, v = motion()
    return contact(time, x, noisy(pushed(x, v) + mass * np.gradient(v, time)))


def clipped(part: float) -> palpate.Contact:
    time, x, v = motion()
    force = noisy(pushed(x, v))
    return contact(time, x, np.minimum(force, part * force.max()))


def stuck(seconds: float) -> palpate.Contact:
    time, x, v = motion()
    force = noisy(pushed(x, v))
    start = np.searchsorted(time, 3.0)
    force[start : start + round(seconds / STEP)] = force[start]
    return contact(time, x, force)


def spiked(part: float) -> palpate.Contact:
    time, x, v = motion()
    force, random = noisy(pushed(x, v)), np.random.default_rng(5)
    hit = random.random(force.size) < part
    return contact(time, x, np.where(hit, force + 10.0, force))


def coarse(part: float) -> palpate.Contact:
    time, x, v = motion()
    force = pushed(x, v)
    step = part * force.max()
    return contact(time, x, step * np.round(force / step))


def held(beat: int) -> palpate.Contact:
    """A force that comes at a lower rate, and is held."""
    time, x, v = motion()
    force = noisy(pushed(x, v))
    return contact(time, x, np.repeat(force[::beat], beat)[: force.size])


def stamped_on_arrival() -> palpate.Contact:
    time, x, v = motion()
    random = np.random.default_rng(3)
    jittered = np.maximum.accumulate(time + 0.9 * STEP * random.random(time.size))
    return contact(jittered + 1e-9 * np.arange(time.size), x, noisy(pushed(x, v)))


def scaled(**factors: float) -> palpate.Contact:
    """A channel in another unit, or of another sign."""
    time, x, v = motion()
    channels = {"time": time, "penetration": x, "force": noisy(pushed(x, v))}
    channels = {name: factors.get(name, 1.0) * values for name, values in channels.items()}
    return contact(channels["time"], channels["penetration"], channels["force"])


def against() -> palpate.Contact:
    """A velocity column of the wrong sign."""
    time, x, v = motion()
    return contact(time, x, noisy(pushed(x, v)), velocity=-v)


def with_velocity(scale: float = 1.0, noise: float = 0.0) -> palpate.Contact:
    """A velocity column that is scaled, or noisy by a part of its rms."""
    time, x, v = motion()
    random = np.random.default_rng(5)
    column = scale * v + noise * np.sqrt(np.mean(v**2)) * random.standard_normal(v.size)
    return contact(time, x, noisy(pushed(x, v)), velocity=column)


def rounded(step: float) -> palpate.Contact:
    """A penetration that is read in coarse steps, m."""
    time, x, v = motion()
    force = noisy(pushed(x, v))
    return palpate.prepare(time=time, penetration=step * np.round(x / step), force=force)
