"""Vectors among the channels of a recording, by the names of their components."""

import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

_INDEX = re.compile(r"^(.*)\[(\d+)\]$")
_LETTERS = ("xyzw", "xyz")
_DIGITS = ("0123", "012", "1234", "123")
# Arrays that hold two: force and torque; position and quaternion.
_PAIRED = {"012345": (3, 6), "123456": (3, 6), "0123456": (3, 7), "1234567": (3, 7)}


@dataclass(frozen=True, slots=True)
class Vector:
    """Channels that are the components of one vector.

    Attributes
    ----------
    stem : str
        What their names share: ``/ft.wrench.force`` of ``/ft.wrench.force.x``, ``f*_N`` of
        ``fx_N``.
    components : tuple of str
        The channels, in the order x, y, z (w), or as they are numbered.
    second : bool
        It follows another one in an array of six or seven: a torque, or a quaternion.
    """

    stem: str
    components: tuple[str, ...]
    second: bool = False

    def __len__(self) -> int:
        return len(self.components)


def vectors_of(names: Iterable[str]) -> list[Vector]:
    """Find vectors of three or four components, in the order in which they are first named.

    ``force.x``, ``force.y``, ``force.z``; ``pos[0]``, ``pos[1]``, ``pos[2]``; ``fx_N``, ``fy_N``,
    ``fz_N``; ``q0`` to ``q3``, ``F1`` to ``F3``. With a ``.w`` it is a quaternion of four; six or
    seven that are numbered are two vectors.
    """
    families: dict[str, dict[str, str]] = defaultdict(dict)
    for name in names:
        for stem, place in _places(name):
            families[stem].setdefault(place, name)
    found: list[Vector] = []
    taken: set[str] = set()
    for stem, places in families.items():
        for vector in _vectors(stem, places):
            if taken.isdisjoint(vector.components):
                found.append(vector)
                taken.update(vector.components)
    return found


def _places(name: str) -> Iterable[tuple[str, str]]:
    """Each way in which a name could be a component: what it shares with the others, and which."""
    if (indexed := _INDEX.match(name)) is not None:
        yield indexed[1], indexed[2]
        return
    stem, dot, last = name.rpartition(".")
    if dot and last.lower() in ("x", "y", "z", "w"):
        yield stem, last.lower()
        return
    for k, sign in enumerate(name):
        if sign.lower() in "wxyz" or sign.isdigit():
            yield f"{name[:k]}*{name[k + 1 :]}", sign.lower()


def _vectors(stem: str, places: dict[str, str]) -> Iterable[Vector]:
    for order in _LETTERS:
        if all(place in places for place in order):
            yield Vector(stem, tuple(places[place] for place in order))
            return
    # As numbers they are all that there is: of ten numbered columns three are no vector.
    for order in (*_DIGITS, *_PAIRED):
        if sorted(places) == list(order):
            components = tuple(places[place] for place in order)
            first, last = _PAIRED.get(order, (len(order), 0))
            yield Vector(stem, components[:first])
            if last:
                yield Vector(stem, components[first:last], second=True)
            return
