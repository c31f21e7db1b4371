"""Least squares of a Hunt–Crossley law, an offset and the surface, together."""

from dataclasses import dataclass

import numpy as np

from palpate.validation import Floats

EXPONENTS = (0.2, 6.0)  # beyond what any material shows; keeps powers finite
STEPS = 15


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Contact, free approach and what lies between, thinned."""

    x: Floats  # over the working depth
    v: Floats  # over its rms
    force: Floats  # N


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Least squares with the surface free: (k, c, n, F₀, d), what it leaves, and its Jacobian."""

    parameters: Floats
    residual: Floats
    jacobian: Floats

    @property
    def energy(self) -> float:
        """Sum of squares, N²."""
        return float(self.residual @ self.residual)


def _model(samples: Samples, parameters: Floats) -> tuple[Floats, Floats]:
    """Force [N] and its gradient by (k, c, n, F₀, d)."""
    k, c, n, offset, depth = parameters
    below = samples.x - depth
    touching = below > 1e-9
    below = np.where(touching, below, 1.0)
    power = np.where(touching, below**n, 0.0)
    force = power * (k + c * samples.v)
    gradient = np.column_stack(
        [power, power * samples.v, np.log(below) * force, np.ones_like(force), -n * force / below]
    )
    return force + offset, gradient


def placed(samples: Samples, start: Floats, *, exponent_fixed: bool = False) -> Placed:
    """Levenberg–Marquardt on (k, c, n, F₀, d), from a start.

    Parameters
    ----------
    samples : Samples
        Contact and free approach, without units.
    start : numpy.ndarray, shape (5,)
        N, N, 1, N, and depths.
    exponent_fixed : bool
        Whether n stays what it is in the start.
    """
    parameters, damping = start.copy(), 1e-4
    model, gradient = _model(samples, parameters)
    gradient[:, 2] *= not exponent_fixed
    residual = samples.force - model
    for _ in range(STEPS):
        size = np.linalg.norm(gradient, axis=0)
        size[size == 0.0] = 1.0
        unit = gradient / size
        normal = unit.T @ unit + damping * np.eye(len(size))
        trial = parameters + np.linalg.solve(normal, unit.T @ residual) / size
        trial[2] = np.clip(trial[2], *EXPONENTS)
        trial[4] = np.clip(trial[4], -3.0, 0.9)
        model, new_gradient = _model(samples, trial)
        new_gradient[:, 2] *= not exponent_fixed
        new = samples.force - model
        if float(new @ new) < float(residual @ residual):
            ended = float(residual @ residual - new @ new) < 1e-7 * float(new @ new)
            parameters, residual, gradient = trial, new, new_gradient
            damping = max(damping / 10.0, 1e-9)
            if ended:
                break
        else:
            damping *= 10.0
    return Placed(parameters, residual, gradient)
