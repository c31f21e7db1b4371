"""Load transfer: the force rises as the probe withdraws, since another place carries the load."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import palpate._core as _core
from palpate.contact import Contact, run_slices
from palpate.digits import percent
from palpate.findings import Check, Finding
from palpate.settings import ContactGate
from palpate.validation import Floats

# While the probe withdraws, no passive material pushes harder than at the turning point. A heel
# does when the foot has rolled on: 5 to 60 % more, while it rises by a fifth. A force that is 20 ms
# late also continues to rise, but only while the depth is still within a few per cent.
RISE, RISE_OF_LARGEST, WITHDRAWN = 1.05, 0.05, 0.95
FEWEST = 2  # touches, and half of all: a border between two materials is no load transfer
SHORTEST = 20  # samples in a touch that counts
# Samples, or a tenth of the duration of the rise. A jump within this time by most of the rise, or
# by half of the force, is the border of another material. Within this time heels rise by at most
# 0.7 of the rise and 0.3 of the force, borders by 0.75 and 1 or more.
SUDDEN = 5
LEAST_PART, MOST_PART = 0.05, 0.9  # of the contact: less has no effect, more leaves too little


def exclude_load_transfer(contact: Contact) -> Contact:
    """Exclude the rest of each touch after another place has begun to carry the load.

    Parameters
    ----------
    contact : Contact
        The contact. It is returned unchanged if the excluded part would be small or would leave
        little, or if load transfer is excluded already.
    """
    if any(finding.check == Check.LOAD_TRANSFER for finding in contact.findings):
        return contact
    channels = contact.penetration, contact.velocity, contact.force, contact.segment
    found = find_load_transfer(*channels)
    if found is None:
        return contact
    out, finding = found
    kept = np.flatnonzero(~out)
    segment = contact.segment[kept] + np.cumsum(np.diff(kept, prepend=kept[0] - 1) > 1)
    return replace(contact.taken(~out), segment=segment, findings=(*contact.findings, finding))


def find_load_transfer(
    depth: Floats, velocity: Floats, force: Floats, segment: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], Finding] | None:
    """Return the samples while another place carries the load, and a finding; None without any."""
    gate = ContactGate(*_core.gate_of(depth, velocity, force))
    inside = gate.makes(depth, force) & np.isfinite(velocity)
    count = int(np.count_nonzero(inside))
    if not count:
        return None
    runs = np.where(inside & (velocity < 0.0), segment, -1)
    starts = np.concatenate([[0], np.flatnonzero(runs[1:] != runs[:-1]) + 1])
    highest, first = np.maximum.reduceat(force, starts), force[starts]
    rising = (runs[starts] >= 0) & (highest > RISE * first)
    if not rising.any():
        return None
    rising &= highest - first > RISE_OF_LARGEST * float(np.percentile(force[inside], 99.0))
    # A touch lasts until the probe is out of the material.
    touches = list(run_slices(np.where(inside | (depth > 0.0), segment, -1)))
    out = np.zeros(len(depth), dtype=bool)
    parts = 0
    for k in np.flatnonzero(rising).tolist():
        start, stop = int(starts[k]), int(np.append(starts, len(depth))[k + 1])
        peak = start + int(np.argmax(force[start:stop]))
        if out[start] or not depth[peak] < WITHDRAWN * depth[start]:
            continue
        part = force[start : peak + 1]
        width = max(part.size // 10, SUDDEN)
        jump = np.max(part[width:] - part[:-width], initial=0.0)
        if jump > min(0.9 * (part[-1] - part[0]), 0.5 * part[0]):
            continue
        touch = next(each for each in touches if each.start <= start < each.stop)
        out[start : touch.stop] = True
        parts += 1
    share = np.count_nonzero(out) / count
    of = sum(np.count_nonzero(inside[touch]) >= SHORTEST for touch in touches)
    if parts < max(FEWEST, 0.5 * of) or not LEAST_PART < share < MOST_PART:
        return None
    words = f"in {parts} touches the force rises while the probe withdraws, so that another place "
    words += f"carries the load: the rest of them, {percent(share)} of the contact, is left out"
    remedy = "if it is the material's own force, run again with --no-reject-outliers"
    return out, Check.LOAD_TRANSFER.finding(words, remedy, severity="with-care")
