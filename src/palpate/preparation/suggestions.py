"""A gate and a scale chosen from the data, where the user chooses none."""

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats

LARGEST = 1e100  # m, m/s or N; beyond it no estimator takes a sample
NOISE_FACTOR = 10.0  # F ≥ 10 σ keeps the bias of the logarithm, σ²/2F², under 0.5 %


def suggest_scale(contact: Contact) -> Scale:
    """Units for the arithmetic: the largest penetration, speed and force of the contact."""
    touching = _touching(contact)
    if not touching.any():
        return Scale()
    units = (contact.penetration, np.abs(contact.velocity), contact.force)
    return Scale(*(_unit(values[touching]) for values in units))


def suggest_gate(contact: Contact) -> ContactGate:
    """Thresholds at ten times the noise, kept between 1 % and 10 % of the largest values."""
    touching = _touching(contact)
    if not touching.any():
        return ContactGate()
    make = _threshold(contact.force, touching)
    return ContactGate(
        minimum_penetration=_threshold(contact.penetration, touching), make_force=make
    )


def _touching(contact: Contact) -> NDArray[np.bool_]:
    x, force = contact.penetration, contact.force
    positive = (x > 0.0) & (force > 0.0)
    return positive & (x < LARGEST) & (np.abs(contact.velocity) < LARGEST) & (force < LARGEST)


def _unit(values: Floats) -> float:
    largest = float(np.max(values, initial=0.0, where=np.isfinite(values)))
    return min(max(largest, 1e-30), 1e30) if largest > 0.0 else 1.0


def _threshold(values: Floats, touching: NDArray[np.bool_]) -> float:
    # The 99th percentile, so that a spike sets nothing.
    largest = float(np.percentile(values[touching], 99.0))
    return float(np.clip(NOISE_FACTOR * noise_of(values), 0.01 * largest, 0.10 * largest))


def noise_of(values: Floats) -> float:
    """Return the standard deviation of white noise on a smooth signal, from its fourth differences.

    They suppress the signal as (ωT)⁴ and have 70 times the noise's variance.
    """
    differences = np.diff(values[np.abs(values) < LARGEST], n=4)
    if differences.size == 0:
        return 0.0
    return float(np.median(np.abs(differences)) / 0.6745 / np.sqrt(70.0))
