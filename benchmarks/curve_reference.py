"""The stated cost of a curve minimised by SciPy from many starts."""

import numpy as np
from scipy.optimize import least_squares

from palpate.estimators.curves import StatedCost
from palpate.validation import Floats


class Reference:
    """Levenberg–Marquardt from many starts, with the analytic Jacobian, to rounding.

    Parameters
    ----------
    cost : StatedCost
        What is minimised.
    surfaces : tuple of float or None
        Where the surface is looked for, m; None: it is at 0.
    exponents : tuple of float
        Where the exponent is looked for.
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
