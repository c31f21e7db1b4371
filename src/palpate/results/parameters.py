"""A law's numbers as a reader needs them: those that it has, and what stands in place of others."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from palpate.diagnosis.data import in_words
from palpate.digits import interval, parameter, rounded
from palpate.estimators import ViscoelasticContact
from palpate.force_laws import (
    ForceLaw,
    GeneralisedHuntCrossley,
    PowerLawRelaxation,
    SingleRelaxation,
)

if TYPE_CHECKING:
    from palpate.identification import Identified

NOT_ESTIMATED = "as offered, not estimated"
#: Name of the row of a spectrum's relaxation times.
OFFERED = "relaxation_times"


@dataclass(frozen=True, slots=True)
class Row:
    """A parameter of a law, in words.

    Attributes
    ----------
    index : int
        Where it stands among the law's parameters.
    name, symbol, unit : str
        By the law; the unit as the law's exponents make it.
    words : str
        The number and its standard error, without a unit; or what it is bound to, such as ``n``.
    interval : str
        That of 95 %; a dash of what was not estimated.
    estimated : bool
        Whether it is a number of its own, which was looked for.
    """

    index: int
    name: str
    symbol: str
    unit: str
    words: str
    interval: str
    estimated: bool

    @property
    def with_unit(self) -> str:
        """The words, and the unit."""
        return f"{self.words} {self.unit}".rstrip()

    def __str__(self) -> str:
        return f"{self.symbol} = {self.with_unit}"


def parameter_rows(result: "Identified") -> list[Row]:
    """Return the parameters that the law has, in its order."""
    if isinstance(result.law, GeneralisedHuntCrossley):
        return list(_generalised(result, result.law))
    return [_number(result, k) for k in range(len(result.law.symbols))]


def law_in_words(result: "Identified") -> str:
    """Return the law that was chosen; the kind of law of a method that has but one."""
    if isinstance(result.estimator, ViscoelasticContact):
        return str(result.estimator.verdict().candidate)
    return str(result.law.kind)


def growth_of(law: GeneralisedHuntCrossley) -> str | None:
    """Return how the damper goes with the spring: ``n`` or ``n − 1``; None where by neither."""
    if law.damping_exponent == law.exponent:
        return "n"
    return "n − 1" if law.damping_exponent == law.exponent - 1.0 else None


def _number(result: "Identified", k: int, unit: str | None = None) -> Row:
    law, name = result.law, result.law.names()[k]
    value, error = float(law.parameters[k]), float(result.standard_errors[k])
    fixed = name in result.fixed
    return Row(
        k,
        name,
        law.symbols[k],
        law.units[k] if unit is None else unit,
        parameter(value, error, fixed=fixed),
        "–" if fixed else interval(value, error),
        not fixed,
    )


def _generalised(result: "Identified", law: GeneralisedHuntCrossley) -> Iterator[Row]:
    stiffness, n, damping, p, relaxing, alpha, shortest, longest = range(len(law.symbols))
    estimator, growth = result.estimator, growth_of(law)
    chosen = estimator.verdict().candidate if isinstance(estimator, ViscoelasticContact) else None
    linear = chosen is not None and chosen.linear
    yield _number(result, stiffness, "N/m" if linear else None)
    yield _bound(law, n, "1") if linear else _number(result, n)
    if chosen is None or chosen.damping != "none":
        units = {"n": "N·s/mⁿ⁺¹", "n − 1": "N·s/m" if linear else "N·s/mⁿ"}
        yield _number(result, damping, units.get(growth or ""))
        yield _number(result, p) if growth is None else _bound(law, p, growth)
    if not law.remembers:
        if chosen is not None and chosen.memory != "none":
            yield _bound(law, relaxing, "0, no memory is better")
        return
    yield _number(result, relaxing, "N/m" if linear else None)
    if isinstance(law.relaxation, SingleRelaxation):
        own = _number(result, longest)
        yield Row(longest, "relaxation_time", "τ", own.unit, own.words, own.interval, True)
        return
    if isinstance(law.relaxation, PowerLawRelaxation):
        yield _number(result, alpha)
    ends = " to ".join(_time(each) for each in (law.shortest_time, law.longest_time))
    words = f"{ends} ({NOT_ESTIMATED})"
    yield Row(shortest, OFFERED, "τ", "", words, "–", False)


def _time(seconds: float) -> str:
    """Thousands of seconds are seconds still."""
    return in_words(seconds, "s") if seconds < 1.0 else f"{rounded(seconds, 3)} s"


def _bound(law: ForceLaw, k: int, words: str) -> Row:
    return Row(k, law.names()[k], law.symbols[k], "", words, "–", False)


def correlated(result: "Identified") -> list[tuple[int, str]]:
    """Return index and symbol of the parameters that can correlate: those that were estimated."""
    rows = [row for row in parameter_rows(result) if row.estimated]
    known = np.isfinite(np.diag(result.correlations))
    return [(row.index, row.symbol) for row in rows if known[row.index]]
