"""Simulated contacts of ``benchmarks.laws``: materials, motions, noise, and the exact answer."""

import math
import zlib
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks.diagnosis.trials import MOTIONS
from palpate.validation import Floats

Random = np.random.Generator

DAMPERS = "hunt-crossley", "half-space", "kelvin-voigt"
# Ranges of the relaxation times, s; a spectrum has four times an octave from the first to the last.
MEMORIES = {
    "none": (),
    "one time": ((0.03, 1.0),),
    "two times": ((0.02, 0.1), (0.3, 2.0)),
    "three times": ((0.02, 0.06), (0.15, 0.5), (1.0, 3.0)),
    "flat": ((3e-3, 20e-3), (1.0, 10.0)),
    "power law": ((3e-3, 20e-3), (1.0, 10.0)),
}
SLS = "SLS × √x"
RELAXING = [(damper, memory) for damper in DAMPERS for memory in MEMORIES if memory != "none"]
USUAL = list(MOTIONS)
SHORT = "one touch", "one cycle"
BEGINNINGS = *SHORT, "lasting sine", "lasting sine after a hold"
NOISES = "white", "AR .9", "20 Hz low-pass", "∝ load"
LATE = "clean", "3 ms late", "10 ms late", "low-passed"
RATES = 100.0, 200.0, 500.0, 1000.0
MOST = 4000  # samples of a recording
FINE = 4000.0  # Hz at least, of the simulation


@dataclass(frozen=True)
class Material:
    """F = K xⁿ + B xᵖ v + Σ mᵢ gᵢ,  ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ  for x > 0, else 0.

    One outside of the family has n = 1.5, and F = √x (K x + B v + Σ mᵢ gᵢ) with gᵢ of x: a standard
    linear solid times the radius of contact.
    """

    stiffness: float
    exponent: float
    damping: float
    damping_exponent: float
    times: Floats
    branches: Floats  # mᵢ, N/mⁿ
    outside: bool = False

    def elastic(self, x: Floats, step: float) -> Floats:
        """Force of spring and memory, N."""
        depth = np.maximum(x, 0.0)
        power = depth if self.outside else depth**self.exponent
        force, rise = self.stiffness * power, np.diff(power, prepend=power[0])
        for time, stiffness in zip(self.times, self.branches, strict=True):
            keep = math.exp(-step / time)  # exact where xⁿ is linear within a step
            share = stiffness * time / step * (1.0 - keep)
            force = force + share * lfilter([1.0], [1.0, -keep], rise)
        return np.where(x > 0.0, force * (np.sqrt(depth) if self.outside else 1.0), 0.0)

    def damper(self, x: Floats, v: Floats) -> Floats:
        """Force of the damper, N."""
        return np.where(x > 0.0, self.damping * np.maximum(x, 1e-9) ** self.damping_exponent * v, 0)

    def response(self, depth: float, omega: float) -> tuple[float, float]:
        """K′ and B′ of a small oscillation about a depth at which it has relaxed, SI."""
        phase = 1j * omega * self.times
        memory = complex(np.sum(self.branches * phase / (1.0 + phase)))
        share = 1.0 if self.outside else self.exponent
        slope = depth ** (self.exponent - 1.0)
        whole = slope * (self.exponent * self.stiffness + share * memory)
        return whole.real, whole.imag / omega + self.damping * depth**self.damping_exponent


@dataclass(frozen=True)
class Case:
    """The kinds of one contact; with a seed its key sets all that is drawn."""

    part: str
    number: int
    damper: str
    memory: str
    motion: str
    noise: str = "white"
    fault: str = "clean"

    @property
    def key(self) -> str:
        """The same text in every build."""
        return "/".join(map(str, asdict(self).values()))


@dataclass(frozen=True)
class Pressed:
    """A simulated recording, its material, and the motion's median depth and frequency."""

    time: Floats
    penetration: Floats
    force: Floats
    material: Material
    rate: float
    noise: float  # of the peak force
    depth: float
    frequency: float  # rms speed over rms displacement in contact, rad/s


def cases(part: str) -> list[Case]:
    """Return every contact of a part."""
    white = "white"
    rows: dict[str, list[Any]] = {
        "a": [*product(DAMPERS, MEMORIES, USUAL)] * 2,
        "b": [(*RELAXING[k % 15], motion) for motion in BEGINNINGS for k in range(24)],
        "c": [*product(DAMPERS, ["none"], USUAL, NOISES)] * 3,
        "f": [
            *((*RELAXING[k % 15], USUAL[k % 6], white, fault) for fault in LATE for k in range(33)),
            *((DAMPERS[k % 3], "none", USUAL[k // 3 % 6], white, LATE[2]) for k in range(33)),
        ],
        "g": [
            *product(["half-space"], [SLS], USUAL * 4),
            *product(DAMPERS[:2], ["none"], USUAL * 2, [white], ["friction"]),
        ],
        "h": [
            ("hunt-crossley", memory, motion, noise, fault)
            for noise, fault in ((white, "clean"), ("AR .9", "clean"), (white, "K + 10 %"))
            for memory, motion in [*product(("none", "one time"), ("multi-sine", "chirp"))] * 5
        ],
    }
    return [Case(part, k, *row) for k, row in enumerate(rows.get(part, []))]


def press(case: Case, seed: int) -> Pressed:
    """Draw motion and material, and simulate the force on a finer clock."""
    random = np.random.default_rng([seed, zlib.crc32(case.key.encode())])
    rate = float(random.choice(RATES[2:] if case.motion in SHORT or case.part == "h" else RATES))
    noise = _between(random, 1e-3 if case.part == "c" else 2e-3, 2e-2)
    every = math.ceil(FINE / rate)
    step = 1.0 / (every * rate)
    wave, first = _motion(case.motion, step, min(random.uniform(4.0, 10.0), MOST / rate), random)
    x = _between(random, 1e-3, 15e-3) * wave / np.max(wave)
    v = np.gradient(x, step)
    inside = np.flatnonzero(x > 0.0)
    inside = inside[inside >= first]
    depth = float(np.median(x[inside]))
    omega = float(np.sqrt(np.mean(v[inside] ** 2)) / np.std(x[inside]))
    fastest = float(np.max(np.abs(v[inside])))
    material = _material(case, random, float(np.max(x)), depth, omega, fastest)
    elastic = material.elastic(x, step)
    if case.fault == "K + 10 %":
        elastic[x.size // 2 :] *= 1.1
    force = _fault(case.fault, elastic + material.damper(x, v), v, step, random)[first::every]
    peak = float(np.max(force))
    force = force + noise * peak * _noise(case.noise, force / peak, rate, random)
    time = np.arange(force.size) / rate
    return Pressed(time, x[first::every], force, material, rate, noise, depth, omega)


def _between(random: Random, low: float, high: float) -> float:
    return math.exp(random.uniform(math.log(low), math.log(high)))


def _clock(step: float, seconds: float) -> Floats:
    return np.asarray(step * np.arange(float(round(seconds / step))))


def _motion(kind: str, step: float, seconds: float, random: Random) -> tuple[Floats, int]:
    """Penetration at every step in any unit, and the first that is recorded."""
    if kind in MOTIONS:
        faster = random.uniform(2.0, 5.0) if kind == "press" else 1.0  # several presses
        time = _clock(step, seconds)
        while (x := MOTIONS[kind](time, seconds, faster, random))[0] > 0.0:
            pass  # another that begins in free air
        return x, 0
    if kind == "one touch":
        lasts, above = random.uniform(0.06, 0.18), random.uniform(0.4, 1.5)
        width = 0.5 * math.pi * lasts / math.acos(math.sqrt(above / (1.0 + above)))
        time = _clock(step, 1.0) - 0.5
        bell = np.cos(np.pi * np.clip(time / width, -0.5, 0.5)) ** 2
        return np.asarray((1.0 + above) * bell - above), 0
    # Cycles that begin in contact, after some seconds of the same, or of rest there.
    turns, before = random.uniform(0.5, 2.0), random.uniform(1.0, 4.0)
    count = 1 if kind == "one cycle" else random.integers(6, 13)
    time = _clock(step, before + count / turns) - before
    moving = np.maximum(time, 0.0) if kind.endswith("hold") else time
    phase = random.uniform(0.0, 2.0 * np.pi)
    x = 1.0 + random.uniform(0.2, 0.7) * np.sin(2.0 * np.pi * turns * moving + phase)
    approach = np.clip((time + before) / 0.5, 0.0, 1.0)
    begun = approach**2 * (3.0 - 2.0 * approach)
    return np.asarray(x * begun), int(np.searchsorted(time, 0.0))


def _material(
    case: Case, random: Random, deepest: float, depth: float, omega: float, fastest: float
) -> Material:
    """Draw a material whose damper has a loss tangent of 0.03 to 0.3 at the motion's frequency."""
    n = 1.0 if case.damper == "kelvin-voigt" else random.uniform(1.1, 2.2)
    n = 1.5 if case.memory == SLS else n
    p = {"hunt-crossley": n, "half-space": n - 1.0, "kelvin-voigt": 0.0}[case.damper]
    stiffness = _between(random, 0.3, 50.0) / deepest**n
    # The damper alone does not pull.
    loss = min(_between(random, 0.03, 0.3), 0.6 * omega * depth / (n * fastest))
    damping = loss * stiffness * n * depth ** (n - 1.0 - p) / omega
    ranges = MEMORIES["one time" if case.memory == SLS else case.memory]
    times = np.array([_between(random, *each) for each in ranges])
    shares = random.uniform(0.5, 1.5, times.size)
    if case.memory in ("flat", "power law"):
        times = times[0] * 2.0 ** np.arange(0.0, math.log2(times[1] / times[0]), 0.25)
        shares = times ** -(random.uniform(0.1, 0.3) if case.memory == "power law" else 0.0)
    branches = stiffness * random.uniform(0.3, 1.5) * shares / max(float(np.sum(shares)), 1e-9)
    return Material(stiffness, n, damping, p, times, branches, case.memory == SLS)


def _fault(fault: str, force: Floats, v: Floats, step: float, random: Random) -> Floats:
    if fault.endswith("late"):
        late = round(1e-3 * float(fault.split()[0]) / step)
        return np.concatenate([np.full(late, force[0]), force[: force.size - late]])
    if fault == "low-passed":
        return np.asarray(lfilter(*butter(2, random.uniform(15.0, 30.0), fs=1.0 / step), force))
    if fault == "friction":
        way = np.tanh(5.0 * v / np.sqrt(np.mean(v**2)))
        return np.asarray(force * (1.0 + random.uniform(0.03, 0.08) * way))
    return force


def _noise(kind: str, load: Floats, rate: float, random: Random) -> Floats:
    """Noise of unit variance; where it grows with the load, at the peak."""
    white = random.standard_normal(load.size)
    if kind == "AR .9":
        return np.asarray(math.sqrt(1.0 - 0.81) * lfilter([1.0], [1.0, -0.9], white))
    if kind == "20 Hz low-pass":
        slow = lfilter(*butter(2, 20.0, fs=rate), white)
        return np.asarray(slow / np.std(slow))
    return white * (0.05 + load) if kind == "∝ load" else white
