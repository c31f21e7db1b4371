"""How well a recording can tell where things are."""

import math

import numpy as np

from palpate.contact import Contact
from palpate.preparation.spikes import step_of
from palpate.preparation.suggestions import noise_of
from palpate.validation import Floats

LARGEST = 1e30  # m; beyond it no estimator is set
# The zero of an encoder lies anywhere within a step, and stays there for a whole recording.
OF_THE_NOISE = 2.0


def suggest_surface_deviation(contact: Contact) -> float | None:
    """How well the surface is known, m: twice the noise of the penetration, its rounding included.

    None where the penetration has neither.
    """
    return resolution_of(contact.penetration)


def resolution_of(penetration: Floats) -> float | None:
    """Twice the noise of a penetration, its rounding included, m; None where it has neither."""
    x = penetration[np.isfinite(penetration)]
    with np.errstate(over="ignore", invalid="ignore"):  # of absurd depths: ±1e308 m
        noise = max(noise_of(x), step_of(x) / math.sqrt(12.0))
    deviation = OF_THE_NOISE * noise
    return deviation if 0.0 < deviation < LARGEST else None
