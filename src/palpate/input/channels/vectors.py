"""The vectors among the channels of a recording, by their names."""

import re
from collections import defaultdict
from collections.abc import Iterable

from palpate.input.recordings.units import divide_unit, split_name
from palpate.validation import frozen

_INDEX = re.compile(r"^(.*)\[(\d+)\]$")
_LETTERS = ("xyzw", "xyz")
_QUATERNIONS = ("0123", "1234")
# Arrays of two vectors: force and torque, or position and quaternion.
_PAIRED = {"012345": (3, 6), "0123456": (3, 7)}
_ARRAYS = {"012": (3, 3), **_PAIRED}
# A column such as ``position_0``, from an array written as columns.
_FLATTENED = re.compile(r"(.*[^\d\s_.])[_.]?(\d)")
# Numbers in a name with one of these words count objects or repetitions, not axes of a vector.
_COUNTED = ("run", "trial", "test", "cell", "sensor", "marker", "finger", "repeat")
COUNTED = frozenset((*_COUNTED, *(f"{word}s" for word in _COUNTED)))
# ``ft_sensor[0]`` and ``load_cell[0]`` are the axes of one sensor, ``load_cells[0]`` is a sensor.
ONE_OF_MANY = COUNTED - {"cell", "sensor", "marker", "finger"}


@frozen
class Vector:
    """Channels that are the components of one vector.

    Attributes
    ----------
    stem : str
        The common part of their names: ``/ft.wrench.force`` of ``/ft.wrench.force.x``, ``f*_N``
        of ``fx_N``.
    components : tuple of str
        The channels, in the order x, y, z (w) or of their numbers.
    second : bool
        Whether it is the second vector in an array of six or seven: a torque or a quaternion.
    """

    stem: str
    components: tuple[str, ...]
    second: bool = False

    def __len__(self) -> int:
        return len(self.components)


def find_vectors(names: Iterable[str]) -> list[Vector]:
    """Find vectors of three or four components, in order of first appearance.

    ``force.x``, ``force.y``, ``force.z``; ``pos[0]``, ``pos[1]``, ``pos[2]``; ``fx_N``, ``fy_N``,
    ``fz_N``; ``q0`` to ``q3``. A ``.w`` makes it a quaternion; six or seven elements of an array
    are two vectors. Other numbers in names count runs or sensors as often as axes.
    """
    families: dict[str, dict[str, str]] = defaultdict(dict)
    for name in names:
        for stem, place in _places(name):
            families[stem].setdefault(place, name)
    vectors: list[Vector] = []
    components: set[str] = set()
    for stem, places in families.items():
        for vector in _vectors(stem, places):
            if components.isdisjoint(vector.components):
                vectors.append(vector)
                components.update(vector.components)
    return vectors


def find_flattened_arrays(names: Iterable[str]) -> list[Vector]:
    """Find consecutive columns ``name_0``, ``name_1`` … that may be an array written as columns."""
    families: dict[str, list[tuple[int, int, str]]] = defaultdict(list)
    for place, name in enumerate(names):
        bare, _ = divide_unit(name)
        if (parts := _FLATTENED.fullmatch(bare)) and COUNTED.isdisjoint(split_name(bare)):
            families[parts[1]].append((place, int(parts[2]), name))
    arrays: list[Vector] = []
    for stem, columns in families.items():
        places, numbers, components = zip(*columns, strict=True)
        consecutive = places == tuple(range(places[0], places[0] + len(places)))
        order = "".join(map(str, numbers))
        if consecutive and order in _ARRAYS:
            arrays += _divide_array(stem, components, *_ARRAYS[order])
    return arrays


def _places(name: str) -> Iterable[tuple[str, str]]:
    """Each way to read a name as a component: the common part, and the letter or number."""
    if (indexed := _INDEX.match(name)) is not None:
        if split_name(re.split(r"[/.]", indexed[1])[-1])[-1:] not in [[w] for w in ONE_OF_MANY]:
            yield f"{indexed[1]}[]", indexed[2]
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
    # Numbered channels must be complete: three of ten numbered columns are not a vector.
    order = "".join(sorted(places))
    components = tuple(places[place] for place in sorted(places))
    if stem.endswith("[]") and order in _ARRAYS:
        yield from _divide_array(stem.removesuffix("[]"), components, *_ARRAYS[order])
    elif order in _QUATERNIONS:
        yield Vector(stem.removesuffix("[]"), components)


def _divide_array(
    stem: str, components: tuple[str, ...], border: int, size: int
) -> Iterable[Vector]:
    yield Vector(stem, components[:border])
    if size > border:
        yield Vector(stem, components[border:size], second=True)
