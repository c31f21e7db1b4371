"""A gate and a scale chosen from the data, where the user chooses none."""

import dataclasses

import numpy as np

from palpate import _core
from palpate.contact import Contact
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats, number_in

LARGEST = 1e100  # m, m/s or N; beyond it no estimator takes a sample


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
    x, speed, force = contact.penetration, np.abs(contact.velocity), contact.force
    touching = (x > 0.0) & (force > 0.0) & (x < LARGEST) & (speed < LARGEST) & (force < LARGEST)
    largest = [np.max(each[touching], initial=0.0) for each in (x, speed, force)]
    return Scale(*(float(np.clip(each, 1e-30, 1e30)) if each > 0.0 else 1.0 for each in largest))


def suggest_gate(contact: Contact) -> ContactGate:
    """Thresholds at ten times the noise, kept between 1 % and 10 % of the largest values.

    A force near its threshold is taken where noise made it large, which biases: probing near the
    surface costs a soft material 10 % of K. Where that is more than 3 % of the contact the depth
    decides instead, where it separates them: contact is then what is deeper than where the force
    falls short of its threshold.
    """
    return ContactGate(*_core.gate_of(contact.penetration, contact.velocity, contact.force))


def noise_of(values: Floats) -> float:
    """Return the standard deviation of white noise on a smooth signal, from its fourth differences.

    They suppress the signal as (ωT)⁴ and have 70 times the noise's variance.
    """
    return _core.noise_of(values)
