"""A channel that is held: the same value again and again, at a fixed beat."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding
from palpate.digits import rounded
from palpate.validation import Floats

LONGEST = 60  # samples of a beat
IN_STEP = 0.9  # of the changes, that fall on one phase
MOST = 20_000  # samples that are looked at


def held(data: Data) -> Finding | None:
    """Changes at one phase of every k ≤ 60 samples; that is a delay of (k − 1)/2 samples."""
    for name, values in (("force", data.force), ("penetration", data.penetration)):
        beat = beat_of(values)
        if beat:
            late = 0.5e3 * (beat - 1) * data.sample_time
            return Finding(
                "held channel",
                f"the {name} changes only every {beat} samples, as one that is held: "
                f"{rounded(late, 2)} ms late on average",
                "record at the rate of the slowest channel, or keep one sample of each beat",
                stiffness="with-care",
                damping="with-care",
            )
    return None


def beat_of(values: Floats) -> int:
    """Samples for which a held channel keeps a value; 0 for one that is not held."""
    values = values[:MOST]
    at = np.flatnonzero(np.diff(values))
    if at.size < 20 or at.size > 0.6 * len(values):
        return 0
    beat = round(float(np.median(np.diff(at))))
    if not 2 <= beat <= LONGEST:
        return 0
    # The phase may slip by one sample now and then where the two rates are no multiples.
    common = np.bincount(at % beat, minlength=beat).max() / at.size
    return beat if common > IN_STEP and at.size > 0.5 * len(values) / beat else 0
