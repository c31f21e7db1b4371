"""The truth that a simulated recording states, beside what was identified."""

import math

from palpate.digits import rounded
from palpate.force_laws import ForceLaw
from palpate.identification import Identification
from palpate.recordings.truth import truth_of

#: Beside a table that has such a distance.
LEGEND = "σ: distance from the truth that the file states, in standard errors"


def stated_truth(result: Identification) -> ForceLaw | None:
    """Return the force law that the recording says it was made with, if any."""
    return truth_of(result.contact.provenance)


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


def _signed(distance: float) -> str:
    size = rounded(abs(distance), 2)
    return f"{'-' if distance < 0.0 else '+'}{size}"
