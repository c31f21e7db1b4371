"""``python -m benchmarks.curves``: whole-curve fits a second, and whether each is the minimum.

Needs the ``develop`` extra. With one core: ``taskset -c 0 python -m benchmarks.curves``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rich.progress import track
from scipy.optimize import least_squares

from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
)
from benchmarks.common.timing import least_seconds, native_programs
from palpate import InvalidParameterError, Scale, SingleStageRLS, VariableProjection, fit_curves
from palpate.input.preparation.gate import suggest_scale
from palpate.method.contact import Contact
from palpate.method.estimators import batch_fit as core
from palpate.method.estimators.batch_fit import CurveFits
from palpate.validation import Floats

Motion = Callable[[Floats], tuple[Floats, Floats]]

DEPTH, SPEED, PUSH = 10e-3, 20e-3, 2.0  # of a curve whose numbers are one, in SI
SURFACES = (-0.2 * DEPTH, 0.2 * DEPTH)
KNOWN: dict[str, Any] = {}
UNKNOWN: dict[str, Any] = {"surface": "estimate", "surface_range": SURFACES}
ONE_WAY = "one-way approach"
LOW = "approach–retract, n 0.5 to 1"
NANO = 1e9
EXPONENTS = (0.3, 3.6)  # within which a minimum counts
LOW_ENOUGH: dict[str, Any] = {"x_scale": "jac", "xtol": 1e-10, "ftol": 1e-10, "gtol": 1e-10}


@dataclass(frozen=True)
class Curves:
    """A set: arrays one row a curve, SI, and the truth by K, B, n, F₀, d."""

    penetration: Floats
    velocity: Floats
    force: Floats
    truth: Floats
    noise: Floats

    def __len__(self) -> int:
        return len(self.force)


def approach_and_retract(time: Floats) -> tuple[Floats, Floats]:
    """One depth above the surface to one below it and back, at constant speed."""
    return 1.0 - 2.0 * np.abs(2.0 * time - 1.0), np.where(time < 0.5, 1.0, -1.0)


def palpation(time: Floats) -> tuple[Floats, Floats]:
    """Two sines, which leave contact."""
    slow, fast = 6.0 * np.pi, 14.6 * np.pi
    depth = 0.45 + 0.4 * np.sin(slow * time) + 0.25 * np.sin(fast * time)
    speed = 0.4 * slow * np.cos(slow * time) + 0.25 * fast * np.cos(fast * time)
    return depth, speed / (0.4 * slow + 0.25 * fast)


def one_way(time: Floats) -> tuple[Floats, Floats]:
    """Going in, slower with depth: v = a − b x, which hardly distinguishes n from n + 1."""
    rate = 3.0
    fall = np.exp(-rate * time)
    return 1.3 * (1.0 - fall) / (1.0 - np.exp(-rate)) - 0.3, fall


MOTIONS: dict[str, Motion] = {
    "approach–retract": approach_and_retract,
    "palpation": palpation,
    "one-way approach": one_way,
}


def random_curves(
    motion: Motion,
    count: int,
    *,
    samples: int = 1000,
    surface: bool = False,
    exponents: tuple[float, float] = (1.0, 2.5),
    seed: int = 0,
) -> Curves:
    """Curves of laws n ~ ``exponents``, c/k in 0 to 0.4, noise 0.1 to 3 % of the peak force.

    With ``surface`` the surface is within ±0.15 of the depth, else at 0.
    """
    chance = np.random.default_rng(seed)
    depth, speed = motion((np.arange(samples) + 0.5) / samples)
    exponent = chance.uniform(*exponents, count)
    dissipation = chance.uniform(0.0, 0.4, count)
    start = chance.uniform(-0.15, 0.15, count) if surface else np.zeros(count)
    offset = 0.03 * chance.standard_normal(count)
    noise = 10.0 ** chance.uniform(-3.0, np.log10(0.03), count)
    # The surface shifts the coordinate; the motion through the material stays the same.
    inside = np.maximum(depth, 0.0) ** exponent[:, None]
    clean = inside * (1.0 + dissipation[:, None] * speed)
    peak = clean.max(axis=1)
    force = clean / peak[:, None] + offset[:, None]
    force += noise[:, None] * chance.standard_normal((count, samples))
    stiffness = PUSH / peak * DEPTH**-exponent
    truth = np.stack(
        [stiffness, stiffness * dissipation / SPEED, exponent, PUSH * offset, DEPTH * start], axis=1
    )
    penetration = DEPTH * (depth + start[:, None])
    velocity = np.broadcast_to(SPEED * speed, penetration.shape).copy()
    return Curves(penetration, velocity, PUSH * force, truth, PUSH * noise)


def main(*, curves: int = 400, markdown: Path | None = None) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    curves
        Number of each kind.
    markdown
        Write the tables to this file as Markdown.
    """
    sections = [measure_rates(curves), measure_minima(curves), measure_recursion(curves)]
    facts = describe_machine(native_programs().compiler)
    publish(sections, facts, "Fits of whole curves", markdown)


def measure_rates(count: int) -> Section:
    """Curves a second, of a thousand points, one thread."""
    update = _update_seconds()
    rows = [Row("SingleStageRLS.replay, a sample", NANO * update, "ns")]
    for name, motion in MOTIONS.items():
        known = random_curves(motion, count, seed=1)
        per_sample = least_seconds(partial(_fit, known, KNOWN))[0] / known.force.size
        ratio, to = per_sample / update, "SingleStageRLS.replay"
        rows.append(_rate(f"surface known, {name}", known, KNOWN, 10_000))
        rows.append(Row("  a sample", NANO * per_sample, "ns", ratio, to, Limit(2.0)))
    for name, motion in MOTIONS.items():
        unknown = random_curves(motion, count, surface=True, seed=2)
        least = 1000 if name == ONE_WAY else 3000
        rows.append(_rate(f"surface unknown, {name}", unknown, UNKNOWN, least))
        fixed = {**UNKNOWN, "exponent": 1.5}
        rows.append(_rate("  exponent fixed", unknown, fixed, None))
    notes = [
        f"{count} curves of 1000 points, one thread, fit_curves; shortest of the rounds, "
        "in time of that thread on its processor."
    ]
    return Section("Whole curves, through Python", rows, notes)


def measure_minima(count: int) -> Section:
    """Compare J with the lowest that SciPy finds from many starts."""
    rows = []
    for name, motion in MOTIONS.items():
        fraction = 0.01 if name == ONE_WAY else 0.0
        rows += _above(f"known, {name}", random_curves(motion, count, seed=3), KNOWN, fraction)
        curves = random_curves(motion, count, surface=True, seed=4)
        rows += _above(f"unknown, {name}", curves, UNKNOWN, fraction)
    low = random_curves(approach_and_retract, count, surface=True, exponents=(0.5, 1.0), seed=5)
    rows += _above(f"unknown, {LOW}", low, UNKNOWN, 0.01)
    notes = [
        "J(fit_curves) above the lowest J that Levenberg–Marquardt (SciPy) finds from 7 starts "
        "with the surface known and 24 with it unknown, in σ² of the noise."
    ]
    return Section("Minimum of the documented cost", rows, notes)


def measure_recursion(count: int) -> Section:
    """Compare the recursion with the whole-curve fit, in standard errors."""
    rows = []
    for surface, settings in ((False, KNOWN), (True, UNKNOWN)):
        word = "unknown" if surface else "known"
        for name, motion in MOTIONS.items():
            few = max(count // 4, 10) if surface else count
            curves = random_curves(motion, few, surface=surface, seed=6)
            apart = apart_from_the_recursion(
                rolled(curves) if motion is approach_and_retract else curves, settings
            )
            judged = name != ONE_WAY  # two laws fit equally well there, so either may be the result
            worst = Limit(0.5 if surface else 0.1) if judged else None
            median = Limit(0.1) if judged and surface else None
            rows += [
                Row(f"{word}, {name}: median", float(np.median(apart)), "s.e.", limit=median),
                Row("  worst", float(apart.max()), "s.e.", limit=worst),
            ]
    notes = [
        "The largest of K, B and n apart, in the standard errors of fit_curves. All free air of "
        "approach–retract curves comes before contact: the recursion does not go back to it."
    ]
    return Section("The recursion, compared with it", rows, notes)


def rolled(curves: Curves) -> Curves:
    """The same approach–retract curves with all free air before their contact."""
    quarter = curves.force.shape[1] // 4
    names = ("penetration", "velocity", "force")
    return replace(curves, **{n: np.roll(getattr(curves, n), quarter, axis=1) for n in names})


def _fit(curves: Curves, settings: dict[str, Any]) -> CurveFits:
    return fit_curves(curves.penetration, curves.velocity, curves.force, **settings)


def _update_seconds() -> float:
    curves = random_curves(MOTIONS["palpation"], 100, seed=1)
    x, v, f = (np.ravel(values) for values in (curves.penetration, curves.velocity, curves.force))
    estimator = SingleStageRLS()

    def replay() -> None:
        estimator.reset()
        estimator.replay(x, v, f)

    return least_seconds(replay)[0] / x.size


def _rate(name: str, curves: Curves, settings: dict[str, Any], least: float | None) -> Row:
    rate = len(curves) / least_seconds(partial(_fit, curves, settings))[0]
    limit = None if least is None else at_least(least)
    return Row(name, rate, "curves/s", limit=limit)


def _above(name: str, curves: Curves, settings: dict[str, Any], fraction: float) -> list[Row]:
    """Count the fits above SciPy by more than 1e-4 σ², with the largest difference."""
    fits = _fit(curves, settings)
    excess = np.empty(len(curves))
    for k in track(range(len(curves)), description=name, transient=True):
        row = curves.penetration[k], curves.velocity[k], curves.force[k]
        cost = stated_cost(*row, **settings)
        reference = Reference(cost, settings.get("surface_range"))
        found = np.array([column[k] for column in parameters(fits)])
        starts = 24 if "surface" in settings else 7
        excess[k] = (cost.value(found) - reference.least(starts)) / fits.noise[k] ** 2
    above = int(np.count_nonzero(excess > 1e-4))
    allowed = int(fraction * len(curves))
    return [
        Row(f"{name}: above SciPy by 1e-4 σ²", above, f"of {len(curves)}", limit=Limit(allowed)),
        Row("  by at most", float(max(excess.max(), 0.0)), "σ²", limit=Limit(1.0)),
        Row("  SciPy above by 1e-4 σ²", int(np.count_nonzero(excess < -1e-4)), "curves"),
    ]


def parameters(fits: CurveFits) -> tuple[Any, ...]:
    """Return K, B, n, F₀ and d, one array each."""
    return fits.K, fits.B, fits.n, fits.offset, fits.surface


def apart_from_the_recursion(curves: Curves, settings: dict[str, Any]) -> Any:
    """Return the largest difference of K, B and n, in standard errors, for each curve."""
    fits = _fit(curves, settings)
    apart = np.empty(len(curves))
    time = 1e-3 * np.arange(curves.force.shape[1])
    for k in range(len(curves)):
        row = curves.penetration[k], curves.velocity[k], curves.force[k]
        scale = suggest_scale(Contact(time, penetration=row[0], velocity=row[1], force=row[2]))
        estimator = VariableProjection(scale=scale, **settings)
        estimator.replay(*row)
        law = estimator.estimate().parameters
        mine = np.array([column[k] for column in parameters(fits)[:3]])
        apart[k] = (np.abs(law - mine) / fits.standard_errors[k, :3]).max()
    return apart


_FIRM, _LIGHT = 2, 3  # of a sample in a fit, by the core: firm and light contact
# Of the priors, as in include/palpate/projection/covariance.hpp.
_EXPONENT, _EXPONENT_DEVIATION, _DISSIPATION_DEVIATION = 1.3, 1.0, 1.0
_OFFSET_WITHOUT_TARE = 20.0  # standard deviations of the noise, where a unit of force is less


@dataclass(frozen=True, eq=False)
class StatedCost:
    """J = Σ (F − F̂)² + σ² [(n − 1.3)² + (b/b_s)² + (F₀ − m)²/s²], over the selected samples.

    b = B/K is in units of the scale, b_s = 1, and σ² is the variance of the final residual.

    Attributes
    ----------
    penetration, velocity, force : numpy.ndarray, shape (j,)
        The selected samples, SI.
    scale : Scale
        The units of the arithmetic.
    offset_mean, offset_deviation : float
        The prior of F₀, N; with a deviation of 0 it is one unit of force, or 20 σ.
    variance : float
        σ² of the priors, N².
    exponent : float or None
        Its value if it is fixed.
    offset : bool
        Whether F₀ is fitted.
    """

    penetration: Floats
    velocity: Floats
    force: Floats
    scale: Scale
    offset_mean: float
    offset_deviation: float
    variance: float
    exponent: float | None
    offset: bool

    def residuals(self, parameters: Floats) -> Floats:
        """Return the residuals whose squares sum to J, N: of the samples, then of the priors.

        Parameters
        ----------
        parameters : numpy.ndarray, shape (5,)
            K, B, n, F₀ and d, SI.
        """
        stiffness, damping, exponent, offset, surface = parameters
        depth = self.penetration - surface
        power = np.where(depth > 0.0, np.abs(depth) ** exponent, 0.0)
        model = power * (stiffness + damping * self.velocity) + offset
        noise = np.sqrt(self.variance)
        parts = [noise * damping / stiffness * self.scale.velocity / _DISSIPATION_DEVIATION]
        if self.exponent is None:
            parts.append(noise * (exponent - _EXPONENT) / _EXPONENT_DEVIATION)
        if self.offset:
            parts.append((offset - self.offset_mean) * noise / self.offset_width)
        return np.concatenate([self.force - model, parts])

    @property
    def offset_width(self) -> float:
        """Standard deviation of the prior of F₀, N."""
        if self.offset_deviation > 0.0:
            return self.offset_deviation
        return max(self.scale.force, _OFFSET_WITHOUT_TARE * float(np.sqrt(self.variance)))

    def value(self, parameters: Floats) -> float:
        """J at K, B, n, F₀ and d, N²."""
        return float(np.sum(self.residuals(parameters) ** 2))


def stated_cost(
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    force: "ArrayLike",
    *,
    exponent: float | None = None,
    offset: bool = True,
    **settings: Any,
) -> StatedCost:
    """Return the cost that :func:`fit_curves` minimises, for one curve.

    Parameters
    ----------
    penetration, velocity, force : array_like, shape (samples,)
        m, m/s and N.
    exponent, offset, **settings
        As :func:`fit_curves` takes them.

    Raises
    ------
    InvalidParameterError
        As :func:`fit_curves` does; or the curve has no contact.
    """
    curves = core._check_curves(penetration, velocity, force)
    roles = np.empty(curves[0].shape, np.uint8)
    usual: dict[str, Any] = fit_curves.__kwdefaults__ or {}
    checked = core._check_settings(1, {**usual, "exponent": exponent, "offset": offset, **settings})
    numbers, _, _, codes = core._fit_rows(curves, checked, 1, roles)
    if codes[0, 1] == core.STATUS_WORDS.index("no contact"):
        raise InvalidParameterError("the curve has no contact")
    chosen = (roles[0] == _FIRM) | (roles[0] == _LIGHT)
    units, prior = numbers[0, 7:10].tolist(), numbers[0, 10:].tolist()
    found: list[Any] = [values[0, chosen] for values in curves]
    found += [Scale(*units), *prior, exponent, offset]
    return StatedCost(*found)


class Reference:
    """Levenberg–Marquardt from many starts, in units of the scale.

    Parameters
    ----------
    cost : StatedCost
        The cost to minimise.
    surfaces : tuple of float or None
        Starts for the surface, m; None: it is at 0.
    """

    def __init__(self, cost: StatedCost, surfaces: tuple[float, float] | None = None) -> None:
        self.cost, self.surfaces = cost, surfaces
        self.open = np.array([True, True, cost.exponent is None, cost.offset, surfaces is not None])

    def least(self, starts: int) -> float:
        """The lowest J of all starts, N²; infinite where none ends within the ranges."""
        low, high = EXPONENTS
        if self.surfaces is None:
            return min(self._from(n, 0.0) for n in np.linspace(low + 0.2, high - 0.3, starts))
        shallow, deep = (at / self.cost.scale.penetration for at in self.surfaces)
        exponents = np.linspace(low + 0.4, high - 0.7, 4)
        inside = np.linspace(shallow, deep, starts // 4 + 2)[1:-1]
        return min(self._from(n, d) for n in exponents for d in inside)

    def in_si(self, point: Floats) -> Floats:
        """K, B, n, F₀, d of k, c, n, F₀, d in units of the scale."""
        k, c, n, offset, surface = point
        scale = self.cost.scale
        unit = scale.force * scale.penetration**-n
        damping = c * unit / scale.velocity
        return np.array([k * unit, damping, n, offset * scale.force, surface * scale.penetration])

    def _from(self, exponent: float, surface: float) -> float:
        start = self._linear(self.cost.exponent or exponent, surface)

        def point(free: Floats) -> Floats:
            whole = start.copy()
            whole[self.open] = free
            return self.in_si(whole)

        def residuals(free: Floats) -> Floats:
            return self.cost.residuals(point(free)) / self.cost.scale.force

        start[3] *= self.cost.offset
        free = start[self.open]
        best = point(least_squares(residuals, free, method="lm", **LOW_ENOUGH).x)
        low, high = self.surfaces or (0.0, 0.0)
        within = EXPONENTS[0] <= best[2] <= EXPONENTS[1] and low <= best[4] <= high
        return self.cost.value(best) if within else np.inf

    def _linear(self, exponent: float, surface: float) -> Floats:
        """Return the least squares of k, c and F₀ with exponent and surface fixed."""
        scale = self.cost.scale
        depth = np.maximum(self.cost.penetration / scale.penetration - surface, 0.0)
        power = np.where(depth > 0.0, depth**exponent, 0.0)
        columns = np.stack(
            [power, power * self.cost.velocity / scale.velocity, np.ones_like(power)], axis=1
        )
        k, c, offset = np.linalg.lstsq(columns, self.cost.force / scale.force, rcond=None)[0]
        return np.array([k if abs(k) > 1e-3 else 1e-3, c, exponent, offset, surface])


if __name__ == "__main__":
    run_command(main)
