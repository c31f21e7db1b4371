"""The common part of all wires: addresses, the order of samples, pairs of topics, publishing.

Each wire has a module with its source of samples and its publisher: :mod:`~palpate.live.zeromq`,
:mod:`~palpate.live.dds` and :mod:`~palpate.live.zenoh`; the last two share the messages of ROS 2,
:mod:`~palpate.live.ros`.
"""

import re
import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from enum import Enum
from multiprocessing.connection import Connection
from statistics import median_high
from typing import Any, NamedTuple, Protocol
from urllib.parse import parse_qsl

import numpy as np

from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.schema import RunState, describe_status, estimates, read_run
from palpate.live.sinks import PLACE, Sink, Watching, unpack_parameters
from palpate.live.sources import (
    SOURCES,
    Arrival,
    Counts,
    Orientation,
    SourceOptions,
    Value,
    find_wire,
)
from palpate.validation import Floats, check_choice, frozen, number_in, shown, whole_in

# The part of an address after its scheme: ``/pose,/wrench?domain=3&tolerance=0.002``.


@frozen
class WireAddress:
    """A wire's address, parsed.

    Attributes
    ----------
    scheme : str
        Such as ``"dds"``; used in error messages.
    target : str
        The part before the question mark.
    options : mapping
        The options after it, by name.
    """

    scheme: str
    target: str
    options: Mapping[str, str]

    def one_of(self, name: str, choices: Sequence[str]) -> str:
        """Return an option that is one of ``choices``. Default: the first."""
        value = self.options.get(name, choices[0])
        check_choice(f"{self.scheme}: {name}", value, choices)
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


def parse_address(scheme: str, address: str, allowed: Sequence[str]) -> WireAddress:
    """Parse an address without its scheme.

    Raises
    ------
    InvalidParameterError
        The address has an unknown option, or the same option twice.
    """
    target, _, query = address.partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    options = dict(pairs)
    for name in options:
        if name not in allowed:
            raise InvalidParameterError(
                f"{scheme}: unknown option {shown(name)}; known are {', '.join(sorted(allowed))}"
            )
    if len(options) != len(pairs):
        raise InvalidParameterError(f"{scheme}: duplicate option in {shown(query)}")
    return WireAddress(scheme, target, options)


# Names in ROS have letters, digits and underscores only; Zenoh reads other characters as patterns.
_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


def topic_names(address: WireAddress, most: int) -> tuple[str, ...]:
    """Return the topic names in a ROS address, each with its leading slash.

    Raises
    ------
    InvalidParameterError
        There are no topics, more than ``most``, duplicates, or invalid names.
    """
    names = tuple(address.target.split(",")) if address.target else ()
    if not 1 <= len(names) <= most or len(set(names)) != len(names):
        form = "/pose,/wrench (position and force), or a single topic that contains both"
        form = form if most == 2 else "/palpate (a single prefix)"
        raise InvalidParameterError(
            f"{address.scheme}: topics must have the form {form}, not {shown(address.target)}"
        )
    for name in names:
        if not _NAME.fullmatch(name):
            raise InvalidParameterError(
                f"{address.scheme}: {shown(name)} is not a valid topic name, such as /robot/pose"
            )
    return tuple(f"/{name.removeprefix('/')}" for name in names)


# Order of the samples, losses, and the time at which each became available.

NANO = 1_000_000_000
# ns: a sample that is older than the one before by at most this was overtaken on the way. An older
# one means that the clock was set or the robot restarted.
LONGEST_OVERTAKING = NANO
# Time steps evaluated together.
WINDOW = 64
_QUIET = 8  # steps
# ns: a longer step is a pause of the robot, without lost samples.
LONGEST_GAP = NANO
# A larger jump of the sample number, 1000 s at 1 kHz, is a restarted count and no loss.
MOST_LOST = 1_000_000
# s of silence after which a stream may follow another publisher.
SILENCE = 0.5


class Succession(Enum):
    """Verdict on the order of a sample."""

    NEXT = "next"
    """The sample follows the one before it."""
    ANEW = "anew"
    """The sample is the first, or the first after a restart of the sender or its clock."""
    REFUSED = "refused"
    """The sample is a duplicate or too late; it is counted and dropped."""


class Order:
    """Checks the order of one stream of samples and counts losses.

    It uses the sender's sample number if the wire has one, otherwise the gaps in time
    (:class:`Gaps`).

    Parameters
    ----------
    counts : Counts
        Receives the counts.
    """

    def __init__(self, counts: Counts) -> None:
        self._counts = counts
        self._number: int | None = None
        self._stamp: int | None = None
        self._gaps = Gaps()

    def admit(self, stamp: int, number: int | None = None) -> Succession:
        """Check a sample.

        Parameters
        ----------
        stamp : int
            Time of the sample on the sender's clock, ns.
        number : int, optional
            The sender's sample number.
        """
        if self._stamp is None:
            return self._begin(stamp, number)
        step = stamp - self._stamp
        counts = self._counts
        ahead = 0 if number is None or self._number is None else number - self._number
        # A smaller number with a later time: the sender was restarted.
        if ahead > MOST_LOST + 1 or ahead < 0 < step or (ahead <= 0 and step < -LONGEST_OVERTAKING):
            return self._begin(stamp, number)
        if ahead <= 0 and step <= 0:
            counts.repeated += step == 0
            counts.disordered += step < 0
            return Succession.REFUSED
        counts.lost += ahead - 1 if ahead else self._gaps.see(step)
        self._number = number
        self._stamp = stamp
        return Succession.NEXT if step > -LONGEST_OVERTAKING else Succession.ANEW

    def _begin(self, stamp: int, number: int | None) -> Succession:
        self.finish_pending()
        self._number = number
        self._stamp = stamp
        return Succession.ANEW

    def finish_pending(self) -> None:
        """Count the losses in the steps that are not evaluated yet."""
        self._counts.lost += self._gaps.finish_pending()


class Gaps:
    """Finds missing samples from the steps between timestamps.

    The nominal step is the median of about the last 6000. A step longer than 1.5 nominal steps
    starts a gap, which ends with eight nominal steps in a row: a busy robot sends samples late, and
    then several quickly. The gap's duration in nominal steps gives the number of missing samples.
    A step of more than 1 s is a pause of the robot.
    """

    def __init__(self) -> None:
        self._steps: list[int] = []
        self._medians: deque[int] = deque(maxlen=99)
        self._balance = 0.0
        self._quiet = _QUIET

    def see(self, step: int) -> int:
        """Add a step, ns; return how many more samples are missing."""
        if step <= LONGEST_GAP:
            self._steps.append(step)
        return self._judge() if len(self._steps) >= WINDOW else 0

    def _judge(self) -> int:
        if len(self._steps) >= _QUIET or not self._medians:
            self._medians.append(median_high(self._steps))
        usual = median_high(self._medians)
        missing = 0
        for step in self._steps:
            apart = step / usual - 1.0
            if self._quiet >= _QUIET:
                if apart > 0.5:
                    self._balance = apart
                    self._quiet = 0
                continue
            self._balance += apart
            self._quiet = self._quiet + 1 if abs(apart) <= 0.5 else 0
            if self._quiet >= _QUIET:
                missing += self._whole()
        self._steps.clear()
        return missing

    def _whole(self) -> int:
        """Return the number of missing samples; less than 0.7 of one is jitter."""
        missing = int(max(self._balance + 0.3, 0.0))
        self._balance = 0.0
        self._quiet = _QUIET
        return missing

    def finish_pending(self) -> int:
        """Evaluate the remaining steps; return how many samples are missing."""
        known = self._judge() if len(self._steps) >= 3 or (self._medians and self._steps) else 0
        return known + self._whole()


class Receipt:
    """Estimates when each sample became available, on this machine's monotonic clock.

    A sample that the loop waited for became available now. A sample from the queue is assumed to
    have followed the previous one after the difference of their timestamps.
    """

    def __init__(self) -> None:
        self._stamp = 0
        self._there = 0.0

    def there(self, stamp: int, *, waited: bool) -> float:
        """Return the time, s, of a sample with the timestamp ``stamp``, ns."""
        now = time.monotonic()
        if not waited:
            now = min(now, self._there + max(stamp - self._stamp, 0) / NANO)
        self._stamp = stamp
        self._there = now
        return now


class Followed:
    """The publisher that a topic follows, so that samples of two publishers never mix."""

    def __init__(self) -> None:
        self._who: object = None
        self._heard = -SILENCE

    def accepts(self, who: object) -> bool:
        """Whether to accept a sample of publisher ``who``."""
        now = time.monotonic()
        if who != self._who and now - self._heard < SILENCE:
            return False
        self._who = who
        self._heard = now
        return True


# The common part of all sources on a wire.

#: Longest description of a fault, characters: it may contain names that a peer chose.
LONGEST_WORDS = 300


class WireSource:
    """Base of the sources on a wire, which turn messages into arrivals.

    Parameters
    ----------
    name : str
        Scheme and address.
    options : SourceOptions
        Options of the source.
    streams : int
        Number of streams of messages; the order of each is checked separately. Default: 1.
    """

    def __init__(self, name: str, options: SourceOptions, streams: int = 1) -> None:
        self.name = name
        self.sample_time = options.sample_time or 1e-3
        self.counts = Counts()
        self._vectors = options.vectors
        self._orientation = options.orientation
        self._origin: int | None = None
        self._orders = [Order(self.counts) for _ in range(streams)]
        self._ready: deque[Arrival] = deque()

    @property
    def origin(self) -> int:
        """Zero of the times, ns on the sender's clock: the first timestamp if after 1970."""
        return self._origin or 0

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None if none arrives within ``timeout``, s."""
        until = time.monotonic() + timeout
        while not self._ready:
            something = self._receive(0.0) or self._receive(max(until - time.monotonic(), 0.0))
            if not self._ready and time.monotonic() >= until:
                if not something:
                    self.finish_pending()
                return None
        return self._ready.popleft()

    def _receive(self, seconds: float) -> bool:
        """Read the messages that arrive within a time, s; return whether there were any."""
        raise NotImplementedError

    def not_open_error(self) -> PalpateError:
        """Return the error for a source that is read before it is opened."""
        return PalpateError(f"{self.name} is not open")

    def give(
        self,
        stamp: int,
        position: Value,
        force: Value,
        there: float,
        orientation: Orientation | None = None,
    ) -> None:
        """Queue a sample, with its time relative to the origin so that no digits are lost."""
        if self._origin is None:
            # A float of 10⁸ s, three years, resolves 15 ns; smaller times need no origin.
            self._origin = stamp if abs(stamp) > 100_000_000 * NANO else 0
        time = (stamp - self._origin) / NANO
        self._ready.append(Arrival(time, position, force, there, orientation))

    def refuse(self, words: str) -> None:
        """Count a message without a valid sample."""
        self.counts.malformed += 1
        self.counts.last_fault = words[:LONGEST_WORDS]  # it may contain a peer's text

    def finish_pending(self) -> None:
        """Count the samples missing so far."""
        for order in self._orders:
            order.finish_pending()


# Pairing of positions and forces from two topics by their timestamps.

# Samples of a topic that wait for the other topic, 1 s at 1 kHz; further ones are unpaired.
WAITING = 1024


class Stamped(NamedTuple):
    """A value of one topic, or a position and an orientation, with its timestamp."""

    stamp: int  # ns
    value: Value | tuple[float, ...]
    there: float  # s, monotonic


class Pair(NamedTuple):
    """The values of both topics at one time."""

    stamp: int
    leader: Value | tuple[float, ...]
    follower: Value | tuple[float, ...]
    there: float


class Pairing:
    """Pairs each sample of the leading topic with a value of the other topic.

    That value is the one with the same timestamp. Otherwise it is interpolated linearly between its
    two neighbours, if these are at most twice ``tolerance`` apart, else it is the nearest within
    ``tolerance``. A sample without a partner is skipped and counted as unpaired. Interpolation
    waits for the later neighbour.

    Parameters
    ----------
    tolerance : int
        Largest time between the samples of a pair, ns.
    counts : Counts
        Receives the count of unpaired samples.
    """

    def __init__(self, tolerance: int, counts: Counts) -> None:
        self._tolerance = tolerance
        self._counts = counts
        self._leaders: deque[Stamped] = deque()
        self._followers: deque[Stamped] = deque(maxlen=WAITING)

    def lead(self, sample: Stamped, *, anew: bool) -> list[Pair]:
        """Add a sample of the leading topic; return the pairs that are complete now.

        ``anew`` means that its clock was set: waiting samples belong to the old clock.
        """
        if anew:
            self._count_unpaired(len(self._leaders), "the clock of the positions or forces was set")
            self._leaders.clear()
            # The other topic's clock was set too; keep its samples of the new clock.
            near = [f for f in self._followers if abs(f.stamp - sample.stamp) < LONGEST_OVERTAKING]
            self._followers = deque(near, maxlen=WAITING)
        self._leaders.append(sample)
        if len(self._leaders) > WAITING:
            self._leaders.popleft()
            self._count_unpaired(
                1,
                f"{WAITING} samples of one topic arrived without any of the other",
            )
        return self._take_complete_pairs()

    def follow(self, sample: Stamped, *, anew: bool) -> list[Pair]:
        """Add a sample of the other topic; return the pairs that are complete now."""
        if anew:
            self._followers.clear()
        self._followers.append(sample)
        return self._take_complete_pairs()

    def _take_complete_pairs(self) -> list[Pair]:
        pairs = []
        leaders = self._leaders
        followers = self._followers
        while leaders:
            stamp = leaders[0].stamp
            while len(followers) >= 2 and followers[1].stamp <= stamp:
                followers.popleft()
            if not followers or followers[-1].stamp < stamp:
                break  # the next one has not arrived yet
            leader = leaders.popleft()
            before = followers[0]
            after = before if before.stamp >= stamp else followers[1]
            value = self._value_at(stamp, before, after)
            if value is not None:
                pairs.append(Pair(stamp, leader.value, value, max(leader.there, after.there)))
        return pairs

    def _value_at(
        self,
        stamp: int,
        stamped: Stamped,
        after: Stamped,
    ) -> Value | tuple[float, ...] | None:
        """Interpolate between two neighbours, which may be the same, or take the nearer one."""
        span = after.stamp - stamped.stamp
        if 0 < span <= 2 * self._tolerance:
            part = (stamp - stamped.stamp) / span
            between: Value | tuple[float, ...] = _between(stamped.value, after.value, part)
            return between
        nearest = stamped if 2 * (stamp - stamped.stamp) <= span else after
        away = abs(nearest.stamp - stamp)
        if away <= self._tolerance:
            return nearest.value
        self._count_unpaired(
            1,
            f"the nearest sample of the other topic is {away / NANO:.3g} s away: raise "
            f"tolerance={self._tolerance / NANO:.3g} in the address",
        )
        return None

    def _count_unpaired(self, count: int, text: str) -> None:
        if count:
            self._counts.unpaired += count
            self._counts.last_fault = text


def _between(before: Any, after: Any, part: float) -> Any:
    if isinstance(before, tuple):
        if sum(a * b for a, b in zip(before[3:], after[3:], strict=True)) < 0.0:
            # q and −q are one rotation; between them there is none.
            after = (*after[:3], *(-each for each in after[3:]))
        return tuple(a + part * (b - a) for a, b in zip(before, after, strict=True))
    return before + part * (after - before)


# Publishing: each estimate, and the status five times a second.

#: Published topics.
TOPICS = ("estimate", "status")
GENERATION = PLACE["method"]


class Wire(Protocol):
    """Encodes estimates and status as messages and sends them."""

    #: Scheme and address.
    name: str

    def open(self) -> None:
        """Connect; raises PalpateError if that fails."""

    def estimate(self, values: dict[str, Any]) -> bytes:
        """Return the message of one sample: :data:`palpate.live.schema.ESTIMATE_FIELDS`."""

    def status(self, values: dict[str, Any]) -> bytes:
        """Return the message of a status: :func:`palpate.live.schema.describe_status`."""

    def put(self, topic: int, data: bytes) -> bool:
        """Send a message on one of :data:`TOPICS`; return whether the queue had room for it."""

    def close(self) -> None:
        """Disconnect; may be called twice."""


_PAUSE = 1e-3  # s between reads of new rows
_TOLD_EVERY = 0.2  # s between status messages


class Publisher:
    """Sink that publishes each estimate on a wire, and the status five times a second."""

    gently = False  # a robot may act on the estimates
    every_sample = True

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        #: Such as ``publish zmq:tcp://127.0.0.1:5556``.
        self.name = f"publish {wire.name}"
        self._last: dict[str, Any] = {}  # the last published estimate, and its row
        self._row: Floats = np.empty((0, 0))
        self._count = 0
        self._told = 0.0

    def run(self, watching: Watching, commands: Connection) -> None:
        """Publish until the loop stops."""
        self._watching = watching
        try:
            self._wire.open()
            self._go_on()
        except PalpateError as error:
            print(f"palpate: {error}", file=sys.stderr)
        finally:
            self._wire.close()

    def _go_on(self) -> None:
        waiting = self._watching.take()
        over = False
        version = -1
        while not over:
            over = self._watching.over
            status = self._watching.status()
            rows = self._watching.take()
            waiting = np.concatenate([waiting, rows]) if len(waiting) else rows
            # The first sample sets the zero of the times.
            if status["counts"]["taken"]:
                if version != self._watching.shared_json.version:
                    version = self._watching.shared_json.version
                    run = read_run(status, self._watching.others().get("diagnosis"))
                waiting = self._publish(run, waiting)
                self._tell(status, run)
            time.sleep(_PAUSE)
        self._watching.tell({})

    def _publish(self, run: RunState, rows: Floats) -> Floats:
        """Send the rows of the estimator in the status; return those of later estimators."""
        generations = rows[:, GENERATION]
        mine = rows[generations == run.generation]
        # Rows of an earlier estimator, which the status no longer describes, are dropped.
        self._watching.dropped += int(np.count_nonzero(generations < run.generation))
        for values in estimates(mine, run, self._count):
            # Messages without room in the queue count as dropped rows.
            self._watching.dropped += not self._wire.put(0, self._wire.estimate(values))
            self._count += 1
            self._last = values
        if len(mine):
            self._row = mine[-1:]
        return rows[generations > run.generation]

    def _tell(self, status: dict[str, Any], run: RunState) -> None:
        """Publish the status, also without new rows, so that a lost source is reported."""
        now = time.monotonic()
        if now < self._told or self._last.get("parameter_names") != run.texts["parameter_names"]:
            return
        self._told = now + _TOLD_EVERY
        _, _, (covariance,) = unpack_parameters(self._row, len(run.parameter_names))
        said = describe_status(status, run, self._last, covariance)
        self._wire.put(1, self._wire.status(said))
        self._watching.tell({})


# From a command-line option to a sink.


def open_publisher(address: str) -> Sink:
    """Return the sink that publishes estimates on a wire, such as ``zmq:tcp://127.0.0.1:5556``.

    Raises
    ------
    InvalidParameterError
        The address names no wire.
    MissingExtraError
        A package that the wire needs is not installed.
    """
    kind, module, rest = find_wire(address)
    if kind is None or not kind.wire:
        known = ", ".join(f"{name}:…" for name, each in SOURCES.items() if each.wire)
        raise InvalidParameterError(
            f"--publish must begin with one of {known}, not {shown(address)}"
        )
    made: Wire = getattr(module, kind.wire)(rest)
    try:
        made.open()  # so that an address in use fails before the loop starts
    finally:
        made.close()
    return Publisher(made)
