"""What a motion can identify: Fisher information and the Cramér–Rao bound.

For F = f(x, v; θ) + ε with white noise of standard deviation σ, no unbiased estimator of θ has a
covariance below

    (JᵀJ)⁻¹ σ²,   J = ∂f/∂θ at every sample.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw
from palpate.validation import Floats, instance, number_in, signals


@dataclass(frozen=True, slots=True, eq=False)
class CramerRaoBound:
    """The least standard errors that a motion allows.

    Attributes
    ----------
    names : tuple of str
        The law's parameters, then ``offset`` and ``surface`` where they are unknown too.
    standard_errors : numpy.ndarray, shape (q,)
        Lower bounds, SI; infinite where the motion does not identify it.
    covariance : numpy.ndarray, shape (q, q)
        The inverse of the information; infinite where that is singular.
    """

    names: tuple[str, ...]
    standard_errors: Floats
    covariance: Floats

    def __getitem__(self, name: str) -> float:
        """Return the bound of one quantity."""
        if name not in self.names:
            raise InvalidParameterError(
                f"name must be one of {', '.join(self.names)}, not {name!r}"
            )
        return float(self.standard_errors[self.names.index(name)])


def sensitivity(law: ForceLaw, penetration: "ArrayLike", velocity: "ArrayLike") -> Floats:
    """∂F/∂θ for the law's parameters at every sample, shape (k, p); zero out of contact.

    Parameters
    ----------
    law : force law
    penetration, velocity : array_like, shape (k,)
        m and m/s, finite.
    """
    instance("law", law, ForceLaw)
    x, v = _finite_signals(penetration, velocity)
    inside = x > 0.0
    gradient = law.parameter_gradient(np.where(inside, x, 1.0), v)
    return np.where(inside[:, None], gradient, 0.0)


def jacobian(
    law: ForceLaw,
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    *,
    offset: bool = False,
    surface: bool = False,
) -> Floats:
    """∂F/∂(θ[, offset][, surface]) at every sample, shape (k, q).

    Arguments as :func:`fisher_information`.
    """
    columns = [sensitivity(law, penetration, velocity)]
    if offset:
        columns.append(np.ones((len(columns[0]), 1)))
    if surface:
        columns.append(_by_surface(law, penetration, velocity)[:, None])
    return np.hstack(columns)


def fisher_information(
    law: ForceLaw,
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    noise: float,
    *,
    offset: bool = False,
    surface: bool = False,
) -> Floats:
    """JᵀJ/σ² of a motion for a law.

    Parameters
    ----------
    law : force law
        The material.
    penetration, velocity : array_like, shape (k,)
        The motion, m and m/s.
    noise : float
        σ of the force, N, in [1e-30, 1e30].
    offset, surface : bool
        Whether a force offset [N] and the position of the surface [m] are unknown too.

    Returns
    -------
    numpy.ndarray, shape (q, q)
        In the order of the law's parameters, the offset, the surface.
    """
    sigma = number_in("noise", noise, 1e-30, 1e30)
    rows = jacobian(law, penetration, velocity, offset=offset, surface=surface) / sigma
    information: Floats = rows.T @ rows
    return information


def cramer_rao_bound(
    law: ForceLaw,
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    noise: float,
    *,
    offset: bool = False,
    surface: bool = False,
) -> CramerRaoBound:
    """Return the least standard errors that a motion allows.

    Arguments are those of :func:`fisher_information`.
    """
    information = fisher_information(
        law, penetration, velocity, noise, offset=offset, surface=surface
    )
    names = (*law.as_dict(), *(["offset"] if offset else []), *(["surface"] if surface else []))
    covariance = inverse_information(information)
    return CramerRaoBound(names, np.sqrt(np.diag(covariance)), covariance)


def _by_surface(law: ForceLaw, penetration: "ArrayLike", velocity: "ArrayLike") -> Floats:
    """∂F/∂d where x becomes x − d."""
    x, v = _finite_signals(penetration, velocity)
    inside = x > 0.0
    return np.where(inside, -law.penetration_gradient(np.where(inside, x, 1.0), v), 0.0)


def _finite_signals(penetration: "ArrayLike", velocity: "ArrayLike") -> tuple[Floats, Floats]:
    x, v = signals(penetration=penetration, velocity=velocity)
    for name, values in (("penetration", x), ("velocity", v)):
        if not np.isfinite(values).all():
            raise InvalidParameterError(
                f"{name} must be finite, not {values[~np.isfinite(values)][0]} at sample "
                f"{int(np.argmin(np.isfinite(values)))}"
            )
    return x, v


def inverse_information(information: Floats) -> Floats:
    """Covariance from an information matrix; infinite where a direction carries nothing."""
    diagonal = np.sqrt(np.diag(information))
    unit = np.where(diagonal > 0.0, diagonal, 1.0)
    scaled = information / np.outer(unit, unit)
    # Rounding of k samples' sums leaves eigenvalues of this size where there are none.
    if np.linalg.eigvalsh(scaled).min() < 1e-13:
        return np.full_like(information, np.inf)
    inverse: Floats = np.linalg.inv(scaled) / np.outer(unit, unit)
    return inverse
