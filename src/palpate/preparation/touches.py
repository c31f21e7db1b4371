"""The touches of a contact: from one separation to the next."""

from dataclasses import dataclass

import numpy as np

from palpate.contact import Contact, run_slices
from palpate.preparation.gates import choose_gate
from palpate.settings import ContactGate
from palpate.validation import Plain

BREAK = 0.8  # force at which contact ends, as a fraction of that at which it begins
# s. A shorter time out of contact is noise at the surface, or a bounce.
SHORTEST_LIFT = 0.05


@dataclass(frozen=True, slots=True)
class Touch(Plain):
    """One touch.

    Attributes
    ----------
    number : int
        Number of the touch, from 1.
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


def find_touches(contact: Contact, gate: ContactGate | None = None) -> list[Touch]:
    """Find the touches: intervals of force above the gate, at least 50 ms apart.

    Parameters
    ----------
    contact : Contact
        The contact. A touch does not extend over segments.
    gate : ContactGate, optional
        The gate whose forces begin and end a touch. Default: chosen from the data.
    """
    chosen = choose_gate(contact) if gate is None else gate
    limit = max(chosen.break_force or BREAK * chosen.make_force, 0.0)
    found = []
    for part in contact.segments():
        time, force = contact.time[part], np.nan_to_num(contact.force[part])
        depth = np.nan_to_num(contact.penetration[part])
        runs = [run for run in run_slices(force > limit) if force[run.start] > limit]
        for start, stop in _join_near(runs, time.tolist()):
            peak = float(force[start:stop].max())
            if peak > chosen.make_force:
                deepest = float(depth[start:stop].max())
                found.append((float(time[start]), float(time[stop - 1]), peak, deepest))
    return [Touch(number, *each) for number, each in enumerate(found, start=1)]


def _join_near(runs: list[slice], time: list[float]) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for run in runs:
        start = run.start
        if joined and time[start] - time[joined[-1][1] - 1] < SHORTEST_LIFT:
            start = joined.pop()[0]
        joined.append((start, run.stop))
    return joined
