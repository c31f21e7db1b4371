"""Least squares of any law, error bars of any residual, and a recursion of one's own."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.settings import Configured
from palpate.validation import Floats, arguments, covariance_matrix, signal

MOST_STEPS = 25


def long_run_covariance(
    scores: Floats, residual: Floats, shared: Sequence[Floats] = (), fitted: int = 0
) -> Floats:
    """Covariance of Σ u e for a residual e that is correlated, whatever with.

    Σ d_k D_k of Haar levels, with t₀.₉₇₅(ν)/1.96, as in ``docs/variable-projection.md``: the
    estimator of all error bars.

    Parameters
    ----------
    scores : numpy.ndarray, shape (k, p)
        u, one row a sample, in the order of time: the influence of its residual.
    residual : numpy.ndarray, shape (k,)
        e, of a fit to these samples.
    shared : sequence of numpy.ndarray
        Where residuals are averages over windows: the part of its window that each row shares with
        the next, with the next but one, and so on.
    fitted : int
        How many parameters the fit has.
    """
    covariance = np.empty((scores.shape[1],) * 2)
    shares = np.array([part.sum() / (len(residual) - k) for k, part in enumerate(shared, start=1)])
    _core.long_run_covariance(np.ascontiguousarray(scores), residual, shares, fitted, covariance)
    return covariance


def robust_covariance(
    jacobian: Floats, residual: Floats, shared: Sequence[Floats] = (), others: int = 0
) -> Floats:
    """Covariance of a least squares from its Jacobian and what it leaves.

    ``others`` is how many parameters were fitted too, whose columns are orthogonal to these; for
    ``shared`` see :func:`long_run_covariance`.
    """
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = 1.0
    unit = jacobian / size
    scores = unit @ (np.linalg.pinv(unit.T @ unit, hermitian=True) / size)
    return long_run_covariance(scores, residual, shared, len(size) + others)


class Fitted(NamedTuple):
    """Parameters of the least Σ r², with r, shape (k,), and its negative slopes, shape (k, p)."""

    parameters: Floats
    residual: Floats
    jacobian: Floats


def least_squares(
    model: Callable[[Floats], tuple[Floats, Floats]],
    start: Floats,
    bounds: tuple[Floats | float, Floats | float] = (-np.inf, np.inf),
    enough: float = 1e-9,
) -> Fitted:
    """Levenberg–Marquardt from a start, of any law; in one step where the model is linear.

    Of the Hunt–Crossley law on samples as they are ``_core.fit_samples`` finds the same minimum
    three to fifteen times quicker; this one takes any law's gradient, and averages of it.

    Parameters
    ----------
    model : callable
        Gives the residual of parameters, shape (k,), and the force's gradient by them, (k, p); a
        column of zeros keeps its parameter.
    start : numpy.ndarray, shape (p,)
        Where it begins.
    bounds : tuple of numpy.ndarray
        The lowest and the highest parameters.
    enough : float
        It ends when a step gains less than this of Σ r².
    """
    best, damping, (low, high) = Fitted(start, *model(start)), 1e-9, bounds
    energy = float(best.residual @ best.residual)
    for _ in range(MOST_STEPS):
        slope, at = best.jacobian.T @ best.residual, best.parameters
        held = ((at <= low) & (slope < 0.0)) | ((at >= high) & (slope > 0.0))
        jacobian = np.where(held, 0.0, best.jacobian)
        size = np.linalg.norm(jacobian, axis=0)
        size[size == 0.0] = 1.0
        unit = jacobian / size
        # Damped, the condition is no worse than 1e9, so that normal equations will do.
        normal = unit.T @ unit + max(damping, 1e-12) * np.eye(len(size))
        trial = np.clip(at + np.linalg.solve(normal, slope / size) / size, low, high)
        after = Fitted(trial, *model(trial))
        gained = energy - float(after.residual @ after.residual)
        if not gained > 0.0:
            damping = max(damping, 1e-6) * 10.0
            if damping > 1e3:
                break
            continue
        best, energy, damping = after, energy - gained, damping / 10.0
        if gained < enough * (energy + gained):
            break
    return best


def mean_error(values: Floats) -> float:
    """Standard error of the mean of correlated values."""
    count = len(values)
    scores = np.full((count, 1), 1.0 / count)
    return float(np.sqrt(long_run_covariance(scores, values - values.mean(), (), 1)[0, 0]))


# The bare recursion of eq. 13, for a regression of one's own.


class LeastSquares(Configured, _core.LeastSquares):
    """Recursive least squares with forgetting, for any y = φᵀθ that is linear in θ.

    g = P φ;  L = g / (λ + φᵀ g);  e = y − φᵀ θ;  θ ← θ + L e;  P ← (P − L gᵀ) / λ   (eq. 13)

    Parameters
    ----------
    order : int
        Number of coefficients θ, 1 to 8.
    initial : array_like, shape (order,), optional
        θ₀; zeros unless given.
    initial_covariance : float or array_like
        P₀: a scalar, ``order`` variances or a matrix, in the units of θ².

    Raises
    ------
    InvalidParameterError
        An order outside 1 to 8, or a start of another size.
    """

    __slots__ = ("_settings",)

    def __init__(
        self,
        order: int,
        *,
        initial: "ArrayLike | None" = None,
        initial_covariance: "ArrayLike" = 1e6,
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        if not isinstance(order, int | np.integer) or not 1 <= order <= 8:
            raise InvalidParameterError(f"order must be a whole number in [1, 8], not {order!r}")
        start = np.zeros(order) if initial is None else signal("initial", initial)
        if start.size != order or not np.all(np.abs(start) < 1e100):
            raise InvalidParameterError(
                f"initial must be {order} finite coefficients, not {initial!r}"
            )
        covariance = covariance_matrix("initial_covariance", initial_covariance, int(order))
        super().__init__(int(order), start, covariance.reshape(-1))

    def reset(self) -> None:
        """Forget every row taken."""
        fresh = LeastSquares(**self._settings)
        self._restore(fresh._state())
