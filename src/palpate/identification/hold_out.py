"""Prediction of the second half of a recording from its first half."""

from collections.abc import Callable

import numpy as np

from palpate.digits import percent, rounded
from palpate.errors import RecordingError
from palpate.findings import Check, Finding, NextStep, Remedy
from palpate.method.contact import Contact
from palpate.method.rows import rms
from palpate.validation import Floats, Mask

# A law that predicts worse than this multiple of Hunt–Crossley's error is not to be trusted.
WORSE = 1.1
FEWEST = 100  # samples in contact
Predict = Callable[[Contact, Contact], Floats]


def check_prediction(
    contact: Contact,
    taken: Mask,
    law: Predict,
    plain: Predict,
) -> Finding:
    """Report how well a law and plain Hunt–Crossley of the first half predict the second.

    Parameters
    ----------
    contact : Contact
        The whole contact.
    taken : numpy.ndarray of bool, shape (k,)
        Its samples in contact; the halves have as many.
    law, plain : callable
        Identify their first argument, and return the force of the second, N.

    Raises
    ------
    RecordingError
        There are too few samples in contact.
    """
    inside = np.flatnonzero(taken)
    if inside.size < FEWEST:
        text = f"--hold-out needs {FEWEST} samples in contact, and there are {inside.size}"
        raise RecordingError.of(contact.source, text)
    second = inside[inside.size // 2 :]
    first = contact.taken(slice(0, int(second[0])))
    force = contact.force[second]
    size = rms(force)
    errors = [rms(force - predict(first, contact)[second]) for predict in (law, plain)]
    ratio = errors[0] / errors[1] if errors[1] else 1.0
    parts = [percent(error / size) for error in errors]
    worse = ratio > WORSE
    return Check.HOLD_OUT.finding(
        f"the law of the first half predicts the second to {parts[0]} of the force, plain "
        f"Hunt–Crossley to {parts[1]}: {rounded(ratio, 3)} times that error",
        Remedy(NextStep.PLAIN_LAW) if worse else None,
        mark="do-not-trust" if worse else "trust",
    )
