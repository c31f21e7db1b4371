"""Positions and forces that come on two topics, brought together by their stamps."""

from collections import deque
from typing import NamedTuple

from palpate.live.arrivals import Counts, Value
from palpate.live.wires.ordering import LONGEST_OVERTAKING, NANO

# Samples of a topic that wait for the other one: 1 s at 1 kHz, and then they count as unpaired.
WAITING = 1024


class Stamped(NamedTuple):
    """One value of one topic."""

    stamp: int  # ns
    value: Value
    there: float  # s, monotonic


class Pair(NamedTuple):
    """A value of each topic at one time."""

    stamp: int
    leader: Value
    follower: Value
    there: float


class Pairing:
    """Gives a pair for each sample of the leading topic.

    The other topic's value is that with the same stamp; where there is none, it is interpolated by
    a straight line between the two around it, if they are at most twice ``tolerance`` apart;
    else it is the nearest that is at most ``tolerance`` away. A sample that finds none is left out
    and counted as unpaired. Interpolation waits for the later of the two.

    Parameters
    ----------
    tolerance : int
        ns.
    counts : Counts
        Where what is left out is counted.
    """

    def __init__(self, tolerance: int, counts: Counts) -> None:
        self._tolerance, self._counts = tolerance, counts
        self._leaders: deque[Stamped] = deque()
        self._followers: deque[Stamped] = deque(maxlen=WAITING)

    def lead(self, sample: Stamped, *, anew: bool) -> list[Pair]:
        """Take a sample of the leading topic; return the pairs that are complete now.

        ``anew`` says that its clock begins again: what waits belongs to the old one.
        """
        if anew:
            self._unpaired(len(self._leaders), "the clock of the positions or forces was set")
            self._leaders.clear()
            # The other topic's clock begins again too; what came of it already is kept.
            near = [f for f in self._followers if abs(f.stamp - sample.stamp) < LONGEST_OVERTAKING]
            self._followers = deque(near, maxlen=WAITING)
        self._leaders.append(sample)
        if len(self._leaders) > WAITING:
            self._leaders.popleft()
            self._unpaired(1, f"{WAITING} samples of one topic came, and none of the other")
        return self._resolved()

    def follow(self, sample: Stamped, *, anew: bool) -> list[Pair]:
        """Take a sample of the other topic."""
        if anew:
            self._followers.clear()
        self._followers.append(sample)
        return self._resolved()

    def _resolved(self) -> list[Pair]:
        pairs = []
        leaders, followers = self._leaders, self._followers
        while leaders:
            stamp = leaders[0].stamp
            while len(followers) >= 2 and followers[1].stamp <= stamp:
                followers.popleft()
            if not followers or (len(followers) == 1 and followers[0].stamp < stamp):
                break  # the one after it is not there yet
            leader = leaders.popleft()
            value = self._value_at(stamp)
            if value is not None:
                there = max(leader.there, followers[min(1, len(followers) - 1)].there)
                if followers[0].stamp == stamp:
                    there = max(leader.there, followers[0].there)
                pairs.append(Pair(stamp, leader.value, value, there))
        return pairs

    def _value_at(self, stamp: int) -> Value | None:
        before = self._followers[0]
        if before.stamp == stamp:
            return before.value
        if before.stamp > stamp:
            return self._near(before, stamp)
        after = self._followers[1]
        span = after.stamp - before.stamp
        if span <= 2 * self._tolerance:
            return _between(before.value, after.value, (stamp - before.stamp) / span)
        nearer = before if 2 * (stamp - before.stamp) <= span else after
        return self._near(nearer, stamp)

    def _near(self, sample: Stamped, stamp: int) -> Value | None:
        away = abs(sample.stamp - stamp)
        if away <= self._tolerance:
            return sample.value
        self._unpaired(
            1,
            f"the nearest stamp of the other topic is {away / NANO:.3g} s away, more than the "
            f"tolerance of {self._tolerance / NANO:.3g} s",
        )
        return None

    def _unpaired(self, count: int, words: str) -> None:
        if count:
            self._counts.unpaired += count
            self._counts.last_fault = words


def _between(before: Value, after: Value, part: float) -> Value:
    if isinstance(before, tuple) and isinstance(after, tuple):
        x, y, z = (a + part * (b - a) for a, b in zip(before, after, strict=True))
        return x, y, z
    assert isinstance(before, float)  # both are of one topic
    assert isinstance(after, float)
    return before + part * (after - before)
