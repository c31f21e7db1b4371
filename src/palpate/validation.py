"""Checks of arguments, so that every setting refuses nonsense in the same words."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.errors import InvalidParameterError

Floats = NDArray[np.float64]


def number(name: str, value: Any) -> float:
    """``value`` as a finite float."""
    try:
        result = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidParameterError(f"{name} must be a number, not {value!r}") from None
    if not math.isfinite(result):
        raise InvalidParameterError(f"{name} must be finite, not {value!r}")
    return result


def number_in(name: str, value: Any, low: float, high: float, *, open_low: bool = False) -> float:
    """``value`` as a float in [low, high], or in (low, high] where ``open_low``."""
    result = number(name, value)
    if result < low or result > high or (open_low and result == low):
        bracket = "(" if open_low else "["
        raise InvalidParameterError(f"{name} must be in {bracket}{low:g}, {high:g}], not {value!r}")
    return result


def instance(name: str, value: Any, kinds: type | tuple[type, ...]) -> None:
    """Refuse ``value`` unless it is of one of the kinds."""
    if not isinstance(value, kinds):
        allowed = kinds if isinstance(kinds, tuple) else (kinds,)
        words = " or ".join(kind.__name__ for kind in allowed)
        raise InvalidParameterError(f"{name} must be a {words}, not {value!r}")


def signal(name: str, values: ArrayLike) -> Floats:
    """``values`` as a contiguous one-dimensional float array (a copy only where it must be)."""
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "fiub":
            raise TypeError
        result = np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidParameterError(
            f"{name} must be an array of real numbers, not {type(values).__name__}"
        ) from None
    if array.ndim != 1:
        raise InvalidParameterError(f"{name} must be one-dimensional, not {array.ndim}-dimensional")
    return result


def signals(**arrays: ArrayLike) -> tuple[Floats, ...]:
    """Each array as by :func:`signal`, all of the same length."""
    checked = {name: signal(name, values) for name, values in arrays.items()}
    if len({array.size for array in checked.values()}) > 1:
        lengths = ", ".join(f"{name} has {array.size}" for name, array in checked.items())
        raise InvalidParameterError(f"arrays must have the same length: {lengths}")
    return tuple(checked.values())


def covariance_matrix(name: str, value: ArrayLike, size: int) -> Floats:
    """A positive definite matrix from a scalar, a diagonal or a matrix."""
    try:
        given = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidParameterError(f"{name} must be numbers, not {value!r}") from None
    if given.ndim == 0:
        matrix = np.diag(np.full(size, float(given)))
    elif given.shape == (size,):
        matrix = np.diag(given)
    elif given.shape == (size, size) and np.array_equal(given, given.T):
        matrix = given.copy()
    else:
        raise InvalidParameterError(
            f"{name} must be a scalar, {size} variances or a symmetric {size} × {size} matrix, "
            f"not an array of shape {given.shape}"
        )
    variances = np.diag(matrix)
    if not np.all((variances >= 1e-20) & (variances <= 1e20)):
        raise InvalidParameterError(f"{name} must have variances in [1e-20, 1e+20], not {value!r}")
    deviations = np.sqrt(variances)
    if np.linalg.eigvalsh(matrix / np.outer(deviations, deviations)).min() < 1e-10:
        raise InvalidParameterError(f"{name} must be positive definite, not {value!r}")
    return np.ascontiguousarray(matrix)
