"""Inertia of what moves between the force sensor and the material."""

from dataclasses import replace

import numpy as np

from palpate.contact import Contact
from palpate.digits import format_quantity


def subtract_inertia(contact: Contact, mass: float | None) -> Contact:
    """Subtract mass × acceleration from the force, kg; the acceleration is that of the penetration.

    The sensor pushes the mass and the mass the material: F = F_sensor − m dv/dt. None: unknown.
    """
    if mass is None:
        return contact
    force = contact.force.copy()
    for part in contact.segments():
        if len(force[part]) > 1:
            force[part] -= mass * np.gradient(contact.velocity[part], contact.time[part])
    before = contact.provenance.get("force")
    words = f"minus the inertia of {format_quantity(mass, 'kg')} beyond the sensor"
    made = {**contact.provenance, "force": words if before is None else f"{before}; {words}"}
    return replace(contact, force=force, moving_mass=mass, provenance=made)
