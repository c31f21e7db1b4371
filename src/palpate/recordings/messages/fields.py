"""What a message consists of: a tree of numbers, texts, lists and groups."""

from dataclasses import dataclass
from typing import TypeAlias

from palpate.errors import PalpateError

# Lists of more elements than this are no vector, matrix or set of joints, but a scan or an image.
LONGEST_LIST = 64

#: A group of two numbers that is a time, seconds first, and the name by which all formats know it.
TIME = "builtin_interfaces/msg/Time"
DURATION = "builtin_interfaces/msg/Duration"
TRANSFORM = "geometry_msgs/msg/TransformStamped"


class UndecodableError(PalpateError):
    """A message, or a definition of messages, that cannot be understood: the message says why."""


@dataclass(frozen=True, slots=True)
class Number:
    """A number of fixed size; its dtype as NumPy writes it, without the order of bytes: ``f8``."""

    dtype: str

    @property
    def size(self) -> int:
        """How many bytes it takes."""
        return int(self.dtype[1:])


@dataclass(frozen=True, slots=True)
class Text:
    """A string."""


@dataclass(frozen=True, slots=True)
class Many:
    """A list; of a fixed length, unless that is None."""

    element: "Field"
    length: int | None


@dataclass(frozen=True, slots=True)
class Group:
    """A message within a message: names and fields.

    Attributes
    ----------
    smallest : int
        The fewest bytes that it can take, without padding.
    """

    name: str
    fields: tuple[tuple[str, "Field"], ...]
    smallest: int


Field: TypeAlias = Number | Text | Many | Group


def smallest(field: Field) -> int:
    """Return the fewest bytes that a field can take, without padding."""
    if isinstance(field, Number):
        return field.size
    if isinstance(field, Group):
        return field.smallest
    if isinstance(field, Many) and field.length is not None:
        return field.length * smallest(field.element)
    return 4  # the count of a list or a string


def normal_name(type_name: str) -> str:
    """Return the name of a type as ROS 2 writes it: ``geometry_msgs/msg/Wrench``."""
    package, slash, rest = type_name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else type_name


def one_line(text: str) -> str:
    """Return a name from a file so that it can be shown: one line, printable, not endless."""
    shown = "".join(each if each.isprintable() else "?" for each in text[:200])
    return shown if len(text) <= 200 else shown + "…"
