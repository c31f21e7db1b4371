"""What the data say of a contact: a gate and a scale, its touches, and its noise."""

import math
from dataclasses import dataclass

import numpy as np

import palpate._core as _core
from palpate._core import noise_of as noise_of
from palpate.contact import Contact, slices_of
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats, Plain, number_in

LARGEST = 1e100  # m, m/s or N; beyond it no estimator takes a sample


def choose_gate(
    contact: Contact,
    *,
    minimum_penetration: float | None = None,
    minimum_force: float | None = None,
) -> ContactGate:
    """Return the gate of a contact: the thresholds that are given, and the rest by its samples.

    That is at ten times the noise, kept between 1 % and 10 % of the largest values. A force near
    its threshold is taken where noise made it large, which biases: probing near the surface costs a
    soft material 10 % of K. Where that is more than 3 % of the contact the depth decides instead,
    where it separates them: contact is then what is deeper than where the force falls short of its
    threshold.

    Parameters
    ----------
    contact : Contact
        What the gate is for.
    minimum_penetration : float, optional
        Contact is deeper than this, m, in [0, 1e100].
    minimum_force : float, optional
        Contact is made and lost at this force, N, in [0, 1e100].
    """
    depth, make, lost = _core.gate_of(contact.penetration, contact.velocity, contact.force)
    if minimum_penetration is not None:
        depth = minimum_penetration
    if minimum_force is not None:
        make = lost = number_in("minimum_force", minimum_force, 0.0, LARGEST)
    return ContactGate(depth, make, lost)


def gate_asked_for(
    contact: Contact,
    minimum_penetration: float | None,
    minimum_force: float | None,
    *,
    alone: bool = False,
) -> ContactGate | None:
    """Return the gate of thresholds that are asked for; None where none is.

    ``alone`` is for a method that chooses its samples itself: it gets no threshold beside these.
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
    """Units for the arithmetic: the largest penetration, speed and force of the contact."""
    x, speed, force = contact.penetration, np.abs(contact.velocity), contact.force
    touching = (x > 0.0) & (force > 0.0) & (x < LARGEST) & (speed < LARGEST) & (force < LARGEST)
    largest = [np.max(each[touching], initial=0.0) for each in (x, speed, force)]
    return Scale(*(float(np.clip(each, 1e-30, 1e30)) if each > 0.0 else 1.0 for each in largest))


# The touches of a contact, found and numbered.

BREAK = 0.8  # of the force that makes contact, as of the gate that is chosen
# s. A shorter time out of contact is noise at the surface, or a bounce.
SHORTEST_LIFT = 0.05


@dataclass(frozen=True, slots=True)
class Touch(Plain):
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
        runs = [run for run in slices_of(force > limit) if force[run.start] > limit]
        for start, stop in _joined(runs, time.tolist()):
            peak = float(force[start:stop].max())
            if peak > chosen.make_force:
                deepest = float(depth[start:stop].max())
                found.append((float(time[start]), float(time[stop - 1]), peak, deepest))
    return [Touch(number, *each) for number, each in enumerate(found, start=1)]


def _joined(runs: list[slice], time: list[float]) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for run in runs:
        start = run.start
        if joined and time[start] - time[joined[-1][1] - 1] < SHORTEST_LIFT:
            start = joined.pop()[0]
        joined.append((start, run.stop))
    return joined


# How well a recording can tell where things are.


def suggest_surface_deviation(contact: Contact) -> float | None:
    """How well the surface is known, m: twice the noise of the penetration, its rounding included.

    None where the penetration has neither.
    """
    [found] = resolutions_of(contact.penetration[None]).tolist()
    return None if math.isnan(found) else found


def resolutions_of(penetration: Floats, *, threads: int = 1) -> Floats:
    """Twice the noise of each row, its rounding included, m; NaN where it has neither.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m.
    threads : int
        That share the rows.
    """
    found = np.empty(len(penetration))
    _core.resolutions(penetration, found, threads)
    return found
