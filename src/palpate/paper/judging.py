"""What judges are made of: quantities from an outcome's numbers, bounds on them, and words.

A judge is an expression: ``judge(ratio("scatter α = 0.1", "scatter α = 5"), above(3.0))``. A name
means every number that it begins, word by word: "scatter α = 5" is the largest of "scatter α = 5 K
[%]", "scatter α = 5 B [%]" and "scatter α = 5 n [%]", "scatter α = 5 K|B" that of the first two.
What happened never, NaN, counts as infinite.
"""

import itertools
import math
import operator
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

Numbers = Mapping[str, float]


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

    def seen(self, numbers: Numbers) -> str:
        """Its name and value, with the unit of the numbers that it is of."""
        value = self.of(numbers)
        key = next(iter(named(self.name, numbers)))
        unit = key.partition(" [")[2].removesuffix("]") if math.isfinite(value) else ""
        return f"{self.which}{self.name.replace('|', ' or ')}: {readable(value)} {unit}".rstrip()


Of = str | float | Quantity


@dataclass(frozen=True, slots=True)
class Bound:
    """What a quantity has to keep to.

    Parameters
    ----------
    kept : callable
        Whether a value does, by the numbers.
    others : tuple of Quantity
        What it is held against.
    """

    kept: Callable[[float, Numbers], bool]
    others: tuple[Quantity, ...] = ()


@dataclass(frozen=True, slots=True)
class Condition:
    """A quantity beside ours that has to keep to something too."""

    quantity: Quantity
    bound: Bound


@dataclass(frozen=True, slots=True)
class Finding:
    """What one seed says of a claim.

    Parameters
    ----------
    holds : bool or None
        None: it cannot be checked.
    ours : float or None
        The number measured, in the claim's unit; None where nothing was, or for ever was waited.
    words : str
        The other numbers that the verdict was made from.
    """

    holds: bool | None
    ours: float | None = None
    words: str = ""


@dataclass(frozen=True, slots=True)
class Judge:
    """Whether a claim holds, by an outcome's numbers; see :func:`judge`."""

    ours: Quantity | None
    conditions: tuple[Condition, ...]
    beside: tuple[Quantity, ...] = ()
    elsewhere: str = ""

    def __call__(self, numbers: Numbers) -> Finding:
        """Hold the numbers of one seed against the conditions."""
        value = None if self.ours is None else self.ours.of(numbers)
        held = [each.bound.kept(each.quantity.of(numbers), numbers) for each in self.conditions]
        holds = all(held) if held else None
        words = self._seen(numbers)
        if self.elsewhere:
            there = replace(self, elsewhere="")(beginning_with(self.elsewhere, numbers))
            same = "holds" if there.holds else "does not hold"
            number = "" if there.ours is None else f" ({readable(there.ours)})"
            second = f"On the {self.elsewhere} it {same}{number}"
            second += f": {there.words}" if there.words else ""
            words = f"{words}. {second}" if words else second
        known = value is not None and math.isfinite(value)
        return Finding(holds, value if known else None, words)

    def _seen(self, numbers: Numbers) -> str:
        used = [*([] if self.ours is None else self.ours.parts), *self.beside]
        for each in self.conditions:
            used += [*each.bound.others, *([] if each.quantity == self.ours else [each.quantity])]
        leaves = [leaf for quantity in used for leaf in quantity.leaves()]
        if self.ours is not None and self.ours.name:  # it stands in the column before
            leaves = [leaf for leaf in leaves if leaf.name != self.ours.name]
        return "; ".join(dict.fromkeys(leaf.seen(numbers) for leaf in leaves))


def judge(
    ours: Of, *kept: Bound | Condition, beside: Iterable[Of] = (), elsewhere: str = ""
) -> Judge:
    """Return a judge.

    Parameters
    ----------
    ours : str or Quantity
        The number that the report puts beside the paper's.
    *kept : Bound or Condition
        All of which have to be kept, bounds by ``ours``; without any the claim cannot be checked.
    beside : iterable
        Quantities said beside it.
    elsewhere : str
        How the numbers of a second material begin, of which it is said whether they agree.
    """
    quantity = _quantity(ours)
    conditions = (Condition(quantity, k) if isinstance(k, Bound) else k for k in kept)
    return Judge(quantity, tuple(conditions), tuple(map(_quantity, beside)), elsewhere)


def unchecked(*beside: Of) -> Judge:
    """Return a judge of what cannot be checked and of which nothing is measured."""
    return Judge(None, (), tuple(map(_quantity, beside)))


def that(quantity: Of, bound: Bound) -> Condition:
    """Return the condition that a quantity keeps to a bound."""
    return Condition(_quantity(quantity), bound)


def largest(*of: Of) -> Quantity:
    """Return the largest of some quantities."""
    return _computed(max, of)


def least(*of: Of) -> Quantity:
    """Return the least of some quantities."""
    if len(of) == 1 and isinstance(of[0], str):
        name = of[0]
        return Quantity(lambda numbers: min(named(name, numbers).values()), name, which="least ")
    return _computed(min, of)


def ratio(one: Of, other: Of) -> Quantity:
    """Return one quantity over another."""

    def divided(values: Iterable[float]) -> float:
        a, b = values
        return a / b if b else math.inf

    return _computed(divided, (one, other))


def times(factor: float, of: Of) -> Quantity:
    """Return a multiple of a quantity."""
    quantity = _quantity(of)
    return Quantity(lambda numbers: factor * quantity.of(numbers), parts=(quantity,))


def farthest_from(middle: float, name: str) -> Quantity:
    """Return that of several numbers which is farthest from one."""
    return Quantity(
        lambda numbers: max(named(name, numbers).values(), key=lambda value: abs(value - middle)),
        name,
    )


def above(*others: Of) -> Bound:
    """More than all of these."""
    return _compared(operator.gt, others)


def below(*others: Of) -> Bound:
    """Less than all of these."""
    return _compared(operator.lt, others)


def at_most(*others: Of) -> Bound:
    """Not more than any of these."""
    return _compared(operator.le, others)


def at_least(*others: Of) -> Bound:
    """Not less than any of these."""
    return _compared(operator.ge, others)


def between(low: float, high: float) -> Bound:
    """From the one to the other, both of them too."""
    return Bound(lambda value, _: low <= value <= high)


def about(claimed: float) -> Bound:
    """Read "approximately": within a factor of two either way."""
    return between(claimed / 2.0, 2.0 * claimed)


def finite() -> Bound:
    """Happens at all."""
    return Bound(lambda value, _: math.isfinite(value))


def never() -> Bound:
    """Does not happen."""
    return Bound(lambda value, _: math.isinf(value))


def increasing(*of: Of) -> Condition:
    """Return the condition that each quantity is larger than the one before."""
    quantities = tuple(map(_quantity, of))

    def ordered(numbers: Numbers) -> float:
        values = [quantity.of(numbers) for quantity in quantities]
        return float(all(a < b for a, b in itertools.pairwise(values)))

    return Condition(Quantity(ordered, parts=quantities), Bound(lambda value, _: value == 1.0))


def beginning_with(words: str, numbers: Numbers) -> dict[str, float]:
    """Return the numbers whose names begin with these words, under what follows."""
    prefix = f"{words} "
    return {k.removeprefix(prefix): v for k, v in numbers.items() if k.startswith(prefix)}


def named(name: str, numbers: Numbers) -> dict[str, float]:
    """Return the numbers that a name begins; what happened never as infinite."""
    head, _, last = name.rpartition(" ")
    names = [f"{head} {each}".strip() for each in last.split("|")]
    found = {
        key: math.inf if math.isnan(value) else value
        for key, value in numbers.items()
        if any(key == each or key.startswith(f"{each} ") for each in names)
    }
    if not found:
        raise KeyError(f"no number begins with {name!r}")
    return found


def _quantity(of: Of) -> Quantity:
    if isinstance(of, Quantity):
        return of
    if isinstance(of, str):
        return Quantity(lambda numbers: max(named(of, numbers).values()), of)
    return Quantity(lambda _: of)


def _computed(by: Callable[[Iterable[float]], float], of: Iterable[Of]) -> Quantity:
    parts = tuple(map(_quantity, of))
    if len(parts) == 1:
        return parts[0]
    return Quantity(lambda numbers: by([part.of(numbers) for part in parts]), parts=parts)


def _compared(compare: Callable[[float, float], bool], others: Iterable[Of]) -> Bound:
    quantities = tuple(map(_quantity, others))
    return Bound(
        lambda value, numbers: all(compare(value, each.of(numbers)) for each in quantities),
        quantities,
    )


def readable(value: float) -> str:
    """Three significant digits, and all digits of a whole thousand; infinite and NaN are never."""
    size = abs(value)
    if not math.isfinite(value):
        return "never"
    if size == 0.0:
        return "0"
    if not 1e-3 <= size < 1e6:
        return f"{value:.2e}".replace("-", "−")
    digits = max(0, 2 - math.floor(math.log10(size)))
    return f"{value:.{digits}f}".replace("-", "−")


def over_seeds(every: Iterable[Numbers], *names: str) -> str:
    """Median over the seeds of one number, or of several alike, and the range in brackets."""
    quantities = [_quantity(name) for name in names]
    values = sorted(quantity.of(numbers) for numbers in every for quantity in quantities)
    middle, low, high = map(readable, (statistics.median(values), values[0], values[-1]))
    return middle if low == high else f"{middle} ({low} to {high})"
