"""What judges are made of: conditions on quantities.

A judge is an expression: ``judge(ratio("scatter α = 0.1", "scatter α = 5"), above(3.0))``.
"""

import math
import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

from palpate.paper.quantities import (
    Numbers,
    Of,
    Quantity,
    beginning_with,
    quantities,
    quantity,
    said,
)


@dataclass(frozen=True, slots=True)
class Condition:
    """What a quantity has to keep to.

    Parameters
    ----------
    kept : callable
        Whether a value does, by the values of the others.
    others : tuple of Quantity
        What it is held against.
    of : Quantity, optional
        What has to keep to it; ours unless given.
    """

    kept: Callable[..., bool]
    others: tuple[Quantity, ...] = ()
    of: Quantity | None = None

    def values(self, numbers: Numbers) -> list[float]:
        """Of all that it compares."""
        first = () if self.of is None else (self.of,)
        return [each.of(numbers) for each in (*first, *self.others)]


@dataclass(frozen=True, slots=True)
class Finding:
    """What one seed says of a claim.

    Parameters
    ----------
    holds : bool or None
        None: it cannot be checked.
    ours : float or None
        The number measured, in the claim's unit; None where nothing was, or for ever was waited.
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
        compared = [each.values(numbers) for each in self.conditions]
        known = not any(math.isnan(each) for values in compared for each in values)
        held = [each.kept(*v) for each, v in zip(self.conditions, compared, strict=True)]
        finite = value is not None and math.isfinite(value)
        return Finding(all(held) if held and known else None, value if finite else None)

    def words(self, every: Sequence[Numbers]) -> str:
        """Say every number that was used over the seeds, but what stands in the column before."""
        used = [*([] if self.ours is None else self.ours.parts), *self.beside]
        for each in self.conditions:
            used += [*each.others, *([] if each.of in (None, self.ours) else [each.of])]
        ours = self.ours.name if self.ours else ""
        leaves = (leaf for each in used for leaf in each.leaves() if leaf.name != ours)
        words = "; ".join(dict.fromkeys(leaf.seen(every) for leaf in leaves))
        return f"{words}{'. ' if words else ''}{self._there(every)}" if self.elsewhere else words

    def _there(self, every: Sequence[Numbers]) -> str:
        """Say what the second material has to say."""
        judge = replace(self, elsewhere="")
        numbers = [beginning_with(self.elsewhere, each) for each in every]
        findings = [judge(each) for each in numbers]
        held = sum(finding.holds is True for finding in findings)
        ours = said(math.inf if each.ours is None else each.ours for each in findings)
        verdict = f"holds in {held} of {len(every)} seeds" if held else "does not hold"
        words = f"On the {self.elsewhere} it {'holds' if held == len(every) else verdict} ({ours})"
        return f"{words}: {more}" if (more := judge.words(numbers)) else words


def judge(
    ours: Of, *kept: Condition, beside: str | Iterable[Of] = (), elsewhere: str = ""
) -> Judge:
    """Return a judge.

    Parameters
    ----------
    ours : str or Quantity
        The number that the report puts beside the paper's.
    *kept : Condition
        All of which have to be kept; without any the claim cannot be checked.
    beside : str or iterable
        Quantities said beside it.
    elsewhere : str
        How the numbers of a second material begin, of which it is said whether they agree.
    """
    measured = quantity(ours)
    conditions = tuple(each if each.of else replace(each, of=measured) for each in kept)
    others = quantities(beside) if isinstance(beside, str) else quantities(*beside)
    return Judge(measured, conditions, others, elsewhere)


def unchecked() -> Judge:
    """Return a judge of what cannot be checked and of which nothing is measured."""
    return Judge()


def that(of: Of, kept: Condition) -> Condition:
    """Return the condition that another quantity than ours keeps to one."""
    return replace(kept, of=quantity(of))


def compared(by: Callable[[float, float], bool], *others: Of) -> Condition:
    """Compares so with all of these."""
    return Condition(
        lambda value, *rest: all(by(value, each) for each in rest), quantities(*others)
    )


above, below = partial(compared, operator.gt), partial(compared, operator.lt)
at_least, at_most = partial(compared, operator.ge), partial(compared, operator.le)


def between(low: float, high: float) -> Condition:
    """From the one to the other, both of them too."""
    return Condition(lambda value: low <= value <= high)


def about(claimed: float) -> Condition:
    """Read "approximately": within a factor of two either way."""
    return between(claimed / 2.0, 2.0 * claimed)


def finite() -> Condition:
    """Happens at all."""
    return Condition(math.isfinite)


def never() -> Condition:
    """Does not happen."""
    return Condition(math.isinf)


def increasing(*of: Of) -> Condition:
    """Each quantity is larger than the one before."""
    first, *others = quantities(*of)
    return Condition(lambda *values: all(a < b for a, b in pairwise(values)), tuple(others), first)
