"""The contacts of a probe that travels: one at each place."""

from collections.abc import Iterator
from dataclasses import replace

from palpate.contact import Contact
from palpate.preparation.along_penetration import assumption
from palpate.preparation.prepared import Place

OF_THE_WHOLE = ("episodes", "surface", "orientation")


def at_places(contact: Contact) -> Iterator[tuple[Place, Contact]]:
    """Return each place and the contact there, with its own surface; none where it is one place.

    Within an episode the orientation hardly changes: only the whole has to be warned of that.
    """
    places = () if contact.prepared is None else contact.prepared.places
    parts = list(contact.segments())
    common = tuple(remark for remark in contact.remarks if remark.step not in OF_THE_WHOLE)
    for place in places:
        times = ((place.start <= contact.time[part.start] <= place.stop, part) for part in parts)
        part = next((part for inside, part in times if inside), None)
        if part is None:  # left out by a window
            continue
        own = replace(
            contact.taken(part),
            surface_deviation=place.surface.deviation or None,
            remarks=(*common, *assumption(place.surface)),
        )
        yield place, own
