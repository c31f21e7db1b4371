"""When a claim holds: conditions on quantities, which are made of an outcome's numbers.

A judge is an expression: ``judge(number("scatter α = 0.1") / "scatter α = 5" > 3.0)``.

A name means every number that it begins, word by word: "scatter α = 5" is the largest of "scatter
α = 5 K [%]", "scatter α = 5 B [%]" and "scatter α = 5 n [%]", "scatter α = 5 K|B" that of the first
two. Names that differ in a word or two are written as one: "time α = {5|6}" is "time α = 5" and
"time α = 6". A time that is NaN never came, and counts as infinite; any other NaN is not known.
"""

import math
import operator
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

Numbers = Mapping[str, float]
_TIMES = ("s", "ms")


@dataclass(frozen=True, slots=True)
class Quantity:
    """What ``of`` makes of an outcome's numbers, which have the ``name``, or of ``parts``.

    Of several numbers it is the largest, or ``which`` says.
    """

    of: Callable[[Numbers], float]
    name: str = ""
    parts: tuple["Quantity", ...] = ()
    which: str = ""

    def leaves(self) -> list["Quantity"]:
        """Those parts that have a name."""
        own = [self] if self.name else []
        return own + [leaf for part in self.parts for leaf in part.leaves()]

    def seen(self, every: Sequence[Numbers]) -> str:
        """Its name and its value over the seeds, with the unit of the numbers that it is of."""
        unit = unit_of(next(iter(named(self.name, every[0]))))
        words = said([self.of(numbers) for numbers in every], unit)
        return f"{self.which}{self.name.replace('|', ' or ')}: {words}"

    def __truediv__(self, other: "Of") -> "Quantity":
        return _computed(lambda v: v[0] / v[1] if v[1] else math.inf, (self, other))

    def __mul__(self, factor: float) -> "Quantity":
        return _computed(math.prod, (factor, self))

    def __lt__(self, other: "Of") -> "Condition":
        return _compared(operator.lt, self, other)

    def __le__(self, other: "Of") -> "Condition":
        return _compared(operator.le, self, other)

    def __gt__(self, other: "Of") -> "Condition":
        return _compared(operator.gt, self, other)

    def __ge__(self, other: "Of") -> "Condition":
        return _compared(operator.ge, self, other)


Of = str | float | Quantity
#: The time of what never happens.
NEVER = math.inf


def quantities(*of: Of) -> tuple[Quantity, ...]:
    """Return the quantities that names, or plain numbers, stand for."""
    every = (_expanded(each) if isinstance(each, str) else [each] for each in of)
    return tuple(number(one) for names in every for one in names)


def _expanded(names: str) -> list[str]:
    if "{" not in names:
        return [names]
    head, _, rest = names.partition("{")
    words, _, tail = rest.partition("}")
    return [head + word + end for word in words.split("|") for end in _expanded(tail)]


def number(of: Of) -> Quantity:
    """Return the quantity that one name, or a plain number, stands for."""
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
        key: math.inf if math.isnan(value) and unit_of(key) in _TIMES else value
        for key, value in numbers.items()
        if key in names or key.startswith(beginnings)
    }
    if not found:
        raise KeyError(f"no number begins with {name!r}")
    known = not any(map(math.isnan, found.values()))
    return found if known else dict.fromkeys(found, math.nan)


def largest_of(name: str, numbers: Numbers) -> float:
    """Return the largest of the numbers that a name begins."""
    return max(named(name, numbers).values())


def unit_of(key: str) -> str:
    """Return what stands in brackets at the end of a number's name."""
    return key.partition(" [")[2].removesuffix("]")


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


def said(values: Iterable[float], unit: str = "") -> str:
    """Median of some values with their unit, and the range in brackets."""
    known = sorted(values)
    middle, low, high = map(readable, (statistics.median(known), known[0], known[-1]))
    words = f"{middle} {unit}".rstrip() if math.isfinite(statistics.median(known)) else middle
    return words if low == high else f"{words} ({low} to {high})"


@dataclass(frozen=True, slots=True)
class Condition:
    """Whether a quantity keeps to what ``kept`` says of its value and those of ``others``."""

    of: Quantity
    kept: Callable[..., bool]
    others: tuple[Quantity, ...] = ()


@dataclass(frozen=True, slots=True)
class Finding:
    """What one seed says of a claim.

    ``holds`` is None where it cannot be checked; ``ours`` is the number measured, in the claim's
    unit, None where nothing was, or for ever was waited.
    """

    holds: bool | None
    ours: float | None = None


@dataclass(frozen=True, slots=True)
class Judge:
    """Whether a claim holds, by an outcome's numbers; see :func:`judge`."""

    ours: Quantity | None = None
    conditions: tuple[Condition, ...] = ()
    beside: tuple[Quantity, ...] = ()
    elsewhere: str = ""

    def __call__(self, numbers: Numbers) -> Finding:
        """Hold the numbers of one seed against the conditions."""
        value = None if self.ours is None else self.ours.of(numbers)
        ours = None if value is None or not math.isfinite(value) else value
        compared = [[q.of(numbers) for q in (each.of, *each.others)] for each in self.conditions]
        if not compared or any(math.isnan(each) for values in compared for each in values):
            return Finding(None, ours)
        pairs = zip(self.conditions, compared, strict=True)
        return Finding(all(each.kept(*values) for each, values in pairs), ours)

    def words(self, every: Sequence[Numbers]) -> str:
        """Say every number that was used over the seeds, but what stands in the column before."""
        used = [*([] if self.ours is None else self.ours.parts), *self.beside]
        for each in self.conditions:
            used += [*each.others, *([] if each.of is self.ours else [each.of])]
        ours = self.ours.name if self.ours else ""
        leaves = (leaf for each in used for leaf in each.leaves() if leaf.name != ours)
        words = "; ".join(dict.fromkeys(leaf.seen(every) for leaf in leaves))
        return f"{words}{'. ' if words else ''}{self._there(every)}" if self.elsewhere else words

    def _there(self, every: Sequence[Numbers]) -> str:
        """Say what the second material has to say, whose numbers begin with ``elsewhere``."""
        judge, prefix = replace(self, elsewhere=""), f"{self.elsewhere} "
        numbers = [
            {k.removeprefix(prefix): v for k, v in each.items() if k.startswith(prefix)}
            for each in every
        ]
        findings = [judge(each) for each in numbers]
        held = sum(finding.holds is True for finding in findings)
        ours = said(math.inf if each.ours is None else each.ours for each in findings)
        verdict = f"holds in {held} of {len(every)} seeds" if held else "does not hold"
        words = f"On the {self.elsewhere} it {'holds' if held == len(every) else verdict} ({ours})"
        return f"{words}: {more}" if (more := judge.words(numbers)) else words


def judge(
    ours: Of | Condition | None = None,
    *kept: Condition,
    beside: str | Iterable[Of] = (),
    elsewhere: str = "",
) -> Judge:
    """Return a judge: of our number, or the condition on it, and of what else has to be kept.

    Without a number nothing is measured, without a condition the claim cannot be checked. What is
    ``beside`` is printed too; ``elsewhere`` begins the numbers of a second material, of which the
    words say whether they agree.
    """
    others = quantities(beside) if isinstance(beside, str) else quantities(*beside)
    if isinstance(ours, Condition):
        return Judge(ours.of, (ours, *kept), others, elsewhere)
    return Judge(None if ours is None else number(ours), kept, others, elsewhere)


def _compared(by: Callable[[float, float], bool], of: Quantity, other: Of) -> Condition:
    every = quantities(other)
    return Condition(of, lambda value, *rest: all(by(value, each) for each in rest), every)


def between(of: Of, low: float, high: float) -> Condition:
    """From the one to the other, both of them too."""
    return Condition(number(of), lambda value: low <= value <= high)


def about(of: Of, claimed: float) -> Condition:
    """Read "approximately": within a factor of two either way."""
    return between(of, claimed / 2.0, 2.0 * claimed)


def increasing(*of: Of) -> Condition:
    """Each quantity is larger than the one before."""
    first, *others = quantities(*of)
    return Condition(first, lambda *v: all(a < b for a, b in pairwise(v)), tuple(others))
