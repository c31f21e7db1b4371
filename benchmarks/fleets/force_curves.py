"""Young's modulus of force curves of known truth: sphere and cone, baselines, adhesion."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.report import Row, Section, at_least
from palpate.findings import Check
from palpate.identification.quantities.elastic_modulus import Cone, Sphere, Tip
from palpate.identification.quantities.indentation import Indentation, fit_approach

Floats = NDArray[np.float64]
COUNT = 40
SAMPLES = 2000  # each way
SEED = 48


@dataclass(frozen=True)
class ForceCurve:
    """An approach and a retract, SI, and the truth."""

    penetration: Floats
    force: Floats
    segment: NDArray[np.int64]
    tip: Tip
    modulus: float
    depth: float
    adheres: bool
    bends: bool

    def fit(self) -> Indentation:
        """Return palpate's fit of the approach."""
        return fit_approach(self.penetration, self.force, self.segment, self.tip)


def force_curve(number: int) -> ForceCurve:
    """Return a curve, always the same: 30 to 300 nm deep, noise of 0.5 to 1.5 % of the peak.

    Even numbers have a sphere, odd ones a cone; of each eight in turn four adhere and four have a
    baseline that bends by 3 to 10 % of the peak. All baselines have a slope.
    """
    random = np.random.default_rng([SEED, number])
    adheres, bends = number // 2 % 2 == 1, number // 4 % 2 == 1
    tip: Tip = Cone(math.radians(random.uniform(18.0, 36.0)))
    if number % 2 == 0:
        tip = Sphere(random.uniform(1e-6, 6e-6))
    depth = math.exp(random.uniform(math.log(30e-9), math.log(300e-9)))
    peak, travel = random.uniform(1e-9, 4e-9), random.uniform(1e-6, 3e-6)
    reduced = peak / tip.force(1.0, depth)
    way = np.linspace(-travel, depth, SAMPLES)
    x = np.concatenate([way, way[::-1]])
    segment = np.repeat([0, 1], SAMPLES)
    force = reduced * tip.factor * np.maximum(x, 0.0) ** tip.exponent
    if adheres:
        pull = random.uniform(0.05, 0.2) * peak
        if isinstance(tip, Sphere):
            force = _adhesive_sphere(x, segment, reduced, tip.radius, pull)
        else:  # a neck on the way out
            neck = np.clip(1.0 + x / (0.3 * depth), 0.0, 1.0)
            force = force - pull * neck * (segment == 1)
    along = (x + travel) / travel
    slope, bend = random.uniform(-0.08, 0.08), random.uniform(0.03, 0.1) * random.choice([-1, 1])
    force = force + peak * (random.uniform(-0.3, 0.3) + slope * along + bends * bend * along**2)
    force = force + random.uniform(0.005, 0.015) * peak * random.normal(size=x.size)
    start = random.uniform(10e-6, 50e-6)
    modulus = 0.75 * reduced  # incompressible
    return ForceCurve(x - start, force, segment, tip, modulus, depth, adheres, bends)


def _adhesive_sphere(
    x: Floats, segment: NDArray[np.int64], reduced: float, radius: float, pull: float
) -> Floats:
    """Return the force on a sphere by Johnson, Kendall and Roberts (1971); it jumps into contact.

    With the contact radius a and the work of adhesion w = 2 P/(3 π R) of a pull-off force P:
    x = a²/R − √(2 π w a/E*), F = 4 E* a³/(3 R) − √(8 π w E* a³); the neck breaks where dx/da = 0.
    """
    work = pull / (1.5 * math.pi * radius)
    least = (math.pi * work * radius**2 / (8.0 * reduced)) ** (1.0 / 3.0)
    a = np.geomspace(least, 3.0 * (least + math.sqrt(radius * x.max())), 4000)
    depth = a**2 / radius - np.sqrt(2.0 * math.pi * work * a / reduced)
    force = 4.0 / 3.0 * reduced * a**3 / radius - np.sqrt(8.0 * math.pi * work * reduced * a**3)
    touching = np.where(segment == 0, x > 0.0, x > depth[0])
    return np.where(touching, np.interp(x, depth, force), 0.0)


def measure() -> Section:
    """Count the curves whose modulus is within two error bars, and whose adhesion is named."""
    curves = [force_curve(number) for number in range(COUNT)]
    fits = [curve.fit() for curve in curves]
    values = [fit.modulus.value for fit in fits]
    errors = [
        abs(value.value - curve.modulus) / value.whole_error
        for value, curve in zip(values, curves, strict=True)
    ]
    named = [
        any(finding.check == Check.PULL_OFF for finding in fit.findings) == curve.adheres
        for fit, curve in zip(fits, curves, strict=True)
    ]
    trusted = [fit.modulus.mark == "trust" for fit in fits]
    rows = [
        Row(f"E within two error bars, of {COUNT}", sum(error <= 2.0 for error in errors), "",
            limit=at_least(36)),
        Row("median error bar", 100.0 * float(np.median(
            [value.whole_error / value.value for value in values])), "%"),
        Row("adhesion named where it is, and only there", sum(named), "",
            limit=at_least(COUNT)),
        Row("trusted", sum(trusted), ""),
    ]  # fmt: skip
    notes = [
        "sphere and cone, baselines with slope and bend, adhesion by Johnson, Kendall, Roberts"
    ]
    return Section("Young's modulus of synthetic force curves", rows, notes)
