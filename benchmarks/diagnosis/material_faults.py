"""Materials that are not Hunt–Crossley; the truth is their own response."""

from collections.abc import Callable

import numpy as np
from scipy.signal import hilbert, lfilter

from benchmarks.diagnosis.trials import Trial
from benchmarks.diagnosis.unseen import Damage, Unseen, percent
from palpate.validation import Floats

# ---- without memory


def growing_exponent(part: float) -> Damage:
    """The exponent grows with depth: a thin layer on a stiff ground."""

    def damage(t: Trial) -> None:
        k, b, n = t.law.parameters
        deepest = t.deepest

        def response(x: Floats, v: Floats) -> Floats:
            power = k * np.where(x > 0.0, x, 1.0) ** n * (x > 0.0)
            steeper = (np.maximum(x, 1e-9) / deepest) ** (part * x / deepest)
            return np.asarray(power * steeper * (1.0 + b / k * v))

        t.respond(response)

    return damage


def second_layer(part: float) -> Damage:
    """A harder layer is reached at half the depth."""

    def damage(t: Trial) -> None:
        middle, rise = 0.5 * t.deepest, part * t.peak / (0.5 * t.deepest) ** t.law.exponent

        def response(x: Floats, v: Floats) -> Floats:
            beyond = np.maximum(x - middle, 0.0)
            return np.asarray(t.law.force(x, v) + rise * beyond**t.law.exponent)

        t.respond(response)

    return damage


def thin_sample(part: float) -> Damage:
    """The ground stiffens a sample of finite thickness."""

    def damage(t: Trial) -> None:
        deepest = t.deepest

        def response(x: Floats, v: Floats) -> Floats:
            ratio = part * np.sqrt(x / deepest)
            return np.asarray(t.law.force(x, v) * (1.0 + 1.13 * ratio + 1.28 * ratio**2))

        t.respond(response)

    return damage


def exponential(part: float) -> Damage:
    """F = A (exp(x/l) − 1), l a part of the depth, with the law's damping."""

    def damage(t: Trial) -> None:
        length, peak = t.deepest / part, t.peak
        ratio = t.law.parameters[1] / t.law.parameters[0]

        def response(x: Floats, v: Floats) -> Floats:
            rest = peak * np.expm1(x / length) / np.expm1(part)
            return np.asarray(rest * (1.0 + ratio * v))

        t.respond(response)

    return damage


def constant_damper(part: float) -> Damage:
    """A part of the damping does not depend on the depth."""

    def damage(t: Trial) -> None:
        typical = t.law.damping_at(0.5 * t.deepest)
        t.respond(lambda x, v: np.asarray(t.law.force(x, v) + part * typical * v))

    return damage


def root_damper(part: float) -> Damage:
    """A part of the damping grows with the root of the depth."""

    def damage(t: Trial) -> None:
        typical, middle = t.law.damping_at(0.5 * t.deepest), 0.5 * t.deepest
        t.respond(
            lambda x, v: np.asarray(t.law.force(x, v) + part * typical * np.sqrt(x / middle) * v)
        )

    return damage


def adhesion(part: float) -> Damage:
    """A pull like that of JKR, which grows with the root of the depth."""

    def damage(t: Trial) -> None:
        pull, deepest = part * t.peak, t.deepest
        t.respond(
            lambda x, v: np.asarray(
                t.law.force(x, v) - pull * np.sqrt((x + 0.05 * deepest) / deepest)
            )
        )

    return damage


# ---- with the direction or the past


def neck(part: float) -> Damage:
    """Liquid pulls on withdrawal, to a tenth of the depth above the surface."""

    def damage(t: Trial) -> None:
        wet, reach = 0.0, 0.1 * t.deepest
        pull = np.zeros(t.time.size)
        for k, x in enumerate(t.penetration.tolist()):
            wet = 1.0 if x > 0.0 else wet if x > -reach else 0.0
            pull[k] = wet * min(1.0, 1.0 + x / reach)
        t.force = t.force - part * t.peak * pull

    return damage


def sticky(part: float) -> Damage:
    """The material pulls while the probe goes out."""

    def damage(t: Trial) -> None:
        out = 0.5 - 0.5 * np.tanh(5.0 * t.velocity / t.speed)
        t.add(-part * t.peak * out * t.touching)

    return damage


def plastic(part: float) -> Damage:
    """The surface stays behind, by a part of the deepest so far; the truth is the last."""

    def damage(t: Trial) -> None:
        set_ = part * np.maximum.accumulate(np.maximum(t.penetration, 0.0))
        x = t.penetration - set_
        t.force = np.where(x > 0.0, t.law.force(np.maximum(x, 0.0), t.velocity), 0.0)
        t.truth = lambda depth: t.of_the_law(depth - float(set_[-1]))

    return damage


def slow_recovery(part: float) -> Damage:
    """The surface follows the probe, and returns within half a second."""

    def damage(t: Trial) -> None:
        behind, at, keep = np.zeros(t.time.size), 0.0, float(np.exp(-t.step / 0.5))
        for k, x in enumerate(t.penetration.tolist()):
            at = max(keep * at, part * x)
            behind[k] = at
        x = t.penetration - behind
        force = np.where(x > 0.0, t.law.force(np.maximum(x, 0.0), t.velocity), 0.0)
        t.add(force - t.force)

    return damage


def tilted(part: float) -> Damage:
    """The surface comes nearer, by a part of the depth."""

    def damage(t: Trial) -> None:
        _other_surface(t, part * t.deepest * t.time / t.time[-1])

    return damage


def another_place(part: float) -> Damage:
    """Midway the probe changes to a place where the surface is higher."""

    def damage(t: Trial) -> None:
        _other_surface(t, part * t.deepest * (t.time > 0.5 * t.time[-1]))

    return damage


def _other_surface(t: Trial, nearer: Floats) -> None:
    """The truth is that of the mean surface."""
    x = t.penetration + nearer
    t.force = np.where(x > 0.0, t.law.force(np.maximum(x, 0.0), t.velocity), 0.0)
    mean = float(nearer.mean())
    t.truth = lambda depth: t.of_the_law(depth + mean)


def mullins(part: float) -> Damage:
    """Each press softens the material, the first ones most."""

    def damage(t: Trial) -> None:
        presses = np.cumsum(np.diff(t.touching, prepend=0.0) > 0.0)
        t.scale(1.0 - part * (1.0 - np.exp(-np.maximum(presses - 1.0, 0.0) / 2.0)))

    return damage


def healing(part: float) -> Damage:
    """The material hardens after each press, and rests soft."""

    def damage(t: Trial) -> None:
        keep = float(np.exp(-t.step / 0.7))
        worked = lfilter([1.0 - keep], [1.0, -keep], t.spring / t.peak)
        t.add(-part * t.spring * worked)

    return damage


def speed_power(power: float) -> Callable[[float], Damage]:
    """A part of the damping goes with a power of the speed."""

    def make(part: float) -> Damage:
        def damage(t: Trial) -> None:
            w = t.velocity / t.speed
            linear = t.force - t.spring
            if t.speed > 0.0:
                curved = np.sign(w) * np.abs(w) ** power
                t.add(part * linear * (curved / np.where(w == 0.0, 1.0, w) - 1.0))

        return damage

    return make


def structural(part: float) -> Damage:
    """A loss that is the same at every frequency."""

    def damage(t: Trial) -> None:
        spring = t.spring - t.spring.mean()
        t.add(-part * np.imag(hilbert(spring)) * t.touching)

    return damage


def branches(taus: tuple[float, ...], shares: tuple[float, ...]) -> Callable[[float], Damage]:
    """Relaxing branches beside the spring."""

    def make(part: float) -> Damage:
        def damage(t: Trial) -> None:
            extra = np.zeros(t.time.size)
            for tau, share in zip(taus, shares, strict=True):
                keep = float(np.exp(-t.step / tau))
                rest = t.spring - t.spring[0]
                extra += share * lfilter([keep, -keep], [1.0, -keep], rest)
            t.add(part * extra)

        return damage

    return make


POWER = tuple(0.01 * 4.0**k for k in range(6))
DIFFUSION = tuple(1.0 / (2.0 * k + 1.0) ** 2 for k in range(5))

MATERIAL_FAULTS: list[Unseen] = [
    *percent("exponent grows", growing_exponent, 0.2, 0.5),
    *percent("second layer", second_layer, 0.2, 1.0),
    *percent("thin sample", thin_sample, 0.2, 0.6),
    *percent("exponential law", exponential, 1.0, 3.0),
    *percent("constant damper", constant_damper, 0.3, 1.0),
    *percent("damper of √x", root_damper, 0.3, 1.0),
    *percent("adhesion", adhesion, 0.03, 0.1),
    *percent("liquid neck", neck, 0.03, 0.1),
    *percent("pull on withdrawal", sticky, 0.01, 0.04),
    *percent("plastic set", plastic, 0.05, 0.15),
    *percent("slow recovery", slow_recovery, 0.05, 0.15),
    *percent("tilted surface", tilted, 0.05, 0.15),
    *percent("another place", another_place, 0.03, 0.1),
    *percent("Mullins", mullins, 0.1, 0.3),
    *percent("softens under work", healing, 0.1, 0.3),
    *percent("damping ∝ √v", speed_power(0.5), 0.5, 1.0),
    *percent("damping ∝ v^1.5", speed_power(1.5), 0.5, 1.0),
    *percent("structural damping", structural, 0.03, 0.1),
    *percent("relaxation, 20 ms", branches((0.02,), (1.0,)), 0.1, 0.4),
    *percent("relaxation, 3 s", branches((3.0,), (1.0,)), 0.1, 0.4),
    *percent("relaxation, two times", branches((0.05, 1.0), (0.5, 0.5)), 0.1, 0.4),
    *percent("power-law relaxation", branches(POWER, (1.0 / 6,) * 6), 0.15, 0.5),
    *percent(
        "poroelastic relaxation", branches(DIFFUSION, tuple(0.8 * d for d in DIFFUSION)), 0.1, 0.4
    ),
]
