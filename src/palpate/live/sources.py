"""Sources of live samples: their interface, the replay of recordings, and addresses."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

from palpate.errors import InvalidParameterError, import_extra
from palpate.method.contact import Contact
from palpate.validation import frozen, number_in, shown

#: A number, or a vector in the frame of the source.
Value: TypeAlias = float | tuple[float, float, float]
#: Unit quaternion x, y, z, w of the pose.
Orientation: TypeAlias = tuple[float, float, float, float]


class Arrival(NamedTuple):
    """One measurement.

    Attributes
    ----------
    time : float
        Time on the source's clock, s.
    position : float or tuple of 3 float
        Position of the probe, or penetration, m.
    force : float or tuple of 3 float
        Contact force, N.
    there : float
        Time on this machine's monotonic clock at which the measurement became available, s. The
        loop's delay counts from then on.
    orientation : tuple of 4 float, optional
        Orientation of the probe, a unit quaternion x, y, z, w, if a payload requires it.
    """

    time: float
    position: Value
    force: Value
    there: float
    orientation: Orientation | None = None


@dataclass(slots=True)
class Counts:
    """Counts of a source, of faults before the samples reached the loop.

    Attributes
    ----------
    lost : int
        Samples that were sent but did not arrive, or found the queue full.
    repeated, disordered : int
        Samples that arrived twice, or after a later one; skipped.
    malformed : int
        Messages without a valid sample; skipped.
    unpaired : int
        Positions without a force at their time, or forces without a position, if the two arrive
        separately; skipped.
    last_fault : str
        Description of the last malformed or unpaired sample.
    """

    lost: int = 0
    repeated: int = 0
    disordered: int = 0
    malformed: int = 0
    unpaired: int = 0
    last_fault: str = field(default="")


# The interface of a source.


class EndOfSourceError(Exception):
    """The source has ended; the message says why, if that is unexpected."""


class Source(Protocol):
    """Source of samples: a recording, the laboratory, or a robot on a wire.

    The loop's thread calls all methods. ``take`` is the only place where the loop waits.

    A source may also have: ``offers``, a mapping from the names of its options to their choices;
    ``chosen``, the present choices; ``ask(options)``, which changes them and returns a message, or
    raises InvalidParameterError; ``news()``, which returns the messages since the last call;
    ``rest``, the time without contact at its start, s; ``pace``, the speed of its clock; and
    ``origin``, the zero of its times, ns since 1970.
    """

    @property
    def name(self) -> str:
        """Name of the source, for the user."""

    @property
    def sample_time(self) -> float:
        """Nominal time between samples, s."""

    @property
    def counts(self) -> Counts:
        """Faults so far."""

    def open(self) -> None:
        """Start to deliver samples.

        Raises
        ------
        PalpateError
            The address is in use, a topic has the wrong type, or the file is damaged.
        """

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None if none arrives within ``timeout``, s.

        Raises
        ------
        EndOfSourceError
            The source has ended.
        """

    def close(self) -> None:
        """Close files and sockets; may be called twice."""


# Replay of a recording, at its own speed or faster.


class Replay:
    """Source that replays a recording.

    Parameters
    ----------
    contact : Contact
        Contact whose penetration and force are delivered; the loop computes the velocity.
    speed : float
        Speed relative to the recording, in (0, 1e6], or infinite: as fast as possible. Default: 1.
    """

    def __init__(self, contact: Contact, *, speed: float = 1.0) -> None:
        if speed != float("inf"):
            speed = number_in("speed", speed, 0.0, 1e6, open_low=True)
        self.name = contact.source or "recording"
        self.sample_time = contact.sample_time
        #: Speed of its clock.
        self.pace = speed
        self.counts = Counts()
        self._rows = zip(
            contact.time.tolist(),
            contact.penetration.tolist(),
            contact.force.tolist(),
            strict=True,
        )
        self._news = _hindsight(contact)
        self._waiting: tuple[float, float, float] | None = None
        self._began = 0.0
        self._first = float(contact.time[0]) if len(contact) else 0.0

    def open(self) -> None:
        """Start the replay."""
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
        """Return the messages about the recording, once."""
        news = self._news
        self._news = []
        return news

    def close(self) -> None:
        """Do nothing: no resources are open."""


def _hindsight(contact: Contact) -> list[str]:
    """Return messages about results from the whole recording, which a robot would not have."""
    said = [finding.titled for finding in contact.findings]
    found = {"tare": contact.tare_deviation, "surface": contact.surface_deviation}
    names = [name for name, deviation in found.items() if deviation is not None]
    if contact.prepared is not None and contact.prepared.normal is not None:
        names.append("contact normal")
    if not names:
        return said
    text = " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
    return [f"{text} computed from the whole recording, as in palpate identify", *said]


# From an address, such as ``lab:ball`` or a file's name, to a source.


class Kind(NamedTuple):
    """One kind of source.

    Attributes
    ----------
    module, opener : str
        Module, and the callable in it that makes a source from an address and options.
    wire : str
        Callable that makes a :class:`~palpate.live.wires.Wire` from an address; empty if
        estimates cannot be published this way.
    form : str
        Example of an address.
    text : str
        Description.
    """

    module: str
    opener: str
    wire: str
    form: str
    text: str


@frozen
class SourceOptions:
    """Options of all kinds of sources; each source uses those that apply to it.

    Attributes
    ----------
    sample_time : float, optional
        Nominal time between samples, s. Default: the source's own.
    vectors : bool
        Whether position and force must be vectors, because a direction is given. Default: False.
    orientation : bool
        Whether samples must have an orientation, because a payload is given. Default: False.
    speed : float
        Speed of a replay relative to the recording. Default: 1.
    reading : mapping, optional
        Arguments ``columns`` and ``units`` of :func:`palpate.prepare`, for a recording.
    """

    sample_time: float | None = None
    vectors: bool = False
    orientation: bool = False
    speed: float = 1.0
    reading: Mapping[str, Any] | None = None


#: Kinds of sources by their scheme; an address without one is the path of a recording.
SOURCES: Mapping[str, Kind] = {
    "lab": Kind("laboratory", "open_source", "", "lab:ball", "the laboratory"),
    "zmq": Kind("zeromq", "ZeroMQ", "ZeroMQWire", "zmq:tcp://127.0.0.1:5555", "ZeroMQ"),
    "dds": Kind("dds", "DDS", "DDSWire", "dds:/pose,/wrench", "ROS 2 over DDS"),
    "zenoh": Kind("zenoh", "Zenoh", "ZenohWire", "zenoh:/pose,/wrench", "ROS 2 over Zenoh"),
}


def find_wire(address: str) -> tuple[Kind | None, Any, str]:
    """Return the kind of an address, or None, its module, and the part after the colon.

    Raises
    ------
    MissingExtraError
        A package that the source needs is not installed.
    """
    scheme, colon, rest = address.partition(":")
    kind = SOURCES.get(scheme) if colon else None
    module = None if kind is None else import_extra(f"palpate.live.{kind.module}", scheme, "live")
    return kind, module, rest


def open_source(address: str, options: SourceOptions | None = None) -> Source:
    """Return the source at an address; :meth:`Source.open` starts it.

    Parameters
    ----------
    address : str
        ``lab:ball``, the path of a recording, or an address of a wire (:data:`SOURCES`).
    options : SourceOptions, optional
        Options of the source.

    Raises
    ------
    InvalidParameterError
        The address names no source.
    MissingExtraError
        A package that the source needs is not installed.
    RecordingError
        The recording cannot be read.
    """
    given = options or SourceOptions()
    kind, module, rest = find_wire(address)
    if kind is not None:
        source: Source = getattr(module, kind.opener)(rest, given)
        return source
    if not Path(address).exists():
        known = ", ".join(f"{kind.form} ({kind.text})" for kind in SOURCES.values())
        raise InvalidParameterError(
            f"SOURCE must be the path of a recording, or one of {known}; not {shown(address)}"
        )
    from palpate.input.preparation import prepare

    return Replay(prepare(Path(address), **(given.reading or {})), speed=given.speed)
