"""The truth that a recording states, next to the identified law."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.input.recordings.recording import read_truth
from palpate.output.results.parameters import format_signed, parameter_rows

if TYPE_CHECKING:
    from palpate.identification.identified import Identified


# Tolerance of the logarithms of the first and the last time: a change of a time by 5 % changes M by
# less than 1 %.
_SAME_TIME = 0.05


def stated_truth(result: "Identified", depth: float) -> dict[str, float]:
    """Return the stated truth of the numbers at a depth, SI, by name; empty without one.

    If one of the two laws relaxes: K′ and B′ at the motion's frequency, and no force.
    """
    truth = read_truth(result.contact.provenance)
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
    dampers = {round(each.p - each.n, 6) for each in pair if each.B}
    return names if len(dampers) < 2 else names - {"B", "p"}


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
    law = result.law
    truth = read_truth(result.contact.provenance)
    rows = parameter_rows(result)
    if truth is not None:
        alike = law.simplest()
        law = alike if alike.kind == truth.kind else law
    if truth is None or truth.kind != law.kind:
        return [""] * len(rows)
    # The difference from the truth is meaningful only for comparable parameters.
    same = comparable(law, truth)
    values = law.as_dict()
    real = truth.as_dict()
    phrases = []
    for row in rows:
        error = float(result.standard_errors[row.index]) if row.name in same else 0.0
        known = row.name in real and row.estimated
        deviation = against_truth(values[row.name], real[row.name], error) if known else ""
        phrases.append(deviation and f"truth {deviation}")
    return phrases
