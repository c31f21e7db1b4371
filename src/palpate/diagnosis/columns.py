"""Causes that are a column beside the fit: drift, friction, another damping or shape, inertia."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.cause import Beside, Cause, beside, of_parameter
from palpate.diagnosis.data import in_words
from palpate.diagnosis.fit import Fit
from palpate.digits import rounded
from palpate.force_laws import HuntCrossley
from palpate.validation import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The motion and the law, without units, at every sample of the band.

    Attributes
    ----------
    x, v : numpy.ndarray
        Penetration over the working depth, and velocity over its rms.
    spring : numpy.ndarray
        The law's force at rest, 1 at the working depth: ξⁿ for a power law.
    slope : numpy.ndarray
        ∂F/∂x at rest, 1 at the working depth: ξⁿ⁻¹ for a power law.
    force : numpy.ndarray
        The law's force, N.
    time : numpy.ndarray
        From −½ to ½ over the recording.
    """

    x: Floats
    v: Floats
    spring: Floats
    slope: Floats
    force: Floats
    time: Floats


def shape_of(fit: Fit) -> Shape:
    """Return what columns are made of."""
    law, x = fit.solution.law, np.maximum(fit.x, 1e-12)
    rest = np.zeros_like(x)
    spring, slope = law.force(x, rest), law.penetration_gradient(x, rest)
    time = fit.data.time[fit.band.samples]
    return Shape(
        x * fit.units.depth / fit.reference,
        fit.v * fit.units.speed / fit.speed,
        spring / _unit(np.median(spring)),
        slope / _unit(np.median(slope)),
        law.force(x, fit.v),
        (time - time.mean()) / _unit(np.ptp(time)),
    )


def _unit(value: float) -> float:
    return float(value) or 1.0


def _other_growth(fit: Fit, shape: Shape) -> Floats:
    """x^(n−1) v, of a law whose damping grows as xⁿ; nothing of one whose damping does not grow.

    Beside a constant damper, K₁ v + 2 K₂ x v would be that damper but for some rounding of K₂.
    """
    grows = isinstance(fit.solution.law, HuntCrossley)
    return shape.slope * shape.v if grows else np.zeros_like(shape.v)


def _other_shape(fit: Fit, shape: Shape) -> Floats:
    """∂²F/∂n², or where the exponent is fixed ∂F/∂n: xⁿ is the tip's as far as that is known."""
    logarithm = np.log(np.maximum(shape.x, 1e-12))
    return shape.spring * (logarithm if fit.fixed else logarithm**2)


def _shape(fit: Fit, found: Beside) -> str:
    if fit.fixed:
        return "the force does not grow with depth as by the exponent that was given"
    return "the force grows with depth in another way than the law's"


def _acceleration(fit: Fit, _: Shape) -> Floats:
    """dv/dt, m/s²; times the mass that moves beyond the sensor it is a force."""
    data = fit.data
    rate = np.gradient(data.velocity, np.maximum(np.gradient(data.time).cumsum(), data.time))
    return rate[fit.band.samples]


@dataclass(frozen=True, slots=True)
class Column:
    """A cause that is one column.

    Attributes
    ----------
    values : callable
        The column at the samples of the band.
    sentence : callable
        What was found, from the fit and the column's coefficient.
    remedy : str
        What to do.
    """

    values: Callable[[Fit, Shape], Floats]
    sentence: Callable[[Fit, Beside], str]
    remedy: str


def _drift(fit: Fit, found: Beside) -> str:
    way = "hardens" if found.amount > 0.0 else "softens"
    return f"the material {way} by {abs(found.amount):.1%} over the recording"


def _creep(fit: Fit, found: Beside) -> str:
    return f"the zero of the force drifts by {in_words(abs(found.amount), 'N')}"


def _friction(fit: Fit, found: Beside) -> str:
    part = abs(found.amount) / max(abs(fit.force_at_depth(fit.solution.law)), 1e-300)
    return f"a friction of {part:.1%} of the force: it turns with the direction, not with the speed"


def _inertia(fit: Fit, found: Beside) -> str:
    words = f"a mass of {rounded(found.amount, 2)} kg moves with the probe beyond the force sensor"
    return words if found.amount > 0.0 else "the force follows the acceleration"


#: Each cause by its name.
COLUMNS: dict[str, Column] = {
    "gain drift": Column(
        lambda fit, s: s.force * s.time,
        _drift,
        "identify parts of the recording, with --start and --stop",
    ),
    "offset drift": Column(
        lambda fit, s: s.time, _creep, "let the sensor warm up, and tare before each touch"
    ),
    "friction": Column(
        lambda fit, s: s.spring * np.tanh(20.0 * s.v),
        _friction,
        "press along the surface's normal; the damping is for this speed only",
    ),
    "damping form": Column(
        _other_growth,
        lambda fit, found: "the damping grows with depth in another way than the law's",
        "the stiffness at working depth holds; take the damping at that depth only",
    ),
    "damping with depth": Column(
        lambda fit, s: s.spring * s.v,
        lambda fit, found: "the damping grows with depth, as it does not in the law",
        "--method variable-projection, which has F = K xⁿ + B xⁿ v",
    ),
    "shape": Column(
        _other_shape,
        _shape,
        "identify a smaller range of depths, with --min-penetration",
    ),
    "square speed": Column(
        lambda fit, s: s.spring * s.v * np.abs(s.v),
        lambda fit, found: "the damping is not in proportion to the speed",
        "the damping is for this speed only; move as fast as the task will",
    ),
    "inertia": Column(
        _acceleration, _inertia, "weigh what moves beyond the sensor and take m·a off the force"
    ),
}


def columns(fit: Fit) -> list[Cause]:
    """Fit every column beside the law, one at a time."""
    shape, found = shape_of(fit), []
    for name, column in COLUMNS.items():
        result = beside(fit, fit.band.mean(column.values(fit, shape)))
        if result is not None:
            found.append(cause_of(fit, name, result, column.sentence(fit, result), column.remedy))
    return found


def cause_of(fit: Fit, name: str, result: Beside, sentence: str, remedy: str | None) -> Cause:
    """A cause from what its column gave."""
    change = result.change
    if not math.isfinite(result.z):
        result = Beside(result.change, result.amount, 0.0, 0.0)
    return Cause(
        name,
        result.z,
        result.gain,
        *fit.moves(change),
        of_parameter(fit, change),
        sentence,
        remedy,
        lambda other: other.moves(change),
    )
