"""The laboratory as a source: its stepping runs beside the loop, a little ahead of the clock."""

import time
from collections import deque
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

from palpate.errors import InvalidParameterError, MissingExtraError, RecordingError
from palpate.lab import (
    MATERIALS,
    TRAJECTORIES,
    Bench,
    IdealProbe,
    OngoingBench,
    Sensors,
    TwinPantograph,
)
from palpate.live.realtime import end, give_way, show_name, start
from palpate.live.ring import Address, Reader, Writer
from palpate.live.sources import Arrival, Counts, EndOfSourceError, SourceOptions
from palpate.validation import one_of, shown

#: Of a row: time, position, force, and when it is due by the monotonic clock.
WIDTH = 4
#: Rows that wait for the loop: 4 s at 1 kHz, after which the oldest are lost, and counted.
CAPACITY = 4096
# s ahead of the clock: other work of this machine, such as a browser that draws, may hold the
# process up for a tenth of a second; and no longer than this a person waits for what is asked.
_AHEAD = 0.2
# s at a time: the kinematics of some samples together take little more than those of one.
_BLOCK = 0.01
_BEHIND = 1.0  # s, after which the laboratory's clock is set anew


@dataclass(frozen=True, slots=True)
class Setup:
    """What the laboratory begins with."""

    material: str
    motion: str
    sample_time: float
    seed: int
    probe: str

    def bench(self) -> tuple[OngoingBench, str, str]:
        """Return the bench, its probe's name, and what is to be said of it."""
        probe = IdealProbe() if self.probe == "ideal" else TwinPantograph()
        touched, sensors = MATERIALS[self.material], Sensors(sample_time=self.sample_time)
        try:
            bench = Bench(touched, TRAJECTORIES[self.motion], probe, sensors)
            return OngoingBench(bench, self.seed), probe.name, ""
        except MissingExtraError as error:
            own, name, _ = replace(self, probe="ideal").bench()
            return own, name, f"an {name} in place of the {probe.name}: {error}"


def press(setup: Setup, ring: Address, connection: Connection) -> None:
    """Write samples until the other end of the connection is closed."""
    show_name("lab")
    give_way(gently=False)
    with (
        closing(Writer(made=ring)) as writer,
        suppress(BrokenPipeError, ConnectionResetError, EOFError),
    ):
        _Pressing(setup, writer, connection).run()


class _Pressing:
    def __init__(self, setup: Setup, writer: Writer, connection: Connection) -> None:
        self._setup, self._writer, self._connection = setup, writer, connection
        self._bench, self._probe, words = setup.bench()
        self._say(words)
        self._began = time.monotonic() + _BLOCK  # all the rest of the lead is gained in a moment
        self._block = max(round(_BLOCK / setup.sample_time), 1)

    def run(self) -> None:
        while True:
            early = self._began + self._bench.now - _AHEAD - time.monotonic()
            # What is asked for wakes it.
            if self._connection.poll(max(early, 0.0)):
                self._obey()
                continue
            if early < -_BEHIND:
                self._began -= early
                self._say(f"the laboratory was {-early:.1f} s behind: its clock is set anew")
            self._press()

    def _press(self) -> None:
        try:
            rows = self._bench.advance(self._block)
        except InvalidParameterError as error:
            first = {"material": self._setup.material, "motion": self._setup.motion}
            self._say(f"{error}; the first material is back", **first)
            return
        dues = rows[:, 0] + self._began
        now = time.monotonic()
        for row, due in zip(rows.tolist(), dues.tolist(), strict=True):
            self._writer.write(*row, max(due, now))

    def _obey(self) -> None:
        name, value = self._connection.recv()
        if name == "motion":
            self._bench.move(TRAJECTORIES[value])
        else:
            (self._bench.change if name == "change" else self._bench.place)(MATERIALS[value])

    def _say(self, sentence: str, **chosen: str) -> None:
        self._connection.send((sentence, self._probe, chosen))


# The laboratory at its own pace, in a process of its own: MuJoCo never holds the loop.

_STARTING = 60.0  # s: MuJoCo takes one or two to be imported, more on a busy machine
_SHORTEST, _LONGEST = 1e-4, 1e-2  # s between samples
_LOOK_AGAIN = 2e-4  # s, where the laboratory is behind


def open_source(address: str, options: SourceOptions) -> "Laboratory":
    """Return the laboratory of ``lab:MATERIAL`` or ``lab:MATERIAL,MOTION``."""
    material, _, motion = address.partition(",")
    chosen, step = (material or "ball", motion or "three-sines"), options.sample_time or 1e-3
    return Laboratory(*chosen, sample_time=step, seed=options.seed)


class Laboratory:
    """The laboratory's rig in place of a robot, in real time.

    A process of its own computes samples a little ahead, and each is there to be taken when its
    time has come.

    Parameters
    ----------
    material, motion : str
        Of :data:`palpate.lab.MATERIALS` and :data:`palpate.lab.TRAJECTORIES`.
    sample_time : float
        s, in [1e-4, 1e-2].
    seed : int
        Of noise, bias and encoder phases.
    probe : str
        ``"twin-pantograph"``; or ``"ideal"``, which is taken too where MuJoCo is absent.
    """

    def __init__(
        self,
        material: str = "ball",
        motion: str = "three-sines",
        *,
        sample_time: float = 1e-3,
        seed: int = 0,
        probe: str = "twin-pantograph",
    ) -> None:
        given = {"material": material, "motion": motion}
        self._chosen = {kind: _known(kind, name) for kind, name in given.items()}
        if not _SHORTEST <= sample_time <= _LONGEST:
            raise InvalidParameterError(
                f"the laboratory's --rate must be from {1.0 / _LONGEST:g} to {1.0 / _SHORTEST:g} "
                f"samples a second, not {1.0 / sample_time:g}"
            )
        self._setup = Setup(material, motion, sample_time, seed, probe)
        self.sample_time, self.counts = sample_time, Counts()
        materials = list(MATERIALS)
        #: What can be asked for, and the choices: the material with the probe lifted meanwhile, or
        #: changed under it.
        self.offers = {"material": materials, "motion": list(TRAJECTORIES), "change": materials}
        self._rows: deque[list[float]] = deque()
        self._open = False
        self._said: list[str] = []
        self._probe = probe

    @property
    def name(self) -> str:
        """What is touched by what."""
        material = MATERIALS[self._chosen["material"]].name
        return f"laboratory: {material}, {self._probe.replace('-', ' ')}"

    @property
    def rest(self) -> float:
        """Time at the start in which nothing is touched, s: for a tare."""
        return TRAJECTORIES[self._chosen["motion"]].pause

    @property
    def chosen(self) -> dict[str, Any]:
        """What is chosen now; and the truth, which identification should give back."""
        return {**self._chosen, "truth": MATERIALS[self._chosen["material"]].describe()}

    def open(self) -> None:
        """Start the process, and wait until the rig stands."""
        self._ring = Writer(CAPACITY, WIDTH)
        self._reader = Reader(self._ring.address)
        given = self._setup, self._ring.address
        self._process, self._connection = start("laboratory", press, *given)
        self._open = True
        if not self._connection.poll(_STARTING):
            raise RecordingError("the laboratory did not begin within a minute")
        if not self._listen():
            raise RecordingError("the laboratory's process ended before it began")

    def take(self, timeout: float) -> Arrival | None:
        """Wait until the next sample is due, and return it."""
        until = time.monotonic() + timeout
        while not self._rows:
            taken = self._reader.take()
            self.counts.lost += taken.dropped
            self._rows.extend(taken.rows.tolist())
            if not self._rows:
                if not self._process.is_alive():
                    raise EndOfSourceError("the laboratory's process has ended by itself")
                if time.monotonic() >= until:
                    return None
                time.sleep(_LOOK_AGAIN)
        row = self._rows[0]
        due, now = row[3], time.monotonic()
        if due > now:
            time.sleep(max(min(due, until) - now, 0.0))
            if due > until:
                return None
        self._rows.popleft()
        return Arrival(row[0], row[1], row[2], due)

    def ask(self, options: dict[str, Any]) -> str:
        """Exchange the material, under the lifted probe or at once; or the motion."""
        if not options or not set(options) <= set(self.offers):
            raise InvalidParameterError(
                f"the laboratory can be asked for {', '.join(self.offers)}, not {shown(options)}"
            )
        return "; ".join(self._asked(name, value) for name, value in options.items())

    def _asked(self, name: str, value: Any) -> str:
        kind = "motion" if name == "motion" else "material"
        chosen = _known(kind, value)
        if not self._open:
            raise InvalidParameterError("the laboratory is not open")
        with suppress(OSError):  # it has ended, which the next sample that is asked for says
            self._connection.send((name, chosen))
        self._chosen[kind] = chosen
        if name == "motion":
            return f"motion: {chosen}"
        now = "from now on" if name == "change" else "when the probe has left the other"
        return f"material: {MATERIALS[chosen].name}, {now}"

    def news(self) -> list[str]:
        """What the laboratory has said since this was last asked for."""
        if self._open:
            self._listen()
        said, self._said = self._said, []
        return said

    def _listen(self) -> bool:
        """Take the words that wait; whether the process is there to say more."""
        with suppress(EOFError, OSError):
            while self._connection.poll():
                sentence, self._probe, chosen = self._connection.recv()
                self._said += [sentence] if sentence else []
                self._chosen |= chosen
            return True
        return False

    def close(self) -> None:
        """End the process; the memory is given back."""
        if not self._open:
            return
        self._open = False
        self._connection.close()  # by which it knows
        end([self._process], 2.0)
        self._reader.close()
        self._ring.close()


def _known(kind: str, name: Any) -> str:
    names = MATERIALS if kind == "material" else TRAJECTORIES
    one_of(kind, name, names)
    return str(name)
