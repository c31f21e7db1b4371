"""Delay of the force against the motion: finding it, and taking it out."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from palpate.digits import with_error
from palpate.errors import RecordingError
from palpate.input.preparation.settings import check_delay
from palpate.input.preparation.velocity import find_spikes
from palpate.method.contact import Contact, Delay, add_step
from palpate.method.estimators.least_squares import robust_covariance
from palpate.method.rows import rms
from palpate.validation import Floats, Indices, Integers

LONGEST_FOUND = 50e-3  # s; beyond this or a sixth of the motion's period delays are ambiguous
SCANNED = 13  # shifts of a coarse scan
MOST_SCANNED = 4000  # samples in the scan
MOST_SAMPLES = 400_000  # samples in the search
MOST_ROUNDS = 8
WINDOWS_A_PERIOD = 20  # windows over which noise is averaged, as in the diagnosis
REPEATED = 0.25  # fraction of repeated readings above which a force counts as rounded
LIGHT = 0.1  # fraction of the median depth; at smaller depths contact may be lost


def remove_delay(
    contact: Contact, late: float | tuple[float, float] | Delay | Literal["find"]
) -> Contact:
    """Remove the delay of the force, s, by linear interpolation.

    It shifts the force rather than the motion, because interpolation smooths, and a smoothed
    penetration would change the velocity. If the force is rounded, it shifts the motion and the
    clock instead: an interpolated force would lie between two levels of the sensor, and the error
    of rounding is known only at a level. It drops the samples at an end of a segment whose force or
    motion is then unknown. A delay without a standard error is assumed to be known to half a
    sample.
    """
    if late == 0.0 or not len(contact):
        return contact
    if isinstance(late, str):
        delay = find_delay(contact)
    else:
        delay = check_delay("delay", late, contact.sample_time)
    late = delay.seconds
    if late == 0.0:
        return replace(contact, delay=delay)
    keep = np.zeros(len(contact), dtype=bool)
    is_rounded = np.mean(np.diff(contact.force) == 0.0) > REPEATED
    shifted = ("penetration", "velocity") if is_rounded else ("force",)
    channels = {name: getattr(contact, name).copy() for name in shifted}
    for run in contact.segments():
        time = contact.time[run]
        at = time - late if is_rounded else time + late
        for values in channels.values():
            values[run] = np.interp(at, time, values[run])
        keep[run] = (at >= time[0]) & (at <= time[-1])
    if is_rounded:
        channels["time"] = contact.time - late
    size = with_error(abs(late) * 1e3, delay.standard_error * 1e3, unit="ms")
    provenance = dict(contact.provenance)
    add_step(provenance, "force", f"shifted {size} {'earlier' if late > 0 else 'later'}")
    return replace(contact, **channels, provenance=provenance, delay=delay).taken(keep)


def find_delay(
    contact: Contact, longest: float = LONGEST_FOUND, *, least_samples: int = 1
) -> Delay:
    """Find the delay of the force: the shift of the motion by which Hunt–Crossley fits best.

    The shift is a whole number of samples, because interpolation smooths the motion, and a shift by
    half a sample would then fit clean data better. The remaining delay is the coefficient of dF̂/dτ
    in a regression that also contains the gradient of the law. The regression uses averages over a
    twentieth of the motion's period, and its standard error allows for a correlated residual.

    Parameters
    ----------
    contact : Contact
        The contact.
    longest : float
        Longest delay to look for, s; a sixth of the motion's period if that is shorter. Default: 50
        ms.
    least_samples : int
        Look for a delay of at least this many samples, even if that is longer. Default: 1.

    Raises
    ------
    RecordingError
        There is no contact, or the best shift is the longest.
    """
    contact = contact.taken(slice(MOST_SAMPLES))
    with np.errstate(invalid="ignore"):
        spikes = find_spikes(contact.force)
    contact = replace(contact, force=np.where(spikes, np.nan, contact.force))
    period = motion_period(contact)
    step = contact.sample_time
    reach = int(min(max(longest, least_samples * step), period / 6.0) / step)
    if reach < 1:
        raise _unknown(contact, "there is no contact, or its motion is too fast for the samples")
    shift = _scan(contact, reach)
    width = max(int(period / WINDOWS_A_PERIOD / step), 1)
    for _ in range(MOST_ROUNDS):
        remainder = _find_remainder(contact, shift, width)
        if not abs(shift) < reach or not abs(remainder.seconds) > 0.5 * step:
            break
        shift = int(np.clip(shift + round(remainder.seconds / step), -reach, reach))
    if not math.isfinite(remainder.seconds + remainder.standard_error):
        raise _unknown(contact, "too few samples are in contact")
    if not abs(shift) < reach:
        size = f"{abs(shift) * step * 1e3:.3g} ms"
        raise _unknown(contact, f"the best shift is {size}, the longest that is looked at")
    return replace(remainder, seconds=shift * step + remainder.seconds)


def _scan(contact: Contact, reach: int) -> int:
    """The shift by whole samples, of a coarse scan, that leaves the least noise."""
    from palpate.method.estimators.batch_fit import fit_curves

    shifts = np.unique(np.linspace(-reach, reach, SCANNED).round().astype(int)).tolist()
    every = -(-len(contact) // MOST_SCANNED)
    motions = [_shift_motion(contact, shift) for shift in shifts]
    depths, rates = np.stack(motions, axis=1)[:, :, ::every]
    forces = np.tile(contact.force[::every], (len(shifts), 1))
    noise = fit_curves(depths, rates, forces).noise
    if not np.isfinite(noise).any():
        raise _unknown(contact, "there is no contact")
    return int(shifts[int(np.nanargmin(noise))])


def motion_period(contact: Contact) -> float:
    """Return the period of a sine of the same speed and travel in contact, s; 0 without motion."""
    x, v = contact.penetration, contact.velocity
    inside = (x > 0.0) & np.isfinite(v)
    speed = rms(v[inside]) if inside.any() else 0.0
    return 2.0 * math.pi * float(np.std(x[inside])) / speed if speed > 0.0 else 0.0


def _unknown(contact: Contact, why: str) -> RecordingError:
    message = f"palpate cannot find the delay of the force: {why}; pass it, such as --delay 5ms"
    return RecordingError.of(contact.source, message)


def _shift_motion(contact: Contact, shift: int) -> tuple[Floats, Floats]:
    """Penetration and velocity ``shift`` samples earlier; NaN outside the segment."""
    place = np.arange(len(contact)) - shift
    source = np.clip(place, 0, len(contact) - 1)
    inside = (place == source) & (contact.segment[source] == contact.segment)
    depth = np.where(inside, contact.penetration[source], np.nan)
    return depth, np.where(inside, contact.velocity[source], np.nan)


def _find_remainder(contact: Contact, shift: int, width: int) -> Delay:
    """Return the delay that remains after a shift by whole samples; NaN if unknown."""
    from palpate.method.estimators.batch_fit import fit_curves

    x, v = _shift_motion(contact, shift)
    fit = fit_curves(x, v, contact.force)
    law = fit.law(0)
    motions = [(x, v), *(_shift_motion(contact, shift + by) for by in (1, -1))]
    deep = LIGHT * float(np.nanmedian(x[x > 0.0]))
    used = np.all([(depth > deep) & np.isfinite(rate) for depth, rate in motions], axis=0)
    used &= np.isfinite(contact.force)
    (x, v), later, earlier = ((depth[used], rate[used]) for depth, rate in motions)
    slope = (law.force(*later) - law.force(*earlier)) / (2.0 * contact.sample_time)
    residual = contact.force[used] - law.force(x, v) - float(fit.offset[0])
    columns = np.column_stack([law.parameter_gradient(x, v), np.ones_like(x), slope, residual])
    rows = _means(columns, np.flatnonzero(used), contact.segment[used], width)
    if len(rows) < 2 * columns.shape[1]:
        return Delay(math.nan, math.nan, found=True, from_contact=True)
    law_columns = rows[:, :-2] / np.maximum(np.linalg.norm(rows[:, :-2], axis=0), 1e-300)
    slope, residual = (_remove(column, law_columns) for column in rows[:, -2:].T)
    seconds = float(slope @ residual) / max(float(slope @ slope), 1e-300)
    noise = residual - seconds * slope
    variance = robust_covariance(slope[:, None], noise, (), law_columns.shape[1])[0, 0]
    return Delay(seconds, math.sqrt(variance), found=True, from_contact=True)


def _remove(values: Floats, columns: Floats) -> Floats:
    """The residual of a least squares of values by columns."""
    residual: Floats = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    return residual


def _means(values: Floats, at: Indices, segment: Integers, width: int) -> Floats:
    """Means over windows of up to ``width`` consecutive rows within a segment."""
    width = min(width, max(len(at) // 40, 1))
    border = np.flatnonzero((np.diff(at) != 1) | (np.diff(segment) != 0)) + 1
    runs = np.split(np.arange(len(at)), border)
    starts = np.concatenate([run[: max(len(run) - width + 1, 0) : width] for run in runs])
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    means: Floats = (sums[starts + width] - sums[starts]) / width
    return means
