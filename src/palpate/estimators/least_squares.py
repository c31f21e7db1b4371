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
FEWEST_BLOCKS = 8  # fewer say too little of a variance


def block_variance(scores: Floats, floor: Floats) -> Floats:
    """Variance of the sum of correlated scores: the largest over dyadic blocks.

    Over m blocks of b = 1, 2, 4 … samples V_b = Σ (Σ u)² m/(m − 1); of the longer ones only what
    exceeds their own scatter counts, V_b (1 − √(2/m)).

    Parameters
    ----------
    scores : numpy.ndarray, shape (k, p)
        One row a sample, in the order of time.
    floor : numpy.ndarray, shape (p,)
        The variance if the samples were independent.
    """
    largest, length = floor, 1
    while len(scores) // length >= FEWEST_BLOCKS:
        count = len(scores) // length
        sums = scores[: count * length].reshape(count, length, -1).sum(axis=1)
        variance = (sums**2).sum(axis=0) * count / (count - 1.0)
        trusted = 1.0 if length == 1 else 1.0 - np.sqrt(2.0 / count)
        largest = np.maximum(largest, variance * trusted)
        length *= 2
    return largest


def robust_covariance(
    jacobian: Floats, residual: Floats, shared: Sequence[Floats] = (), others: int = 0
) -> Floats:
    """Covariance of least squares from the influence of each row, in blocks of every length.

    With u_i = (JᵀJ)⁻¹ J_i r_i, the white covariance r²(JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ is widened on both
    sides, so that its correlations stay and its variances are those of :func:`block_variance`.

    Parameters
    ----------
    jacobian : numpy.ndarray, shape (k, p)
        Of the fit.
    residual : numpy.ndarray, shape (k,)
        What it leaves.
    shared : sequence of numpy.ndarray
        R for white samples: the part of its window that each row shares with the next, with the
        next but one, and so on. Blocks alone find but 2.2 of the 3 times that windows which share
        two thirds take: bars of 0.85 of their width.
    others : int
        Parameters that were fitted too, whose columns are orthogonal to these.
    """
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = 1.0
    unit = jacobian / size
    inverse = np.linalg.pinv(unit.T @ unit, hermitian=True)
    scores = unit @ inverse
    white = scores.T @ scores
    for lag, part in enumerate(shared, start=1):
        both = scores[:-lag].T @ (scores[lag:] * part[:, None])
        white += both + both.T
    white *= float(residual @ residual) / max(len(residual) - len(size) - others, 1)
    variances = np.diag(white).clip(min=np.finfo(float).tiny)
    widening = np.sqrt(block_variance(scores * residual[:, None], variances) / variances)
    covariance: Floats = white * np.outer(widening, widening) / np.outer(size, size)
    return covariance


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
    deviations = (values - values.mean()) / len(values)
    white = (deviations**2).sum()
    return float(np.sqrt(block_variance(deviations[:, None], np.array([white]))[0]))


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
