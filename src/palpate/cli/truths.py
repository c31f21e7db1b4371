"""The truth that a simulated recording states, beside what was identified."""

import math

import numpy as np

from palpate.diagnosis import Quantity
from palpate.digits import rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.identifying import Identification
from palpate.recordings.truth import truth_of

#: Beside a table that has such a distance.
LEGEND = "σ: distance from the truth that the file states, in standard errors"
# Of the logarithms of a spectrum's ends: 5 % of a time move M by less than 1 %.
_SAME_TIME = 0.05


def stated_truth(result: Identification) -> ForceLaw | None:
    """Return the force law that the recording says it was made with, if any."""
    return truth_of(result.contact.provenance)


def truth_at_rest(result: Identification) -> ForceLaw | None:
    """Return the stated truth where its force, stiffness and damping at rest mean the same.

    Where one of the two laws remembers what the other does not, they do not.
    """
    law, truth = result.law, stated_truth(result)
    if truth is None or not (law.remembers or truth.remembers):
        return truth
    return truth if comparable(law, truth) else None


def comparable(law: ForceLaw, truth: ForceLaw) -> set[str]:
    """Return the parameters of a law that mean what the truth's of the same names do.

    Those of a law of another kind do not; of two generalised laws they do where the same relaxes,
    the same kind of spectrum over the same times; but B is in N·s/mᵖ⁺¹.
    """
    names = set(law.names())
    if law.kind != truth.kind:
        return set()
    if not isinstance(law, GeneralisedHuntCrossley) or not isinstance(truth, type(law)):
        return names
    if not _same_memory(law, truth):
        return set()
    pair = (law, truth)
    dampers = {round(each.damping_exponent - each.exponent, 6) for each in pair if each.damping}
    return names if len(dampers) < 2 else names - {"damping", "damping_exponent"}


def felt_beside_truth(result: Identification) -> str:
    """Say what a small oscillation feels, and the truth of it; empty where nothing remembers."""
    truth = stated_truth(result)
    if truth is None or not (truth.remembers or result.law.remembers):
        return ""
    try:
        felt = result.dynamic_stiffness()
    except InvalidParameterError:  # of a probe that never moved there is no frequency
        return ""
    real = GeneralisedHuntCrossley.of(truth).dynamic_stiffness(felt.depth, felt.frequency)
    stiffness = _felt_beside(felt.stiffness, real.real, "N/m")
    damping = _felt_beside(felt.damping, real.imag / felt.frequency, "N·s/m")
    same = comparable(result.law, truth) == set(result.law.names())
    other = "" if same else "the file's law is another; "
    return (
        f"{other}an oscillation of {rounded(felt.frequency, 3)} rad/s about "
        f"{rounded(1e3 * felt.depth, 3)} mm feels {stiffness} and {damping}"
    )


def beside_truth(value: float, truth: float, *errors: float) -> str:
    """Return the truth, and how many standard errors away from it a number is.

    Parameters
    ----------
    value, truth : float
        Of one unit.
    errors : float
        Of the value; all of them together count.
    """
    known = [error for error in errors if math.isfinite(error)]
    words = f"truth {rounded(truth, 5)}"
    error = math.hypot(*known)
    if not (error > 0.0 and math.isfinite(value)):
        return words
    return f"{words}, {_signed((value - truth) / error)} σ"


def _felt_beside(found: Quantity, exact: float, unit: str) -> str:
    bars = found.standard_error, found.systematic
    words = with_error(found.value, *bars, unit=unit)
    return f"{words} ({beside_truth(found.value, exact, *bars)})"


def _same_memory(law: GeneralisedHuntCrossley, truth: GeneralisedHuntCrossley) -> bool:
    if not (law.remembers and truth.remembers):
        return law.remembers == truth.remembers
    if type(law.relaxation) is not type(truth.relaxation):
        return False
    ends = [[each.shortest_time, each.longest_time] for each in (law, truth)]
    # One relaxation time is identified, and so is its difference from the truth.
    return 0.0 in ends[0] or bool(np.ptp(np.log(ends), axis=0).max() < _SAME_TIME)


def _signed(distance: float) -> str:
    size = rounded(abs(distance), 2)
    return f"{'-' if distance < 0.0 else '+'}{size}"
