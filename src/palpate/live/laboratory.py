"""The laboratory as a source: a separate process simulates it slightly ahead of real time."""

import time
from collections import deque
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from palpate import lab
from palpate.errors import InvalidParameterError, MissingExtraError, RecordingError
from palpate.live.realtime import end, leave_core, show_name, start
from palpate.live.sources import Arrival, Counts, EndOfSourceError, SourceOptions
from palpate.validation import check_choice, shown

# s ahead of real time: other programs may delay the process by a tenth of a second. It is also the
# time that a command takes to have an effect.
_AHEAD = 0.2
# s per step: the kinematics of several samples take little longer than for one sample.
_BLOCK = 0.01
_BEHIND = 1.0  # s late, after which the laboratory's clock is reset


def start_bench(
    material: str,
    motion: str,
    probe: str,
    sample_time: float,
) -> tuple[lab.OngoingBench, str, str]:
    """Return the bench, its probe's name, and a message if the probe was replaced."""
    wanted = lab.IdealProbe() if probe == "ideal" else lab.TwinPantograph()
    bench = lab.Bench(
        lab.MATERIALS[material],
        lab.TRAJECTORIES[motion],
        wanted,
        lab.Sensors(sample_time=sample_time),
    )
    try:
        return lab.OngoingBench(bench), wanted.name, ""
    except MissingExtraError as error:
        ideal = lab.IdealProbe()
        text = f"using an {ideal.name} instead of the {wanted.name}: {error}"
        return lab.OngoingBench(replace(bench, probe=ideal)), ideal.name, text


def press(chosen: dict[str, str], probe: str, step: float, connection: Connection) -> None:
    """Send samples until the other end closes the connection."""
    show_name("lab")
    leave_core()  # it inherits the loop's first place: it stands for a robot
    with suppress(BrokenPipeError, ConnectionResetError, EOFError):
        _Pressing(chosen, probe, step, connection).run()


class _Pressing:
    def __init__(
        self,
        chosen: dict[str, str],
        probe: str,
        step: float,
        connection: Connection,
    ) -> None:
        self._first = chosen
        self._connection = connection
        self._bench, self._probe, words = start_bench(**chosen, probe=probe, sample_time=step)
        self._say(words)
        self._began = time.monotonic() + _BLOCK  # the rest of its lead is gained immediately
        self._block = max(round(_BLOCK / step), 1)

    def run(self) -> None:
        while True:
            early = self._began + self._bench.now - _AHEAD - time.monotonic()
            # A command ends the wait.
            if self._connection.poll(max(early, 0.0)):
                self._obey()
                continue
            if early < -_BEHIND:
                self._began -= early
                self._say(f"the laboratory was {-early:.1f} s late: its clock was reset")
            self._press()

    def _press(self) -> None:
        try:
            rows = self._bench.advance(self._block)
        except InvalidParameterError as error:
            self._say(f"{error}; palpate returned to the first material", **self._first)
            return
        due = np.maximum(rows[:, 0] + self._began, time.monotonic())
        self._connection.send(np.column_stack([rows, due]).tolist())

    def _obey(self) -> None:
        name, value = self._connection.recv()
        if name == "motion":
            self._bench.move(lab.TRAJECTORIES[value])
        else:
            (self._bench.change if name == "change" else self._bench.place)(lab.MATERIALS[value])

    def _say(self, sentence: str, **chosen: str) -> None:
        self._connection.send((sentence, self._probe, chosen))


# The source in the loop's process, which MuJoCo never blocks.

_STARTING = 60.0  # s: importing MuJoCo takes one or two, more on a busy machine
_SHORTEST = 1e-4
_LONGEST = 1e-2  # s between samples


def open_source(address: str, options: SourceOptions) -> "Laboratory":
    """Return the laboratory of ``lab:MATERIAL`` or ``lab:MATERIAL,MOTION``."""
    material, _, motion = address.partition(",")
    chosen = material or "ball", motion or "three-sines"
    return Laboratory(*chosen, sample_time=options.sample_time or 1e-3)


class Laboratory:
    """Source that simulates the laboratory's rig in real time.

    A separate process computes the samples slightly ahead; each is delivered at its time.

    Parameters
    ----------
    material, motion : str
        A key of :data:`palpate.lab.MATERIALS` and of :data:`palpate.lab.TRAJECTORIES`. Default:
        "ball" and "three-sines".
    sample_time : float
        Time between samples, s, in [1e-4, 1e-2]. Default: 1e-3.
    probe : str
        ``"twin-pantograph"`` or ``"ideal"``, which also replaces the former if MuJoCo is not
        installed. Default: ``"twin-pantograph"``.
    """

    def __init__(
        self,
        material: str = "ball",
        motion: str = "three-sines",
        *,
        sample_time: float = 1e-3,
        probe: str = "twin-pantograph",
    ) -> None:
        check_choice("material", material, lab.MATERIALS)
        check_choice("motion", motion, lab.TRAJECTORIES)
        if not _SHORTEST <= sample_time <= _LONGEST:
            raise InvalidParameterError(
                f"the laboratory's --rate must be in [{1.0 / _LONGEST:g}, {1.0 / _SHORTEST:g}] Hz, "
                f"not {1.0 / sample_time:g}"
            )
        self._chosen = {"material": material, "motion": motion}
        self.sample_time = sample_time
        self.counts = Counts()
        materials = list(lab.MATERIALS)
        #: Options and their choices. "material" lifts the probe first, "change" does not.
        self.offers = {"material": materials, "motion": list(lab.TRAJECTORIES), "change": materials}
        # Time, position, force, and the due time on the monotonic clock.
        self._rows: deque[list[float]] = deque()
        self._open = False
        self._said: list[str] = []
        self._probe = probe

    @property
    def name(self) -> str:
        """Material and probe."""
        material = lab.MATERIALS[self._chosen["material"]].name
        return f"laboratory: {material}, {self._probe.replace('-', ' ')}"

    @property
    def rest(self) -> float:
        """Time without contact at the start, s, for the tare."""
        return lab.TRAJECTORIES[self._chosen["motion"]].pause

    @property
    def chosen(self) -> dict[str, Any]:
        """The present choices, and the true parameters, which identification should recover."""
        return {**self._chosen, "truth": lab.MATERIALS[self._chosen["material"]].describe()}

    def open(self) -> None:
        """Start the process and wait until the rig is ready."""
        given = self._chosen, self._probe, self.sample_time
        self._process, self._connection = start("laboratory", press, *given)
        self._open = True
        if not self._connection.poll(_STARTING):
            raise RecordingError("the laboratory did not start within a minute")
        if not self._listen():
            raise RecordingError("the laboratory's process crashed at its start")

    def take(self, timeout: float) -> Arrival | None:
        """Wait until the next sample is due, and return it."""
        until = time.monotonic() + timeout
        while not self._rows:
            if not self._connection.poll(max(until - time.monotonic(), 0.0)):
                return None
            if not self._listen():
                raise EndOfSourceError("the laboratory's process has ended unexpectedly")
        row = self._rows[0]
        due = row[3]
        now = time.monotonic()
        if due > now:
            time.sleep(max(min(due, until) - now, 0.0))
            if due > until:
                return None
        self._rows.popleft()
        return Arrival(row[0], row[1], row[2], due)

    def ask(self, options: dict[str, Any]) -> str:
        """Change the material, with the probe lifted or in contact, or the motion."""
        if not options or not set(options) <= set(self.offers):
            raise InvalidParameterError(
                f"options of the laboratory are {', '.join(self.offers)}, not {shown(options)}"
            )
        return "; ".join(self._send_request(name, value) for name, value in options.items())

    def _send_request(self, name: str, value: Any) -> str:
        kind = "motion" if name == "motion" else "material"
        check_choice(kind, value, self.offers[name])
        if not self._open:
            raise InvalidParameterError("the laboratory is not open")
        with suppress(OSError):  # it has crashed; ``take`` reports that
            self._connection.send((name, value))
        self._chosen[kind] = value
        if name == "motion":
            return f"motion: {value}"
        now = "from now on" if name == "change" else "as soon as the probe is out of contact"
        return f"material: {lab.MATERIALS[value].name}, {now}"

    def news(self) -> list[str]:
        """Return the laboratory's messages since the last call."""
        if self._open:
            self._listen()
        said = self._said
        self._said = []
        return said

    def _listen(self) -> bool:
        """Read the pending samples and messages; return whether the process still runs."""
        with suppress(EOFError, OSError):
            while self._connection.poll():
                message = self._connection.recv()
                if isinstance(message, list):
                    self._rows.extend(message)
                    continue
                sentence, self._probe, chosen = message
                self._said += [sentence] if sentence else []
                self._chosen |= chosen
            return True
        return False

    def close(self) -> None:
        """End the process."""
        if not self._open:
            return
        self._open = False
        self._connection.close()  # which tells the process to end
        end([self._process], 2.0)
