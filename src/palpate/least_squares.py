"""The bare recursion of eq. 13, for a regression of one's own."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.settings import Configured
from palpate.validation import arguments, covariance_matrix, signal


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
