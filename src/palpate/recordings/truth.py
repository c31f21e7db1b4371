"""The law that a simulated recording says it was made with."""

import json
from collections.abc import Mapping

from palpate.force_laws import ForceLaw, law_from


def truth_of(notes: Mapping[str, str]) -> ForceLaw | None:
    """Return the force law of the note ``truth``; None where there is none that can be read.

    Parameters
    ----------
    notes : mapping
        What a recording says of itself. ``truth`` is JSON: the law's ``kind`` and parameters.
    """
    try:
        return law_from(dict(json.loads(notes["truth"])))
    except (KeyError, ValueError, TypeError, RecursionError):
        return None
