"""Faults between a material and its recording, one at a time."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis.probing import SAMPLE_TIME, Probing
from palpate.validation import Floats

Damage = Callable[[Probing], None]


@dataclass(frozen=True)
class Fault:
    """A fault of one severity.

    Attributes
    ----------
    kind, severity : str
        Which fault, and how much, as text.
    before, after : callable, optional
        Its effect before the sensors' noise, and after it.
    names : tuple of str
        Checks that identify it correctly.
    stops : bool
        Whether the verdict must be *do not trust*.
    """

    kind: str
    severity: str
    before: Damage | None = None
    after: Damage | None = None
    names: tuple[str, ...] = ()
    stops: bool = False


def _spring(p: Probing) -> Floats:
    """Force at rest, N."""
    rest: Floats = p.law.force(np.maximum(p.penetration, 0.0), np.zeros_like(p.time))
    return rest


def _later(values: Floats, seconds: float) -> Floats:
    time = SAMPLE_TIME * np.arange(values.size)
    shifted: Floats = np.interp(time - seconds, time, values)
    return shifted


def surface(metres: float) -> Damage:
    """The penetration is counted from another surface."""

    def damage(p: Probing) -> None:
        p.penetration = p.penetration + metres

    return damage


def delay(seconds: float) -> Damage:
    """The force lags."""

    def damage(p: Probing) -> None:
        p.force = _later(p.force, seconds)

    return damage


def change(step: float) -> Damage:
    """The material is stiffer from 4 s on; the truth is the last."""

    def damage(p: Probing) -> None:
        p.force = np.where(p.time > 4.0, (1.0 + step) * p.force, p.force)
        p.stiffness, p.damping = (1.0 + step) * p.stiffness, (1.0 + step) * p.damping
        p.law_is_true = False

    return damage


def gain_drift(part: float) -> Damage:
    """The material softens by a part; the truth is that at the end."""

    def damage(p: Probing) -> None:
        p.force = p.force * (1.0 - part * p.time / p.time[-1])
        p.stiffness, p.damping = (1.0 - part) * p.stiffness, (1.0 - part) * p.damping
        p.law_is_true = False

    return damage


def offset_drift(part: float) -> Damage:
    """The zero of the force drifts by a part of its largest."""

    def damage(p: Probing) -> None:
        p.force = p.force + part * float(p.force.max()) * p.time / p.time[-1]

    return damage


def memory(part: float, tau: float) -> Damage:
    """A relaxing branch; the truth is the response at the motion's frequency."""

    def damage(p: Probing) -> None:
        spring, state = _spring(p), np.zeros(p.time.size)
        decay = np.exp(-SAMPLE_TIME / tau)
        for k in range(1, spring.size):
            state[k] = decay * state[k - 1] + spring[k] - spring[k - 1]
        p.force = p.force + part * state
        inside = p.penetration[p.penetration > 1e-3]
        turn = p.speed / float(np.std(inside)) * tau
        share = part / (1.0 + turn**2)
        p.stiffness, p.damping = (
            p.stiffness * (1.0 + share * turn**2),
            p.damping + share * tau * p.stiffness,
        )
        p.law_is_true = False

    return damage


def friction(part: float) -> Damage:
    """A part of the force that changes sign with the direction."""

    def damage(p: Probing) -> None:
        p.force = p.force + part * _spring(p) * np.tanh(20.0 * p.velocity / p.speed)

    return damage


def damping_form(power: float) -> Damage:
    """Damping in proportion to another power of depth, the same at working depth."""

    def damage(p: Probing) -> None:
        x = np.maximum(p.penetration, 0.0)
        ratio = np.where(x > 0.0, (np.maximum(x, 1e-9) / p.depth) ** power, 0.0)
        p.force = _spring(p) + p.damping * ratio * p.velocity * (x > 0.0)
        p.law_is_true = False

    return damage


def quadratic(p: Probing) -> None:
    """F = K₁x + K₂x² + Bv, each spring with half of the force at working depth."""
    x, d = np.maximum(p.penetration, 0.0), p.depth
    at_depth = float(p.law.force(d, 0.0))
    p.force = 0.5 * at_depth * (x / d + (x / d) ** 2) + p.damping * p.velocity * (x > 0.0)
    p.stiffness = 1.5 * at_depth / d
    p.law_is_true = False


def linear(p: Probing) -> None:
    """F = Kx + Bv."""
    x, d = np.maximum(p.penetration, 0.0), p.depth
    p.stiffness = float(p.law.force(d, 0.0)) / d
    p.force = p.stiffness * x + p.damping * p.velocity * (x > 0.0)
    p.law_is_true = False


def square_speed(part: float) -> Damage:
    """Damping that grows with the speed."""

    def damage(p: Probing) -> None:
        w = p.velocity / p.speed
        p.force = p.force + part * _spring(p) * w * np.abs(w)

    return damage


def inertia(mass: float) -> Damage:
    """A mass beyond the sensor."""

    def damage(p: Probing) -> None:
        p.force = p.force + mass * np.gradient(p.velocity, p.time)

    return damage


def saturation(part: float) -> Damage:
    """The sensor's range ends below the largest force."""

    def damage(p: Probing) -> None:
        p.force = np.minimum(p.force, part * float(p.force.max()))

    return damage


def stuck(part: float) -> Damage:
    """The force is constant in segments of 0.1 s."""

    def damage(p: Probing) -> None:
        for start in p.random.integers(2000, p.time.size - 100, round(part * SECONDS_OF_STUCK)):
            p.force[start : start + 100] = p.force[start]

    return damage


SECONDS_OF_STUCK = 70  # segments that would fill the recording


def spiked(part: float) -> Damage:
    """Single samples at half the largest force more."""

    def damage(p: Probing) -> None:
        hit = p.random.random(p.time.size) < part
        signs = p.random.choice([-1.0, 1.0], p.time.size)
        p.force = np.where(hit, p.force + 0.5 * signs * float(p.force.max()), p.force)

    return damage


def coarse(part: float) -> Damage:
    """Steps of a part of the largest force."""

    def damage(p: Probing) -> None:
        step = part * float(p.force.max())
        p.force = step * np.round(p.force / step)

    return damage


def jitter(part: float) -> Damage:
    """Wrong time stamps."""

    def damage(p: Probing) -> None:
        p.time = p.time + part * SAMPLE_TIME * p.random.uniform(-1.0, 1.0, p.time.size)

    return damage


def missing(part: float) -> Damage:
    """Samples that were never written."""

    def damage(p: Probing) -> None:
        keep = p.random.random(p.time.size) >= part
        for name in ("time", "penetration", "velocity", "force"):
            setattr(p, name, getattr(p, name)[keep])

    return damage


def bias(newtons: float) -> Damage:
    """A sensor that was not tared."""

    def damage(p: Probing) -> None:
        p.force = p.force + newtons

    return damage


def scaled(name: str, factor: float) -> Damage:
    """A channel in another unit, or with another sign."""

    def damage(p: Probing) -> None:
        setattr(p, name, factor * getattr(p, name))
        p.law_is_true = False

    return damage


def swapped(p: Probing) -> None:
    """Force and penetration exchanged."""
    p.penetration, p.force = p.force, p.penetration


def velocity_against(p: Probing) -> None:
    """A velocity column with the wrong sign."""
    p.recorded_velocity = -p.velocity


def _faults() -> list[Fault]:
    drift = ("gain drift", "change")
    form = ("damping form", "shape", "delay", "misfit")
    return [
        *(
            Fault("surface", f"{mm:+g} mm", after=surface(1e-3 * mm), names=("surface",))
            for size in (0.2, 0.35, 0.7, 1.5)
            for mm in (size, -size)
        ),
        *(
            Fault("delay", f"{ms:g} ms", before=delay(1e-3 * ms), names=("delay",))
            for ms in (0.5, 1.0, 2.0, 5.0, 10.0, -3.0)
        ),
        *(
            Fault("change", f"{step:.0%}", before=change(step), names=drift)
            for step in (0.05, 0.1, 0.3, 1.0)
        ),
        *(
            Fault("gain drift", f"{part:.0%}", before=gain_drift(part), names=drift)
            for part in (0.05, 0.15, 0.4)
        ),
        *(
            Fault("offset drift", f"{part:.0%}", before=offset_drift(part), names=("offset drift",))
            for part in (0.05, 0.15)
        ),
        *(
            Fault("memory", f"{part:.0%}, {tau:g} s", before=memory(part, tau), names=("memory",))
            for part in (0.1, 0.5)
            for tau in (0.1, 1.0)
        ),
        *(
            Fault("friction", f"{part:.0%}", before=friction(part), names=("friction",))
            for part in (0.02, 0.05, 0.15)
        ),
        Fault("damping form", "n − 1", before=damping_form_of_slope, names=form),
        Fault("another law", "extended Kelvin–Voigt", before=quadratic, names=form),
        Fault("another law", "Kelvin–Voigt", before=linear, names=form),
        *(
            Fault("square speed", f"{part:.0%}", before=square_speed(part), names=("square speed",))
            for part in (0.02, 0.05)
        ),
        *(
            Fault("inertia", f"{mass:g} kg", before=inertia(mass), names=("inertia",))
            for mass in (0.1, 0.4)
        ),
        *(
            Fault("saturation", f"{part:.0%}", after=saturation(part), names=("saturation",))
            for part in (0.95, 0.8, 0.6)
        ),
        Fault("stuck", "8 %", after=stuck(0.08), names=("stuck force",)),
        Fault("spikes", "1 %", after=spiked(0.01), names=("spikes",)),
        *(
            Fault("coarse", f"{part:.0%}", after=coarse(part), names=("coarse steps",))
            for part in (0.2, 0.05)
        ),
        Fault("jitter", "10 %", after=jitter(0.1)),
        Fault("missing", "10 %", after=missing(0.1)),
        Fault("bias", "3 N", after=bias(3.0)),
        *_input_faults(),
    ]


def damping_form_of_slope(p: Probing) -> None:
    """Damping in proportion to xⁿ⁻¹."""
    damping_form(p.law.exponent - 1.0)(p)


def _input_faults() -> list[Fault]:
    return [
        Fault("unit", "mm", None, scaled("penetration", 1e3), ("penetration unit",), stops=True),
        Fault("unit", "mN", None, scaled("force", 1e3), ("force unit",), stops=True),
        Fault("unit", "ms", None, scaled("time", 1e3), ("time unit",), stops=True),
        Fault("sign", "force", None, scaled("force", -1.0), ("signs",), stops=True),
        Fault("sign", "penetration", None, scaled("penetration", -1.0), ("signs",), stops=True),
        Fault("swapped", "columns", None, swapped, ("penetration unit",), stops=True),
        Fault("velocity", "reversed", None, velocity_against, ("velocity column",), stops=True),
    ]


#: Every fault; the first is none.
FAULTS: list[Fault] = [Fault("clean", ""), *_faults()]
