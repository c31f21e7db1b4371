"""Delay of the force against the motion: finding it, and taking it out."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact, Delay, add_step
from palpate.digits import with_error
from palpate.errors import RecordingError
from palpate.estimators.batch_fit import fit_curves
from palpate.estimators.least_squares import robust_covariance
from palpate.preparation.settings import check_delay
from palpate.preparation.velocity import find_spikes
from palpate.validation import Floats

LONGEST_FOUND = 50e-3  # s; beyond this or a sixth of the motion's period delays are ambiguous
SCANNED = 13  # shifts of a coarse scan
MOST_SCANNED, MOST_SAMPLES = 4000, 400_000  # largest numbers of samples: in the scan, in the search
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
    rounded = np.mean(np.diff(contact.force) == 0.0) > REPEATED
    moved = ("penetration", "velocity") if rounded else ("force",)
    channels = {name: getattr(contact, name).copy() for name in moved}
    for part in contact.segments():
        time = contact.time[part]
        wanted = time - late if rounded else time + late
        for name, values in channels.items():
            values[part] = np.interp(wanted, time, getattr(contact, name)[part])
        keep[part] = (wanted >= time[0]) & (wanted <= time[-1])
    if rounded:
        channels["time"] = contact.time - late
    made = dict(contact.provenance)
    size = with_error(abs(late) * 1e3, delay.standard_error * 1e3, unit="ms")
    add_step(made, "force", f"shifted {size} {'earlier' if late > 0 else 'later'}")
    return replace(contact, **channels, provenance=made, delay=delay).taken(keep)


def find_delay(contact: Contact, longest: float = LONGEST_FOUND) -> Delay:
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

    Raises
    ------
    RecordingError
        There is no contact, or the best shift is the longest.
    """
    contact = contact.taken(slice(MOST_SAMPLES))
    with np.errstate(invalid="ignore"):
        lost = find_spikes(contact.force)
    contact = replace(contact, force=np.where(lost, np.nan, contact.force))
    period, step = motion_period(contact), contact.sample_time
    reach = int(min(longest, period / 6.0) / step)
    if reach < 1:
        raise _unknown(contact, "there is no contact, or its motion is too fast for the samples")
    width = max(int(period / WINDOWS_A_PERIOD / step), 1)
    every = -(-len(contact) // MOST_SCANNED)
    scan = np.unique(np.linspace(-reach, reach, SCANNED).round().astype(int)).tolist()
    motions = [_shift_motion(contact, shift) for shift in scan]
    depths, rates = np.stack(motions, axis=1)[:, :, ::every]
    forces = np.tile(contact.force[::every], (len(scan), 1))
    noise = fit_curves(depths, rates, forces).noise
    if not np.isfinite(noise).any():
        raise _unknown(contact, "there is no contact")
    shift, rest, error = scan[int(np.nanargmin(noise))], 0.0, math.nan
    for _ in range(MOST_ROUNDS):
        rest, error = _rest(contact, shift, width)
        if not abs(shift) < reach or not abs(rest) > 0.5 * step:
            break
        shift = int(np.clip(shift + round(rest / step), -reach, reach))
    if not math.isfinite(rest + error):
        raise _unknown(contact, "too few samples are in contact")
    if not abs(shift) < reach:
        words = f"the best shift is {abs(shift) * step * 1e3:.3g} ms, the longest that is looked at"
        raise _unknown(contact, words)
    return Delay(shift * step + rest, error, found=True, from_contact=True)


def motion_period(contact: Contact) -> float:
    """Return the period of a sine of the same speed and travel in contact, s; 0 without motion."""
    x, v = contact.penetration, contact.velocity
    inside = (x > 0.0) & np.isfinite(v)
    speed = math.sqrt(float(np.mean(v[inside] ** 2))) if inside.any() else 0.0
    return 2.0 * math.pi * float(np.std(x[inside])) / speed if speed > 0.0 else 0.0


def _unknown(contact: Contact, why: str) -> RecordingError:
    words = "palpate cannot find the delay of the force"
    return RecordingError.of(contact.source, f"{words}: {why}; pass it, such as --delay 5ms")


def _shift_motion(contact: Contact, shift: int) -> tuple[Floats, Floats]:
    """Penetration and velocity ``shift`` samples earlier; NaN outside the segment."""
    place = np.arange(len(contact)) - shift
    there = np.clip(place, 0, len(contact) - 1)
    known = (place == there) & (contact.segment[there] == contact.segment)
    x, v = contact.penetration[there], contact.velocity[there]
    return np.where(known, x, np.nan), np.where(known, v, np.nan)


def _rest(contact: Contact, shift: int, width: int) -> tuple[float, float]:
    """Return the delay that remains after a shift by whole samples, and its standard error, s."""
    (x, v), force = _shift_motion(contact, shift), contact.force
    fit = fit_curves(x, v, force)
    law, offset = fit.law(0), float(fit.offset[0])
    motion = [(x, v), *(_shift_motion(contact, shift + by) for by in (1, -1))]
    deep = LIGHT * float(np.nanmedian(x[x > 0.0]))
    used = np.all([(each > deep) & np.isfinite(rate) for each, rate in motion], axis=0)
    used &= np.isfinite(force)
    (x, v), *around = [(each[used], rate[used]) for each, rate in motion]
    later, earlier = (law.force(*each) for each in around)
    slope = (later - earlier) / (2.0 * contact.sample_time)
    residual = force[used] - law.force(x, v) - offset
    columns = np.column_stack([law.parameter_gradient(x, v), np.ones_like(x), slope, residual])
    rows = _means(columns, np.flatnonzero(used), contact.segment[used], width)
    if len(rows) < 2 * columns.shape[1]:
        return math.nan, math.nan
    own, (slope, residual) = rows[:, :-2], rows[:, -2:].T
    own = own / np.maximum(np.linalg.norm(own, axis=0), 1e-300)
    left, after = (
        (each - own @ np.linalg.lstsq(own, each, rcond=None)[0]) for each in (slope, residual)
    )
    rest = float(left @ after / max(left @ left, 1e-300))
    variance = robust_covariance(left[:, None], after - rest * left, (), own.shape[1])[0, 0]
    return rest, math.sqrt(variance)


def _means(values: Floats, at: NDArray[np.intp], segment: NDArray[np.int64], width: int) -> Floats:
    """Means over windows of up to ``width`` consecutive rows within a segment."""
    width = min(width, max(len(at) // 40, 1))
    border = np.flatnonzero((np.diff(at) != 1) | (np.diff(segment) != 0)) + 1
    runs = np.split(np.arange(len(at)), border)
    starts = np.concatenate([run[: max(len(run) - width + 1, 0) : width] for run in runs])
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    means: Floats = (sums[starts + width] - sums[starts]) / width
    return means
