"""Reasons why a contact cannot be identified: no sample in contact, no velocity, no approach."""

import numpy as np

from palpate.contact import Contact
from palpate.diagnosis import Data
from palpate.digits import rounded
from palpate.errors import NoContactError, RecordingError
from palpate.estimators.estimate import Trace
from palpate.preparation.touch import depends_on_position
from palpate.settings import ContactGate
from palpate.validation import Floats


def why_nothing(data: Data, gate: ContactGate) -> RecordingError:
    """Return the error for no sample taken: the most severe finding of the data, if any."""
    contact = data.contact
    for finding in data.findings:
        if finding.severity == "do-not-trust":
            return RecordingError.of(contact.source, str(finding))
    air = len(contact) > 0 and not gate.makes(contact.penetration, contact.force).any()
    air = air and not depends_on_position(contact.force, contact.penetration)
    kind = NoContactError if air else RecordingError
    return kind.of(contact.source, no_contact_message(contact, gate))


def no_contact_message(contact: Contact, gate: ContactGate) -> str:
    """Describe why no sample was taken."""
    if not len(contact):
        return "there are no samples"
    inside = gate.makes(contact.penetration, contact.force)
    if inside.any() and not np.isfinite(contact.velocity[inside]).any():
        return (
            f"no sample in contact has a velocity: {not_finite(contact)}; pass "
            "--velocity none to differentiate the penetration instead"
        )
    return (
        f"no contact found: no sample has penetration above "
        f"{rounded(gate.minimum_penetration, 3)} m and force above {rounded(gate.make_force, 3)} N "
        f"(the largest are {_largest(contact.penetration)} m and {_largest(contact.force)} N); "
        "check units and signs, or pass a smaller --min-penetration or --min-force"
    )


def not_finite(contact: Contact) -> str:
    """Describe which channels are not finite, their origin, and the number of their samples."""
    penetration = ~np.isfinite(contact.penetration)
    force = ~np.isfinite(contact.force)
    velocity = ~np.isfinite(contact.velocity) & ~penetration  # for another reason
    phrases = []
    for name, wrong in {"penetration": penetration, "velocity": velocity, "force": force}.items():
        if wrong.any():
            origin = f" ({contact.provenance[name]})" if name in contact.provenance else ""
            phrases.append(f"{name}{origin} is NaN or infinite in {wrong.sum()}")
    return f"{', '.join(phrases)} of {len(contact)} samples"


def _largest(values: Floats) -> str:
    known = values[~np.isnan(values)]
    return rounded(known.max(), 3) if known.size else "no"


# Samples above the surface that a fit of the surface needs; the force in free air is then known to
# a quarter of σ.
FEWEST_ABOVE = 20


def check_approach(contact: Contact, trace: Trace, surface: float) -> None:
    """Raise if too few samples lie above an estimated surface: they show where the force begins."""
    above = int(np.count_nonzero(contact.penetration[trace.taken] < surface))
    if above < FEWEST_ABOVE:
        raise RecordingError.of(contact.source, no_approach(above, len(contact), surface))


def no_approach(above: int, samples: int, surface: float) -> str:
    """Describe that too few samples lie above the surface that was found."""
    return (
        f"cannot estimate the surface without a free approach: {above} of {samples} samples lie "
        f"above the best surface, {rounded(surface, 3)} m, and at least {FEWEST_ABOVE} must; "
        "start the recording before the touch, or pass the position of the surface"
    )
