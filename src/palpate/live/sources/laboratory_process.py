"""What runs beside the loop: the laboratory's stepping, a little ahead of the clock."""

import time
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.lab import MATERIALS, TRAJECTORIES, Bench, IdealProbe, OngoingBench, Sensors
from palpate.live.realtime import give_way, show_name
from palpate.live.ring import Address, Writer

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
        sensors = Sensors(sample_time=self.sample_time)
        material, motion = MATERIALS[self.material], TRAJECTORIES[self.motion]
        if self.probe != "ideal":
            from palpate.lab import TwinPantograph

            try:
                bench = Bench(material, motion, TwinPantograph(), sensors)
                return OngoingBench(bench, self.seed), "twin pantograph", ""
            except MissingExtraError as error:
                words = f"an ideal probe in place of the twin pantograph: {error}"
        else:
            words = ""
        bench = Bench(material, motion, IdealProbe(), sensors)
        return OngoingBench(bench, self.seed), "ideal probe", words


@dataclass(frozen=True, slots=True)
class Word:
    """What the process says."""

    sentence: str
    probe: str
    chosen: dict[str, str] = field(default_factory=dict)


def press(setup: Setup, ring: Address, connection: Connection) -> None:
    """Write samples until the other end of the connection is closed."""
    show_name("lab")
    give_way(gently=False)
    writer = Writer(made=ring)
    with suppress(BrokenPipeError, ConnectionResetError, EOFError):
        bench, probe, words = setup.bench()
        connection.send(Word(words, probe))
        _Pressing(setup, bench, probe, writer, connection).run()
    writer.close()


class _Pressing:
    def __init__(
        self,
        setup: Setup,
        bench: OngoingBench,
        probe: str,
        writer: Writer,
        connection: Connection,
    ) -> None:
        self._setup, self._bench, self._probe = setup, bench, probe
        self._writer, self._connection = writer, connection
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
            chosen = {"material": self._setup.material, "motion": self._setup.motion}
            self._say(f"{error}; the first material is back", chosen)
            return
        dues = rows[:, 0] + self._began
        now = time.monotonic()
        for row, due in zip(rows.tolist(), dues.tolist(), strict=True):
            self._writer.write(*row, max(due, now))

    def _obey(self) -> None:
        name, value = self._connection.recv()
        if name == "motion":
            self._bench.move(TRAJECTORIES[value])
        elif name == "change":
            self._bench.change(MATERIALS[value])
        else:
            self._bench.place(MATERIALS[value])

    def _say(self, sentence: str, chosen: dict[str, str] | None = None) -> None:
        self._connection.send(Word(sentence, self._probe, chosen or {}))
