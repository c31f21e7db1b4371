"""Materials that are not Hunt–Crossley; the truth is their own response."""

import numpy as np
from scipy.signal import hilbert, lfilter

from benchmarks.bank.trials import Damage, Fault, Trial, severities
from palpate.validation import Floats

# ---- without memory


def growing_exponent(t: Trial, part: float) -> None:
    """The exponent grows with depth: a thin layer on a stiff ground."""
    k, b, n = t.law.parameters
    deepest = t.deepest

    def response(x: Floats, v: Floats) -> Floats:
        power = k * np.where(x > 0.0, x, 1.0) ** n * (x > 0.0)
        steeper = (np.maximum(x, 1e-9) / deepest) ** (part * x / deepest)
        return np.asarray(power * steeper * (1.0 + b / k * v))

    t.respond(response)


def second_layer(t: Trial, part: float) -> None:
    """A harder layer is reached at half the depth."""
    middle, rise = 0.5 * t.deepest, part * t.peak / (0.5 * t.deepest) ** t.law.n

    def response(x: Floats, v: Floats) -> Floats:
        beyond = np.maximum(x - middle, 0.0)
        return np.asarray(t.law.force(x, v) + rise * beyond**t.law.n)

    t.respond(response)


def thin_sample(t: Trial, part: float) -> None:
    """The ground stiffens a sample of finite thickness."""
    deepest = t.deepest

    def response(x: Floats, v: Floats) -> Floats:
        ratio = part * np.sqrt(x / deepest)
        return np.asarray(t.law.force(x, v) * (1.0 + 1.13 * ratio + 1.28 * ratio**2))

    t.respond(response)


def exponential(t: Trial, part: float) -> None:
    """F = A (exp(x/l) − 1), l a part of the depth, with the law's damping."""
    length, peak = t.deepest / part, t.peak
    ratio = t.law.parameters[1] / t.law.parameters[0]

    def response(x: Floats, v: Floats) -> Floats:
        rest = peak * np.expm1(x / length) / np.expm1(part)
        return np.asarray(rest * (1.0 + ratio * v))

    t.respond(response)


def damper(power: float) -> Damage:
    """A part of the damping grows with a power of the depth."""

    def damage(t: Trial, part: float) -> None:
        middle = 0.5 * t.deepest
        extra = part * t.law.damping_at(middle)
        t.respond(lambda x, v: t.law.force(x, v) + extra * (x / middle) ** power * v)

    return damage


def adhesion(t: Trial, part: float) -> None:
    """A pull like that of JKR, which grows with the root of the depth."""
    pull, deepest = part * t.peak, t.deepest
    t.respond(
        lambda x, v: np.asarray(t.law.force(x, v) - pull * np.sqrt((x + 0.05 * deepest) / deepest))
    )


# ---- with the direction or the past


def neck(t: Trial, part: float) -> None:
    """Liquid pulls on withdrawal, to a tenth of the depth above the surface."""
    wet, reach = 0.0, 0.1 * t.deepest
    pull = np.zeros(t.time.size)
    for k, x in enumerate(t.penetration.tolist()):
        wet = 1.0 if x > 0.0 else wet if x > -reach else 0.0
        pull[k] = wet * min(1.0, 1.0 + x / reach)
    t.force = t.force - part * t.peak * pull


def sticky(t: Trial, part: float) -> None:
    """The material pulls while the probe goes out."""
    out = 0.5 - 0.5 * np.tanh(5.0 * t.velocity / t.speed)
    t.add(-part * t.peak * out * t.touching)


def plastic(t: Trial, part: float) -> None:
    """The surface stays behind, by a part of the deepest so far; the truth is the last."""
    set_ = part * np.maximum.accumulate(np.maximum(t.penetration, 0.0))
    x = t.penetration - set_
    t.force = np.where(x > 0.0, t.law.force(np.maximum(x, 0.0), t.velocity), 0.0)
    t.truth = lambda depth: t.of_the_law(depth - float(set_[-1]))


def slow_recovery(t: Trial, part: float) -> None:
    """The surface follows the probe, and returns within half a second."""
    behind, at, keep = np.zeros(t.time.size), 0.0, float(np.exp(-t.step / 0.5))
    for k, x in enumerate(t.penetration.tolist()):
        at = max(keep * at, part * x)
        behind[k] = at
    x = t.penetration - behind
    force = np.where(x > 0.0, t.law.force(np.maximum(x, 0.0), t.velocity), 0.0)
    t.add(force - t.force)


def tilted(t: Trial, part: float) -> None:
    """The surface comes nearer, by a part of the depth."""
    _other_surface(t, part * t.deepest * t.time / t.time[-1])


def another_place(t: Trial, part: float) -> None:
    """Midway the probe changes to a place where the surface is higher."""
    _other_surface(t, part * t.deepest * (t.time > 0.5 * t.time[-1]))


def _other_surface(t: Trial, nearer: Floats) -> None:
    """The truth is that of the mean surface."""
    x = t.penetration + nearer
    t.force = np.where(x > 0.0, t.law.force(np.maximum(x, 0.0), t.velocity), 0.0)
    mean = float(nearer.mean())
    t.truth = lambda depth: t.of_the_law(depth + mean)


def mullins(t: Trial, part: float) -> None:
    """Each press softens the material, the first ones most."""
    presses = np.cumsum(np.diff(t.touching, prepend=0.0) > 0.0)
    t.scale(1.0 - part * (1.0 - np.exp(-np.maximum(presses - 1.0, 0.0) / 2.0)))


def healing(t: Trial, part: float) -> None:
    """The material hardens after each press, and rests soft."""
    keep = float(np.exp(-t.step / 0.7))
    worked = lfilter([1.0 - keep], [1.0, -keep], t.spring / t.peak)
    t.add(-part * t.spring * worked)


def power_of_speed(power: float) -> Damage:
    """A part of the damping goes with a power of the speed."""

    def damage(t: Trial, part: float) -> None:
        ratio = np.maximum(np.abs(t.velocity) / t.speed, 1e-9) ** (power - 1.0)
        t.add(part * (t.force - t.spring) * (ratio - 1.0))

    return damage


def structural(t: Trial, part: float) -> None:
    """A loss that is the same at every frequency."""
    spring = t.spring - t.spring.mean()
    t.add(-part * np.imag(hilbert(spring)) * t.touching)


def branches(*spectrum: tuple[float, float]) -> Damage:
    """Relaxing branches beside the spring: their times, s, and shares of the part."""

    def damage(t: Trial, part: float) -> None:
        extra = np.zeros(t.time.size)
        for tau, share in spectrum:
            keep = float(np.exp(-t.step / tau))
            extra += share * lfilter([keep, -keep], [1.0, -keep], t.spring - t.spring[0])
        t.add(part * extra)

    return damage


POWER_LAW = branches(*((0.01 * 4.0**k, 1.0 / 6.0) for k in range(6)))  # from 10 ms to 10 s
DIFFUSION = branches(*((d, 0.8 * d) for d in (1.0 / (2.0 * k + 1.0) ** 2 for k in range(5))))


# ---- what the diagnosis looks for


def change(t: Trial, part: float, at: float = 4.0) -> None:
    """The material is stiffer from a time on, s."""
    t.scale(np.where(t.time > at, 1.0 + part, 1.0))


def softening(t: Trial, part: float) -> None:
    """The material softens, at an even rate."""
    t.scale(1.0 - part * t.time / t.time[-1])


def relaxation(t: Trial, part: float, tau: float = 0.1) -> None:
    """A branch of one time, s."""
    branches((tau, 1.0))(t, part)


def friction(t: Trial, part: float) -> None:
    """A part of the force that changes sign with the direction; the truth is without it."""
    t.force = t.force + part * t.spring * np.tanh(20.0 * t.velocity / t.speed)


def square_of_speed(t: Trial, part: float) -> None:
    """A force that grows with the square of the speed."""
    w = t.velocity / t.speed
    t.force = t.force + part * t.spring * w * np.abs(w)


def half_space_damper(t: Trial) -> None:
    """Damping in proportion to xⁿ⁻¹, the same at working depth."""
    damping, depth, power = t.law.damping_at(t.depth), t.depth, t.law.n - 1.0
    t.respond(lambda x, v: t.law.force(x, 0.0 * v) + damping * (x / depth) ** power * v)


def two_springs(t: Trial) -> None:
    """F = K₁x + K₂x² + Bv, each spring with half of the force at working depth."""
    force, damping, depth = float(t.law.force(t.depth, 0.0)), t.law.damping_at(t.depth), t.depth
    t.respond(lambda x, v: 0.5 * force * (x / depth + (x / depth) ** 2) + damping * v)


def linear(t: Trial) -> None:
    """F = Kx + Bv."""
    force, damping, depth = float(t.law.force(t.depth, 0.0)), t.law.damping_at(t.depth), t.depth
    t.respond(lambda x, v: force * x / depth + damping * v)


_FORM = ("damping form", "shape", "delay", "misfit")
#: Faults that the diagnosis looks for.
KNOWN_MATERIAL_FAULTS: list[Fault] = [
    *severities("change", change, 0.05, 0.1, 0.3, 1.0, names=("slow change", "change")),
    *severities("slow change", softening, 0.05, 0.15, 0.4, names=("slow change", "change")),
    *severities("memory, 0.1 s", relaxation, 0.1, 0.5, names=("memory",)),
    *severities("memory, 1 s", branches((1.0, 1.0)), 0.1, 0.5, names=("memory",)),
    *severities("friction", friction, 0.02, 0.05, 0.15, names=("friction",)),
    Fault("damping form", "n − 1", half_space_damper, names=_FORM),
    Fault("another law", "extended Kelvin–Voigt", two_springs, names=_FORM),
    Fault("another law", "Kelvin–Voigt", linear, names=_FORM),
    *severities("square speed", square_of_speed, 0.02, 0.05, names=("square speed",)),
]
#: Faults for most of which palpate has no check.
MATERIAL_FAULTS: list[Fault] = [
    *severities("exponent grows", growing_exponent, 0.2, 0.5),
    *severities("second layer", second_layer, 0.2, 1.0),
    *severities("thin sample", thin_sample, 0.2, 0.6),
    *severities("exponential law", exponential, 1.0, 3.0),
    *severities("constant damper", damper(0.0), 0.3, 1.0),
    *severities("damper of √x", damper(0.5), 0.3, 1.0),
    *severities("adhesion", adhesion, 0.03, 0.1),
    *severities("liquid neck", neck, 0.03, 0.1),
    *severities("pull on withdrawal", sticky, 0.01, 0.04),
    *severities("plastic set", plastic, 0.05, 0.15),
    *severities("slow recovery", slow_recovery, 0.05, 0.15),
    *severities("tilted surface", tilted, 0.05, 0.15),
    *severities("another place", another_place, 0.03, 0.1),
    *severities("Mullins", mullins, 0.1, 0.3),
    *severities("softens under work", healing, 0.1, 0.3),
    *severities("damping ∝ √v", power_of_speed(0.5), 0.5, 1.0),
    *severities("damping ∝ v^1.5", power_of_speed(1.5), 0.5, 1.0),
    *severities("structural damping", structural, 0.03, 0.1),
    *severities("relaxation, 20 ms", branches((0.02, 1.0)), 0.1, 0.4),
    *severities("relaxation, 3 s", branches((3.0, 1.0)), 0.1, 0.4),
    *severities("relaxation, two times", branches((0.05, 0.5), (1.0, 0.5)), 0.1, 0.4),
    *severities("power-law relaxation", POWER_LAW, 0.15, 0.5),
    *severities("poroelastic relaxation", DIFFUSION, 0.1, 0.4),
]
