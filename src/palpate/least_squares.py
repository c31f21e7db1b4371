"""The bare recursion of eq. 13, for a regression of one's own."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.validation import covariance_matrix, signal


class LeastSquares(_core.LeastSquares):
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
        if not isinstance(order, int | np.integer) or not 1 <= order <= 8:
            raise InvalidParameterError(f"order must be a whole number in [1, 8], not {order!r}")
        start = np.zeros(order) if initial is None else signal("initial", initial)
        if start.size != order or not np.all(np.abs(start) < 1e100):
            raise InvalidParameterError(
                f"initial must be {order} finite coefficients, not {initial!r}"
            )
        covariance = covariance_matrix("initial_covariance", initial_covariance, int(order))
        self._settings: tuple[int, Any, Any] = (int(order), initial, initial_covariance)
        super().__init__(int(order), start, covariance.reshape(-1))

    def reset(self) -> None:
        """Forget every row taken."""
        order, initial, covariance = self._settings
        fresh = LeastSquares(order, initial=initial, initial_covariance=covariance)
        self._restore(fresh._state())

    def copy(self) -> "LeastSquares":
        """Return an engine with the same settings and state, from here on independent."""
        order, initial, covariance = self._settings
        return _restored(order, initial, covariance, self._state())

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> "LeastSquares":
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (*self._settings, self._state())


def _restored(order: int, initial: Any, initial_covariance: Any, state: bytes) -> LeastSquares:
    engine = LeastSquares(order, initial=initial, initial_covariance=initial_covariance)
    try:
        engine._restore(state)
    except (TypeError, ValueError) as error:
        raise InvalidParameterError(f"LeastSquares: {error}") from None
    return engine
