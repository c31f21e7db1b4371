"""The touches of a contact, found and numbered."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.preparation.rows import runs_of
from palpate.preparation.suggestions import choose_gate
from palpate.settings import ContactGate

BREAK = 0.8  # of the force that makes contact, as of the gate that is chosen
# s. A shorter time out of contact is noise at the surface, or a bounce.
SHORTEST_LIFT = 0.05


@dataclass(frozen=True, slots=True)
class Touch:
    """One time in contact.

    Attributes
    ----------
    number : int
        From 1.
    start, stop : float
        s.
    peak_force : float
        N.
    peak_penetration : float
        m.
    """

    number: int
    start: float
    stop: float
    peak_force: float
    peak_penetration: float

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers."""
        return {name: getattr(self, name) for name in self.__slots__}


def touches_of(contact: Contact, gate: ContactGate | None = None) -> list[Touch]:
    """Find the touches: times in which the force is above that of a gate, lifts of 50 ms apart.

    Parameters
    ----------
    contact : Contact
        Of any number of touches; those of separate segments are separate.
    gate : ContactGate, optional
        Whose forces make and break contact; chosen from the data unless given.
    """
    chosen = choose_gate(contact) if gate is None else gate
    limit = max(chosen.break_force or BREAK * chosen.make_force, 0.0)
    found = []
    for part in contact.segments():
        time, force = contact.time[part], np.nan_to_num(contact.force[part])
        depth = np.nan_to_num(contact.penetration[part])
        runs = [run for run in runs_of(force > limit) if force[run[0]] > limit]
        for start, stop in _joined(runs, time.tolist()):
            peak = float(force[start:stop].max())
            if peak > chosen.make_force:
                deepest = float(depth[start:stop].max())
                found.append((float(time[start]), float(time[stop - 1]), peak, deepest))
    return [Touch(number, *each) for number, each in enumerate(found, start=1)]


def _joined(runs: list[tuple[int, int]], time: list[float]) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for start, stop in runs:
        if joined and time[start] - time[joined[-1][1] - 1] < SHORTEST_LIFT:
            joined[-1] = joined[-1][0], stop
        else:
            joined.append((start, stop))
    return joined
