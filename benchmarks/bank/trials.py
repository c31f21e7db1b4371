"""Trials: a material pressed along many motions, at many rates, and recorded by plain sensors.

A trial is *good* or *hard*, or free of faults with noise of many kinds, or by an *ideal* probe.
"""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, lfilter, sosfilt

from palpate import Contact, HuntCrossley, prepare
from palpate.validation import Floats

Response = Callable[[Floats, Floats], Floats]
Damage = Callable[["Trial", float], None]
Truth = Callable[[float], tuple[float, float]]
FINE = 2000.0  # Hz at least: the faults act on this grid, before the sensors take samples of it
MOST = 8000  # samples of a recording
RATES = (100.0, 125.0, 250.0, 500.0, 1000.0)
SEVERAL = ("touches", "ramps", "holds", "chirp", "multi-sine")


@dataclass
class Trial:
    """A probe pressed on a material, and the truth at any depth.

    Attributes
    ----------
    time, penetration, velocity, force : numpy.ndarray, shape (k,)
        s, m, m/s, N, on a fine grid; the first three are the true motion.
    position : numpy.ndarray, shape (k,)
        The penetration as the position sensor reports it, m.
    law : HuntCrossley
        The material without a fault.
    random : numpy.random.Generator
    rate : float
        Samples per second of the recording.
    noise : float
        Standard deviation of the force's noise, N.
    truth : callable
        Stiffness and damping at a depth.
    recorded_velocity : numpy.ndarray, optional
        A velocity column.
    least : float
        Penetration from which a sample counts for the motion's depth and speed, m.
    described : bool
        Whether the law describes the material.
    """

    time: Floats
    penetration: Floats
    velocity: Floats
    force: Floats
    law: HuntCrossley
    random: np.random.Generator
    rate: float
    noise: float
    position: Floats = field(init=False)
    truth: Truth = field(init=False)
    recorded_velocity: Floats | None = None
    least: float = 0.0
    described: bool = True

    def __post_init__(self) -> None:
        self.position = self.penetration
        self.truth = self.of_the_law

    @property
    def deepest(self) -> float:
        """The largest penetration, m."""
        return float(self.penetration.max())

    @property
    def peak(self) -> float:
        """The largest force without a fault, N."""
        return float(self.law.force(self.deepest, 0.0))

    @property
    def touching(self) -> Floats:
        """1 in contact, 0 outside."""
        return (self.penetration > 0.0).astype(float)

    @property
    def depth(self) -> float:
        """The median penetration in contact, m."""
        return float(np.median(self.penetration[self.penetration > self.least]))

    @property
    def speed(self) -> float:
        """The rms velocity in contact, m/s."""
        return float(np.sqrt(np.mean(self.velocity[self.penetration > self.least] ** 2)))

    @property
    def turns(self) -> float:
        """The motion's typical angular frequency, rad/s."""
        return self.speed / float(np.std(self.penetration[self.penetration > self.least]))

    @property
    def every(self) -> int:
        """Steps of the fine grid from sample to sample."""
        return round(1.0 / (self.rate * self.step))

    @property
    def step(self) -> float:
        """Of the fine grid, s."""
        return float(self.time[1] - self.time[0])

    @property
    def spring(self) -> Floats:
        """Force at rest, N."""
        rest: Floats = self.law.force(np.maximum(self.penetration, 0.0), 0.0 * self.time)
        return rest

    def of_the_law(self, depth: float) -> tuple[float, float]:
        """Return stiffness and damping without a fault."""
        return self.law.stiffness_at(depth), self.law.damping_at(depth)

    def respond(self, response: Response) -> None:
        """Another material without memory: its slopes at rest are the truth."""
        inside = np.maximum(self.penetration, 0.0)
        self.force = np.where(self.penetration > 0.0, response(inside, self.velocity), 0.0)

        def truth(depth: float) -> tuple[float, float]:
            dx, dv = 1e-4 * depth, 1e-4 * self.speed
            x, v = np.array([depth + dx, depth - dx, depth, depth]), np.array([0.0, 0.0, dv, -dv])
            f = response(x, v)
            return float(f[0] - f[1]) / (2.0 * dx), float(f[2] - f[3]) / (2.0 * dv)

        self.truth, self.described = truth, False

    def add(self, extra: Floats) -> None:
        """Let the material add a force that depends on the past or the speed.

        The truth is its equivalent linear response: least squares over the samples near the depth.
        """
        self.force = self.force + extra
        penetration, velocity = self.penetration, self.velocity

        def truth(depth: float) -> tuple[float, float]:
            near = np.abs(penetration - depth) < 0.3 * depth
            x, v = penetration[near] - depth, velocity[near]
            columns = np.stack([x**0, x, x**2, v], axis=1)
            found = np.linalg.lstsq(
                columns / (size := np.abs(columns).max(0)), extra[near], rcond=None
            )[0]
            stiffness, damping = self.of_the_law(depth)
            return stiffness + float(found[1] / size[1]), damping + float(found[3] / size[3])

        self.truth, self.described = truth, False

    def scale(self, gain: Floats) -> None:
        """Let the material harden or soften; the truth is its last state."""
        self.force, last = self.force * gain, float(gain[-1])

        def truth(depth: float) -> tuple[float, float]:
            stiffness, damping = self.of_the_law(depth)
            return last * stiffness, last * damping

        self.truth, self.described = truth, False

    def sample(self, noise: Floats | None = None, fine: float | None = None) -> None:
        """Take samples of the fine grid, with noise on force and position (``fine``, m)."""
        every = self.every
        for name in ("time", "penetration", "velocity", "force", "position"):
            setattr(self, name, getattr(self, name)[::every])
        if self.recorded_velocity is not None:
            self.recorded_velocity = self.recorded_velocity[::every]
        white = self.random.standard_normal
        self.force = self.force + (self.noise * white(self.time.size) if noise is None else noise)
        if fine is None:
            fine = self.random.uniform(2e-5, 2e-4) * self.deepest
        self.position = self.position + fine * white(self.time.size)

    @property
    def contact(self) -> Contact:
        """Return the contact as a user prepares it."""
        return prepare(
            time=self.time,
            penetration=self.position,
            force=self.force,
            velocity=self.recorded_velocity,
        )


@dataclass(frozen=True)
class Fault:
    """A fault of one severity.

    Attributes
    ----------
    kind, severity : str
        Which fault, and how much, as text.
    damage : callable
        Its effect.
    sampled : bool
        Whether it acts on the samples with their noise, not on the fine grid.
    shown : bool
        Whether a file can show it: not if another material of the same law gives the same file.
    names : tuple of str
        Checks that identify it correctly, if the diagnosis looks for it.
    stops : bool
        Whether the verdict must be *do not trust*.
    """

    kind: str
    severity: str
    damage: Callable[[Trial], None] = lambda trial: None
    sampled: bool = False
    shown: bool = True
    names: tuple[str, ...] = ()
    stops: bool = False


def severities(
    kind: str,
    damage: Damage,
    *sizes: float,
    unit: str = "%",
    sampled: bool = False,
    shown: bool = True,
    names: tuple[str, ...] = (),
) -> list[Fault]:
    """One fault in several sizes; per cent are parts of one."""
    return [
        Fault(
            kind,
            f"{100.0 * size if unit == '%' else size:g} {unit}".replace(" °", "°"),
            lambda trial, size=size: damage(trial, size),  # type: ignore[misc]
            sampled,
            shown,
            names,
        )
        for size in sizes
    ]


def spoil(made: Trial, fault: Fault) -> Trial:
    """Put a fault on a trial, and take its samples."""
    fine = 1e-6 if made.least else None  # m, of an ideal probe
    if not fault.sampled:
        fault.damage(made)
    made.sample(fine=fine)
    if fault.sampled:
        fault.damage(made)
    return made


def good(seed: int, key: str) -> Trial:
    """Noise below 0.6 % of the peak force, 100 Hz and more, several cycles."""
    random = generator(seed, key)
    motion = str(random.choice(SEVERAL))
    return pressed(random, motion, random.uniform(3.0, 15.0), RATES, random.uniform(5e-4, 6e-3))


def hard(seed: int, key: str) -> Trial:
    """Noise of 0.5 to 2.5 % of the peak force, or a single press, or 50 to 100 Hz."""
    random = generator(seed, key)
    why = random.integers(3)
    noise = random.uniform(5e-3, 2.5e-2) if why == 0 else random.uniform(5e-4, 6e-3)
    motion = "press" if why == 1 else str(random.choice(SEVERAL))
    seconds = random.uniform(0.5, 3.0) if why == 1 else random.uniform(3.0, 15.0)
    return pressed(random, motion, seconds, (50.0, 66.0, 80.0) if why == 2 else RATES, noise)


def ideal(seed: int) -> Trial:
    """Three sines about a few millimetres for 7 s, after a time in free air; 1 kHz, 0.05 N."""
    random = np.random.default_rng([seed, 2026])
    time: Floats = np.arange(7000.0) * 1e-3
    depth = random.uniform(4e-3, 12e-3)
    exponent = random.uniform(1.0, 2.1)
    stiffness = random.uniform(4.0, 30.0) / depth**exponent
    # Such that a skew of 1 ms between force and position is 5 to 20 % of the damping.
    dissipation = exponent * 1e-3 / depth / random.uniform(0.05, 0.2)
    law = HuntCrossley(K=stiffness, B=stiffness * dissipation, n=exponent)
    frequencies = random.uniform([3.0, 8.0, 12.0], [6.0, 12.0, 20.0])
    parts = random.uniform([0.15, 0.1, 0.05], [0.3, 0.25, 0.15]) * depth
    phases = random.uniform(0.0, 2.0 * np.pi, 3)
    waves = np.sin(np.outer(time, frequencies) + phases) @ parts
    x = -3e-3 + rise((time - 0.5) / 0.8) * (depth + 3e-3 + waves)
    v = np.gradient(x, time)
    force = np.where(x > 0.0, law.force(np.maximum(x, 0.0), v), 0.0)
    return Trial(time, x, v, force, law, random, 1e3, 0.05, least=1e-3)


def generator(seed: int, key: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(key.encode())])


def pressed(
    random: np.random.Generator,
    motion: str,
    seconds: float,
    rates: tuple[float, ...],
    noise: float,
    faster: float = 1.0,
) -> Trial:
    """Draw a material, and press it.

    Parameters
    ----------
    random
        The generator of this trial.
    motion
        One of the functions below.
    seconds
        Of the recording.
    rates
        One of them, Hz.
    noise
        Of the peak force.
    faster
        Factor on the frequencies.
    """
    possible = [rate for rate in rates if rate * seconds <= MOST] or [min(rates)]
    rate = float(random.choice(possible))
    fine = rate * np.ceil(FINE / rate)
    deepest = np.exp(random.uniform(np.log(1e-3), np.log(15e-3)))
    # The motion starts before the recording, which begins in free air, or in contact.
    time: Floats = np.arange(float(round(seconds * fine))) / fine
    x = deepest * MOTIONS[motion](time, seconds, faster, random)
    v = np.gradient(x, time)
    inside = x > 0.0
    turns = float(np.sqrt(np.mean(v[inside] ** 2)) / np.std(x[inside]))
    exponent = random.uniform(1.0, 2.2)
    peak = np.exp(random.uniform(np.log(0.3), np.log(50.0)))
    depth = float(np.median(x[inside]))
    # Loss tangent at the typical frequency; the force stays positive on withdrawal.
    lag = np.exp(random.uniform(np.log(0.05), np.log(0.4))) / turns
    lag = min(lag, 0.6 * depth / (exponent * float(np.abs(v[inside]).max())))
    stiffness = peak / x.max() ** exponent
    law = HuntCrossley(K=stiffness, B=stiffness * lag * exponent / depth, n=exponent)
    force = np.where(inside, law.force(np.maximum(x, 0.0), v), 0.0)
    return Trial(time, x, v, force, law, random, rate, noise * peak)


def rise(part: Floats) -> Floats:
    """From 0 to 1 with the least jerk."""
    u = np.clip(part, 0.0, 1.0)
    smooth: Floats = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return smooth


def _touches(time: Floats, seconds: float, faster: float, random: np.random.Generator) -> Floats:
    """Through the surface at 1 to 2.5 Hz, each touch a little different."""
    turns = 2.0 * np.pi * random.uniform(1.0, 2.5) * faster
    middle = random.uniform(-0.1, 0.4)
    size = 1.0 + 0.15 * np.sin(0.17 * turns * time + random.uniform(0.0, 6.0))
    x = middle - size * np.cos(turns * time)
    wave: Floats = x / x.max()
    return wave


def _press(time: Floats, seconds: float, faster: float, random: np.random.Generator) -> Floats:
    """In and out once, the way out at another speed; faster: as often."""
    seconds = seconds / faster
    time = time % seconds
    start, turn, end = seconds * np.sort(random.uniform([0.05, 0.45, 0.9], [0.15, 0.6, 0.98]))
    above = random.uniform(0.1, 0.4)
    into, out = (time - start) / (turn - start), (time - turn) / (end - turn)
    return -above + (1.0 + above) * (rise(into) - rise(out))


def _ramps(time: Floats, seconds: float, faster: float, random: np.random.Generator) -> Floats:
    """In and out at nearly constant speeds, each another."""
    corners, heights = [0.0], [-0.2]
    while corners[-1] < seconds:
        corners.append(corners[-1] + random.uniform(0.2, 1.2) / faster)
        heights.append(random.uniform(0.7, 1.0) if heights[-1] < 0.5 else random.uniform(-0.3, 0.2))
    line = np.interp(time, corners, heights)
    step = time[1] - time[0]
    smooth: Floats = gaussian_filter1d(line, 0.03 / faster / step, mode="nearest")
    return smooth / max(float(smooth.max()), 0.3)


def _holds(time: Floats, seconds: float, faster: float, random: np.random.Generator) -> Floats:
    """In, held, out: three and more times."""
    period = seconds / max(3.0, round(seconds / 2.5)) / faster
    phase, above = time % period / period, 0.2
    depths = random.uniform(0.6, 1.0, int(np.ceil(seconds / period)) + 1)
    size = depths[(time // period).astype(int)]
    wave = (size + above) * (rise((phase - 0.05) / 0.25) - rise((phase - 0.6) / 0.25)) - above
    return np.asarray(wave / max(wave.max(), 0.3))


def _chirp(time: Floats, seconds: float, faster: float, random: np.random.Generator) -> Floats:
    """About a depth, from 0.5 to 5 Hz."""
    low, high = random.uniform(0.4, 1.0) * faster, random.uniform(3.0, 6.0) * faster
    phase = 2.0 * np.pi * (low * time + 0.5 * (high - low) * time**2 / seconds)
    return _about(time, np.sin(phase), random.uniform(0.2, 0.8), seconds, random)


def _waves(time: Floats, seconds: float, faster: float, random: np.random.Generator) -> Floats:
    """About a depth, along four to six sines of 0.5 to 6 Hz."""
    count = random.integers(4, 7)
    turns = 2.0 * np.pi * faster * np.exp(random.uniform(np.log(0.5), np.log(6.0), count))
    phases = random.uniform(0.0, 2.0 * np.pi, count)
    waves = np.sin(np.outer(time, turns) + phases) @ random.uniform(0.5, 1.0, count)
    waves = waves / np.abs(waves).max()
    return _about(time, waves, random.uniform(0.3, 1.0), seconds, random)


def _about(
    time: Floats, waves: Floats, size: float, seconds: float, random: np.random.Generator
) -> Floats:
    """Move about a depth, after an approach, which two of three recordings have."""
    last = min(1.0, 0.2 * seconds)
    near = rise((time - 0.3 * last) / last) if random.random() < 0.67 else np.ones(time.size)
    x = (1.0 + size * waves) / (1.0 + size)
    return -0.2 + near * (0.2 + x)


MOTIONS: dict[str, Callable[[Floats, float, float, np.random.Generator], Floats]] = {
    "touches": _touches,
    "press": _press,
    "ramps": _ramps,
    "holds": _holds,
    "chirp": _chirp,
    "multi-sine": _waves,
}


Noise = Callable[[Trial, int], Floats]  # of a trial and a number of samples, N
CLEAN_MOTIONS = ("touches", "press", "multi-sine")
SHORT = "0.5–1.5 s"
LENGTHS = {SHORT: (0.5, 1.5), "1.5–6 s": (1.5, 6.0), "6–20 s": (6.0, 20.0)}


def _white(trial: Trial, count: int) -> Floats:
    return trial.noise * trial.random.standard_normal(count)


def _autoregressive(share: float) -> Noise:
    """Each sample has a share of the one before."""

    def noise(trial: Trial, count: int) -> Floats:
        white = trial.random.standard_normal(count + 500)
        made: Floats = lfilter([np.sqrt(1.0 - share**2)], [1.0, -share], white)[500:]
        return trial.noise * made

    return noise


def _low_pass(hertz: float) -> Noise:
    """White noise behind the sensor's filter, of second order."""

    def noise(trial: Trial, count: int) -> Floats:
        if 2.2 * hertz >= trial.rate:  # nothing to filter at that rate
            return _white(trial, count)
        sections = butter(2, hertz, fs=trial.rate, output="sos")
        made = sosfilt(sections, trial.random.standard_normal(count + 500))[500:]
        return np.asarray(trial.noise * made / np.std(made))

    return noise


def _proportional(trial: Trial, count: int) -> Floats:
    """In proportion to the force, and a little everywhere."""
    share = 2.0 * np.abs(trial.force[:: trial.every]) / trial.peak + 0.05
    return share * _white(trial, count)


def _heavy(trial: Trial, count: int) -> Floats:
    """Student's t with three degrees of freedom, of the same variance."""
    return np.asarray(trial.noise * trial.random.standard_t(3.0, count) / np.sqrt(3.0))


def _steps(trial: Trial, count: int) -> Floats:
    """Force in steps of 1 to 3 % of the peak."""
    force = trial.force[:: trial.every]
    step = trial.random.uniform(0.01, 0.03) * trial.peak
    analogue = force + 0.1 * step * trial.random.standard_normal(count)
    return np.asarray(step * np.round(analogue / step) - force)


NOISES: dict[str, Noise] = {
    "white": _white,
    **{f"AR(1) {share:g}": _autoregressive(share) for share in (0.5, 0.8, 0.9, 0.95, 0.98)},
    **{f"low-pass {hertz:g} Hz": _low_pass(hertz) for hertz in (20.0, 50.0, 100.0, 200.0)},
    "∝ force": _proportional,
    "Student t3": _heavy,
    "steps": _steps,
    "6 × faster": _white,
}


def clean(seed: int, kind: str, motion: str, length: str) -> Trial:
    """Return a recording without a fault."""
    random = generator(seed, f"{kind}/{motion}/{length}")
    faster = 6.0 if kind == "6 × faster" else 1.0
    least = 250.0 if length == SHORT else 100.0  # else there are too few samples to check a law
    if kind in ("6 × faster", "low-pass 200 Hz", "low-pass 100 Hz"):
        least = 1000.0 if (kind, motion) == ("6 × faster", "multi-sine") else 500.0
    rates = tuple(rate for rate in RATES if rate >= least)
    seconds = random.uniform(*LENGTHS[length])
    share = np.exp(random.uniform(np.log(5e-4), np.log(1e-2)))
    made = pressed(random, motion, seconds, rates, float(share), faster)
    made.sample(NOISES[kind](made, made.time[:: made.every].size))
    return made
