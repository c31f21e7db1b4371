"""The parameters of an identified law as text, and compared with the truth of a recording."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.digits import format_quantity, parameter, rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.recordings.recording import truth_of

if TYPE_CHECKING:
    from palpate.identification.identified import Identified


#: Name of the row of a law's relaxation times.
RELAXATION = "relaxation_times"
_LAWS = {
    "hunt-crossley": "Hunt–Crossley",
    "kelvin-voigt": "Kelvin–Voigt",
    "extended-kelvin-voigt": "extended Kelvin–Voigt",
}


@dataclass(frozen=True, slots=True)
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
    verdict, kind = result.estimator.verdict(), result.law.kind
    return _LAWS.get(kind, kind) if verdict is None else verdict.candidate.title


def parameter_rows(result: "Identified") -> list[ParameterRow]:
    """Return the parameters of the law, in its order."""
    if result.law.relaxes:
        return list(_generalised(result, result.law))
    return [_number(result, k) for k in range(len(result.law.symbols))]


def _number(result: "Identified", k: int, unit: str | None = None) -> ParameterRow:
    law, name = result.law, result.law.names()[k]
    fixed, unit = name in result.fixed, law.units[k] if unit is None else unit
    words = parameter(float(law.parameters[k]), float(result.standard_errors[k]), fixed=fixed)
    return ParameterRow(k, name, law.symbols[k], unit, words, not fixed)


def _generalised(result: "Identified", law: GeneralisedHuntCrossley) -> Iterator[ParameterRow]:
    stiffness, n, damping, p, relaxing = range(len(law.symbols))
    verdict, growth = result.estimator.verdict(), _growth(law)
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
    yield ParameterRow(relaxing, RELAXATION, "τ", "", describe_relaxation(law))


def describe_relaxation(law: GeneralisedHuntCrossley) -> str:
    """Return the relaxation time of a law with memory, or the range of its relaxation times."""
    assert law.relaxation is not None
    if (time := law.relaxation_time) is not None:
        return with_error(time, time * law.relaxation.resolution, unit="s")
    return f"several relaxation times, {relaxation_range(law)}"


def relaxation_range(law: GeneralisedHuntCrossley) -> str:
    """Return the shortest and the longest relaxation time of a law: *32 ms to 2.05 s*."""
    times, weights = law.branches()
    present = times[weights > 0.0]
    return " to ".join(_time(float(each)) for each in present[[0, -1]])


def _growth(law: GeneralisedHuntCrossley) -> str | None:
    """Return the damper's exponent in terms of the spring's, ``n`` or ``n − 1``; else None."""
    if law.damping_exponent == law.exponent:
        return "n"
    return "n − 1" if law.damping_exponent == law.exponent - 1.0 else None


def _time(seconds: float) -> str:
    """Format a time; a thousand seconds or more keep the unit s."""
    return format_quantity(seconds, "s") if seconds < 1.0 else f"{rounded(seconds, 3)} s"


def _bound(law: ForceLaw, k: int, words: str) -> ParameterRow:
    return ParameterRow(k, law.names()[k], law.symbols[k], "", words)


# The truth stated in a recording, compared with the identified law.

# Tolerance of the logarithms of the first and the last time: a change of a time by 5 % changes M by
# less than 1 %.
_SAME_TIME = 0.05


def stated_truth(result: "Identified", depth: float) -> dict[str, float]:
    """Return the stated truth of the numbers at a depth, SI, by name; empty without one.

    If one of the two laws relaxes: K′ and B′ at the motion's frequency, and no force.
    """
    truth = truth_of(result.contact.provenance)
    if truth is None or not math.isfinite(depth):
        return {}
    if not (result.law.remembers or truth.remembers):
        return dict(zip(("force", "stiffness", "damping"), truth.at_rest(depth), strict=True))
    omega = result.frequency
    try:
        real = GeneralisedHuntCrossley.of(truth).dynamic_stiffness(depth, omega)
    except InvalidParameterError:  # a probe that never moved, or a truth of another form
        return {}
    return {"stiffness": float(real.real), "damping": float(real.imag) / omega}


def comparable(law: Any, truth: Any) -> set[str]:
    """Return the names of the law's parameters that are comparable to the truth's.

    Laws of different kinds share none. For two generalised laws they are comparable if both relax
    or neither, and if both have one relaxation time or the same kind of spectrum over the same
    times. B is comparable only with equal p − n, because its unit is N·s/mᵖ⁺¹.
    """
    names = set(law.names())
    if law.kind != truth.kind:
        return set()
    if not (law.relaxes and truth.relaxes):
        return names
    if not _same_memory(law, truth):
        return set()
    pair = (law, truth)
    dampers = {round(each.damping_exponent - each.exponent, 6) for each in pair if each.damping}
    return names if len(dampers) < 2 else names - {"damping", "damping_exponent"}


def _same_memory(law: GeneralisedHuntCrossley, truth: GeneralisedHuntCrossley) -> bool:
    if not (law.remembers and truth.remembers):
        return law.remembers == truth.remembers
    if law.relaxation_time is not None and truth.relaxation_time is not None:
        return True
    ends = [np.log(each.branches()[0][[0, -1]]) for each in (law, truth)]
    same_kind = type(law.relaxation) is type(truth.relaxation)
    return same_kind and bool(np.ptp(ends, axis=0).max() < _SAME_TIME)


def against_truth(value: float, truth: float, error: float, unit: str = "") -> str:
    """Return the truth, and the difference of a number from it in standard errors."""
    words = f"{rounded(truth, 5)} {unit}".rstrip()
    if not (error > 0.0 and math.isfinite(value) and math.isfinite(error)):
        return words
    return f"{words}, {format_signed((value - truth) / error, 2)} σ"


def truths(result: "Identified") -> list[str]:
    """Return the truth of each parameter, or empty texts if it is a law of another kind."""
    law, truth, rows = result.law, truth_of(result.contact.provenance), parameter_rows(result)
    if truth is not None:
        alike = law.simplest()
        law = alike if alike.kind == truth.kind else law
    if truth is None or truth.kind != law.kind:
        return [""] * len(rows)
    # The difference from the truth is meaningful only for comparable parameters.
    same = comparable(law, truth)
    values, real, words = law.as_dict(), truth.as_dict(), []
    for row in rows:
        error = float(result.standard_errors[row.index]) if row.name in same else 0.0
        known = row.name in real and row.estimated
        deviation = against_truth(values[row.name], real[row.name], error) if known else ""
        words.append(deviation and f"truth {deviation}")
    return words


def format_signed(value: float, digits: int) -> str:
    """Format a number with its sign to some significant digits."""
    return f"{'-' if value < 0.0 else '+'}{rounded(abs(value), digits)}"
