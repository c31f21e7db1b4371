"""``@frozen``: a value, whose fields are set once and listed."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar, dataclass_transform, overload

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
