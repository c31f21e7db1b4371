"""A channel that is held: the same value again and again, at a fixed beat (sample and hold)."""

import math

import numpy as np

from palpate.digits import rounded
from palpate.findings import Check, Finding
from palpate.method.rows import count_true, median, typical_step
from palpate.validation import Floats, Indices, Mask, frozen

LONGEST = 60  # samples between two changes
IN_STEP = 0.9  # least fraction of the changes on one phase
REGULAR = 0.8  # least fraction of regular gaps
IRREGULAR = 0.35  # tolerance of a regular gap, over the mean gap
MOST_HELD = 20_000  # samples that are examined
FEWEST_LEFT = 50  # samples in contact, above a tenth of the largest force


@frozen(eq=False)
class FreshSamples:
    """The samples at which a held channel changes, each measured then.

    Attributes
    ----------
    before : numpy.ndarray of bool, shape (k,)
        Samples from which the velocity is computed: all, or only samples at which the position
        changes.
    after : numpy.ndarray of bool
        Samples of ``before`` to keep after that: all, or the first after each change of the force.
    changes : numpy.ndarray of int, optional
        Changes of the force, if it is interpolated between them because the position is held too.
    late : float or tuple of float
        Delay of the force, s, with its standard error if the rates are no multiples: a value is
        then logged by up to a sample after it was measured.
    finding : Finding
        A note.
    """

    before: Mask
    after: Mask
    changes: Indices | None
    late: float | tuple[float, float]
    finding: Finding

    def taken(self, force: Floats) -> Floats:
        """Return the force, (k,) or (k, 3), at the samples ``before``."""
        at = self.changes
        if at is not None:
            samples = np.arange(len(force))
            force = np.apply_along_axis(lambda axis: np.interp(samples, at, axis[at]), 0, force)
        return force[self.before]


def find_fresh_samples(
    time: Floats, depth: Floats, force: Floats, pressed: Floats
) -> FreshSamples | None:
    """Find the samples to keep of a recording with a held channel; None without one.

    Also None if fewer than 50 samples in contact would remain. If both channels are held, the
    slower one decides.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s.
    depth, force : numpy.ndarray, shape (k,) or (k, 3)
        As recorded.
    pressed : numpy.ndarray, shape (k,)
        Compression with any offset.
    """
    beats = hold_length(_busiest(depth)), hold_length(_busiest(force))
    if not any(beats):
        return None
    moves = _changes(depth)
    pushes = _changes(force)
    force_is_slower = beats[1] > beats[0]
    changes = None
    if not beats[0]:
        velocity_from = np.ones(len(time), dtype=bool)
        keep = pushes
    else:
        velocity_from = moves
        keep = np.ones(count_true(moves), dtype=bool)
        if beats[1]:
            changes = np.flatnonzero(pushes)
            if force_is_slower:
                keep = np.diff(np.cumsum(pushes)[moves], prepend=0) > 0
    low, high = np.nanpercentile(pressed, [1.0, 99.0])
    in_contact = pressed[velocity_from][keep] > 0.9 * low + 0.1 * high
    if count_true(in_contact) < FEWEST_LEFT:
        return None
    late: float | tuple[float, float] = 0.0
    apart = [beat != round(beat) for beat in beats]
    if any(apart):
        step = typical_step(time)
        late = 0.5 * step * (apart[1] - apart[0]), step * math.sqrt(sum(apart) / 12.0)
    name = "force" if force_is_slower else "position"
    finding = report_held_channel(name, max(beats))
    return FreshSamples(velocity_from, keep, changes, late, finding)


def report_held_channel(name: str, beat: float, late: float | None = None) -> Finding:
    """Report a channel that changes every ``beat`` samples; ``late``: mean delay, s, if kept."""
    message = f"the {name} changes only every {beat:.0f} samples (sample and hold): "
    if late is None:
        return Check.HELD_CHANNEL.finding(f"{message}palpate uses the samples at which it changes")
    message += f"it is {rounded(1e3 * late, 2)} ms late on average"
    remedy = "record at the rate of the slowest channel"
    return Check.HELD_CHANNEL.finding(message, remedy, mark="with-care")


def _changes(values: Floats) -> Mask:
    changed: Mask = np.diff(values, axis=0, prepend=values[:1]) != 0.0
    return changed if values.ndim == 1 else np.any(changed, axis=1)


def _busiest(values: Floats) -> Floats:
    """The axis that changes most often, without the samples that are not finite."""
    axes = np.atleast_2d(values.T)
    busiest: Floats = max(axes, key=lambda axis: count_true(np.diff(axis) != 0.0))
    return busiest[np.isfinite(busiest)]


def hold_length(values: Floats) -> float:
    """Mean number of samples for which a held channel keeps a value; 0 if it is not held.

    It is a whole number if all changes fall on one phase, as with clocks in step.
    """
    values = values[:MOST_HELD]
    steps = np.diff(values)
    changes = np.flatnonzero(steps)
    if changes.size < 20 or changes.size > 0.6 * len(values):
        return 0.0
    gaps = np.diff(changes)
    beat = round(median(gaps))
    if not 2 <= beat <= LONGEST or changes.size <= 0.5 * len(values) / beat:
        return 0.0
    # The phase may slip by one sample now and then if the two rates are no multiples.
    if np.bincount(changes % beat, minlength=beat).max() / changes.size > IN_STEP:
        return float(beat)
    # If the rates are no multiples, the gaps are nearly equal. The gaps between the steps of a
    # noisy channel vary, and the steps of a ramp have equal heights.
    mean = float(gaps[gaps < 1.5 * beat].mean())
    regular = np.abs(gaps - mean) < IRREGULAR * mean
    heights = np.abs(steps[changes])
    ramp = np.mean(heights < 1.5 * np.median(heights[heights > 0.0])) > IN_STEP
    return mean if mean > 1.9 and np.mean(regular) > REGULAR and not ramp else 0.0
