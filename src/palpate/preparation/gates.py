"""Quantities found from the data of a contact: gate, scale, touches and noise."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import palpate._core as _core
from palpate._core import noise_of as noise_of
from palpate.contact import Contact, slices_of
from palpate.findings import Check, Finding
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats, Plain, number_in

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
    """Return the gate for the requested thresholds; None if there are none.

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
    x, speed, force = contact.penetration, np.abs(contact.velocity), contact.force
    touching = (x > 0.0) & (force > 0.0) & (x < LARGEST) & (speed < LARGEST) & (force < LARGEST)
    largest = [np.max(each[touching], initial=0.0) for each in (x, speed, force)]
    return Scale(*(float(np.clip(each, 1e-30, 1e30)) if each > 0.0 else 1.0 for each in largest))


# A sensor that shows no light touch.

FEWEST_RESTING, FEWEST_PRESSED = 20, 3  # samples at the value of the dead band; of these in contact
ABOVE_NOISE = 4.0  # σ or steps, from that value to the next


def dead_band_of(contact: Contact) -> float:
    """Return the least force above a dead band, N; 0 without one.

    In a dead band the most common force is the least, no sample lies within four σ and steps above
    it, and the probe is in contact there, but no deeper than at twice that force: else the sensor
    was lost.
    """
    known = np.isfinite(contact.force) & np.isfinite(contact.penetration)
    force, depth = contact.force[known], contact.penetration[known]
    if np.count_nonzero(force[1:] == force[:-1]) < FEWEST_RESTING:
        return 0.0
    values, counts = np.unique(force, return_counts=True)
    most = int(np.argmax(counts))
    if counts[most] < FEWEST_RESTING or most + 1 == values.size:
        return 0.0
    least = float(values[most + 1])
    band = least - float(values[most])
    if band <= ABOVE_NOISE * max(noise_of(force), _core.step_of(force)):
        return 0.0
    shown = np.flatnonzero(force >= least)
    near = shown[force[shown] <= least + band]
    if near.size < FEWEST_PRESSED:
        near = shown[np.argsort(force[shown])[:FEWEST_PRESSED]]
    pressed = depth[(force == values[most]) & (depth > 0.0)]
    dead = pressed.size >= FEWEST_PRESSED and pressed.max() <= depth[near].max()
    return least if dead else 0.0


# The touches of a contact.

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


def touches_of(contact: Contact, gate: ContactGate | None = None) -> list[Touch]:
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


# The resolution of a recording.


def suggest_surface_deviation(contact: Contact) -> float | None:
    """Return the uncertainty of the surface, m: twice the noise and rounding of the penetration.

    None if the penetration has neither.
    """
    [found] = resolutions_of(contact.penetration[None]).tolist()
    return None if math.isnan(found) else found


def resolutions_of(penetration: Floats, *, threads: int = 1) -> Floats:
    """Return twice the noise and rounding of each row, m; NaN if it has neither.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m.
    threads : int
        Number of threads.
    """
    found = np.empty(len(penetration))
    _core.resolutions(penetration, found, threads)
    return found


# Parts of a touch that are no contact with one place: the force rises on the way out.

# No passive material pushes harder at less depth, on the way out, than where the probe turned. A
# heel does when the foot has rolled on: 5 to 60 % more, while it rises by a fifth. A force that is
# 20 ms late rises on too, but only while the depth is still within a few per cent.
RISE, RISE_OF_LARGEST, WITHDRAWN = 1.05, 0.05, 0.95
FEWEST = 2  # touches, and half of them: where one material ends and another begins is no such part
SHORTEST = 20  # samples in a touch that counts
# Samples, or a tenth of the rise: all of it within, or half of the force, is the border of another
# material. Heels rise by at most 0.7 of it and 0.3 of the force, borders by 0.75 and 1 or more.
SUDDEN = 5
LEAST_PART, MOST_PART = 0.05, 0.9  # of the contact: less changes no result, more leaves none


def exclude_load_transfer(contact: Contact) -> Contact:
    """Return the contact without the rest of each touch from where the load goes elsewhere.

    Parameters
    ----------
    contact : Contact
        Returned as it is if that is little of it, or leaves little, or is excluded already.
    """
    if any(finding.check == Check.LOAD_TRANSFER for finding in contact.findings):
        return contact
    found = load_transfer(contact.penetration, contact.velocity, contact.force, contact.segment)
    if found is None:
        return contact
    out, finding = found
    kept = np.flatnonzero(~out)
    segment = contact.segment[kept] + np.cumsum(np.diff(kept, prepend=kept[0] - 1) > 1)
    return replace(contact.taken(~out), segment=segment, findings=(*contact.findings, finding))


def load_transfer(
    depth: Floats, velocity: Floats, force: Floats, segment: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], Finding] | None:
    """Return the samples during which another place carries the load, and a finding; or None."""
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
    touches = list(slices_of(np.where(inside | (depth > 0.0), segment, -1)))
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
    finding = Check.LOAD_TRANSFER.finding(
        f"in {parts} touches the force rises while the probe withdraws, so that another place "
        f"carries the load: the rest of them, {share:.0%} of the contact, is left out",
        "if it is the material's own force, run again with --no-reject-outliers",
        severity="with-care",
    )
    return out, finding
