"""The contact gate and the scale that suit the samples of a contact."""

import numpy as np

import palpate._core as _core
from palpate.method.contact import Contact
from palpate.method.settings import ContactGate, Scale
from palpate.validation import number_in

LARGEST = 1e100  # m, m/s or N; estimators reject larger samples


def choose_gate(
    contact: Contact,
    *,
    minimum_penetration: float | None = None,
    minimum_force: float | None = None,
) -> ContactGate:
    """Return the gate of a contact: the given thresholds, and the others from its samples.

    The default threshold is ten times the noise, within 1 to 10 % of the largest values. Near it
    the gate accepts forces that noise made large, a bias of 10 % of K for probing near the surface
    of a soft material. If that concerns more than 3 % of the contact and depth separates these
    samples, the gate uses the depth at which the force falls below its threshold instead.

    Parameters
    ----------
    contact : Contact
        The contact.
    minimum_penetration : float, optional
        Least penetration in contact, m, in [0, 1e100]. Default: from the data.
    minimum_force : float, optional
        Force at which contact begins and ends, N, in [0, 1e100]. Default: from the data.

    Returns
    -------
    ContactGate
        Thresholds of penetration, m, and force, N.

    Examples
    --------
    >>> import palpate
    >>> contact = palpate.prepare("examples/recordings/ball.csv")
    >>> gate = palpate.choose_gate(contact)
    >>> round(gate.make_force, 1)  # N
    0.7
    """
    depth, make, lost = _core.gate_of(contact.penetration, contact.velocity, contact.force)
    if minimum_penetration is not None:
        depth = minimum_penetration
    if minimum_force is not None:
        make = lost = number_in("minimum_force", minimum_force, 0.0, LARGEST)
    return ContactGate(depth, make, lost)


def requested_gate(
    contact: Contact,
    minimum_penetration: float | None,
    minimum_force: float | None,
    *,
    alone: bool = False,
) -> ContactGate | None:
    """Return the gate for the requested thresholds, or None if no threshold is requested.

    ``alone`` is for a method that chooses its samples itself: it gets no other threshold.
    """
    if minimum_penetration is None and minimum_force is None:
        return None
    if alone:
        force = minimum_force or 0.0
        return ContactGate(minimum_penetration or 0.0, force, force)
    return choose_gate(
        contact, minimum_penetration=minimum_penetration, minimum_force=minimum_force
    )


def suggest_scale(contact: Contact) -> Scale:
    """Return scaling units: the largest penetration, speed and force of the contact."""
    speed = np.abs(contact.velocity)
    channels = contact.penetration, speed, contact.force
    inside = (contact.penetration > 0.0) & (contact.force > 0.0)
    for channel in channels:
        inside &= channel < LARGEST
    largest = (float(np.max(channel[inside], initial=0.0)) for channel in channels)
    return Scale(*(float(np.clip(size, 1e-30, 1e30)) if size > 0.0 else 1.0 for size in largest))
