"""Quantities made of an outcome's numbers, and how they are said.

A name means every number that it begins, word by word: "scatter α = 5" is the largest of "scatter
α = 5 K [%]", "scatter α = 5 B [%]" and "scatter α = 5 n [%]", "scatter α = 5 K|B" that of the first
two. Names that differ in a word or two are written as one: "time α = {5|6}" is "time α = 5" and
"time α = 6". A time that is NaN never came, and counts as infinite; any other NaN is not known.
"""

import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

Numbers = Mapping[str, float]
_TIMES = ("s", "ms")


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number made of an outcome's numbers.

    Parameters
    ----------
    of : callable
        Gives it.
    name : str
        Of the numbers, which then are said; empty for what is computed of ``parts``, each of
        which is said.
    parts : tuple of Quantity
        What it is computed of.
    which : str
        Of several numbers of the name; the largest unless said.
    """

    of: Callable[[Numbers], float]
    name: str = ""
    parts: tuple["Quantity", ...] = ()
    which: str = ""

    def leaves(self) -> Iterator["Quantity"]:
        """What has a name."""
        if self.name:
            yield self
        for part in self.parts:
            yield from part.leaves()

    def seen(self, every: Sequence[Numbers]) -> str:
        """Its name and its value over the seeds, with the unit of the numbers that it is of."""
        unit = _unit(next(iter(named(self.name, every[0]))))
        words = said([self.of(numbers) for numbers in every], unit)
        return f"{self.which}{self.name.replace('|', ' or ')}: {words}"


Of = str | float | Quantity


def quantities(*of: Of) -> tuple[Quantity, ...]:
    """Return the quantities that names, or plain numbers, stand for."""
    every = (_expanded(each) if isinstance(each, str) else [each] for each in of)
    return tuple(quantity(one) for names in every for one in names)


def _expanded(names: str) -> list[str]:
    if "{" not in names:
        return [names]
    head, _, rest = names.partition("{")
    words, _, tail = rest.partition("}")
    return [head + word + end for word in words.split("|") for end in _expanded(tail)]


def quantity(of: Of) -> Quantity:
    """Return the quantity that a name, or a plain number, stands for."""
    if isinstance(of, Quantity):
        return of
    return _chosen(max, of) if isinstance(of, str) else Quantity(lambda _: of)


def largest(*of: Of) -> Quantity:
    """Return the largest of some quantities."""
    return _computed(max, of)


def least(*of: Of) -> Quantity:
    """Return the least of some quantities."""
    if len(of) == 1 and isinstance(name := of[0], str) and "{" not in name:
        return _chosen(min, name, "least ")
    return _computed(min, of)


def ratio(one: Of, other: Of) -> Quantity:
    """Return one quantity over another."""
    return _computed(lambda values: values[0] / values[1] if values[1] else math.inf, (one, other))


def times(factor: float, of: Of) -> Quantity:
    """Return a multiple of a quantity."""
    return _computed(math.prod, (factor, of))


def farthest_from(middle: float, name: str) -> Quantity:
    """Return that of several numbers which is farthest from one."""
    return _chosen(lambda values: max(values, key=lambda value: abs(value - middle)), name)


def _chosen(by: Callable[[Iterable[float]], float], name: str, which: str = "") -> Quantity:
    return Quantity(lambda numbers: by(named(name, numbers).values()), name, which=which)


def _computed(by: Callable[[list[float]], float], of: Iterable[Of]) -> Quantity:
    parts = quantities(*of)

    def value(numbers: Numbers) -> float:
        values = [part.of(numbers) for part in parts]
        return math.nan if any(map(math.isnan, values)) else by(values)

    return parts[0] if len(parts) == 1 else Quantity(value, parts=parts)


def named(name: str, numbers: Numbers) -> dict[str, float]:
    """Return the numbers that a name begins, or whose name it is; none of them if one is NaN."""
    head, _, last = name.rpartition(" ")
    names = {f"{head} {each}".strip() for each in last.split("|")}
    beginnings = tuple(f"{each} " for each in names)
    found = {
        key: math.inf if math.isnan(value) and _unit(key) in _TIMES else value
        for key, value in numbers.items()
        if key in names or key.startswith(beginnings)
    }
    if not found:
        raise KeyError(f"no number begins with {name!r}")
    known = not any(map(math.isnan, found.values()))
    return found if known else dict.fromkeys(found, math.nan)


def _unit(key: str) -> str:
    return key.partition(" [")[2].removesuffix("]")


def beginning_with(words: str, numbers: Numbers) -> dict[str, float]:
    """Return the numbers whose names begin with these words, under what follows."""
    prefix = f"{words} "
    return {k.removeprefix(prefix): v for k, v in numbers.items() if k.startswith(prefix)}


def readable(value: float) -> str:
    """Three significant digits, and all digits of a whole thousand; infinite is never."""
    size = abs(value)
    if not math.isfinite(value):
        return "not known" if math.isnan(value) else "never"
    if size == 0.0:
        return "0"
    if not 1e-3 <= size < 1e6:
        return f"{value:.2e}".replace("-", "−")
    digits = max(0, 2 - math.floor(math.log10(size)))
    return f"{value:.{digits}f}".replace("-", "−")


def over_seeds(every: Iterable[Numbers], *names: str) -> str:
    """Median over the seeds of one number, or of several alike, and the range in brackets."""
    return said([each.of(numbers) for numbers in every for each in quantities(*names)])


def said(values: Iterable[float], unit: str = "") -> str:
    """Median of some values with their unit, and the range in brackets."""
    known = sorted(values)
    middle, low, high = map(readable, (statistics.median(known), known[0], known[-1]))
    words = f"{middle} {unit}".rstrip() if math.isfinite(statistics.median(known)) else middle
    return words if low == high else f"{words} ({low} to {high})"
