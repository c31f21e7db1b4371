"""The recorder: writes measurements and estimates to an MCAP file, as ROS 2 messages."""

import math
import os
import struct
import sys
import time
from contextlib import suppress
from datetime import datetime
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from palpate.errors import import_extra
from palpate.live.ring import MOST_PARAMETERS
from palpate.live.schema import message_definition
from palpate.live.sinks import PLACE, Watching
from palpate.live.view import verdict_on
from palpate.live.wires import NANO
from palpate.writing import create_new_file

if TYPE_CHECKING:
    from mcap.writer import Writer


#: Topics of measurements and estimates; ``palpate identify`` reads the first.
INPUT = "/input"
ESTIMATE = "/estimate"
_MATRIX = MOST_PARAMETERS**2


def message_type(name: str) -> tuple[str, str]:
    """Return the full name of a message type and its definition, from the folder ``messages``.

    Prepared quantities have separate names there, so that no reader treats them as measured.
    """
    return f"palpate_msgs/msg/{name}", message_definition(name)


_HEAD = b"\0\1\0\0"  # CDR, little endian
_NUMBERS_CDR = struct.Struct("<4siI2d")
_VECTORS_CDR = struct.Struct("<4siI6d")
_ESTIMATE_CDR = struct.Struct(f"<4siI{4 + MOST_PARAMETERS + _MATRIX + 5}d3BxH")
_LATEST = 2**31  # s: the limit of a time in ROS 2

Row = list[float]


def _places(*names: str) -> list[int]:
    return [PLACE[name] for name in names]


_NUMBER = _places("input_position_x", "input_force_x")
_IN_SPACE = _places(*(f"input_{what}_{axis}" for what in ("position", "force") for axis in "xyz"))
_FOUND = _places(
    "penetration", "velocity", "force", "predicted_force",
    *(f"parameter_{k}" for k in range(MOST_PARAMETERS)),
    *(f"covariance_{k}" for k in range(_MATRIX)),
    "offset", "surface", "margin", "cycle", "lateness",
)  # fmt: skip
_WHOLE = _places("status", "preparation", "state")


def describe_run(status: dict[str, Any]) -> dict[str, str]:
    """Return the description of a run, as metadata of its recording."""
    law = status.get("law", {})
    units = zip(law.get("symbols", ()), law.get("units", ()), strict=True)
    tare = status.get("tare")
    preparation = str(status.get("preparation", ""))
    tared = "being measured" if tare is None else f"{tare:.6g} N was subtracted online"
    verdict = verdict_on(status)
    told = {"law": str(verdict.law.candidate)} if verdict and verdict.law.known else {}
    if said := status.get("diagnosis", {}).get("answer"):
        told["diagnosis"] = str(said)
    return {
        "source": str(status.get("source", "")),
        "method": str(status.get("method", "")),
        **told,
        "parameters": ", ".join(f"{name} [{unit or '1'}]" for name, unit in units),
        "preparation": preparation or "defaults",
        "tare": tared if "tare_time=" in preparation else "none",
        "payload": str(status.get("payload") or "none"),
        "delay": f"{status.get('delay', 0.0):g} s from a measurement to its estimate",
    }


#: s between writes: a process that is killed loses at most this much.
FLUSHED_EVERY = 0.25
# ns: a larger jump of the source's clock does not move the log times.
_SET = 5_000_000_000


class Recorder:
    """Sink that records to MCAP files on request; it never overwrites a file.

    The topic ``/input`` has the measurements, which ``palpate identify`` can read; ``/estimate``
    has the estimates. It writes and syncs four times a second. If the process is killed, the file
    remains readable up to the last write.

    Parameters
    ----------
    path : Path, optional
        File to record to from the start. Default: wait for
        ``LiveCommand("record", {"on": True})``.
    folder : Path, optional
        Folder for recordings without a path. Default: the current one.

    Raises
    ------
    MissingExtraError
        The package ``mcap`` is not installed.
    """

    name = "recorder"
    gently = False

    def __init__(self, path: Path | None = None, folder: Path | None = None) -> None:
        import_extra("mcap", "a recording", "live")
        self._path = path
        self.every_sample = path is not None
        self._folder = Path() if folder is None else folder

    def run(self, watching: Watching, commands: Connection) -> None:
        """Record until the loop stops; exit with status 1 if a recording failed."""
        recording = None
        wish = 0
        said = ""
        failed = False
        if self._path is not None:
            recording, said = _begun(self._path)
            failed = recording is None
        goes_on = True
        while goes_on:
            goes_on = watching.wait(FLUSHED_EVERY)
            status = watching.status()
            status["diagnosis"] = watching.diagnosis(status)
            asked = status.get("record", {})
            rows = watching.take().tolist()
            if recording is not None:
                said = recording.write(rows, status, watching.dropped) or said
            if asked.get("wish", 0) != wish:
                wish = asked["wish"]
                recording, said = self._obey(recording, asked)
                watching.reader.samples.go_back(asked["since"])  # to the time of the command
            if recording is not None and recording.failed:
                recording = None
                failed = True
            watching.tell(_describe(recording, said))
        if recording is not None:
            said = recording.finish()
            failed = failed or recording.failed
        watching.tell({**_describe(recording, said), "on": False})
        if failed:
            sys.exit(1)  # tells the loop's process

    def _obey(self, recording: "RunFile | None", asked: dict[str, Any]) -> "_Begun":
        said = "no recording is running" if recording is None else recording.finish()
        if not asked["on"]:
            return None, said
        return _begun(self._folder / datetime.now().strftime("palpate-%Y-%m-%d-%H%M%S.mcap"))


def _describe(recording: "RunFile | None", said: str) -> dict[str, Any]:
    page = {"on": recording is not None, "said": said}
    if recording is None:
        return page
    return {**page, "path": str(recording.path), "rows": recording.rows, "bytes": recording.bytes}


def _begun(path: Path) -> "_Begun":
    try:
        file, taken = create_new_file(path)
    except OSError as error:
        return None, f"cannot record to {path}: {error.strerror or error}"
    text = "" if taken == path else f", because {path} already exists"
    return RunFile(taken, file), f"recording to {taken}{text}"


class RunFile:
    """One recording.

    Parameters
    ----------
    path : Path
        Name of the file.
    file : file object
        Empty file, open for writing.
    """

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self.path = path
        self._file = file
        self.rows = self.bytes = 0
        self.failed = False
        self._writer: Writer | None = None
        self._shift = self._last = 0
        self._dropped = -1
        self._described = dict[str, str]()

    def write(self, rows: list[Row], status: dict[str, Any], dropped: int) -> str:
        """Write rows and sync them to disk; return a description of an error, if any."""
        try:
            if rows:
                self._begin(rows, status)
                for row in rows:
                    self._add(row)
            self._note_dropped(dropped)
            self._note_changed(status)
            self._sync()
        except OSError as error:
            return self._given_up(error)
        return ""

    def _given_up(self, error: OSError) -> str:
        """Close the file after an error, such as a full disk; return a description."""
        self.failed = True
        with suppress(OSError):  # the buffer cannot be written either
            self._file.close()
        text = f"{self.path}: {error.strerror or error}: the recording ends after {self.rows} rows"
        return f"{text}, of which the last {FLUSHED_EVERY:g} s may be missing"

    def _sync(self) -> None:
        # It may take seconds on a slow disk; meanwhile the ring keeps 16 s of rows at 1 kHz.
        self._file.flush()
        os.fsync(self._file.fileno())
        self.bytes = self._file.tell()

    def _begin(self, rows: list[Row], status: dict[str, Any]) -> None:
        if self._writer is not None:
            return
        from mcap.writer import IndexType, Writer

        # Without chunks each message is complete once written. An index would be missing anyway if
        # the process is killed.
        writer = Writer(self._file, use_chunking=False, index_types=IndexType.METADATA)
        writer.start(profile="ros2", library="palpate")
        vectors = not math.isnan(rows[0][PLACE["input_position_y"]])
        self._measured = (_VECTORS_CDR, _IN_SPACE) if vectors else (_NUMBERS_CDR, _NUMBER)
        names = ("MeasurementInSpace" if vectors else "Measurement", "Estimate")
        self._origin = int(status.get("origin", 0))  # zero of the source's times, ns
        schemas = [
            writer.register_schema(name, "ros2msg", text.encode())
            for name, text in map(message_type, names)
        ]
        self._channels = [
            writer.register_channel(topic, "cdr", schema)
            for topic, schema in zip((INPUT, ESTIMATE), schemas, strict=True)
        ]
        self._described = describe_run(status)
        writer.add_metadata("palpate", self._described)
        self._writer = writer

    def _add(self, row: Row) -> None:
        stamp = self._stamp(row[PLACE["arrived"]])
        if stamp is None:
            return
        form, places = self._measured
        measured = form.pack(_HEAD, *divmod(stamp, NANO), *[row[k] for k in places])
        self._put(0, stamp, measured)
        taken = self._stamp(row[PLACE["time"]])
        if taken is not None:  # else no sample was prepared
            whole = [*(int(row[k]) & 0xFF for k in _WHOLE), int(row[PLACE["method"]]) & 0xFFFF]
            found = [row[k] for k in _FOUND]
            self._put(1, stamp, _ESTIMATE_CDR.pack(_HEAD, *divmod(taken, NANO), *found, *whole))
        self.rows += 1

    def _put(self, channel: int, stamp: int, message: bytes) -> None:
        assert self._writer is not None  # it has begun
        log = self._log_time(stamp)
        number = self.rows & 0xFFFFFFFF
        self._writer.add_message(self._channels[channel], log, message, log, number)

    def _stamp(self, time: float) -> int | None:
        """Convert a time of the source's clock to ns; None if it is invalid."""
        if not -_LATEST < time < _LATEST:
            return None
        stamp = self._origin + round(1e9 * time)
        return stamp if -_LATEST < stamp // NANO < _LATEST else None

    def _log_time(self, stamp: int) -> int:
        """Return a measurement's time on this machine's clock, ns, from the source's steps."""
        now = time.time_ns()
        if not abs(stamp + self._shift - now) < _SET:
            self._shift = now - stamp
        self._last = max(stamp + self._shift, self._last)
        return self._last

    def _note_dropped(self, dropped: int) -> None:
        """Record newly lost rows in the metadata."""
        if self._writer is None or dropped == self._dropped:
            return
        if self._dropped >= 0:
            lost = str(dropped - self._dropped)
            self._writer.add_metadata("palpate", {f"rows lost after {self.rows}": lost})
        self._dropped = dropped

    def _note_changed(self, status: dict[str, Any]) -> None:
        """Record changes of the description, such as another estimator, in the metadata."""
        now = describe_run(status)
        changed = {name: words for name, words in now.items() if self._described.get(name) != words}
        if self._writer is not None and changed:
            since = f"by row {self.rows}, estimator {status.get('generation', 0)}"
            notes = {f"{name} {since}": words for name, words in changed.items()}
            self._writer.add_metadata("palpate", notes)
            self._described = now

    def finish(self) -> str:
        """Finish and close the file; return a description of the result."""
        try:
            if self._writer is not None:
                self._writer.finish()  # type: ignore[no-untyped-call]
            self._sync()
            self._file.close()
        except OSError as error:
            return self._given_up(error)
        return f"recorded {self.rows} rows to {self.path}"


_Begun = tuple[RunFile | None, str]
