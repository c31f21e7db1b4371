"""Time as it was stamped, made to run forward: what is skipped, and where it starts again."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import SHORTEST_STEP
from palpate.remarks import Remark
from palpate.validation import Floats

# A recorder that was started again begins at an earlier time, and goes on from there; a late
# message is followed by one that is later than all before it.
RESTART = 10  # samples in a row
GAP = 10.0  # median steps
MOST_SKIPPED = 0.02  # of the samples; more calls for care
MOST_BACKWARD = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Which samples are taken, by their time.

    Attributes
    ----------
    keep : numpy.ndarray of bool, shape (k,)
        Those with a time that is later than all before it since the last start.
    part : numpy.ndarray of int, shape (k,)
        A number that grows where the label changes, or the recording starts again.
    restarts : int
        How often it starts again.
    first_wrong : int
        The first sample that is not taken, or with which it starts again; −1 where there is none.
    untimed, repeated, late : int
        How many have no time, the time of the one before, or an earlier one.
    """

    keep: NDArray[np.bool_]
    part: NDArray[np.int64]
    restarts: int
    first_wrong: int
    untimed: int
    repeated: int
    late: int

    @property
    def skipped(self) -> int:
        """How many are not taken."""
        return self.untimed + self.repeated + self.late

    def remarks(self, what: str) -> list[Remark]:
        """Say what was skipped, and whether the recording was started again."""
        found = []
        if self.skipped:
            reasons = {
                "without a time": self.untimed,
                "with the time of the one before": self.repeated,
                "with an earlier time": self.late,
            }
            listed = ", ".join(f"{count} {words}" for words, count in reasons.items() if count)
            many = self.skipped > MOST_SKIPPED * self.keep.size
            found.append(
                Remark(
                    "rows",
                    f"{self.skipped} of {self.keep.size} {what} were skipped: {listed}",
                    "look at the recorder's clock; --strict refuses them",
                    "with-care" if many else "note",
                )
            )
        if self.restarts:
            times = "once" if self.restarts == 1 else f"{self.restarts} times"
            words = f"the time starts again {times}: contacts are kept apart there"
            found.append(Remark("rows", words))
        return found


def rows_of(
    time: NDArray[np.int64] | Floats,
    label: NDArray[np.int64] | None = None,
    *,
    largest: float = math.inf,
) -> Rows:
    """Say which samples have a time that increases.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        In any unit; whole numbers stay exact.
    label : numpy.ndarray of int, shape (k,), optional
        Changes where a separate contact begins: time may then be anything.
    largest : float
        What is beyond is no time, in the same unit.
    """
    timed = np.isfinite(time) & (np.abs(time) <= largest)
    t, given = time[timed], np.zeros(time.size, np.int64) if label is None else label
    own = given[timed]
    keep, part = np.ones(t.size, dtype=bool), np.zeros(t.size, dtype=np.int64)
    repeated, number = 0, 0
    again: list[int] = []
    for start, stop in runs_of(own):
        starts = _starts(t[start:stop])
        again += [start + each for each in starts]
        for low, high in pairwise([0, *starts, stop - start]):
            inside = t[start + low : start + high]
            before = np.maximum.accumulate(inside)[:-1]
            with np.errstate(over="ignore"):  # of absurd times
                later = (inside[1:] > before) & (inside[1:] - before >= SHORTEST_STEP)
            keep[start + low + 1 : start + high] = later
            repeated += int(np.count_nonzero(~later & (inside[1:] >= before)))
            part[start + low : start + high] = number
            number += 1
    late = int(np.count_nonzero(~keep)) - repeated
    taken, parts = np.zeros(time.size, dtype=bool), np.zeros(time.size, dtype=np.int64)
    taken[timed], parts[timed] = keep, part
    wrong = [*np.flatnonzero(timed)[again[:1]].tolist(), *np.flatnonzero(~taken)[:1].tolist()]
    untimed = int(np.count_nonzero(~timed))
    return Rows(taken, parts, len(again), min(wrong, default=-1), untimed, repeated, max(late, 0))


def runs_of(label: NDArray[Any]) -> list[tuple[int, int]]:
    """Where each run of equal labels starts and stops."""
    if not label.size:
        return []
    borders = np.flatnonzero(label[1:] != label[:-1]) + 1
    return list(pairwise([0, *borders.tolist(), label.size]))


def _starts(t: NDArray[np.int64] | Floats) -> list[int]:
    """Where time falls and goes on from there: the recorder was started again."""
    falls = np.flatnonzero(t[1:] < t[:-1]) + 1 if t.size else np.empty(0, dtype=np.int64)
    if falls.size > MOST_BACKWARD * t.size:  # it does not start again, it runs backward
        return []
    found: list[int] = []
    last = 0
    for k in falls.tolist():
        after = t[k : k + RESTART]
        on = after.size == RESTART and bool((np.diff(after) > 0).all())
        if on and after[-1] < t[last:k].max():
            found.append(k)
            last = k
    return found


def gaps(time: Floats, part: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Say of each sample whether a gap lies before it.

    Longer than ten steps, by the median of the five before it and of the five after it, whichever
    is larger: where the rate changes there is no gap.
    """
    steps = np.diff(time)
    inside = part[1:] == part[:-1]
    found = np.zeros(time.size, dtype=bool)
    if not inside.any():
        return found
    far = np.flatnonzero(inside & (steps > GAP * float(np.median(steps[inside]))))
    for k in far.tolist():
        around = [steps[max(k - 5, 0) : k], steps[k + 1 : k + 6]]
        usual = max((float(np.median(each)) for each in around if each.size), default=0.0)
        found[k + 1] = steps[k] > GAP * usual > 0.0
    return found
