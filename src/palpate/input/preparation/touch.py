"""The touches of a contact, whether there are any, and where another place carries the load."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

import palpate._core as _core
from palpate.digits import percent
from palpate.findings import Check, Finding
from palpate.input.preparation.gate import choose_gate
from palpate.input.preparation.resolution import noise_of
from palpate.method.contact import Contact
from palpate.method.rows import count_true, finite_rows, row_norms, run_slices, true_runs
from palpate.method.settings import ContactGate
from palpate.validation import Floats, Integers, Mask, Plain, frozen

BREAK = 0.8  # force at which contact ends, as a fraction of that at which it begins
# s. A shorter time out of contact is noise at the surface, or a bounce.
SHORTEST_LIFT = 0.05
NOISES_OF_TOUCH = 6.0  # σ of the norm of the force: a larger change is a touch
FEWEST_TO_DEPEND = 20
LEAST_EXPLAINED = 0.05
TINY = 1e-300


@frozen
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
    touches = list[Touch]()
    for segment in contact.segments():
        time = contact.time[segment]
        force = np.nan_to_num(contact.force[segment])
        depth = np.nan_to_num(contact.penetration[segment])
        for start, stop in _join_close_runs(true_runs(force > limit), time.tolist()):
            peak = float(force[start:stop].max())
            if peak > chosen.make_force:
                deepest = float(depth[start:stop].max())
                number = len(touches) + 1
                touches.append(
                    Touch(number, float(time[start]), float(time[stop - 1]), peak, deepest)
                )
    return touches


def _join_close_runs(runs: Iterable[slice], time: list[float]) -> list[tuple[int, int]]:
    joined = list[tuple[int, int]]()
    for run in runs:
        start = run.start
        if joined and time[start] - time[joined[-1][1] - 1] < SHORTEST_LIFT:
            start = joined.pop()[0]
        joined.append((start, run.stop))
    return joined


# Whether there is a touch at all.


def depends_on_position(force: Floats, position: Floats) -> bool:
    """Whether a force depends on the position or its changes: then the probe touches.

    A motion with few samples per period looks like noise. R² of white noise on m terms is about
    m/k, and less than 4 m/k.
    """
    f = force.reshape(len(force), -1)
    p = position.reshape(len(position), -1)
    finite = finite_rows(f, p)
    f = f[finite]
    p = p[finite]
    if len(f) < FEWEST_TO_DEPEND:
        return False
    terms = np.hstack([p, (p - p.mean(axis=0)) ** 2, np.gradient(p, axis=0)])
    terms = terms - terms.mean(axis=0)
    terms = terms / np.maximum(np.abs(terms).max(axis=0), TINY)
    rounding = len(f) * (1e-12 * np.abs(f).max(axis=0)) ** 2  # what a constant axis is left with
    f = f - f.mean(axis=0)
    residual = f - terms @ np.linalg.lstsq(terms, f, rcond=1e-9)[0]
    total = (f**2).sum(axis=0)
    explained = (total - (residual**2).sum(axis=0)) / np.maximum(total, rounding + TINY)
    return bool(explained.max() > LEAST_EXPLAINED + 4.0 * terms.shape[1] / len(f))


def never_touches(force: Floats, position: Floats) -> bool:
    """Whether a force, tared or not, is constant within its noise, wherever the probe is."""
    f = force.reshape(len(force), -1)
    finite = f[finite_rows(f)]
    if not len(finite):
        return False
    noise = math.sqrt(sum(noise_of(component) ** 2 for component in finite.T))
    changes = row_norms(finite - np.median(finite, axis=0))
    constant = not (changes > NOISES_OF_TOUCH * noise).any()
    return constant and not depends_on_position(force, position)


# Load transfer: the force rises as the probe withdraws, since another place carries the load.

# While the probe withdraws, no passive material pushes harder than at the turning point. A heel
# does when the foot has rolled on: 5 to 60 % more, while it rises by a fifth. A force that is 20 ms
# late also continues to rise, but only while the depth is still within a few per cent.
RISE = 1.05
RISE_OF_LARGEST = 0.05
WITHDRAWN = 0.95
FEWEST = 2  # touches, and half of all: a border between two materials is no load transfer
SHORTEST = 20  # samples in a touch that counts
# Samples, or a tenth of the duration of the rise. A jump within this time by most of the rise, or
# by half of the force, is the border of another material. Within this time heels rise by at most
# 0.7 of the rise and 0.3 of the force, borders by 0.75 and 1 or more.
SUDDEN = 5
# of the contact: less has no effect, more leaves too little
LEAST_PART = 0.05
MOST_PART = 0.9


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
    transfer = find_load_transfer(
        contact.penetration, contact.velocity, contact.force, contact.segment
    )
    if transfer is None:
        return contact
    excluded, finding = transfer
    remaining = np.flatnonzero(~excluded)
    gaps = np.diff(remaining, prepend=remaining[0] - 1) > 1
    segment = contact.segment[remaining] + np.cumsum(gaps)
    findings = (*contact.findings, finding)
    return replace(contact.taken(~excluded), segment=segment, findings=findings)


def find_load_transfer(
    depth: Floats, velocity: Floats, force: Floats, segment: Integers
) -> tuple[Mask, Finding] | None:
    """Return the samples while another place carries the load, and a finding; None without any."""
    gate = ContactGate(*_core.gate_of(depth, velocity, force))
    inside = gate.makes(depth, force) & np.isfinite(velocity)
    count = count_true(inside)
    if not count:
        return None
    runs = np.where(inside & (velocity < 0.0), segment, -1)
    starts = np.concatenate([[0], np.flatnonzero(runs[1:] != runs[:-1]) + 1])
    turning = force[starts]
    highest = np.maximum.reduceat(force, starts)
    rising = (runs[starts] >= 0) & (highest > RISE * turning)
    if not rising.any():
        return None
    rising &= highest - turning > RISE_OF_LARGEST * float(np.percentile(force[inside], 99.0))
    # A touch lasts until the probe is out of the material.
    touches = list(run_slices(np.where(inside | (depth > 0.0), segment, -1)))
    excluded = np.zeros(len(depth), dtype=bool)
    transfers = 0
    stops = np.append(starts[1:], len(depth))
    for k in np.flatnonzero(rising).tolist():
        start = int(starts[k])
        peak = start + int(np.argmax(force[start : stops[k]]))
        withdrawn = depth[peak] < WITHDRAWN * depth[start]
        if excluded[start] or not withdrawn or _jumps(force[start : peak + 1]):
            continue
        touch = next(run for run in touches if run.start <= start < run.stop)
        excluded[start : touch.stop] = True
        transfers += 1
    share = count_true(excluded) / count
    long_touches = sum(count_true(inside[touch]) >= SHORTEST for touch in touches)
    fewest = max(FEWEST, 0.5 * long_touches)
    if transfers < fewest or not LEAST_PART < share < MOST_PART:
        return None
    problem = (
        f"in {transfers} touches the force rises while the probe withdraws, so that another place "
        f"carries the load: the rest of them, {percent(share)} of the contact, is left out"
    )
    return excluded, Check.LOAD_TRANSFER.finding(
        problem,
        "if it is the material's own force, run again with --no-reject-outliers",
        severity="with-care",
    )


def _jumps(rise: Floats) -> bool:
    """Whether a rise of the force is sudden: the border of another material."""
    width = max(rise.size // 10, SUDDEN)
    jump = np.max(rise[width:] - rise[:-width], initial=0.0)
    return bool(jump > min(0.9 * (rise[-1] - rise[0]), 0.5 * rise[0]))
