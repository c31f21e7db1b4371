"""A second bank, written apart from ``benchmarks.bank.trials``: other motions, rates, noises, faults.

Each recording is a :class:`Pressed` with its truth K′ and B′ at any depth and frequency.
"""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

from benchmarks.bank.trials import rise
from palpate import Contact, prepare
from palpate.validation import Floats

Truth = Callable[[float, float], tuple[float, float]]
RATES = (60.0, 90.0, 150.0, 200.0, 333.0, 500.0, 1000.0, 2000.0)  # Hz
FINE = 3000.0  # Hz at least
MOST = 8000  # samples
PINK = ([0.0499220, -0.0959935, 0.0506127, -0.0044088], [1.0, -2.4949560, 2.0172659, -0.5221894])


@dataclass
class Pressed:
    """A probe pressed on a material: signals on a fine grid, SI, and what is needed for faults."""

    random: np.random.Generator
    time: Floats
    penetration: Floats
    rate: float

    def __post_init__(self) -> None:
        random, x = self.random, self.penetration
        self.velocity = v = np.gradient(x, self.time)
        self.inside = inside = x > 0.0
        self.deepest, self.depth = float(x.max()), float(np.median(x[inside]))
        self.speed = float(np.sqrt(np.mean(v[inside] ** 2)))
        self.turns = self.speed / float(np.std(x[inside]))
        self.exponent = n = random.uniform(1.0, 2.3)
        self.peak = _log_uniform(random, 0.2, 80.0)
        self.stiffness = self.peak / self.deepest**n
        lag = _log_uniform(random, 0.03, 0.5) / self.turns
        lag = min(lag, 0.6 * self.depth / (n * float(np.abs(v[inside]).max())))
        self.damping = self.stiffness * lag * n / self.depth
        self.power = np.maximum(x, 0.0) ** n
        self.force = self.stiffness * self.power + self.damping * self.power * v
        self.position, self.amount = x, random.uniform(0.3, 1.0) * random.choice([-1.0, 1.0])
        self.truth: Truth = lambda depth, turns: (
            self.stiffness * n * depth ** (n - 1.0),
            self.damping * depth**n,
        )

    def low_pass(self, values: Floats, hertz: float) -> Floats:
        """Values behind a filter of second order."""
        over = 1.0 / (self.time[1] - self.time[0])
        sections = butter(2, min(hertz, 0.45 * over), fs=over, output="sos")
        filtered: Floats = values[0] + sosfilt(sections, values - values[0])
        return filtered


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


# Motions, 1 where they are deepest.


def _wander(random: np.random.Generator, time: Floats) -> Floats:
    """A random walk in a band of frequencies about a depth."""
    over = 1.0 / (time[1] - time[0])
    band = butter(3, [0.3, random.uniform(2.0, 6.0)], "band", fs=over, output="sos")
    wave = sosfilt(band, random.standard_normal(time.size + int(6 * over)))[-time.size :]
    return 1.0 + wave / np.abs(wave).max() * random.uniform(0.3, 0.9)


def _triangles(random: np.random.Generator, time: Floats) -> Floats:
    """Nearly constant speeds, through the surface or not."""
    over, hertz = 1.0 / (time[1] - time[0]), random.uniform(0.5, 2.0)
    wave = 2.0 * np.abs(2.0 * ((time * hertz + random.random()) % 1.0) - 1.0) - 1.0
    smooth = sosfilt(butter(2, 8.0 * hertz, fs=over, output="sos"), np.tile(wave, 2))[time.size :]
    return random.uniform(0.3, 1.3) + smooth * random.uniform(0.7, 1.0)


def _decay(random: np.random.Generator, time: Floats) -> Floats:
    """An oscillation that dies out."""
    faded = np.exp(-time / (time[-1] * random.uniform(0.3, 0.8)))
    return 1.0 + 0.8 * faded * np.sin(2.0 * np.pi * random.uniform(1.0, 4.0) * time)


def _stairs(random: np.random.Generator, time: Floats) -> Floats:
    """Random depths, held after quick steps."""
    place = time / random.uniform(0.4, 0.9)
    step = place.astype(int)
    levels = random.uniform(0.4, 1.4, int(step[-1]) + 2)
    return levels[step] + np.diff(levels)[step] * rise(4.0 * (place - step))


def _two_sines(random: np.random.Generator, time: Floats) -> Floats:
    slow, quick = 2.0 * np.pi * random.uniform([0.4, 2.0], [1.2, 5.0])
    return 1.0 + 0.5 * np.sin(slow * time) + 0.25 * np.sin(quick * time + 1.0)


def _taps(random: np.random.Generator, time: Floats) -> Floats:
    """Through the surface, at a frequency that wanders."""
    phase = 2.0 * np.pi * random.uniform(1.0, 3.0) * (time + 0.03 * np.sin(0.7 * time))
    return random.uniform(-0.2, 0.3) - np.cos(phase) * (1.0 + 0.1 * np.sin(0.4 * phase))


MOTIONS = (_wander, _triangles, _decay, _stairs, _two_sines, _taps)

# Faults; the amount a of each is ± 0.3 to 1.


def _slides(p: Pressed) -> Floats:
    return np.tanh(50.0 * p.velocity / p.speed)


def _skew(p: Pressed) -> None:
    p.force = np.interp(p.time - 4e-3 * p.amount, p.time, p.force)


def _friction(p: Pressed) -> None:
    p.force = p.force + 0.05 * abs(p.amount) * p.stiffness * p.power * _slides(p)


def _guide(p: Pressed) -> None:
    p.force = p.force + 0.02 * abs(p.amount) * p.peak * _slides(p)


def _mass(p: Pressed) -> None:
    acceleration = np.gradient(p.velocity, p.time)
    size = np.sqrt(np.mean(acceleration[p.inside] ** 2))
    p.force = p.force + 0.03 * abs(p.amount) * p.peak * acceleration / size


def _zero(p: Pressed) -> None:
    p.force = p.force + 0.04 * p.amount * p.peak * p.time / p.time[-1]


def _curved(p: Pressed) -> None:
    p.force = p.force * (1.0 + 0.03 * p.amount * p.force / p.peak)


def _span(p: Pressed) -> None:
    p.force = p.force * (1.0 + 0.08 * p.amount * p.time / p.time[-1])


def _slow_wave(p: Pressed) -> None:
    turns = 2.0 * np.pi * p.random.uniform(0.5, 3.0) / p.time[-1]
    p.force = p.force + 0.03 * p.amount * p.peak * np.sin(turns * p.time + 1.0)


def _play(p: Pressed) -> None:
    reach, at = 0.02 * abs(p.amount) * p.deepest, float(p.position[0])
    follows = np.empty_like(p.position)
    for k, place in enumerate(p.position.tolist()):
        at = min(max(at, place - reach), place + reach)
        follows[k] = at
    p.position = follows


def _slow_force(p: Pressed) -> None:
    hertz = p.random.uniform(8.0, 60.0) * max(p.turns / 12.0, 0.3)
    p.force = p.low_pass(p.force, hertz)


def _eccentric(p: Pressed) -> None:
    wave = np.sin(1.5 * 2.0 * np.pi * p.position / p.deepest)
    p.position = p.position + 0.01 * p.amount * p.deepest * wave


def _warming(p: Pressed) -> None:
    warm = 1.0 - np.exp(-p.time / (0.3 * p.time[-1]))
    p.force = p.force + 0.04 * p.amount * p.peak * warm


def _clicks(p: Pressed) -> None:
    hit = p.random.random(p.time.size) < 0.004 * p.rate * (p.time[1] - p.time[0])
    p.force = p.force + 0.5 * p.peak * hit * p.random.standard_normal(p.time.size)


def _half_space(p: Pressed) -> None:
    """A material whose damping grows as xⁿ⁻¹; the truth goes with it."""
    n, damping = p.exponent, p.damping * p.depth
    xs = np.maximum(p.penetration, 0.0)
    p.force = p.stiffness * p.power + damping * xs ** (n - 1.0) * p.velocity
    p.truth = lambda depth, turns: (
        p.stiffness * n * depth ** (n - 1.0),
        damping * depth ** (n - 1.0),
    )


def _relaxing(p: Pressed) -> None:
    """One or three relaxation times, with a damper or without."""
    n, count = p.exponent, int(p.random.choice([1, 3]))
    times = np.exp(p.random.uniform(math.log(0.02), math.log(p.time[-1] / 3.0), count))
    sizes = p.random.uniform(0.1, 0.6, count) * p.stiffness / count
    damping, step = p.damping * p.random.choice([0.0, 0.5]), float(p.time[1] - p.time[0])
    p.force = (p.stiffness + damping * p.velocity) * p.power
    for size, time in zip(sizes, times, strict=True):
        decay = math.exp(-step / time)
        rate = np.diff(p.power, prepend=p.power[0])
        p.force = p.force + size * lfilter([(1.0 - decay) * time / step], [1.0, -decay], rate)

    def truth(depth: float, turns: float) -> tuple[float, float]:
        phase, slope = turns * times, n * depth ** (n - 1.0)
        stored = p.stiffness + float(np.sum(sizes * phase**2 / (1.0 + phase**2)))
        lost = float(np.sum(sizes * times / (1.0 + phase**2)))
        return slope * stored, damping * depth**n + slope * lost

    p.truth = truth


Damage = Callable[[Pressed], None]
FAULTS: dict[str, Damage] = {
    "skew": _skew, "friction": _friction, "guide": _guide, "mass": _mass, "zero": _zero,
    "curved": _curved, "span": _span, "slow wave": _slow_wave, "play": _play,
    "slow force": _slow_force,
}  # fmt: skip
#: In neither bank's design.
KINDS: dict[str, Damage] = {
    "eccentric": _eccentric, "warming": _warming, "clicks": _clicks, "half-space": _half_space,
}  # fmt: skip
IN_AIR = (_guide, _zero, _slow_wave, _mass, _warming, _skew, _slow_force, _clicks)


def _noise(p: Pressed, color: str, force: Floats) -> Floats:
    """Noise of standard deviation 1 at the samples."""
    white = p.random.standard_normal(force.size + 4000)
    if color == "AR(1)":
        share = p.random.uniform(0.8, 0.98)
        made = lfilter([math.sqrt(1.0 - share**2)], [1.0, -share], white)
    elif color == "low-pass":
        sections = butter(2, p.random.uniform(0.02, 0.2) * p.rate, fs=p.rate, output="sos")
        made = sosfilt(sections, white)
    elif color == "pink":
        made = lfilter(*PINK, white)
    elif color == "hum":
        clock = np.arange(white.size) / p.rate
        made = 0.6 * white + 1.1 * np.sin(2.0 * np.pi * 50.0 * clock + 1.0)
    elif color == "∝ force":
        made = np.r_[np.zeros(4000), np.abs(force) / p.peak + 0.05] * white
        return np.asarray(made[4000:])
    else:
        return white[4000:]
    return np.asarray(made[4000:] / made[4000:].std())


COLORS = ("AR(1)", "low-pass", "pink", "hum")


def press(kind: str, seed: int) -> tuple[Contact, Truth]:
    """Return a recording and its truth. Kind: clean, filtered, relaxing, or the name of a fault."""
    random = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    rate = float(random.choice(RATES))
    seconds = min(random.uniform(2.0, 12.0), MOST / rate)
    every = math.ceil(FINE / rate)
    time: Floats = np.arange(int(seconds * rate * every)) / (rate * every)
    motion = MOTIONS[random.integers(len(MOTIONS))]
    x = motion(random, time)
    if motion not in (_triangles, _taps) and random.random() < 0.7:  # from free air
        x = -0.25 + rise((time / time[-1] - 0.05) / 0.1) * (x + 0.25)
    p = Pressed(random, time, x / x.max() * _log_uniform(random, 8e-4, 20e-3), rate)
    damage = {**FAULTS, **KINDS, "relaxing": _relaxing}.get(kind)
    if damage is not None:
        damage(p)
    if damage not in IN_AIR:
        p.force = np.where(p.inside, p.force, 0.0)
    force, position = p.force[::every], p.position[::every]
    color = {"filtered": str(random.choice(COLORS)), "clean": str(random.choice(["", "∝ force"]))}
    size = _log_uniform(random, 3e-4, 1.5e-2) * p.peak
    force = force + size * _noise(p, color.get(kind, ""), force)
    fine = _log_uniform(random, 1e-5, 2e-4) * p.deepest
    position = position + fine * random.standard_normal(position.size)
    return prepare(time=time[::every], penetration=position, force=force), p.truth


def strike(seed: int) -> tuple[Contact, Truth]:
    """Return blows of a hammer of which 7 to 50 % are beyond its force sensor."""
    random = np.random.default_rng([seed, 38])
    n, mass, beyond = random.uniform(1.0, 2.0), _log_uniform(random, 0.05, 1.5), random.uniform(0.07, 0.5)
    speed, touch = random.uniform(0.15, 1.2), _log_uniform(random, 4e-3, 4e-2)
    deepest = speed * touch / np.pi
    stiffness = 0.5 * mass * speed**2 * (n + 1.0) / deepest ** (n + 1.0)
    damping = stiffness * random.uniform(0.05, 0.35) / speed
    rate, over = float(random.choice([2000.0, 5000.0, 10000.0])), 8
    step, places, accelerations = 1.0 / (rate * over), [], []
    for _ in range(int(random.integers(1, 6))):
        x, v = -touch * speed, speed * random.uniform(0.8, 1.1)
        for _ in range(int(4.0 * touch / step)):
            force = max(x, 0.0) ** n * (stiffness + damping * v)
            a = -max(force, 0.0) / mass
            places.append(x)
            accelerations.append(a)
            v += a * step
            x += v * step
            v = 0.0 if x < -1.2 * touch * speed else v
    position, measured = np.array(places)[::over], -(1.0 - beyond) * mass * np.array(accelerations)
    force = measured[::over] + 0.003 * measured.max() * random.standard_normal(position.size)
    position = position + 2e-4 * deepest * random.standard_normal(position.size)
    contact = prepare(time=np.arange(position.size) / rate, penetration=position, force=force)
    return contact, lambda depth, turns: (stiffness * n * depth ** (n - 1.0), damping * depth**n)
