"""Values: their types, frozen classes of them, and checks with the same messages everywhere."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, dataclass_transform, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.errors import InvalidParameterError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
Values = NDArray[Any]
_Value = TypeVar("_Value")


@overload
def frozen(kind: type[_Value], /) -> type[_Value]: ...
@overload
def frozen(**options: bool) -> Callable[[type[_Value]], type[_Value]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(kind: Any = None, /, **options: bool) -> Any:
    """Make a class a dataclass with frozen fields in slots; other options are those of dataclass.

    Classes that hold arrays take ``eq=False``, because arrays have no one truth value.
    """
    make = dataclass(frozen=True, slots=True, **options)
    return make if kind is None else make(kind)


def shown(value: Any, most: int = 80) -> str:
    """``value`` for a message: its repr on one line, cut after ``most`` characters."""
    try:
        words = repr(value)
    except Exception:  # a failing repr must not hide the actual error
        words = f"<{type(value).__name__}>"
    words = " ".join(words.split())
    return words if len(words) <= most else words[: most - 3] + "…"


def finite_or_none(value: float | None) -> float | None:
    """``value`` if it is finite, else None: JSON has no NaN and no infinity."""
    return None if value is None or not math.isfinite(value) else float(value)


def plain(value: Any) -> Any:
    """``value`` as JSON types: None for a number that is not finite, a dict for a dataclass."""
    if isinstance(value, float):
        return finite_or_none(value)
    if isinstance(value, Mapping):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple | deque):
        return [plain(each) for each in value]
    return value.as_dict() if hasattr(value, "as_dict") else value


class Plain:
    """A dataclass that converts itself to a dictionary of its fields."""

    __slots__ = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as JSON types; a number that is not finite is None."""
        own: Any = self  # each subclass is a dataclass
        return {field.name: plain(getattr(self, field.name)) for field in fields(own)}


def or_nan(value: float | None) -> float:
    """``value`` as a float; None, JSON's null, is NaN."""
    return math.nan if value is None else float(value)


def arguments(given: dict[str, Any]) -> dict[str, Any]:
    """The arguments of a constructor, from its ``locals()`` before it defines any variable."""
    return {name: value for name, value in given.items() if name not in ("self", "__class__")}


def number(name: str, value: Any) -> float:
    """``value`` as a finite float."""
    if type(value) is float and math.isfinite(value):
        return value  # the fast path: each estimate that a caller reads checks its parameters
    try:
        # float() accepts some of these, but none is one real number.
        if isinstance(value, str | bytes | bytearray | complex) or np.ma.is_masked(value):
            raise TypeError
        if isinstance(value, np.ndarray) and value.ndim:
            raise TypeError
        result = float(value)
    except OverflowError:  # a whole number of hundreds of digits
        raise InvalidParameterError(f"{name} is too large: {shown(value)}") from None
    except Exception:  # an object's own __float__ may raise anything
        raise InvalidParameterError(f"{name} must be a number, not {shown(value)}") from None
    if not math.isfinite(result):
        raise InvalidParameterError(f"{name} must be finite, not {shown(value)}")
    return result


def number_in(name: str, value: Any, low: float, high: float, *, open_low: bool = False) -> float:
    """``value`` as a float in [low, high], or in (low, high] where ``open_low``."""
    result = number(name, value)
    if result < low or result > high or (open_low and result == low):
        bracket = "(" if open_low else "["
        raise InvalidParameterError(
            f"{name} must be in {bracket}{low:g}, {high:g}], not {shown(value)}"
        )
    return result


def check_field(
    owner: Any,
    name: str,
    low: float,
    high: float,
    *,
    open_low: bool = False,
    whole: bool = False,
) -> float:
    """Check a field of a frozen dataclass by :func:`number_in` and store it as a number."""
    value = getattr(owner, name)
    if whole:
        value = whole_in(name, value, int(low), int(high))
    else:
        value = number_in(name, value, low, high, open_low=open_low)
    object.__setattr__(owner, name, value)
    return float(value)


def above_zero(name: str, value: Any) -> float:
    """``value`` as a float in (0, 1e30]."""
    return number_in(name, value, 0.0, 1e30, open_low=True)


def not_below_zero(name: str, value: Any) -> float:
    """``value`` as a float in [0, 1e30]."""
    return number_in(name, value, 0.0, 1e30)


def whole_in(name: str, value: Any, low: int, high: int) -> int:
    """``value`` as a whole number in [low, high]."""
    result = number_in(name, value, low, high)
    if result != int(result):
        raise InvalidParameterError(f"{name} must be a whole number, not {shown(value)}")
    return int(value)  # beyond 2⁵³ a float would round it


def pair_in(name: str, pair: Any, low: float, high: float) -> tuple[float, float]:
    """Two numbers in [low, high]."""
    try:
        first, second = pair
    except Exception:  # an object's own __iter__ may raise anything
        raise InvalidParameterError(
            f"{name} must be (lowest, highest) within [{low:g}, {high:g}], not {shown(pair)}"
        ) from None
    return number_in(name, first, low, high), number_in(name, second, low, high)


def vector_in(name: str, vector: Any, limit: float) -> None:
    """Raise unless ``vector`` is three numbers within ± ``limit``."""
    try:
        three = list(vector)
    except Exception:  # an object's own __iter__ may raise anything
        three = []
    if len(three) != 3 or isinstance(vector, str):
        raise InvalidParameterError(f"{name} must be three numbers, not {shown(vector)}")
    for each in three:
        number_in(name, each, -limit, limit)


def check_choice(name: str, value: Any, allowed: Iterable[str]) -> None:
    """Raise unless ``value`` is one of the allowed words."""
    words = list(allowed)
    if not isinstance(value, str) or value not in words:
        raise InvalidParameterError(f"{name} must be one of {', '.join(words)}, not {shown(value)}")


def instance(name: str, value: Any, kinds: type | tuple[type, ...]) -> None:
    """Raise unless ``value`` is an instance of one of the kinds."""
    if not isinstance(value, kinds):
        allowed = kinds if isinstance(kinds, tuple) else (kinds,)
        text = " or ".join(kind.__name__ for kind in allowed)
        raise InvalidParameterError(f"{name} must be a {text}, not {shown(value)}")


def real_array(name: str, values: ArrayLike) -> Floats:
    """``values`` as a float array of any shape; raises if a mask hides some."""
    reject_masks(name, values)
    array = _floats(values)
    if array is None:
        raise InvalidParameterError(
            f"{name} must be a number, or an array of numbers, not {shown(values)}"
        )
    return array


def _floats(values: Any) -> Floats | None:
    """Values as a float array, copied only if necessary; None if they are not numbers."""
    try:
        array = np.asarray(values)
        return array.astype(np.float64, copy=False) if array.dtype.kind in "fiub" else None
    except Exception:  # an object's own __array__ may raise anything
        return None


def together(**arrays: ArrayLike) -> tuple[Floats, ...]:
    """Each array checked by :func:`real_array`, all broadcast to one shape."""
    usual: Any = [np.array(each) if type(each) is float else each for each in arrays.values()]
    if all(type(each) is np.ndarray and each.dtype == np.float64 for each in usual) and all(
        each.shape == usual[0].shape for each in usual
    ):
        return tuple(usual)
    given = {name: real_array(name, values) for name, values in arrays.items()}
    try:
        return tuple(np.broadcast_arrays(*given.values()))
    except ValueError:
        shapes = " and ".join(str(array.shape) for array in given.values())
        raise InvalidParameterError(
            f"{' and '.join(given)} must have shapes that broadcast together, not {shapes}"
        ) from None


def broadcast_contact(depth: ArrayLike, velocity: ArrayLike = 0.0) -> tuple[Floats, Floats]:
    """Depths in (0, 1e100] m and finite velocities, m/s, broadcast to one shape."""
    if isinstance(depth, float | int) and isinstance(velocity, float | int):  # the usual case
        x = number_in("depth", depth, 0.0, 1e100, open_low=True)
        return np.array(x), np.array(number("velocity", velocity))
    x_all, v_all = together(depth=depth, velocity=velocity)
    all_good("depth", x_all, (x_all > 0.0) & (x_all <= 1e100), "in (0, 1e+100]")
    all_good("velocity", v_all, np.isfinite(v_all), "finite")
    return x_all, v_all


def all_good(name: str, values: Floats, good: NDArray[np.bool_], range_: str) -> None:
    """Raise unless every value is good; the message names the first bad one."""
    if good.all():
        return
    first = int(np.argmin(good.reshape(-1)))
    where = "" if values.ndim == 0 else f" (value {first})"
    bad = values.reshape(-1)[first]
    raise InvalidParameterError(f"{name} must be {range_}, not {bad:g}{where}")


def reject_masks(name: str, values: Any) -> None:
    """Raise if a mask hides some of an array, because NumPy would ignore the mask."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        count = int(np.count_nonzero(np.ma.getmaskarray(values)))
        raise InvalidParameterError(
            f"{name} must not be masked, but {count} values are; fill them, with NaN for invalid "
            "samples"
        )


def signal(name: str, values: ArrayLike) -> Floats:
    """``values`` as a contiguous one-dimensional float array, copied only if necessary."""
    reject_masks(name, values)
    array = _floats(values)
    if array is None:
        raise InvalidParameterError(
            f"{name} must be an array of real numbers, not {type(values).__name__}"
        )
    if array.ndim != 1:
        raise InvalidParameterError(f"{name} must be one-dimensional, not {array.ndim}-dimensional")
    return np.ascontiguousarray(array)


def signals(**arrays: ArrayLike) -> tuple[Floats, ...]:
    """Each array checked by :func:`signal`; all must have the same length."""
    checked = {name: signal(name, values) for name, values in arrays.items()}
    same_length(**{name: array.size for name, array in checked.items()})
    return tuple(checked.values())


def same_length(**sizes: int) -> None:
    """Raise if the arrays differ in length."""
    if len(set(sizes.values())) > 1:
        lengths = ", ".join(f"{name} has {size}" for name, size in sizes.items())
        raise InvalidParameterError(f"arrays must have the same length: {lengths}")


def positive(name: str, values: ArrayLike) -> Floats:
    """``values`` as a float array of any shape, all finite and > 0."""
    array = real_array(name, values)
    all_good(name, array, (array > 0.0) & np.isfinite(array), "finite and > 0")
    return array


def covariance_matrix(name: str, value: ArrayLike, size: int) -> Floats:
    """A positive definite matrix from a scalar, a diagonal or a matrix."""
    given = None if np.ma.is_masked(value) else _floats(value)
    if given is None:
        raise InvalidParameterError(f"{name} must be numbers, not {shown(value)}")
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
        raise InvalidParameterError(
            f"{name} must have variances in [1e-20, 1e+20], not {shown(value)}"
        )
    deviations = np.sqrt(variances)
    # Ten thousand times the rounding error of the eigenvalues of a unit diagonal.
    if np.linalg.eigvalsh(matrix / np.outer(deviations, deviations)).min() < 1e-10:
        raise InvalidParameterError(f"{name} must be positive definite, not {shown(value)}")
    return np.ascontiguousarray(matrix)
