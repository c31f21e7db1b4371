"""Least squares of any law, standard errors for any residual, and plain recursive least squares."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.force_laws import HuntCrossley
from palpate.method.settings import Configured
from palpate.validation import Floats, Mask, arguments, covariance_matrix, signal

MOST_STEPS = 25
# For this many rows without shared windows, up to three periods of the motion, there are too few
# blocks to measure the correlation of the noise; fewer rows contain no information on it.
FEW_ROWS = range(30, 65)
POLES = 1.0 - 0.5 ** np.arange(0.0, 4.1, 0.25)


def long_run_covariance(
    scores: Floats,
    residual: Floats,
    shared: Sequence[Floats] = (),
    fitted: int = 0,
) -> Floats:
    """Covariance of Σ u e for a correlated residual e.

    Σ d_k D_k of Haar levels, with t₀.₉₇₅(ν)/1.96, as in ``docs/explain/default-method.md``. All
    standard errors of palpate come from it.

    Parameters
    ----------
    scores : numpy.ndarray, shape (k, p)
        u, the influence of each residual; one row per sample, in the order of time.
    residual : numpy.ndarray, shape (k,)
        e, of a fit to these samples.
    shared : sequence of numpy.ndarray
        For residuals that are averages over windows: the fraction of each row's window that it
        shares with the next row, with the next but one, and so on. Default: no windows.
    fitted : int
        Number of fitted parameters. Default: 0.
    """
    covariance = np.empty((scores.shape[1],) * 2)
    shares = np.array([part.sum() / (len(residual) - k) for k, part in enumerate(shared, start=1)])
    _core.long_run_covariance(np.ascontiguousarray(scores), residual, shares, fitted, covariance)
    return covariance


def robust_covariance(
    jacobian: Floats,
    residual: Floats,
    shared: Sequence[Floats] = (),
    others: int = 0,
) -> Floats:
    """Covariance of a least-squares fit from its Jacobian and residual.

    ``others`` is the number of further fitted parameters, whose columns are orthogonal to these;
    for ``shared`` see :func:`long_run_covariance`.
    """
    size = column_sizes(jacobian)
    unit = jacobian / size
    normal = unit.T @ unit
    # A pseudo-inverse of one number takes a tenth of the time of a diagnosis.
    single = len(size) == 1 and normal[0, 0] > 0.0
    inverse = 1.0 / normal if single else np.linalg.pinv(normal, hermitian=True)
    scores = unit @ (inverse / size)
    covariance = long_run_covariance(scores, residual, shared, len(size) + others)
    every = len(shared) + 1
    if not others and len(residual[::every]) in FEW_ROWS:
        free = np.diag(covariance) > 0.0  # not those that are kept fixed
        variances = _ar1_variances(unit[::every], residual[::every]) / size**2
        wider = float(np.mean(variances[free] / np.diag(covariance)[free]))
        if 1.0 < wider < np.inf:
            covariance *= wider
    return covariance


def _ar1_variances(jacobian: Floats, residual: Floats) -> Floats:
    """Variances of a least-squares fit in the AR(1) noise of the greatest restricted likelihood.

    A fit of four parameters to a single press absorbs most of slow noise. Blocks of the residual
    measure only the rest, but this likelihood allows for it (Patterson & Thompson 1971): for 0.5 s
    presses in AR(1) noise of 0.98 the 95 % intervals of stiffness contain the truth in 86 instead
    of 73 % of cases.
    """
    rows, parameters = jacobian.shape
    both = np.column_stack([jacobian, residual])
    whitened = both - POLES[:, None, None] * np.vstack([np.zeros_like(both[:1]), both[:-1]])
    whitened[:, 0] *= np.sqrt(1.0 - POLES**2)[:, None]
    # The last diagonal entry of R is the norm of the whitened residual.
    r = np.abs(np.diagonal(np.linalg.qr(whitened, mode="r"), axis1=1, axis2=2))
    r = np.maximum(r, np.finfo(float).tiny)
    likelihood = 0.5 * np.log(1.0 - POLES**2) - np.log(r[:, :-1]).sum(axis=1)
    likelihood -= (rows - parameters) * np.log(r[:, -1])
    best = int(np.argmax(likelihood))
    variance = r[best, -1] ** 2 / (rows - parameters) / (1.0 - POLES[best] ** 2)
    scores = jacobian @ np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    lags = np.abs(np.subtract.outer(np.arange(rows), np.arange(rows)))
    variances: Floats = variance * ((POLES[best] ** lags @ scores) * scores).sum(axis=0)
    return variances


def column_sizes(matrix: Floats) -> Floats:
    """Lengths of the columns, by which they are divided; 1 for a column of zeros."""
    with np.errstate(all="ignore"):
        size: Floats = np.sqrt(np.square(matrix).sum(axis=0))
    return np.where(size > 0.0, size, 1.0)


class Fitted(NamedTuple):
    """Parameters of the least Σ r², r, shape (k,), and the negative slopes of r, shape (k, p)."""

    parameters: Floats
    residual: Floats
    jacobian: Floats


def least_squares(
    model: Callable[[Floats], tuple[Floats, Floats]],
    start: Floats,
    bounds: tuple[Floats | float, Floats | float] = (-np.inf, np.inf),
    enough: float = 1e-9,
) -> Fitted:
    """Fit any law by Levenberg–Marquardt from a start; a linear model takes one step.

    For example y = exp(−a t): ``least_squares(lambda a: (y - np.exp(-a * t), -t[:, None] *
    np.exp(-a * t)[:, None]), np.array([1.0])).parameters``.

    For the Hunt–Crossley law on raw samples ``_core.fit_samples`` finds the same minimum three to
    fifteen times faster; this function takes any law, and window averages of its gradient.

    Parameters
    ----------
    model : callable
        Takes parameters and returns their residual, shape (k,), and the gradient of the force with
        respect to them, shape (k, p); a column of zeros keeps its parameter fixed.
    start : numpy.ndarray, shape (p,)
        Starting values.
    bounds : tuple of numpy.ndarray
        Lower and upper bounds. Default: none.
    enough : float
        The fit stops when a step reduces Σ r² by less than this fraction. Default: 1e-9.

    Returns
    -------
    Fitted
        ``parameters``, shape (p,), ``residual``, shape (k,), and ``jacobian``, shape (k, p).

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> t = np.linspace(0.0, 1.0, 50)
    >>> y = np.exp(-3.0 * t)
    >>> def decay(a):
    ...     fitted = np.exp(-a * t)
    ...     return y - fitted, -t[:, None] * fitted[:, None]
    >>> palpate.least_squares(decay, np.array([1.0])).parameters.round(6).tolist()
    [3.0]
    """
    best = Fitted(start, *model(start))
    damping = 1e-9
    (low, high) = bounds
    energy = float(best.residual @ best.residual)
    identity = np.eye(len(start))
    for _ in range(MOST_STEPS):
        slope = best.jacobian.T @ best.residual
        parameters = best.parameters
        held = ((parameters <= low) & (slope < 0.0)) | ((parameters >= high) & (slope > 0.0))
        jacobian = np.where(held, 0.0, best.jacobian) if held.any() else best.jacobian
        size = column_sizes(jacobian)
        unit = jacobian / size
        # Damping limits the condition number to 1e9, so the normal equations are accurate enough.
        normal = unit.T @ unit + max(damping, 1e-12) * identity
        step = np.linalg.solve(normal, slope / size) / size
        trial = np.minimum(np.maximum(parameters + step, low), high)
        if not np.isfinite(trial).all():  # sums of absurd samples overflow
            break
        tried = Fitted(trial, *model(trial))
        gained = energy - float(tried.residual @ tried.residual)
        if not gained > 0.0:
            damping = max(damping, 1e-6) * 10.0
            if damping > 1e3:
                break
            continue
        best = tried
        energy = energy - gained
        damping = damping / 10.0
        if gained < enough * (energy + gained):
            break
    return best


def nonnegative(
    gram: Floats,
    moment: Floats,
    free: Mask,
    used: Mask,
) -> Floats:
    """Return the factors c ≥ 0 that minimise ‖A c − y‖², from the normal equations.

    Lawson & Hanson, Solving Least Squares Problems, 1974, chapter 23. For example the stiffnesses
    of a spectrum of relaxation times: ``nonnegative(a.T @ a, a.T @ y, none, ~none)``.

    Parameters
    ----------
    gram : numpy.ndarray, shape (p, p)
        AᵀA.
    moment : numpy.ndarray, shape (p,)
        Aᵀy.
    free : numpy.ndarray of bool, shape (p,)
        Factors that may have any sign.
    used : numpy.ndarray of bool, shape (p,)
        Factors to fit; the others are 0.

    Returns
    -------
    numpy.ndarray, shape (p,)
        Factors c; 0 for those that are not used.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> a, y = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]]), np.array([1.0, 0.5, 0.0])
    >>> none = np.zeros(2, dtype=bool)
    >>> palpate.nonnegative(a.T @ a, a.T @ y, none, ~none).round(3).tolist()
    [0.5, 0.0]
    """
    gram = gram + 1e-10 * np.trace(gram) / len(gram) * np.eye(len(gram))
    active = free & used
    factors = np.zeros(len(moment))
    for _ in range(3 * len(moment)):
        best = np.zeros_like(factors)
        best[active] = np.linalg.solve(gram[np.ix_(active, active)], moment[active])
        low = active & ~free & (best <= 0.0)
        if low.any():
            part = np.min(factors[low] / np.maximum(factors[low] - best[low], 1e-300))
            factors = factors + part * (best - factors)
            active &= free | (factors > 1e-14)
            continue
        factors = best
        slope = np.where(active | ~used, -np.inf, moment - gram @ factors)
        place = int(np.argmax(slope))
        if not slope[place] > 1e-9 * np.abs(moment).max():
            break
        active[place] = True
    return factors


def mean_error(values: Floats) -> float:
    """Standard error of the mean of correlated values."""
    count = len(values)
    scores = np.full((count, 1), 1.0 / count)
    return float(np.sqrt(long_run_covariance(scores, values - values.mean(), (), 1)[0, 0]))


# The plain recursion of eq. 13, for your own regression.


class LeastSquares(Configured, _core.LeastSquares):
    """Recursive least squares with forgetting, for any model y = φᵀθ.

    g = P φ;  L = g / (λ + φᵀ g);  e = y − φᵀ θ;  θ ← θ + L e;  P ← (P − L gᵀ) / λ   (eq. 13)

    Parameters
    ----------
    order : int
        Number of coefficients θ, 1 to 8.
    initial : array_like, shape (order,), optional
        θ₀. Default: zeros.
    initial_covariance : float or array_like
        P₀: a scalar, ``order`` variances or a matrix, in the units of θ². Default: 1e6.

    Raises
    ------
    InvalidParameterError
        The order is outside 1 to 8, or ``initial`` has another size.

    Examples
    --------
    >>> import palpate
    >>> line = palpate.LeastSquares(2)
    >>> for t in range(10):  # y = 3 + t/2
    ...     status = line.update([1.0, t], 3.0 + 0.5 * t)
    >>> line.parameters.round(3).tolist()
    [3.0, 0.5]
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
        """Forget all rows."""
        fresh = LeastSquares(**self._settings)
        self._restore(fresh._state())


# Joint least squares of a Hunt–Crossley law, an offset and the surface.

EXPONENT_RANGE = (0.2, 6.0)  # wider than for any material; keeps powers finite
SURFACE_RANGE = (-3.0, 0.9)  # working depths


def fit_surface_position(
    samples: Floats, starts: Floats, *, exponent_fixed: bool = False
) -> Fitted:
    """Fit (k, c, n, F₀, d) by least squares from several starts; return the best fit.

    Parameters
    ----------
    samples : numpy.ndarray, shape (3, samples)
        Depth over the working depth, velocity over its rms, and force [N], in contact and free
        approach.
    starts : numpy.ndarray, shape (starts, 5)
        Starting values: N, N, 1, N, and working depths.
    exponent_fixed : bool
        Whether n keeps its starting value.
    """
    exponents = (starts[0, 2],) * 2 if exponent_fixed else EXPONENT_RANGE
    fitted = _core.fit_samples(np.ascontiguousarray(samples), starts, exponents, SURFACE_RANGE)
    parameters = np.array(fitted)
    law = HuntCrossley.from_parameters(fitted[:3])
    x, v, force = samples
    below = x - parameters[4]
    touching = (below > 0.0)[:, None]
    below = np.where(below > 0.0, below, 1.0)
    rows = [*law.parameter_gradient(below, v).T, -law.penetration_gradient(below, v)]
    jacobian = np.insert(np.array(rows).T * touching, 3, 1.0, axis=1)
    jacobian[:, 2] *= not exponent_fixed
    residual = force - jacobian[:, [0, 1, 3]] @ parameters[[0, 1, 3]]
    return Fitted(parameters, residual, jacobian)
