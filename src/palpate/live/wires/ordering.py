"""In which order samples came, how many did not, and since when they were there to be taken."""

import time
from collections import deque
from collections.abc import Collection
from enum import Enum

from palpate.live.arrivals import Counts

NANO = 1_000_000_000
# A stamp that is at most so much, ns, before the one of the sample before it is a sample that was
# overtaken. One that is further back is of a clock that was set, or of a robot that was restarted.
LONGEST_OVERTAKING = NANO
# Steps of time that are judged together.
WINDOW = 64
_QUIET = 8  # steps
# A step of more than this, ns, is a pause of the robot: what it did not send is not lost.
LONGEST_GAP = NANO
# A number that is further ahead than this is no gap, 1000 s at 1 kHz, but another count.
MOST_LOST = 1_000_000
# s: a stream follows one publisher, until that one was silent for so long.
SILENCE = 0.5


class Verdict(Enum):
    """What becomes of a sample."""

    NEXT = "next"
    """It follows the one before it."""
    ANEW = "anew"
    """It is the first, or the sender or its clock begins again."""
    REFUSED = "refused"
    """It came twice, or too late, and was counted."""


class Order:
    """Judges the order of one stream of samples; what is wrong it counts.

    By the sender's own number where the wire has one, and without by the gaps in time:
    :class:`Gaps`.

    Parameters
    ----------
    counts : Counts
        Where it counts.
    """

    __slots__ = ("_counts", "_gaps", "_number", "_stamp")

    def __init__(self, counts: Counts) -> None:
        self._counts = counts
        self._number: int | None = None
        self._stamp: int | None = None
        self._gaps = Gaps()

    def admit(self, stamp: int, number: int | None = None) -> Verdict:
        """Judge a sample.

        Parameters
        ----------
        stamp : int
            Its time by the sender's clock, ns.
        number : int, optional
            Its number by the sender's count.
        """
        if self._stamp is None:
            return self._begin(stamp, number)
        step = stamp - self._stamp
        before = self._number
        if number is not None and before is not None and number != before:
            if number > before:
                missing = number - before - 1
                if missing > MOST_LOST:
                    return self._begin(stamp, number)
                self._counts.lost += missing
                self._number, self._stamp = number, stamp
                return Verdict.NEXT if step > -LONGEST_OVERTAKING else Verdict.ANEW
            if step > 0:  # an earlier number with a later time: a sender that was restarted
                return self._begin(stamp, number)
        return self._by_time(stamp, step, number)

    def _by_time(self, stamp: int, step: int, number: int | None) -> Verdict:
        if step == 0:
            self._counts.repeated += 1
            return Verdict.REFUSED
        if step < 0:
            if step < -LONGEST_OVERTAKING:
                return self._begin(stamp, number)
            self._counts.disordered += 1
            return Verdict.REFUSED
        self._number, self._stamp = number, stamp
        self._counts.lost += self._gaps.see(step)
        return Verdict.NEXT

    def _begin(self, stamp: int, number: int | None) -> Verdict:
        self.settle()
        self._number, self._stamp = number, stamp
        return Verdict.ANEW

    def settle(self) -> None:
        """Count what is missing in the steps that were not judged yet."""
        self._counts.lost += self._gaps.settle()


class Gaps:
    """Finds samples that are missing by the steps of their stamps.

    A step is usual that is the median of the last six thousand or so. One that is longer by more
    than a half misses samples, as many as there are usual steps in it and in those after it, until
    eight in a row were usual: a busy robot sends late, and then quickly what has waited. A step of
    more than 1 s is a pause of the robot.
    """

    __slots__ = ("_balance", "_medians", "_quiet", "_steps")

    def __init__(self) -> None:
        self._steps: list[int] = []
        self._medians: deque[int] = deque(maxlen=99)
        self._balance, self._quiet = 0.0, _QUIET

    def see(self, step: int) -> int:
        """Take a step, ns; return how many more samples are known to be missing."""
        if step <= LONGEST_GAP:
            self._steps.append(step)
        return self._judge() if len(self._steps) >= WINDOW else 0

    def _judge(self) -> int:
        if len(self._steps) >= _QUIET or not self._medians:
            self._medians.append(_median(self._steps))
        usual, missing = _median(self._medians), 0
        for step in self._steps:
            apart = step / usual - 1.0
            if self._quiet >= _QUIET:
                if apart > 0.5:
                    self._balance, self._quiet = apart, 0
                continue
            self._balance += apart
            self._quiet = self._quiet + 1 if abs(apart) <= 0.5 else 0
            if self._quiet >= _QUIET:
                missing += self._whole()
        self._steps.clear()
        return missing

    def _whole(self) -> int:
        """Whole samples that are missing; less than 0.7 of one is a robot's unevenness."""
        missing, self._balance, self._quiet = int(max(self._balance + 0.3, 0.0)), 0.0, _QUIET
        return missing

    def settle(self) -> int:
        """Judge what there is, as nothing more comes; return how many samples are missing."""
        known = self._judge() if len(self._steps) >= 3 or (self._medians and self._steps) else 0
        return known + self._whole()


def _median(values: Collection[int]) -> int:
    return sorted(values)[len(values) // 2]


class Receipt:
    """Since when a sample was there to be taken, by this machine's monotonic clock.

    One that was waited for is there now. One that had been waiting came some time before; it is
    taken to have come after the one before it by as much as its stamp is later.
    """

    __slots__ = ("_stamp", "_there")

    def __init__(self) -> None:
        self._stamp, self._there = 0, 0.0

    def there(self, stamp: int, *, waited: bool) -> float:
        """Return the time, s, for a sample that was stamped at ``stamp``, ns."""
        now = time.monotonic()
        if not waited:
            now = min(now, self._there + max(stamp - self._stamp, 0) / NANO)
        self._stamp, self._there = stamp, now
        return now


class Origin:
    """What times are counted from, ns, so that no digits are lost: the first, if since 1970."""

    __slots__ = ("value",)

    def __init__(self) -> None:
        self.value: int | None = None

    def seconds(self, stamp: int) -> float:
        """Return a time, s, from the origin."""
        if self.value is None:
            # A float of 10⁸ s, three years, has steps of 15 ns; smaller times are left as they are.
            self.value = stamp if abs(stamp) > 100_000_000 * NANO else 0
        return (stamp - self.value) / NANO


class Followed:
    """One publisher of a topic: numbers of two that are mixed would belong to nothing."""

    __slots__ = ("_heard", "_who")

    def __init__(self) -> None:
        self._who: object = None
        self._heard = -SILENCE

    def accepts(self, who: object) -> bool:
        """Whether a sample is of the publisher that is followed."""
        now = time.monotonic()
        if who != self._who and now - self._heard < SILENCE:
            return False
        self._who, self._heard = who, now
        return True
