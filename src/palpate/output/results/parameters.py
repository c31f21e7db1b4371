"""Parameters of an identified law as rows: names, symbols, units, values, errors."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from palpate.digits import parameter, rounded
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import frozen

if TYPE_CHECKING:
    from palpate.identification.identified import Identified


#: Name of the row of a law's relaxation times.
RELAXATION = "relaxation_times"
_LAWS = {
    "hunt-crossley": "Hunt–Crossley",
    "kelvin-voigt": "Kelvin–Voigt",
    "extended-kelvin-voigt": "extended Kelvin–Voigt",
}


@frozen
class ParameterRow:
    """A parameter of a law."""

    #: Index of the parameter in the law.
    index: int
    name: str
    symbol: str
    #: Unit with the law's exponents.
    unit: str
    #: The value with its standard error, or the parameter that determines it, such as ``n``.
    text: str
    #: Whether it is a free parameter that was estimated.
    estimated: bool = False

    @property
    def with_unit(self) -> str:
        """The text and the unit."""
        return f"{self.text} {self.unit}".rstrip()

    def __str__(self) -> str:
        return f"{self.symbol} = {self.with_unit}"


def parameter_terms(result: "Identified") -> str:
    """Return a line for each parameter: ``K = 2002.0 ± 1.9 N/mⁿ``."""
    return "\n".join(map(str, parameter_rows(result)))


def law_name(result: "Identified") -> str:
    """Return the name of the selected law, or of the only law that the method identifies."""
    verdict = result.estimator.verdict()
    kind = result.law.kind
    return _LAWS.get(kind, kind) if verdict is None else verdict.candidate.title


def parameter_rows(result: "Identified") -> list[ParameterRow]:
    """Return the parameters of the law, in its order."""
    if result.law.relaxes:
        return list(_relaxing_rows(result, result.law))
    return [_number(result, k) for k in range(len(result.law.symbols))]


def _number(result: "Identified", k: int, unit: str | None = None) -> ParameterRow:
    law = result.law
    name = result.law.names()[k]
    fixed = name in result.fixed
    unit = law.units[k] if unit is None else unit
    words = parameter(float(law.parameters[k]), float(result.standard_errors[k]), fixed=fixed)
    return ParameterRow(k, name, law.symbols[k], unit, words, not fixed)


def _relaxing_rows(result: "Identified", law: GeneralisedHuntCrossley) -> Iterator[ParameterRow]:
    stiffness, n, damping, p, relaxing = range(len(law.symbols))
    verdict = result.estimator.verdict()
    growth = _growth(law)
    chosen = None if verdict is None else verdict.candidate
    linear = chosen is not None and chosen.linear
    yield _number(result, stiffness, "N/m" if linear else None)
    yield _bound(law, n, "1") if linear else _number(result, n)
    if chosen is None or chosen.damping != "none":
        units = {"n": "N·s/mⁿ⁺¹", "n − 1": "N·s/m" if linear else "N·s/mⁿ"}
        yield _number(result, damping, units.get(growth or ""))
        yield _number(result, p) if growth is None else _bound(law, p, growth)
    if not law.remembers:
        if chosen is not None and chosen.memory != "none":
            yield _bound(law, relaxing, "0 (no relaxation preferred)")
        return
    yield _number(result, relaxing, "N/m" if linear else None)
    yield ParameterRow(relaxing, RELAXATION, "τ", "", law.describe_relaxation())


def felt_times(law: ForceLaw, frequency: float) -> tuple[float, ...]:
    """Return the shortest and the longest time that a recording shows of a law with memory, s.

    At a frequency ω a material is felt as it is 1/ω after a step.
    """
    if not isinstance(law, GeneralisedHuntCrossley) or not law.remembers:
        return ()
    times, weights = law.branches()
    shortest, longest = times[weights > 0.0][[0, -1]].tolist()
    return (min(shortest, 1.0 / frequency) if frequency > 0.0 else shortest, longest)


def _growth(law: GeneralisedHuntCrossley) -> str | None:
    """Return the damper's exponent in terms of the spring's, ``n`` or ``n − 1``; else None."""
    if law.p == law.n:
        return "n"
    return "n − 1" if law.p == law.n - 1.0 else None


def _bound(law: ForceLaw, k: int, text: str) -> ParameterRow:
    return ParameterRow(k, law.names()[k], law.symbols[k], "", text)


def format_signed(value: float, digits: int) -> str:
    """Format a number with its sign to some significant digits."""
    return f"{'-' if value < 0.0 else '+'}{rounded(abs(value), digits)}"
