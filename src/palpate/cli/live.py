"""The command ``palpate live``."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from palpate.cli.options import (
    OUTPUT,
    PREPARED,
    READ,
    Address,
    Channels,
    Depth,
    Direction,
    Duration,
    Law,
    Method,
    MethodOptions,
    Unit,
    names_in,
    quantities,
    quantity,
    units_of,
)
from palpate.cli.reading import flipped, kept_exponent
from palpate.errors import InvalidParameterError, RecordingError

if TYPE_CHECKING:
    from palpate.live.sinks import Sink
    from palpate.live.sources import Source
    from palpate.preparation import OnlinePreparation

# Of the rest that a source begins with, what is sure to be without contact.
_OF_REST = 0.8
_SOURCE = Parameter(completer=names_in("palpate.lab.MATERIALS", prefix="lab:"))
_READ = Parameter(group=READ)
_PREPARED = Parameter(group=PREPARED)
_FLAG = Parameter(group=PREPARED, negative="")
_SIGNED = Parameter(group=PREPARED, allow_leading_hyphen=True)


@Parameter(name="*")
@dataclass(frozen=True)
class StreamOptions:
    """What a source delivers, and how it becomes penetration, velocity and force."""

    rate: Annotated[float | None, _READ] = None
    "Samples a second, nominally; what the source says unless given."
    speed: Annotated[float, _READ] = 1.0
    "Times its own pace, of a recording."
    position: Annotated[Channels | None, _READ] = None
    "The channel of a recording that is the position; looked for unless given."
    force: Annotated[Channels | None, _READ] = None
    "The channel of a recording that is the force; looked for unless given."
    unit: Annotated[tuple[Unit, ...], Parameter(group=READ)] = ()
    "Units of a recording's channels, such as penetration=mm,force=mN."
    tare: Annotated[Duration | None, _PREPARED] = None
    "Take off the mean force of so long at the start, such as 1s; of the laboratory it always is."
    surface: Annotated[Depth | None, _SIGNED] = None
    "Where the material begins: a position such as 0.7mm."
    direction: Annotated[Direction | None, _SIGNED] = None
    "Into the material, three numbers such as 0,0,-1: position and force are vectors then."
    velocity_window: Annotated[float | None, _PREPARED] = None
    "Length of the velocity filter, s; 15 samples but at most 15 ms unless given."
    flip_force: Annotated[bool, _FLAG] = False
    "Turn the sign of the force: compression is to be positive."
    flip_penetration: Annotated[bool, _FLAG] = False
    "Turn the sign of the position: into the material is to be positive."

    def source(self, address: str) -> "Source":
        """Return the source of an address."""
        from palpate.live.sources import SourceOptions, open_source
        from palpate.preparation import Columns
        from palpate.validation import number_in

        rate = None if self.rate is None else number_in("--rate", self.rate, 1e-3, 1e5)
        named = {"position": self.position, "force": self.force}
        columns = Columns(**{name: each for name, each in named.items() if each is not None})
        options = SourceOptions(
            sample_time=None if rate is None else 1.0 / rate,
            vectors=self.direction is not None,
            speed=number_in("--speed", self.speed, 0.0, 1e6, open_low=True),
            reading={"columns": columns, "units": units_of("--unit", self.unit)},
        )
        source = open_source(address, options)
        self._check(address)
        return source

    def _check(self, address: str) -> None:
        """Refuse what would have no effect."""
        from palpate.live.sources import SOURCES

        recording = address.partition(":")[0] not in SOURCES
        others = ("rate",) if recording else ("speed", "position", "force", "unit")
        for name in others:
            if getattr(self, name) != getattr(StreamOptions, name):
                words = "has its own times" if recording else "is no recording"
                raise InvalidParameterError(f"--{name} has no effect: {address} {words}")

    def preparation(self, source: "Source") -> "OnlinePreparation":
        """Return what makes samples of what the source delivers."""
        from palpate.preparation import OnlinePreparation

        given: dict[str, Any] = quantities(self, surface="penetration")
        if self.tare is not None:
            given["tare_time"] = quantity("--tare", self.tare, "time")
        elif rest := getattr(source, "rest", 0.0):
            given["tare_time"] = _OF_REST * rest
        if self.direction is not None:
            given["direction"] = _direction(self.direction)
        given |= {"velocity_window": self.velocity_window, "flip": flipped(self)}
        return OnlinePreparation(sample_time=source.sample_time, **given)


@Parameter(name="*", group=Group("The page", sort_key=8))
@dataclass(frozen=True)
class PageOptions:
    """Where the page is served."""

    page: bool = True
    "Serve a page that shows the loop."
    host: str = "127.0.0.1"
    "Address to listen on; on any but this machine's own a token is demanded, and printed once."
    port: int = 8765
    "Port to listen on; 0 for any that is free."
    open: Annotated[bool, Parameter(negative="")] = False
    "Open the page in a browser."


@Parameter(name="*", group=Group("The loop", sort_key=7))
@dataclass(frozen=True)
class Looping:
    """How the loop runs."""

    realtime: Annotated[bool, Parameter(negative="")] = False
    "Ask for a fixed priority and locked memory; what is not allowed is said."
    seconds: float | None = None
    "Stop after so long, s."
    diagnosis: bool = True
    "Diagnose the last 20 s, every 5 s or more, in a process of its own."


def live(
    source: Annotated[str, _SOURCE],
    /,
    *,
    law: Law = None,
    method: Method = None,
    exponent: Annotated[float | None, Parameter(group=PREPARED)] = None,
    record: Annotated[Path | None, Parameter(group=OUTPUT)] = None,
    publish: Annotated[tuple[Address, ...], Parameter(group=OUTPUT)] = (),
    console: Annotated[bool, Parameter(group=OUTPUT)] = True,
    page: PageOptions = PageOptions(),
    looping: Looping = Looping(),
    incoming: StreamOptions = StreamOptions(),
) -> None:
    """Identify while a robot moves, each sample before the next one comes.

    Ctrl-C ends it; what was lost, late or refused is printed then.

    For example:

        palpate live lab:ball --open
        palpate live sponge.csv --law auto --open
        palpate live probing.mcap --speed 2 --tare 1s --no-page
        palpate live zmq:tcp://127.0.0.1:5555 --direction 0,0,-1 --record touch.mcap

    Parameters
    ----------
    source
        The laboratory, such as lab:ball; a recording's path; or a robot on the wire: an address
        that begins with zmq:, dds: or zenoh:.
    law
        The law: auto, the everyday one that explains the samples best so far, and by how much; any,
        the best of all; or one, such as half-space, flat or half-space+single; Hunt-Crossley's
        unless given.
    method
        The estimator, such as single-stage; the usual one of the law unless given. It can be
        changed in the page.
    exponent
        Exponent of the law where the shape of the tip tells it, such as 1.5 under a sphere; kept,
        whatever method is chosen.
    record
        Record what comes and what is found to this MCAP file; one that is there is left, and the
        name has a number then.
    publish
        Publish the estimates on this wire too, such as zmq:tcp://127.0.0.1:5556.
    console
        Show a line of figures.
    """
    from palpate.live.running import default_estimator, run
    from palpate.validation import number_in

    if looping.seconds is not None:
        number_in("--seconds", looping.seconds, 0.0, 1e9)
    choosing = MethodOptions(law, method)
    chosen = default_estimator(choosing.kind, **choosing.settings)
    if exponent is not None:
        chosen = chosen.replace(exponent=kept_exponent(exponent, type(chosen)))
    taken = incoming.source(source)
    sinks = _sinks(record, publish, page, console=console, diagnosis=looping.diagnosis)
    found = run(
        taken,
        chosen,
        sinks,
        preparation=incoming.preparation(taken),
        realtime=looping.realtime,
        seconds=looping.seconds,
    )
    if "recorder" in found["failed"]:
        raise RecordingError(
            f"{record or 'the recording'}: the recorder failed, and what came after that is not in "
            "it; what was recorded until then can be read"
        )


def _sinks(
    record: Path | None,
    publish: Sequence[str],
    page: PageOptions,
    *,
    console: bool,
    diagnosis: bool,
) -> "list[Sink]":
    from palpate.live.console import Console
    from palpate.live.diagnosing import Diagnosing
    from palpate.live.publishing import open_publisher
    from palpate.live.recorder import Recorder
    from palpate.writing import check_writable

    if record is not None:
        check_writable(record)
    sinks: list[Sink] = [Console(quiet=not console), *map(open_publisher, publish)]
    if diagnosis:
        sinks.append(Diagnosing())
    if record is not None or page.page:
        sinks.append(Recorder(record))
    if page.page:
        from palpate.live.page import Page as PageSink

        sinks.append(PageSink(host=page.host, port=page.port, open_browser=page.open))
    return sinks


def _direction(text: str) -> list[float]:
    """Three numbers with commas between them."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise InvalidParameterError(
            f"--direction must be three numbers such as 0,0,-1, not {text!r}"
        )
    return numbers
