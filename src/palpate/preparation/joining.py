"""Several contacts with one object, as one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.remarks import Remark


def joined(contacts: Sequence[Contact]) -> Contact:
    """Return several contacts with one object as one, in which each is a segment or more.

    Parameters
    ----------
    contacts : sequence of Contact
        In the order in which they are identified; each keeps its own clock.

    Raises
    ------
    InvalidParameterError
        There is none.
    """
    if not contacts:
        raise InvalidParameterError("contacts must hold at least one")
    first = contacts[0]
    if len(contacts) == 1:
        return first
    labels, number = [], 0
    for contact in contacts:
        labels.append(contact.segment + number)
        number = int(labels[-1].max(initial=number)) + 1
    provenance = {
        f"{name} of {contact.source}": words
        for contact in contacts
        for name, words in contact.provenance.items()
    }
    # A velocity is worked out in all of them, or in none: its checks ask for one of them.
    return replace(
        first,
        time=np.concatenate([contact.time for contact in contacts]),
        penetration=np.concatenate([contact.penetration for contact in contacts]),
        velocity=np.concatenate([contact.velocity for contact in contacts]),
        force=np.concatenate([contact.force for contact in contacts]),
        segment=np.concatenate(labels),
        source=", ".join(contact.source for contact in contacts),
        provenance={**first.provenance, **provenance},
        tare_deviation=_widest([contact.tare_deviation for contact in contacts]),
        surface_deviation=_widest([contact.surface_deviation for contact in contacts]),
        remarks=tuple(_of(contact, remark) for contact in contacts for remark in contact.remarks),
        prepared=None,
    )


def _widest(deviations: Sequence[float | None]) -> float | None:
    """The largest; None where one of them is not known."""
    known = [each for each in deviations if each is not None]
    return max(known) if len(known) == len(deviations) else None


def _of(contact: Contact, remark: Remark) -> Remark:
    return replace(remark, sentence=f"{contact.source}: {remark.sentence}")
