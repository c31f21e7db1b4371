"""The documented cost of ``fit_curves``, minimised by SciPy from many starts."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from palpate import InvalidParameterError, Scale, fit_curves
from palpate.estimators import batch_fit as core
from palpate.validation import Floats

#: The role of a sample in a fit, by the codes of :attr:`StatedCost.roles`.
ROLES = ("absent", "free air", "firm contact", "light contact", "left out")
_FIRM, _LIGHT = ROLES.index("firm contact"), ROLES.index("light contact")
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
    roles : numpy.ndarray of uint8, shape (k,)
        The role of each sample of the curve, by the codes of :data:`ROLES`.
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
    roles: NDArray[np.uint8]
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
    if len(curves[0]) != 1:
        raise InvalidParameterError(f"pass one curve, not {len(curves[0])}")
    roles = np.empty(curves[0].shape, np.uint8)
    usual: dict[str, Any] = fit_curves.__kwdefaults__ or {}
    if unknown := settings.keys() - usual.keys():
        raise InvalidParameterError(f"unknown setting {', '.join(sorted(unknown))}")
    checked = core._check_settings(1, {**usual, "exponent": exponent, "offset": offset, **settings})
    numbers, _, _, codes = core._fit_rows(curves, checked, 1, roles)
    if codes[0, 1] == core.STATUS_WORDS.index("no contact"):
        raise InvalidParameterError("the curve has no contact")
    chosen = (roles[0] == _FIRM) | (roles[0] == _LIGHT)
    units, prior = numbers[0, 7:10].tolist(), numbers[0, 10:].tolist()
    found: list[Any] = [values[0, chosen] for values in curves]
    found += [roles[0], Scale(*units), *prior, exponent, offset]
    return StatedCost(*found)


class Reference:
    """Levenberg–Marquardt from many starts, with the analytic Jacobian, to rounding.

    Parameters
    ----------
    cost : StatedCost
        The cost to minimise.
    surfaces : tuple of float or None
        Starts for the surface, m; None: it is at 0.
    exponents : tuple of float
        Starts for the exponent.
    """

    def __init__(
        self,
        cost: StatedCost,
        surfaces: tuple[float, float] | None = None,
        exponents: tuple[float, float] = (0.3, 3.6),
    ) -> None:
        self.cost, self.surfaces, self.exponents = cost, surfaces, exponents
        scale = cost.scale
        self.x = cost.penetration / scale.penetration
        self.w = cost.velocity / scale.velocity
        self.open = np.array([True, True, cost.exponent is None, cost.offset, surfaces is not None])

    def least(self, starts: int) -> float:
        """The lowest J of all starts, N²; infinite where none ends within the ranges."""
        return min((self._from(*start) for start in self._starts(starts)), default=np.inf)

    def in_si(self, point: Floats) -> Floats:
        """K, B, n, F₀, d of k, c, n, F₀, d in units of the scale."""
        k, c, n, offset, surface = point
        scale = self.cost.scale
        unit = scale.force * scale.penetration**-n
        damping = c * unit / scale.velocity
        return np.array([k * unit, damping, n, offset * scale.force, surface * scale.penetration])

    def _starts(self, count: int) -> list[tuple[float, float]]:
        low, high = self.exponents
        if self.surfaces is None:
            return [(n, 0.0) for n in np.linspace(low + 0.2, high - 0.3, count)]
        shallow, deep = (at / self.cost.scale.penetration for at in self.surfaces)
        exponents = np.linspace(low + 0.4, high - 0.7, 4)
        inside = np.linspace(shallow, deep, count // 4 + 2)[1:-1]
        return [(float(n), float(d)) for n in exponents for d in inside]

    def _from(self, exponent: float, surface: float) -> float:
        if self.cost.exponent is not None:
            exponent = self.cost.exponent
        start = self._linear(exponent, surface)
        best = least_squares(
            self._residuals,
            start[self.open],
            jac=self._jacobian,
            method="lm",
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=400,
        )
        point = self._whole(best.x)
        if not self.exponents[0] <= point[2] <= self.exponents[1]:
            return np.inf
        at = point[4] * self.cost.scale.penetration
        if self.surfaces is not None and not self.surfaces[0] <= at <= self.surfaces[1]:
            return np.inf
        return self.cost.value(self.in_si(point))

    def _linear(self, exponent: float, surface: float) -> Floats:
        power = self._power(exponent, surface)
        columns = np.stack([power, power * self.w, np.ones_like(power)], axis=1)
        found = np.linalg.lstsq(columns, self.cost.force / self.cost.scale.force, rcond=None)[0]
        stiffness = found[0] if abs(found[0]) > 1e-3 else 1e-3
        return np.array([stiffness, found[1], exponent, found[2], surface])

    def _power(self, exponent: float, surface: float) -> Floats:
        depth = self.x - surface
        power: Floats = np.where(depth > 0.0, np.abs(depth) ** exponent, 0.0)
        return power

    def _whole(self, open_: Floats) -> Floats:
        point = np.zeros(5)
        point[2] = self.cost.exponent or 0.0
        point[self.open] = open_
        return point

    def _residuals(self, open_: Floats) -> Floats:
        return self.cost.residuals(self.in_si(self._whole(open_))) / self.cost.scale.force

    def _jacobian(self, open_: Floats) -> Floats:
        k, c, n, _, surface = self._whole(open_)
        power, depth = self._power(n, surface), self.x - surface
        below = depth > 0.0
        held = np.where(below, depth, 1.0)
        stiff = k + c * self.w
        slopes = [
            power,
            power * self.w,
            power * np.log(held) * stiff,
            np.ones_like(power),
            np.where(below, -n * power / held * stiff, 0.0),
        ]
        noise = np.sqrt(self.cost.variance) / self.cost.scale.force
        priors = [[-c / k**2 * noise, noise / k, 0.0, 0.0, 0.0]]
        if self.cost.exponent is None:
            priors.append([0.0, 0.0, noise, 0.0, 0.0])
        if self.cost.offset:
            width = self.cost.offset_width / self.cost.scale.force
            priors.append([0.0, 0.0, 0.0, noise / width, 0.0])
        samples = -np.stack(slopes, axis=1)
        whole: Floats = np.concatenate([samples, np.array(priors)])[:, self.open]
        return whole
