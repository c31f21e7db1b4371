"""Why a contact cannot be identified, in words: what, where and what to do."""

import numpy as np

from palpate.contact import Contact
from palpate.diagnosis import Data
from palpate.digits import rounded
from palpate.errors import RecordingError
from palpate.settings import ContactGate
from palpate.trace import Trace
from palpate.validation import Floats

# Samples above the surface that a search for it needs: the force out of contact is then known to a
# quarter of σ.
FEWEST_ABOVE = 20


def why_nothing(data: Data, gate: ContactGate) -> str:
    """Why no sample was taken: by what the checks of the data found, if anything."""
    for finding in data.findings:
        if finding.severity == "do-not-trust":
            where = f"{data.contact.source}: " if data.contact.source else ""
            return f"{where}{finding.sentence} ({finding.remedy})"
    return nothing_taken(data.contact, gate)


def nothing_taken(contact: Contact, gate: ContactGate) -> str:
    """Say why no sample was taken."""
    where = f"{contact.source}: " if contact.source else ""
    if not len(contact):
        return f"{where}there are no samples"
    inside = (contact.penetration > gate.minimum_penetration) & (contact.force > gate.make_force)
    if inside.any() and not np.isfinite(contact.velocity[inside]).any():
        return (
            f"{where}no sample of the contact has a velocity: {not_finite(contact)}; without that "
            "channel it is worked out from the penetration"
        )
    return (
        f"{where}the probe never touches: no sample has penetration above "
        f"{rounded(gate.minimum_penetration, 3)} m and force above {rounded(gate.make_force, 3)} N "
        f"(the largest are {_largest(contact.penetration)} m and {_largest(contact.force)} N); "
        "check the units and signs, or lower the gate"
    )


def not_finite(contact: Contact) -> str:
    """Which channels are not finite, where they come from, and how often, in words."""
    penetration, force = ~np.isfinite(contact.penetration), ~np.isfinite(contact.force)
    velocity = ~np.isfinite(contact.velocity) & ~penetration  # beyond what follows from the depth
    words = []
    for name, wrong in {"penetration": penetration, "velocity": velocity, "force": force}.items():
        if wrong.any():
            origin = f" ({contact.provenance[name]})" if name in contact.provenance else ""
            words.append(f"{name}{origin} is NaN or infinite in {wrong.sum()}")
    return f"{', '.join(words)} of {len(contact)} samples"


def _largest(values: Floats) -> str:
    known = values[~np.isnan(values)]
    return rounded(known.max(), 3) if known.size else "no"


def check_approach(contact: Contact, trace: Trace, surface: float) -> None:
    """A surface is where the force begins: without samples before it, it is a guess from below."""
    above = int(np.count_nonzero(contact.penetration[trace.taken] < surface))
    if above < FEWEST_ABOVE:
        where = f"{contact.source}: " if contact.source else ""
        raise RecordingError(
            f"{where}the search for the surface needs the free approach: {above} of "
            f"{len(contact)} samples lie above the best surface, {rounded(surface, 3)} m, and at "
            f"least {FEWEST_ABOVE} have to; record from before the touch, or give the "
            "penetration from a known surface and leave surface out"
        )
