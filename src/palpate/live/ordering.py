"""What the wires have in common: addresses, the order of samples, messages of ROS, estimates."""

import re
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from statistics import median_high
from typing import Any, NamedTuple
from urllib.parse import parse_qsl

from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.sources import Arrival, Counts, SourceOptions, Value
from palpate.validation import number_in, one_of, shown, whole_in

# What follows the scheme of a wire's address: ``/pose,/wrench?domain=3&tolerance=0.002``.


@dataclass(frozen=True, slots=True)
class WireAddress:
    """A wire's address, taken apart.

    Attributes
    ----------
    scheme : str
        For messages: ``"dds"``.
    target : str
        What stands before the question mark.
    options : mapping
        What stands after it, by name.
    """

    scheme: str
    target: str
    options: Mapping[str, str]

    def one_of(self, name: str, choices: Sequence[str]) -> str:
        """Return an option that has a few possible values, of which the first is the default."""
        value = self.options.get(name, choices[0])
        one_of(f"{self.scheme}: {name}", value, choices)
        return value

    def number(self, name: str, default: float, low: float, high: float) -> float:
        """Return an option that is a number in [low, high]."""
        return number_in(f"{self.scheme}: {name}", self._numeric(name, default), low, high)

    def whole(self, name: str, default: int, low: int, high: int) -> int:
        """Return an option that is a whole number in [low, high]."""
        return whole_in(f"{self.scheme}: {name}", self._numeric(name, default), low, high)

    def _numeric(self, name: str, default: float) -> float:
        text = self.options.get(name, str(default))
        with suppress(ValueError):
            return int(text) if text.isdecimal() else float(text)
        raise InvalidParameterError(f"{self.scheme}: {name} must be a number, not {shown(text)}")


def parsed(scheme: str, address: str, allowed: Sequence[str]) -> WireAddress:
    """Take an address apart, without its scheme.

    Raises
    ------
    InvalidParameterError
        It has an option that this wire does not know, or the same one twice.
    """
    target, _, query = address.partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    options = dict(pairs)
    for name in options:
        if name not in allowed:
            raise InvalidParameterError(
                f"{scheme}: no option {shown(name)}; there are {', '.join(sorted(allowed))}"
            )
    if len(options) != len(pairs):
        raise InvalidParameterError(f"{scheme}: an option is given twice: {shown(query)}")
    return WireAddress(scheme, target, options)


# ROS's names have letters, digits and underscores; what else there is would be a pattern.
_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


def topics_of(address: WireAddress, most: int) -> tuple[str, ...]:
    """Return the names of the topics of an address of ROS, each with its slash.

    Raises
    ------
    InvalidParameterError
        There is none, there are more than ``most``, or one is no name of a topic.
    """
    names = tuple(address.target.split(",")) if address.target else ()
    if not 1 <= len(names) <= most or len(set(names)) != len(names):
        form = "/pose,/wrench: the position's topic and the force's, or one that has both"
        form = form if most == 2 else "/palpate, one name"
        raise InvalidParameterError(
            f"{address.scheme}: topics must be such as {form}; not {shown(address.target)}"
        )
    for name in names:
        if not _NAME.fullmatch(name):
            raise InvalidParameterError(
                f"{address.scheme}: {shown(name)} is no name of a topic, such as /robot/pose"
            )
    return tuple(f"/{name.removeprefix('/')}" for name in names)


# In which order samples came, how many did not, and since when they were there to be taken.

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


class Succession(Enum):
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

    def __init__(self, counts: Counts) -> None:
        self._counts = counts
        self._number: int | None = None
        self._stamp: int | None = None
        self._gaps = Gaps()

    def admit(self, stamp: int, number: int | None = None) -> Succession:
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
        step, counts = stamp - self._stamp, self._counts
        ahead = 0 if number is None or self._number is None else number - self._number
        # An earlier number with a later time: a sender that was restarted.
        if ahead > MOST_LOST + 1 or ahead < 0 < step or (ahead <= 0 and step < -LONGEST_OVERTAKING):
            return self._begin(stamp, number)
        if ahead <= 0 and step <= 0:
            counts.repeated += step == 0
            counts.disordered += step < 0
            return Succession.REFUSED
        counts.lost += ahead - 1 if ahead else self._gaps.see(step)
        self._number, self._stamp = number, stamp
        return Succession.NEXT if step > -LONGEST_OVERTAKING else Succession.ANEW

    def _begin(self, stamp: int, number: int | None) -> Succession:
        self.finish_pending()
        self._number, self._stamp = number, stamp
        return Succession.ANEW

    def finish_pending(self) -> None:
        """Count what is missing in the steps that were not judged yet."""
        self._counts.lost += self._gaps.finish_pending()


class Gaps:
    """Finds samples that are missing by the steps of their stamps.

    A step is usual that is the median of the last six thousand or so. One that is longer by more
    than a half misses samples, as many as there are usual steps in it and in those after it, until
    eight in a row were usual: a busy robot sends late, and then quickly what has waited. A step of
    more than 1 s is a pause of the robot.
    """

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
            self._medians.append(median_high(self._steps))
        usual, missing = median_high(self._medians), 0
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

    def finish_pending(self) -> int:
        """Judge what there is, as nothing more comes; return how many samples are missing."""
        known = self._judge() if len(self._steps) >= 3 or (self._medians and self._steps) else 0
        return known + self._whole()


class Receipt:
    """Since when a sample was there to be taken, by this machine's monotonic clock.

    One that was waited for is there now. One that had been waiting came some time before; it is
    taken to have come after the one before it by as much as its stamp is later.
    """

    def __init__(self) -> None:
        self._stamp, self._there = 0, 0.0

    def there(self, stamp: int, *, waited: bool) -> float:
        """Return the time, s, for a sample that was stamped at ``stamp``, ns."""
        now = time.monotonic()
        if not waited:
            now = min(now, self._there + max(stamp - self._stamp, 0) / NANO)
        self._stamp, self._there = stamp, now
        return now


class Followed:
    """One publisher of a topic: numbers of two that are mixed would belong to nothing."""

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


# What every source on a wire has, whatever its messages are.

#: Letters of what is said of a message: a name in it may have as many as a peer likes.
LONGEST_WORDS = 300


class WireSource:
    """A source, but for the messages, which a wire turns into arrivals.

    Parameters
    ----------
    name : str
        Scheme and address.
    options : SourceOptions
        What is known of the samples.
    streams : int
        Of messages, each of which has an order of its own.
    """

    def __init__(self, name: str, options: SourceOptions, streams: int = 1) -> None:
        self.name, self.sample_time = name, options.sample_time or 1e-3
        self.counts, self._vectors = Counts(), options.vectors
        self._origin: int | None = None
        self._orders = [Order(self.counts) for _ in range(streams)]
        self._ready: deque[Arrival] = deque()

    @property
    def origin(self) -> int:
        """What times are counted from, ns by the sender's clock: the first, if since 1970."""
        return self._origin or 0

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None where none came in time [s]."""
        until = time.monotonic() + timeout
        while not self._ready:
            something = self._receive(0.0) or self._receive(max(until - time.monotonic(), 0.0))
            if not self._ready and time.monotonic() >= until:
                if not something:
                    self.finish_pending()
                return None
        return self._ready.popleft()

    def _receive(self, seconds: float) -> bool:
        """Take what is there, or what comes within a time [s]; whether there was anything."""
        raise NotImplementedError

    def closed(self) -> PalpateError:
        """Return the error of a source that is asked for samples before it is opened."""
        return PalpateError(f"{self.name} is not open")

    def give(self, stamp: int, position: Value, force: Value, there: float) -> None:
        """Have a sample taken next, whose time is counted so that no digits are lost."""
        if self._origin is None:
            # A float of 10⁸ s, three years, has steps of 15 ns; smaller times are left as they are.
            self._origin = stamp if abs(stamp) > 100_000_000 * NANO else 0
        self._ready.append(Arrival((stamp - self._origin) / NANO, position, force, there))

    def refuse(self, words: str) -> None:
        """Count a message that holds no sample."""
        self.counts.malformed += 1
        self.counts.last_fault = words[:LONGEST_WORDS]  # a peer's own may be in it

    def finish_pending(self) -> None:
        """Count what is missing so far."""
        for order in self._orders:
            order.finish_pending()


# Positions and forces that come on two topics, brought together by their stamps.

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
                alone = len(followers) == 1 or followers[0].stamp == stamp
                other = followers[0] if alone else followers[1]
                pairs.append(Pair(stamp, leader.value, value, max(leader.there, other.there)))
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
            part = (stamp - before.stamp) / span
            between: Value = _between(before.value, after.value, part)
            return between
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


def _between(before: Any, after: Any, part: float) -> Any:
    if isinstance(before, tuple):
        return tuple(a + part * (b - a) for a, b in zip(before, after, strict=True))
    return before + part * (after - before)
