"""A gate and a scale chosen from the data, where the user chooses none."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats, number_in

LARGEST = 1e100  # m, m/s or N; beyond it no estimator takes a sample
MOST_UNDECIDED = 0.03  # of the contact within 3 σ of the gate; deep probing has under 0.5 %
NOISE_FACTOR = 10.0  # F ≥ 10 σ keeps the bias of the logarithm, σ²/2F², under 0.5 %


def choose_gate(
    contact: Contact,
    *,
    minimum_penetration: float | None = None,
    minimum_force: float | None = None,
) -> ContactGate:
    """Return the gate of a contact: the thresholds that are given, the suggested ones elsewhere.

    Parameters
    ----------
    contact : Contact
        What the gate is for.
    minimum_penetration : float, optional
        Contact is deeper than this, m, in [0, 1e100].
    minimum_force : float, optional
        Contact is made and lost at this force, N, in [0, 1e100].
    """
    gate = suggest_gate(contact)
    if minimum_penetration is not None:
        depth = number_in("minimum_penetration", minimum_penetration, 0.0, LARGEST)
        gate = dataclasses.replace(gate, minimum_penetration=depth)
    if minimum_force is not None:
        force = number_in("minimum_force", minimum_force, 0.0, LARGEST)
        gate = dataclasses.replace(gate, make_force=force, break_force=force)
    return gate


def suggest_scale(contact: Contact) -> Scale:
    """Units for the arithmetic: the largest penetration, speed and force of the contact."""
    touching = _touching(contact)
    if not touching.any():
        return Scale()
    units = (contact.penetration, np.abs(contact.velocity), contact.force)
    return Scale(*(_unit(values[touching]) for values in units))


def suggest_gate(contact: Contact) -> ContactGate:
    """Thresholds at ten times the noise, kept between 1 % and 10 % of the largest values.

    A force near its threshold is taken where noise made it large, which biases: probing near the
    surface costs a soft material 10 % of K. Where that is more than 3 % of the contact the depth
    decides instead, where it separates them: contact is then what is deeper than where the force
    falls short of its threshold.
    """
    touching = _touching(contact)
    if not touching.any():
        return ContactGate()
    make = _threshold(contact.force, touching)
    least = _threshold(contact.penetration, touching)
    undecided = np.abs(contact.force - make) < 3.0 * noise_of(contact.force)
    inside = touching & (contact.penetration > least)
    if np.count_nonzero(inside & undecided) > MOST_UNDECIDED * np.count_nonzero(inside):
        depth = decisive_depth(contact.penetration, contact.force, touching, make, least)
        if depth is not None:
            return ContactGate(minimum_penetration=depth, make_force=make, break_force=0.0)
    return ContactGate(minimum_penetration=least, make_force=make)


def decisive_depth(
    penetration: Floats, force: Floats, touching: NDArray[np.bool_], make: float, least: float
) -> float | None:
    """Depth beyond which one force in a thousand is at or below ``make``; None beyond half way."""
    x = penetration
    light = np.sort(x[(x > least) & (x < LARGEST) & (force <= make)])
    spared = int(np.count_nonzero(touching) // 1000)
    if light.size <= spared:
        return None
    depth = float(light[-1 - spared])
    return depth if depth <= 0.5 * float(np.percentile(x[touching], 99.0)) else None


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
