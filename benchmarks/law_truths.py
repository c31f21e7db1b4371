"""Known laws, a motion, and the lowest errors that are possible."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate import (
    ContactGate,
    FlatSpectrum,
    GeneralisedHuntCrossley,
    PowerLawRelaxation,
    Scale,
    SingleRelaxation,
    ViscoelasticContact,
)
from palpate.validation import Floats

DT = 1e-3
SECONDS = 4.0
UNITS = Scale(10e-3, 50e-3, 20.0)
GATE = ContactGate(1e-3)
EXPONENT = 1.5
STIFFNESS = 0.5 * 20.0 / 10e-3**EXPONENT


@dataclass(frozen=True)
class Truth:
    """A law, and the right verdict on it."""

    name: str
    verdict: tuple[str, str, bool]  # damping, memory, linear
    law: GeneralisedHuntCrossley

    def found_by(self, estimator: ViscoelasticContact) -> bool:
        """Return whether the verdict is this law."""
        chosen = estimator.verdict().candidate
        return (chosen.damping, chosen.memory, chosen.linear) == self.verdict


def law_of(damping: str, memory: float, relaxation: Any = None, n: float = EXPONENT) -> Any:
    """Return a law by its damper and memory, 10 N at 10 mm."""
    p = n - 1.0 if damping == "half-space" else n
    force = 0.0 if damping == "none" else 0.1
    stiffness = 0.5 * 20.0 / 10e-3**n
    return GeneralisedHuntCrossley(
        stiffness, n, force * 20.0 / 50e-3 / 10e-3**p, p, memory * stiffness, relaxation
    )


def truths(full: bool) -> Iterator[Truth]:
    """Return laws without memory, and with that of one tier."""
    yield Truth("Kelvin–Voigt", ("half-space", "none", True), law_of("half-space", 0.0, n=1.0))
    yield Truth("Hunt–Crossley", ("hunt-crossley", "none", False), law_of("hunt-crossley", 0.0))
    yield Truth("half-space", ("half-space", "none", False), law_of("half-space", 0.0))
    # Six relaxation times a factor of four apart, or twelve of two, from two time steps on.
    low, high = (2.0**0.5, 4096.0 * 2.0**0.5) if full else (1.0, 4096.0)
    kinds: dict[str, tuple[float, Any]] = {"flat": (0.5, FlatSpectrum(low * DT, high * DT))}
    if full:
        kinds["single"] = 0.5, SingleRelaxation(0.05)
        kinds["power-law"] = 1.0, PowerLawRelaxation(0.3, low * DT, high * DT)
    for memory, (size, relaxation) in kinds.items():
        for damping in ("none", "hunt-crossley", "half-space"):
            if memory != "flat" or damping != "none":
                law = law_of(damping, size, relaxation)
                yield Truth(f"{damping}, {memory}", (damping, memory, False), law)


def motion(seed: int) -> tuple[Floats, Floats]:
    """An approach of 0.4 s, and three sines of 4, 11 and 15 rad/s about 10 mm."""
    first, second = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, 2)
    time = DT * np.arange(round((SECONDS + 0.4) / DT)) - 0.4
    parts = ((1e-3, 4.0, 0.0), (1.8e-3, 11.0, first), (1.8e-3, 15.0, second))
    start = 10e-3 + sum(size * math.sin(phase) for size, _, phase in parts)
    slow = (start + 2e-3) / 0.4
    x = 10e-3 + sum(size * np.sin(rate * time + phase) for size, rate, phase in parts)
    v = sum(size * rate * np.cos(rate * time + phase) for size, rate, phase in parts)
    return np.where(time < 0.0, start + slow * time, x), np.where(time < 0.0, slow, v)


def noise(seed: int, size: int, correlation: float) -> Floats:
    """Gaussian noise of unit variance, white or AR(1)."""
    white = np.random.default_rng(10_000 + seed).standard_normal(size)
    if correlation == 0.0:
        return white
    result, now, fresh = np.empty(size), white[0], math.sqrt(1.0 - correlation**2)
    for k, each in enumerate(white.tolist()):
        result[k] = now = correlation * now + fresh * each
    return result


def identified(
    law: GeneralisedHuntCrossley, seed: int, decibels: float, correlation: float, memory: str
) -> tuple[ViscoelasticContact, tuple[Floats, Floats, Floats], float]:
    """Return an estimator fitted to one motion, the motion and the force, and the noise, N."""
    x, v = motion(seed)
    clean = law.force_along(x, v, DT)
    deviation = float(np.sqrt(np.mean(clean[x > 0.0] ** 2))) * 10.0 ** (-decibels / 20.0)
    force = clean + deviation * noise(seed, x.size, correlation)
    estimator = ViscoelasticContact(memory=memory, gate=GATE, scale=UNITS)  # type: ignore[arg-type]
    estimator.replay(x, v, force, at=())
    estimator.finish_pending()
    return estimator, (x, v, force), deviation


def cramer_rao(truth: Truth, x: Floats, v: Floats, deviation: float) -> dict[int, float]:
    """Return the Cramér–Rao bounds of a law's fitted parameters, by their places."""
    damping, memory, linear = truth.verdict
    places = [0] + ([] if linear else [1]) + ([] if damping == "none" else [2])
    places += {"none": [], "flat": [4], "single": [4, 7], "power-law": [4, 5]}[memory]
    columns = []
    for place in places:
        step = 1e-5 * truth.law.parameters[place]
        sides = []
        for sign in (1.0, -1.0):
            numbers = truth.law.parameters
            numbers[place] += sign * step
            if place == 1:
                numbers[3] += sign * step  # p follows n
            sides.append(GeneralisedHuntCrossley.from_parameters(numbers).force_along(x, v, DT))
        columns.append((sides[0] - sides[1]) / (2.0 * step))
    # Out of contact, two hundredths of a unit above the surface, the force is the offset alone.
    seen = (x > GATE.minimum_penetration) | (x < -0.02 * UNITS.penetration)
    slopes = np.column_stack([*columns, np.ones_like(x)])[seen]
    size = np.linalg.norm(slopes, axis=0)
    inverse = np.linalg.inv((slopes / size).T @ (slopes / size))
    errors = deviation * np.sqrt(np.diag(inverse)) / size
    return dict(zip(places, errors.tolist(), strict=False))
