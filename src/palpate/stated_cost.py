"""The cost that :func:`fit_curves` minimises, written down for one curve."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.settings import Scale
from palpate.validation import Floats

#: What a sample is to a fit, by the codes of :attr:`StatedCost.roles`.
ROLES = ("absent", "free air", "firm contact", "light contact", "left out")
_FIRM, _LIGHT = ROLES.index("firm contact"), ROLES.index("light contact")
# Of the priors, as in include/palpate/projection/priors.hpp.
_EXPONENT, _EXPONENT_DEVIATION, _DISSIPATION_DEVIATION = 1.3, 1.0, 1.0
_OFFSET_WITHOUT_TARE = 20.0  # standard deviations of the noise, where a unit of force is less


@dataclass(frozen=True, eq=False)
class StatedCost:
    """J = Σ (F − F̂)² + σ² [(n − 1.3)² + (b/b_s)² + (F₀ − m)²/s²], over the samples chosen.

    b = B/K is in units of the scale, b_s = 1, and σ² is that of the residual which J ends with.

    Attributes
    ----------
    penetration, velocity, force : numpy.ndarray, shape (j,)
        The samples that it is over, SI.
    roles : numpy.ndarray of uint8, shape (k,)
        What each sample of the curve is, by the codes of :data:`ROLES`.
    scale : Scale
        The units of the arithmetic.
    offset_mean, offset_deviation : float
        The prior of F₀, N; a deviation of 0 is none: one unit of force then, or 20 σ.
    variance : float
        σ² of the priors, N².
    exponent : float or None
        Where it is fixed.
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

    @classmethod
    def of(
        cls,
        curve: tuple[Floats, Floats, Floats],
        roles: NDArray[np.uint8],
        numbers: Floats,
        exponent: float | None,
        offset: bool,
    ) -> "StatedCost":
        """From a curve, what the core says of its samples, and its scale, prior and σ²."""
        chosen = (roles == _FIRM) | (roles == _LIGHT)
        penetration, velocity, force = (values[chosen] for values in curve)
        units, (mean, deviation, variance) = numbers[:3], numbers[3:].tolist()
        return cls(
            penetration,
            velocity,
            force,
            roles,
            Scale(*units.tolist()),
            mean,
            deviation,
            variance,
            exponent,
            offset,
        )

    def residuals(self, parameters: Floats) -> Floats:
        """Residuals of which the squares sum to J, N: of the samples, then of the priors.

        Parameters
        ----------
        parameters : numpy.ndarray, shape (5,)
            K, B, n, F₀ and d, SI.
        """
        stiffness, damping, exponent, offset, surface = parameters
        depth = self.penetration - surface
        power = np.where(depth > 0.0, np.abs(depth) ** exponent, 0.0)
        model = power * (stiffness + damping * self.velocity) + offset
        return np.concatenate([self.force - model, self.prior_residuals(parameters)])

    def prior_residuals(self, parameters: Floats) -> Floats:
        """The priors' part of :meth:`residuals`, N."""
        stiffness, damping, exponent, offset, _ = parameters
        noise = np.sqrt(self.variance)
        parts = [noise * damping / stiffness * self.scale.velocity / _DISSIPATION_DEVIATION]
        if self.exponent is None:
            parts.append(noise * (exponent - _EXPONENT) / _EXPONENT_DEVIATION)
        if self.offset:
            parts.append((offset - self.offset_mean) * noise / self.offset_width)
        return np.array(parts)

    @property
    def offset_width(self) -> float:
        """Standard deviation of the prior of F₀, N."""
        if self.offset_deviation > 0.0:
            return self.offset_deviation
        return max(self.scale.force, _OFFSET_WITHOUT_TARE * float(np.sqrt(self.variance)))

    def value(self, parameters: Floats) -> float:
        """J at K, B, n, F₀ and d, N²."""
        return float(np.sum(self.residuals(parameters) ** 2))
