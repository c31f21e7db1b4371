"""A second bank, apart from ``benchmarks.bank.trials``: other motions, rates, noises, faults.

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
        self.amount = random.uniform(0.3, 1.0) * random.choice([-1.0, 1.0])
        self.past, self.slides = self.time / self.time[-1], np.tanh(50.0 * v / self.speed)
        acceleration = np.gradient(v, self.time)
        self.acceleration = acceleration / np.sqrt(np.mean(acceleration[inside] ** 2))
        struck = random.random(x.size) < 0.004 * self.rate * (self.time[1] - self.time[0])
        self.clicks = 0.5 * struck * random.standard_normal(x.size)
        self.truth: Truth = lambda depth, turns: (
            self.stiffness * n * depth ** (n - 1.0),
            self.damping * depth**n,
        )

    def low_pass(self, hertz: float) -> Floats:
        """The force behind a filter of second order."""
        over = 1.0 / (self.time[1] - self.time[0])
        sections = butter(2, min(hertz, 0.45 * over), fs=over, output="sos")
        filtered: Floats = self.force[0] + sosfilt(sections, self.force - self.force[0])
        return filtered


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


# Motions, 1 where they are deepest.


def _wander(random: np.random.Generator, time: Floats) -> Floats:
    """A random walk in a band of frequencies about a depth."""
    over = 1.0 / (time[1] - time[0])
    band = butter(3, [0.3, random.uniform(2.0, 6.0)], "band", fs=over, output="sos")
    wave = sosfilt(band, random.standard_normal(time.size + int(6 * over)))[-time.size :]
    return np.asarray(1.0 + wave / np.abs(wave).max() * random.uniform(0.3, 0.9))


def _triangles(random: np.random.Generator, time: Floats) -> Floats:
    """Nearly constant speeds, through the surface or not."""
    over, hertz = 1.0 / (time[1] - time[0]), random.uniform(0.5, 2.0)
    wave = 2.0 * np.abs(2.0 * ((time * hertz + random.random()) % 1.0) - 1.0) - 1.0
    smooth = sosfilt(butter(2, 8.0 * hertz, fs=over, output="sos"), np.tile(wave, 2))[time.size :]
    return np.asarray(random.uniform(0.3, 1.3) + smooth * random.uniform(0.7, 1.0))


def _decay(random: np.random.Generator, time: Floats) -> Floats:
    """An oscillation that dies out."""
    faded = np.exp(-time / (time[-1] * random.uniform(0.3, 0.8)))
    return np.asarray(1.0 + 0.8 * faded * np.sin(2.0 * np.pi * random.uniform(1.0, 4.0) * time))


def _stairs(random: np.random.Generator, time: Floats) -> Floats:
    """Random depths, held after quick steps."""
    place = time / random.uniform(0.4, 0.9)
    step = place.astype(int)
    levels = random.uniform(0.4, 1.4, int(step[-1]) + 2)
    return np.asarray(levels[step] + np.diff(levels)[step] * rise(4.0 * (place - step)))


def _two_sines(random: np.random.Generator, time: Floats) -> Floats:
    slow, quick = 2.0 * np.pi * random.uniform([0.4, 2.0], [1.2, 5.0])
    return np.asarray(1.0 + 0.5 * np.sin(slow * time) + 0.25 * np.sin(quick * time + 1.0))


def _taps(random: np.random.Generator, time: Floats) -> Floats:
    """Through the surface, at a frequency that wanders."""
    phase = 2.0 * np.pi * random.uniform(1.0, 3.0) * (time + 0.03 * np.sin(0.7 * time))
    return random.uniform(-0.2, 0.3) - np.cos(phase) * (1.0 + 0.1 * np.sin(0.4 * phase))


MOTIONS = (_wander, _triangles, _decay, _stairs, _two_sines, _taps)

# Faults of the force: what it is with a fault of the amount ± 0.3 to 1.

FAULTS: dict[str, Callable[[Pressed], Floats]] = {
    "skew": lambda p: np.interp(p.time - 4e-3 * p.amount, p.time, p.force),
    "friction": lambda p: p.force * (1.0 + 0.05 * abs(p.amount) * p.slides),
    "guide": lambda p: p.force + 0.02 * abs(p.amount) * p.peak * p.slides,
    "mass": lambda p: p.force + 0.03 * abs(p.amount) * p.peak * p.acceleration,
    "zero": lambda p: p.force + 0.04 * p.amount * p.peak * p.past,
    "curved": lambda p: p.force * (1.0 + 0.03 * p.amount * p.force / p.peak),
    "span": lambda p: p.force * (1.0 + 0.08 * p.amount * p.past),
    "wave": lambda p: p.force + 0.03 * p.amount * p.peak * np.sin(10.0 * p.past + 1.0),
    "slow": lambda p: p.low_pass(p.random.uniform(8.0, 60.0) * max(p.turns / 12.0, 0.3)),
    "shifts": lambda p: p.force + 0.02 * p.amount * p.peak * (p.past > p.random.uniform(0.2, 0.8)),
}
#: Faults of a kind that neither bank was chosen with.
KINDS: dict[str, Callable[[Pressed], Floats]] = {
    "warming": lambda p: p.force + 0.04 * p.amount * p.peak * (1.0 - np.exp(-3.0 * p.past)),
    "half-space": lambda p: _half_space(p),
    "clicks": lambda p: p.force + p.peak * p.clicks,
    "creep": lambda p: p.force + 0.03 * abs(p.amount) * p.low_pass(0.1),
}


def _half_space(p: Pressed) -> Floats:
    """A material whose damping grows as xⁿ⁻¹."""
    power, damping = p.exponent - 1.0, p.damping * p.depth
    stiffness = p.truth
    p.truth = lambda depth, turns: (stiffness(depth, turns)[0], damping * depth**power)
    return np.asarray(
        p.stiffness * p.power + damping * np.maximum(p.penetration, 0.0) ** power * p.velocity
    )


def _relaxing(p: Pressed) -> Floats:
    """A material of one or three relaxation times, with a damper or without."""
    n, count = p.exponent, int(p.random.choice([1, 3]))
    times = np.exp(p.random.uniform(math.log(0.02), math.log(p.time[-1] / 3.0), count))
    sizes = p.random.uniform(0.1, 0.6, count) * p.stiffness / count
    damping, step = p.damping * p.random.choice([0.0, 0.5]), float(p.time[1] - p.time[0])
    force = (p.stiffness + damping * p.velocity) * p.power
    rate = np.diff(p.power, prepend=p.power[0]) / step
    for size, time in zip(sizes, times, strict=True):
        decay = math.exp(-step / time)
        force = force + size * lfilter([(1.0 - decay) * time], [1.0, -decay], rate)

    def truth(depth: float, turns: float) -> tuple[float, float]:
        phase, slope = turns * times, n * depth ** (n - 1.0)
        stored = p.stiffness + float(np.sum(sizes * phase**2 / (1.0 + phase**2)))
        lost = float(np.sum(sizes * times / (1.0 + phase**2)))
        return slope * stored, damping * depth**n + slope * lost

    p.truth = truth
    return np.asarray(force)


def _noise(p: Pressed, color: str, force: Floats) -> Floats:
    """Noise of standard deviation 1 at the samples."""
    white = p.random.standard_normal(force.size + 4000)
    if color == "∝ force":
        return np.asarray((np.abs(force) / p.peak + 0.05) * white[4000:])
    if color == "AR(1)":
        share = p.random.uniform(0.8, 0.98)
        white = lfilter([1.0], [1.0, -share], white)
    elif color == "low-pass":
        hertz = p.random.uniform(0.02, 0.2) * p.rate
        white = sosfilt(butter(2, hertz, fs=p.rate, output="sos"), white)
    elif color == "pink":
        white = lfilter(*PINK, white)
    elif color == "hum":
        white = 0.6 * white + 1.1 * np.sin(100.0 * np.pi * np.arange(white.size) / p.rate)
    return np.asarray(white[4000:] / white[4000:].std())


COLORS = {"filtered": ("AR(1)", "low-pass", "pink", "hum"), "clean": ("white", "∝ force")}


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
    change = {**FAULTS, **KINDS, "relaxing": _relaxing}.get(kind)
    force = (p.force if change is None else change(p))[::every]
    color = str(random.choice(COLORS.get(kind, ("white",))))
    force = force + _log_uniform(random, 3e-4, 1.5e-2) * p.peak * _noise(p, color, force)
    fine = _log_uniform(random, 1e-5, 2e-4) * p.deepest
    position = p.penetration[::every] + fine * random.standard_normal(force.size)
    return prepare(time=time[::every], penetration=position, force=force), p.truth


def strike(seed: int) -> tuple[Contact, Truth]:
    """Return blows of a hammer of which 7 to 50 % are beyond its force sensor."""
    random = np.random.default_rng([seed, 38])
    n, beyond = random.uniform([1.0, 0.07], [2.0, 0.5])
    mass = _log_uniform(random, 0.05, 1.5)
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
