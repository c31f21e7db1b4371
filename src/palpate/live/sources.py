"""Where live samples come from: what a source is asked, recordings played again, and addresses."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

from palpate.contact import Contact
from palpate.errors import InvalidParameterError, needed
from palpate.validation import number_in, shown

#: A number, or three along the axes of the recording's frame.
Value: TypeAlias = float | tuple[float, float, float]


class Arrival(NamedTuple):
    """One measurement of a robot.

    Attributes
    ----------
    time : float
        By the source's own clock, s.
    position : float or tuple of 3 float
        Penetration, or where the probe is, m.
    force : float or tuple of 3 float
        N.
    there : float
        By this machine's monotonic clock, s: when the measurement was there to be taken. What comes
        later than this is the loop's own lateness.
    """

    time: float
    position: Value
    force: Value
    there: float


@dataclass(slots=True)
class Counts:
    """What a source noticed on the way, before the loop had it.

    Attributes
    ----------
    lost : int
        Samples that were sent and never came, or for which there was no room.
    repeated, disordered : int
        Samples that came twice, or after a later one; they are left out.
    malformed : int
        Packets that hold no sample; they are left out.
    unpaired : int
        Positions without a force at their time, or forces without a position, where the two come
        apart; they are left out.
    last_fault : str
        Of the malformed and the unpaired, what was wrong with the last, in words.
    """

    lost: int = 0
    repeated: int = 0
    disordered: int = 0
    malformed: int = 0
    unpaired: int = 0
    last_fault: str = field(default="")


# What the loop asks of a source.


class EndOfSourceError(Exception):
    """A source has no more samples, and will have none; in words, where that is a surprise."""


class Source(Protocol):
    """Where samples come from: a recording, the laboratory, or a robot on the wire.

    The loop's own thread calls all of it. ``take`` is the only place where the loop waits.

    A source may have more: ``offers``, a mapping of what it can be asked for to the choices;
    ``chosen``, what is chosen now; ``ask(options)``, which does what a person asks of it and says
    so, or raises InvalidParameterError; ``news()``, sentences since the last call; ``rest``, the
    time at its start in which nothing is touched, s; ``pace``, how fast its clock goes; and
    ``origin``, what its times are counted from, ns since 1970.
    """

    @property
    def name(self) -> str:
        """What a person calls it."""

    @property
    def sample_time(self) -> float:
        """Nominal time between samples, s."""

    @property
    def counts(self) -> Counts:
        """What was lost, repeated or malformed so far."""

    def open(self) -> None:
        """Begin to deliver.

        Raises
        ------
        PalpateError
            It cannot: the address is in use, the topic is of another type, the file is damaged.
        """

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None where none came in time [s].

        Raises
        ------
        EndOfSourceError
            There will be none.
        """

    def close(self) -> None:
        """Let go of files and sockets; may be called twice."""


# A contact that was recorded, delivered again at its own pace or faster.


class Replay:
    """A recording in place of a robot.

    Parameters
    ----------
    contact : Contact
        Its positions and forces are delivered; the velocity is the loop's matter.
    speed : float
        Times its own pace, in (0, 1e6]; or infinite, as fast as the loop goes.
    """

    def __init__(self, contact: Contact, *, speed: float = 1.0) -> None:
        if speed != float("inf"):
            speed = number_in("speed", speed, 0.0, 1e6, open_low=True)
        self.name, self.sample_time = contact.source or "recording", contact.sample_time
        #: How fast its clock goes.
        self.pace = speed
        self.counts = Counts()
        self._rows = zip(
            contact.time.tolist(), contact.penetration.tolist(), contact.force.tolist(), strict=True
        )
        self._news = _hindsight(contact)
        self._waiting: tuple[float, float, float] | None = None
        self._began, self._first = 0.0, float(contact.time[0]) if len(contact) else 0.0

    def open(self) -> None:
        """Begin now."""
        self._began = time.monotonic()

    def take(self, timeout: float) -> Arrival | None:
        """Wait until the next sample is due, and return it."""
        row = self._waiting or next(self._rows, None)
        if row is None:
            raise EndOfSourceError
        now = time.monotonic()
        due = self._began + (row[0] - self._first) / self.pace if self.pace < 1e300 else now
        if due > now + timeout:
            self._waiting = row
            time.sleep(timeout)
            return None
        self._waiting = None
        if due > now:
            time.sleep(due - now)
        return Arrival(row[0], row[1], row[2], due)

    def news(self) -> list[str]:
        """What was found with hindsight, once."""
        news, self._news = self._news, []
        return news

    def close(self) -> None:
        """Nothing is held."""


def _hindsight(contact: Contact) -> list[str]:
    """What no robot in a loop could know, and the preparation of a whole recording said."""
    said = [f"{finding.check}: {finding}" for finding in contact.findings]
    found = {"tare": contact.tare_deviation, "surface": contact.surface_deviation}
    names = [name for name, deviation in found.items() if deviation is not None]
    if contact.prepared is not None and contact.prepared.normal is not None:
        names.append("contact normal")
    if not names:
        return said
    words = " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
    found_there = f"{words} of the recording are those of all of it, as palpate identify finds them"
    return [found_there, *said]


# From what a person writes, such as ``lab:ball`` or a file's name, to a source.


class Kind(NamedTuple):
    """One kind of source.

    Attributes
    ----------
    module, opener : str
        Where it is, and what of an address and options makes the source, not yet open.
    wire : str
        What of an address makes the :class:`~palpate.live.publishing.Wire` that estimates are
        published on; nothing where they cannot be.
    form : str
        How its address is written.
    words : str
        What it is.
    """

    module: str
    opener: str
    wire: str
    form: str
    text: str


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """What is known of a source before it is opened; each takes of it what concerns it.

    Attributes
    ----------
    sample_time : float, optional
        Nominal time between samples, s; the source's own unless given.
    vectors : bool
        Whether position and force are wanted as vectors, since a direction is known.
    speed : float
        Of a recording, times its own pace.
    reading : mapping
        Of a recording, what :func:`palpate.prepare` takes: ``columns`` and ``units``.
    seed : int
        Of the laboratory's noise.
    """

    sample_time: float | None = None
    vectors: bool = False
    speed: float = 1.0
    reading: Mapping[str, Any] | None = None
    seed: int = 0


#: Every kind of source, by what stands before the colon; without one it is a recording's path.
SOURCES: Mapping[str, Kind] = {
    "lab": Kind("laboratory", "open_source", "", "lab:ball", "the laboratory"),
    "zmq": Kind("zeromq", "ZeroMQ", "ZeroMQWire", "zmq:tcp://127.0.0.1:5555", "ZeroMQ"),
    "dds": Kind("dds", "DDS", "DDSWire", "dds:/pose,/wrench", "ROS 2 over DDS"),
    "zenoh": Kind("zenoh", "Zenoh", "ZenohWire", "zenoh:/pose,/wrench", "ROS 2 over Zenoh"),
}

#: What an address that begins with ros1: gets for an answer, as a source or for --publish.
NO_ROS1 = (
    "palpate no longer speaks ROS 1 live: run ros1_bridge and use dds:, "
    "or record a bag and identify that"
)


def wired(address: str) -> tuple[Kind | None, Any, str]:
    """Return the kind of an address, its module, and what follows the colon; None of no kind.

    Raises
    ------
    InvalidParameterError
        It is of ROS 1.
    MissingExtraError
        What it needs is not installed.
    """
    scheme, colon, rest = address.partition(":")
    if scheme == "ros1":
        raise InvalidParameterError(NO_ROS1)
    kind = SOURCES.get(scheme) if colon else None
    module = None if kind is None else needed(f"palpate.live.{kind.module}", scheme, "live")
    return kind, module, rest


def open_source(address: str, options: SourceOptions | None = None) -> Source:
    """Return the source of an address; :meth:`Source.open` begins it.

    Parameters
    ----------
    address : str
        ``lab:ball``, a recording's path, or one of the wires of :data:`SOURCES`.
    options : SourceOptions, optional
        What is known of it.

    Raises
    ------
    InvalidParameterError
        There is no such source.
    MissingExtraError
        What it needs is not installed.
    RecordingError
        The recording cannot be read.
    """
    given = options or SourceOptions()
    kind, module, rest = wired(address)
    if kind is not None:
        source: Source = getattr(module, kind.opener)(rest, given)
        return source
    if not Path(address).exists():
        known = ", ".join(f"{kind.form} ({kind.text})" for kind in SOURCES.values())
        raise InvalidParameterError(
            f"SOURCE must be a recording's path, or one of {known}; not {shown(address)}"
        )
    from palpate.preparation import prepare

    return Replay(prepare(Path(address), **(given.reading or {})), speed=given.speed)
