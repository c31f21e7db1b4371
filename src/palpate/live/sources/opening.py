"""From what a person writes, such as ``lab:ball`` or a file's name, to a source."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from palpate.errors import InvalidParameterError
from palpate.live.sources.source import Source
from palpate.validation import shown


class Kind(NamedTuple):
    """One kind of source.

    Attributes
    ----------
    module : str
        Has ``open_source(address, options)``, which returns the source, not yet open.
    form : str
        How its address is written.
    words : str
        What it is.
    """

    module: str
    form: str
    words: str


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
    "lab": Kind("palpate.live.sources.laboratory", "lab:ball", "the laboratory"),
    "zmq": Kind("palpate.live.sources.zeromq", "zmq:tcp://127.0.0.1:5555", "ZeroMQ"),
    "dds": Kind("palpate.live.sources.dds", "dds:/pose,/wrench", "ROS 2 over DDS"),
    "zenoh": Kind("palpate.live.sources.zenoh", "zenoh:/pose,/wrench", "ROS 2 over Zenoh"),
}

#: What an address that begins with ros1: gets for an answer, as a source or for --publish.
NO_ROS1 = (
    "palpate no longer speaks ROS 1 live: run ros1_bridge and use dds:, "
    "or record a bag and identify that"
)


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
    scheme, colon, rest = address.partition(":")
    if colon and scheme in SOURCES:
        source: Source = import_module(SOURCES[scheme].module).open_source(rest, given)
        return source
    if scheme == "ros1":
        raise InvalidParameterError(NO_ROS1)
    if not Path(address).exists():
        known = ", ".join(f"{kind.form} ({kind.words})" for kind in SOURCES.values())
        raise InvalidParameterError(
            f"SOURCE must be a recording's path, or one of {known}; not {shown(address)}"
        )
    return _replayed(Path(address), given)


def _replayed(path: Path, options: SourceOptions) -> Source:
    from palpate.live.sources.replay import Replay
    from palpate.preparation import prepare

    return Replay(prepare(path, **(options.reading or {})), speed=options.speed)
