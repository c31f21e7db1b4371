"""The law that a simulated recording says it was made with."""

import json
from collections.abc import Mapping

from palpate.force_laws import ExtendedKelvinVoigt, ForceLaw, HuntCrossley, KelvinVoigt


def truth_of(notes: Mapping[str, str]) -> ForceLaw | None:
    """Return the force law of the note ``truth``; None where there is none that can be read.

    Parameters
    ----------
    notes : mapping
        What a recording says of itself. ``truth`` is JSON: the law's ``kind`` and parameters.
    """
    kinds = {kind.kind: kind for kind in (KelvinVoigt, ExtendedKelvinVoigt, HuntCrossley)}
    try:
        words = json.loads(notes["truth"])
        return kinds[words.pop("kind")](**words)
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError):
        return None
