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
    Flag,
    Law,
    Method,
    MethodOptions,
    Unit,
    names_in,
    parse_units,
    quantities,
    quantity,
    si_parameter,
)
from palpate.cli.reading import (
    channels_to_flip,
    check_fixed_exponent,
    negative_number_parameter,
    parse_delay,
)
from palpate.errors import InvalidParameterError, RecordingError

if TYPE_CHECKING:
    from palpate.control_loops import ControlLoop
    from palpate.input.preparation.online import OnlinePreparation
    from palpate.input.wrench import Payload
    from palpate.live.sinks import Sink
    from palpate.live.sources import Source

# Fraction of a source's initial rest that is certainly without contact.
_OF_REST = 0.8
_SOURCE = Parameter(completer=names_in("palpate.lab.MATERIALS", prefix="lab:"))
_READ = Parameter(group=READ)
_PREPARED = Parameter(group=PREPARED)
_FLAG = Parameter(group=PREPARED, negative="")
_SIGNED = Parameter(group=PREPARED, allow_leading_hyphen=True)


@Parameter(name="*")
@dataclass(frozen=True)
class StreamOptions:
    """Options of the source and the preparation of its samples."""

    rate: Annotated[float | None, _READ] = None
    "Nominal sample rate, Hz (default: the source's own)."
    speed: Annotated[float, _READ] = 1.0
    "Replay speed relative to the recording."
    position: Annotated[Channels | None, _READ] = None
    "Position channel of a recording (default: auto-detect)."
    force: Annotated[Channels | None, _READ] = None
    "Force channel of a recording (default: auto-detect)."
    unit: Annotated[tuple[Unit, ...], Parameter(group=READ)] = ()
    "Units of a recording's channels, such as penetration=mm,force=mN."
    tare: Annotated[Duration | None, _PREPARED] = None
    "Subtract the mean force of this long at the start, such as 1s (laboratory: always on)."
    surface: Annotated[Depth | None, _SIGNED] = None
    "Position of the material's surface, such as 0.7mm."
    direction: Annotated[Direction | None, _SIGNED] = None
    "Direction into the material, such as 0,0,-1, for positions and forces that are vectors."
    payload: Annotated[Path | None, Parameter(group=PREPARED, metavar="FILE")] = None
    "Subtract weight and inertia of the tool that palpate payload saved to this file."
    velocity_window: Annotated[float | None, si_parameter("time", "DURATION", PREPARED)] = None
    "Length of the velocity filter, such as 30ms (default: 15 samples, at most 15ms)."
    delay: Annotated[str | None, negative_number_parameter("DURATION")] = None
    "Delay of the force, as palpate skew measures it: 3ms+-0.05ms, up to half the velocity window."
    flip_force: Annotated[bool, _FLAG] = False
    "Invert the sign of the force, so that compression is positive."
    flip_penetration: Annotated[bool, _FLAG] = False
    "Invert the sign of the position, so that into the material is positive."

    def source(self, address: str) -> "Source":
        """Return the source at an address."""
        from palpate.input.channels import Columns
        from palpate.live.sources import SOURCES, SourceOptions, open_source
        from palpate.validation import number_in

        rate = None if self.rate is None else number_in("--rate", self.rate, 1e-3, 1e5)
        named: dict[str, Any] = {"position": self.position, "force": self.force}
        reading: dict[str, Any] = {"units": parse_units("--unit", self.unit)}
        reading["columns"] = Columns(**{name: each for name, each in named.items() if each})
        recording = address.partition(":")[0] not in SOURCES
        if self.payload is not None and recording:
            reading["payload"] = self.tool
        elif self.payload is not None and (self.direction is None or address.startswith("lab:")):
            raise InvalidParameterError(
                "--payload is for a robot's vectors: pass --direction, into the material, such as "
                "0,0,-1, and the address of a robot"
            )
        options = SourceOptions(
            sample_time=None if rate is None else 1.0 / rate,
            vectors=self.direction is not None,
            orientation=self.payload is not None and not recording,
            speed=number_in("--speed", self.speed, 0.0, 1e6, open_low=True),
            reading=reading,
        )
        source = open_source(address, options)
        self._check(address, recording=recording)
        return source

    @property
    def tool(self) -> "Payload | None":
        """The payload in the file, if one is named."""
        from palpate.input.wrench import Payload

        return None if self.payload is None else Payload.load(self.payload)

    def _check(self, address: str, *, recording: bool) -> None:
        """Raise for an option that would have no effect."""
        others = ("rate",) if recording else ("speed", "position", "force", "unit")
        for name in others:
            if getattr(self, name) != getattr(StreamOptions, name):
                text = "has timestamps" if recording else "is not a recording"
                raise InvalidParameterError(f"{address} {text}: omit --{name}")

    def preparation(self, source: "Source") -> "OnlinePreparation":
        """Return the preparation of the source's samples."""
        from palpate.input.preparation.online import OnlinePreparation

        given: dict[str, Any] = quantities(self, surface="penetration")
        if self.tare is not None:
            given["tare_time"] = quantity("--tare", self.tare, "time")
        elif rest := getattr(source, "rest", 0.0):
            given["tare_time"] = _OF_REST * rest
        if self.direction is not None:
            given["direction"] = _direction(self.direction)
        if self.delay is not None:
            if self.payload is not None:
                raise InvalidParameterError(
                    "--payload takes out the delay in its file: pass --delay to palpate payload"
                )
            given["force_delay"] = parse_delay(self.delay)
        given |= {"velocity_window": self.velocity_window, "flip": channels_to_flip(self)}
        return OnlinePreparation(sample_time=source.sample_time, **given)


@Parameter(name="*", group=Group("Live page", sort_key=8))
@dataclass(frozen=True)
class PageOptions:
    """Options of the live page."""

    page: bool = True
    "Serve a live page of the run."
    host: str = "127.0.0.1"
    "Address to listen on; one that other machines reach requires a token, printed at the start."
    port: int = 8765
    "Port to listen on; 0 for a free one."
    open: Flag = False
    "Open the page in a browser."


@Parameter(name="*", group=Group("Real-time loop", sort_key=7))
@dataclass(frozen=True)
class Looping:
    """Options of the real-time loop."""

    realtime: Flag = False
    "Request a fixed priority and locked memory; warn if the system refuses."
    seconds: float | None = None
    "Stop after this time, s."
    diagnosis: bool = True
    "Diagnose the last 20 s, at most every 5 s, in a separate process."
    control_loop: Annotated[Path | None, Parameter(metavar="FILE")] = None
    """Show which gains are safe for the loop of this TOML file, which holds options of palpate
    gains; nothing is sent to a controller."""

    def read_loop(self) -> "ControlLoop | None":
        """Return the control loop in the file, if one is named."""
        from palpate.cli.gains import read_loop

        if self.control_loop is None:
            return None
        if not self.diagnosis:
            raise InvalidParameterError("--control-loop needs the diagnosis: omit --no-diagnosis")
        return read_loop(self.control_loop)


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
    """Identify in real time: update the estimate with each sample before the next arrives.

    Ctrl-C stops the run and prints a summary with the lost, late and rejected samples.

    For example:

        palpate live lab:ball --open
        palpate live sponge.csv --law half-space --open
        palpate live probing.mcap --speed 2 --tare 1s --no-page
        palpate live zmq:tcp://127.0.0.1:5555 --direction 0,0,-1 --record touch.mcap

    Parameters
    ----------
    source
        The laboratory, such as lab:ball; the path of a recording, which is replayed; or the address
        of a robot, which begins with zmq:, dds: or zenoh:.
    law
        Force law: auto, the one that fits best, with relaxation where the material relaxes; or one
        law, such as half-space (default: auto).
    method
        Estimator, such as single-stage (default: depends on the law). The page can change it.
    exponent
        Fix the exponent n of the law, such as 1.5 for a spherical tip, for every estimator.
    record
        Record measurements and estimates to this MCAP file; if it exists, to a numbered one.
    publish
        Also publish the estimates on a wire, such as zmq:tcp://127.0.0.1:5556.
    console
        Show a status line on the console.
    """
    from palpate.live.running import default_estimator, run
    from palpate.live.sources import Replay
    from palpate.validation import number_in
    from palpate.writing import check_writable

    if record is not None:
        check_writable(record)
    if looping.seconds is not None:
        number_in("--seconds", looping.seconds, 0.0, 1e9)
    choosing = MethodOptions(law, method).choose_default_law(exponent)
    chosen = default_estimator(choosing.kind, **choosing.settings)
    if exponent is not None:
        chosen = chosen.replace(exponent=check_fixed_exponent(exponent, type(chosen)))
    tool = incoming.tool
    taken = incoming.source(source)
    sinks = _sinks(record, publish, page, looping, console=console)
    found = run(
        taken,
        chosen,
        sinks,
        preparation=incoming.preparation(taken),
        payload=None if isinstance(taken, Replay) else tool,
        realtime=looping.realtime,
        seconds=looping.seconds,
    )
    if found["tare_refused"]:
        raise RecordingError(f"{source}: {found['tare_refused']}, or omit --tare")
    if "recorder" in found["failed"]:
        raise RecordingError(
            f"{record or 'the recording'}: the recorder failed; the file is readable up to then"
        )


def _sinks(
    record: Path | None,
    publish: Sequence[str],
    page: PageOptions,
    looping: Looping,
    *,
    console: bool,
) -> "list[Sink]":
    from palpate.live.console import Console
    from palpate.live.diagnosing import Diagnosing
    from palpate.live.recorder import Recorder
    from palpate.live.wires import open_publisher

    sinks: list[Sink] = [Console(quiet=not console), *map(open_publisher, publish)]
    loop = looping.read_loop()
    if looping.diagnosis:
        sinks.append(Diagnosing(loop=loop))
    if record is not None or page.page:
        sinks.append(Recorder(record))
    if page.page:
        from palpate.live.page import Page as PageSink

        sinks.append(PageSink(host=page.host, port=page.port, open_browser=page.open))
    return sinks


def _direction(text: str) -> list[float]:
    """Parse three comma-separated numbers."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InvalidParameterError(
            f"--direction must be three numbers such as 0,0,-1, not {text!r}"
        ) from None
    return [x, y, z]
