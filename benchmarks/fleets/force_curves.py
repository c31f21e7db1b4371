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


#: What may be wrong with a curve of :func:`faulty_curve`.
FAULTS = ("none", "wrong tip", "thin sample", "tilted baseline")
EACH = 12


def faulty_curve(fault: str, number: int, *, stated: bool = False) -> tuple[Indentation, float]:
    """Return palpate's fit and the true modulus of a curve with a fault, always the same.

    Even numbers have a sphere, odd ones a cone, and the wrong tip is the other; a thin sample, of 3
    to 7 µm (Dimitriadis 2002; ``stated`` to palpate or not), and a tilted baseline have spheres.
    The baseline tilts by 5 to 15 % of the peak over the position of the piezo. 1 to 20 kPa, noise
    of 0.2 to 0.8 % of the peak, indentation of 0.08 to 0.3 of the radius.
    """
    random = np.random.default_rng([SEED, 69, number])
    modulus = math.exp(random.uniform(math.log(1e3), math.log(2e4)))
    radius = random.uniform(2e-6, 8e-6)
    half_angles = np.radians(random.uniform(18.0, 36.0, 2))
    depth, travel = radius * random.uniform(0.08, 0.3), random.uniform(2e-6, 5e-6)
    thickness = random.uniform(3e-6, 7e-6)
    sphere, cone = Sphere(radius), Cone(float(half_angles[0]))
    true: Tip = sphere if number % 2 == 0 or fault in FAULTS[2:] else cone
    named = true
    if fault == "wrong tip":
        named = Cone(float(half_angles[1])) if true is sphere else sphere
    if fault == "thin sample":
        true = Sphere(radius, thickness)
        named = true if stated else sphere
    depths = np.linspace(-travel, depth, 20_000)
    law = np.array([true.force(modulus / 0.75, x) for x in depths])
    compliance = depth * random.uniform(0.5, 3.0) / law[-1]
    base = np.linspace(-travel, depth + compliance * law[-1], SAMPLES)
    force = np.interp(base, depths + compliance * law, law)
    if fault == "tilted baseline":
        tilt = random.choice([-1, 1]) * random.uniform(0.05, 0.15)
        force = force + tilt * law[-1] * (base - base[0]) / (base[-1] - base[0])
    base, force = (np.concatenate([each, each[::-1]]) for each in (base, force))
    force = force + law[-1] * random.uniform(0.002, 0.008) * random.normal(size=force.size)
    segment = np.repeat([0, 1], SAMPLES)
    return fit_approach(base - compliance * force, force, segment, named, base=base), modulus


def falsely_trusted(fits: list[tuple[Indentation, float]]) -> int:
    """Count the moduli that are wrong by more than 10 % and trusted all the same."""
    return sum(
        fit.modulus.mark == "trust" and abs(fit.modulus.value.value / modulus - 1.0) > 0.1
        for fit, modulus in fits
    )


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
    for fault in FAULTS:
        faulty = [faulty_curve(fault, number) for number in range(EACH)]
        right = EACH - falsely_trusted(faulty)
        rows.append(
            Row(f"{fault}: within 10 % or not trusted, of {EACH}", right, "", limit=at_least(EACH))
        )
        trusted = [fit.modulus.mark == "trust" for fit, _ in faulty]
        rows.append(Row(f"{fault}: trusted", sum(trusted), ""))
    notes = [
        "sphere and cone, baselines with slope and bend, adhesion by Johnson, Kendall, Roberts"
    ]
    return Section("Young's modulus of synthetic force curves", rows, notes)
