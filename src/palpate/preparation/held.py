"""A channel that is held: the same value again and again, at a fixed beat (sample and hold)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.digits import rounded
from palpate.findings import Check, Finding
from palpate.validation import Floats

LONGEST = 60  # samples between two changes
IN_STEP = 0.9  # least fraction of the changes on one phase
REGULAR, IRREGULAR = 0.8, 0.35  # least fraction of regular gaps; their tolerance over their mean
MOST_HELD = 20_000  # samples that are examined
FEWEST_LEFT = 50  # samples in contact, above a tenth of the largest force


@dataclass(frozen=True, slots=True, eq=False)
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

    before: NDArray[np.bool_]
    after: NDArray[np.bool_]
    changes: NDArray[np.intp] | None
    late: float | tuple[float, float]
    finding: Finding

    def taken(self, force: Floats) -> Floats:
        """Return the force, (k,) or (k, 3), at the samples ``before``."""
        at = self.changes
        if at is not None:
            wanted = np.arange(len(force))
            force = np.apply_along_axis(lambda each: np.interp(wanted, at, each[at]), 0, force)
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
    beats = [hold_length(_busiest(each)) for each in (depth, force)]
    if not any(beats):
        return None
    slower = int(beats[1] > beats[0])
    beat, name = beats[slower], ("position", "force")[slower]
    moved, felt = _changes(depth), _changes(force)
    before, after, at = np.ones(len(time), dtype=bool), felt, None
    if beats[0]:
        before, after = moved, np.ones(np.count_nonzero(moved), dtype=bool)
        if beats[1]:
            at = np.flatnonzero(felt)
            if slower:
                after = np.diff(np.cumsum(felt)[before], prepend=0) > 0
    low, high = np.nanpercentile(pressed, [1.0, 99.0])
    if np.count_nonzero(pressed[before][after] > 0.9 * low + 0.1 * high) < FEWEST_LEFT:
        return None
    step = float(np.median(np.diff(time)))
    apart = [each != round(each) for each in beats]
    late = 0.5 * step * (apart[1] - apart[0]), step * math.sqrt(sum(apart) / 12.0)
    finding = report_held_channel(name, beat)
    return FreshSamples(before, after, at, late if any(apart) else 0.0, finding)


def report_held_channel(name: str, beat: float, late: float | None = None) -> Finding:
    """Report a channel that changes every ``beat`` samples; ``late``: mean delay, s, if kept."""
    words = f"the {name} changes only every {beat:.0f} samples (sample and hold): "
    if late is None:
        return Check.HELD_CHANNEL.finding(f"{words}palpate uses the samples at which it changes")
    words += f"it is {rounded(1e3 * late, 2)} ms late on average"
    remedy = "record at the rate of the slowest channel"
    return Check.HELD_CHANNEL.finding(words, remedy, mark="with-care")


def _changes(values: Floats) -> NDArray[np.bool_]:
    changed: NDArray[np.bool_] = np.diff(values, axis=0, prepend=values[:1]) != 0.0
    return changed if values.ndim == 1 else np.any(changed, axis=1)


def _busiest(values: Floats) -> Floats:
    """The axis that changes most often, without the samples that are not finite."""
    busiest: Floats = max(np.atleast_2d(values.T), key=lambda each: np.count_nonzero(np.diff(each)))
    return busiest[np.isfinite(busiest)]


def hold_length(values: Floats) -> float:
    """Mean number of samples for which a held channel keeps a value; 0 if it is not held.

    It is a whole number if all changes fall on one phase, as with clocks in step.
    """
    values = values[:MOST_HELD]
    changes = np.diff(values)
    at = np.flatnonzero(changes)
    if at.size < 20 or at.size > 0.6 * len(values):
        return 0.0
    gaps = np.diff(at)
    beat = round(float(np.median(gaps)))
    if not 2 <= beat <= LONGEST or at.size <= 0.5 * len(values) / beat:
        return 0.0
    # The phase may slip by one sample now and then if the two rates are no multiples.
    if np.bincount(at % beat, minlength=beat).max() / at.size > IN_STEP:
        return float(beat)
    # If the rates are no multiples, the gaps are nearly equal. The gaps between the steps of a
    # noisy channel vary, and the steps of a ramp have equal heights.
    mean = float(gaps[gaps < 1.5 * beat].mean())
    regular = np.abs(gaps - mean) < IRREGULAR * mean
    jumps = np.abs(changes[at])
    ramp = np.mean(jumps < 1.5 * np.median(jumps[jumps > 0.0])) > IN_STEP
    return mean if mean > 1.9 and np.mean(regular) > REGULAR and not ramp else 0.0
