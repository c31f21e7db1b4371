"""What follows the scheme of a wire's address: ``/pose,/wrench?domain=3&tolerance=0.002``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import parse_qsl

from palpate.errors import InvalidParameterError
from palpate.validation import number_in, shown, whole_in


@dataclass(frozen=True, slots=True)
class WireAddress:
    """A wire's address, taken apart.

    Attributes
    ----------
    scheme : str
        For messages: ``"dds"``.
    target : str
        What stands before the question mark.
    options : mapping
        What stands after it, by name.
    """

    scheme: str
    target: str
    options: Mapping[str, str]

    def text(self, name: str, default: str) -> str:
        """Return an option as it was written."""
        return self.options.get(name, default)

    def one_of(self, name: str, choices: Sequence[str]) -> str:
        """Return an option that has a few possible values, of which the first is the default."""
        value = self.options.get(name, choices[0])
        if value not in choices:
            raise InvalidParameterError(
                f"{self._words(name)} must be one of {', '.join(choices)}, not {shown(value)}"
            )
        return value

    def number(self, name: str, default: float, low: float, high: float) -> float:
        """Return an option that is a number in [low, high]."""
        return number_in(self._words(name), self._numeric(name, default), low, high)

    def whole(self, name: str, default: int, low: int, high: int) -> int:
        """Return an option that is a whole number in [low, high]."""
        return whole_in(self._words(name), self._numeric(name, default), low, high)

    def _numeric(self, name: str, default: float) -> float:
        text = self.options.get(name)
        if text is None:
            return default
        try:
            return int(text) if text.isdecimal() else float(text)
        except ValueError:
            raise InvalidParameterError(
                f"{self._words(name)} must be a number, not {shown(text)}"
            ) from None

    def _words(self, name: str) -> str:
        return f"{self.scheme}: {name}"


def parsed(scheme: str, address: str, allowed: Sequence[str]) -> WireAddress:
    """Take an address apart, without its scheme.

    Raises
    ------
    InvalidParameterError
        It has an option that this wire does not know, or the same one twice.
    """
    target, _, query = address.partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    options = dict(pairs)
    for name in options:
        if name not in allowed:
            raise InvalidParameterError(
                f"{scheme}: no option {shown(name)}; there are {', '.join(sorted(allowed))}"
            )
    if len(options) != len(pairs):
        raise InvalidParameterError(f"{scheme}: an option is given twice: {shown(query)}")
    return WireAddress(scheme, target, options)


def topics_of(address: WireAddress, most: int) -> tuple[str, ...]:
    """Return the names of the topics of an address of ROS, each with its slash.

    Raises
    ------
    InvalidParameterError
        There is none, there are more than ``most``, or one is no name of a topic.
    """
    names = tuple(address.target.split(",")) if address.target else ()
    if not 1 <= len(names) <= most or len(set(names)) != len(names):
        form = "/pose,/wrench: the position's topic and the force's, or one that has both"
        raise InvalidParameterError(
            f"{address.scheme}: topics must be such as "
            f"{form if most == 2 else '/palpate, one name'}; not {shown(address.target)}"
        )
    for name in names:
        parts = name.removeprefix("/").split("/")
        # ROS's names have letters, digits and underscores; what else there is would be a pattern.
        if not all(p.replace("_", "a").isalnum() and p.isascii() and not p[0].isdigit()
                   for p in parts):  # fmt: skip
            raise InvalidParameterError(
                f"{address.scheme}: {shown(name)} is no name of a topic, such as /robot/pose"
            )
    return tuple(f"/{name.removeprefix('/')}" for name in names)
