"""The loop: each sample is prepared, learned and written down before the next one comes.

It runs in one thread, which waits nowhere but in the source. Whatever shows or stores what it found
reads the ring, in another process.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from palpate._core import Status
from palpate.errors import InvalidParameterError, PalpateError
from palpate.estimators import ContactEstimator
from palpate.live.arrivals import Arrival, Value
from palpate.live.choices import chosen
from palpate.live.commands import Command
from palpate.live.counts import LoopCounts
from palpate.live.laws_in_force import LawsInForce
from palpate.live.ring import MOST_PARAMETERS, Writer
from palpate.live.sources.source import EndOfSourceError, Source
from palpate.live.states import State
from palpate.live.statistics import Histogram
from palpate.live.status import status_of
from palpate.live.watchdog import Watchdog
from palpate.preparation import OnlinePreparation
from palpate.validation import number_in

IN_TIME = 1e-3  # s: a cycle is in time when it is done so long after its sample was there
SHOWN_FOR = 1.0  # s: how long a change is a state
SILENT = 20  # sample times without a sample, but at least SILENT_TIME, are a silence
SILENT_TIME = 0.2  # s
PATIENCE = 1.0  # s: of a slow source too, a person who asks for something is heard meanwhile
_NONE = (math.nan,) * 4
#: Of a sample that was learned.
TAKEN = frozenset({Status.UPDATED, Status.GUARDED, Status.RESTARTED})
_REFUSED = frozenset({Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE})
_EMPTY_PARAMETERS = (math.nan,) * MOST_PARAMETERS
_NO_NUMBER = "samples come that are no numbers, or too large: they are refused"
_STARVING = "samples come too seldom for the velocity's window: say their --rate"


@dataclass(slots=True)
class Loop:
    """Source, preparation and estimator, and what came of each sample.

    Parameters
    ----------
    source : Source
        Open.
    preparation : OnlinePreparation
        Makes the velocity, and what else the estimator takes.
    estimator : ContactEstimator
        Learns.
    ring : Writer
        Where each sample is written down.
    commands : callable
        Returns the next command that waits, or None; asked between samples.
    """

    source: Source
    preparation: OnlinePreparation
    estimator: ContactEstimator
    ring: Writer
    commands: Callable[[], Command | None] = field(default=lambda: None)
    counts: LoopCounts = field(default_factory=LoopCounts)
    cycle: Histogram = field(default_factory=lambda: Histogram(20e-6))
    lateness: Histogram = field(default_factory=lambda: Histogram(IN_TIME))
    state: State = State.FREE
    held: bool = False
    stopped: bool = False
    said: list[str] = field(default_factory=list)
    #: What a person wants of the recorder, and how many wishes there were.
    record: dict[str, Any] = field(default_factory=lambda: {"wish": 0, "on": False})
    laws: LawsInForce = field(init=False)
    watchdog: Watchdog = field(init=False)
    generation: int = 0
    _changed: float = -math.inf
    _direction: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        given = self.preparation.settings["direction"]
        if given is not None:
            size = math.hypot(*given)
            self._direction = tuple(float(each) / size for each in given)
        self._check_size(self.estimator)
        self.laws = LawsInForce.of(self.estimator)
        self.watchdog = Watchdog.of(self.preparation, getattr(self.source, "pace", 1.0))

    def run(self) -> None:
        """Go on until the source ends, or somebody says stop.

        Raises
        ------
        InvalidParameterError
            The source delivers vectors, and there is no direction; or the other way round.
        """
        silent = max(SILENT * self.source.sample_time, SILENT_TIME)
        patience, waited = min(silent, PATIENCE), 0.0
        while not self.stopped:
            try:
                arrival = self.source.take(patience)
            except EndOfSourceError as end:
                if str(end):
                    self.say(str(end))
                return
            if arrival is None:
                waited += patience
                if waited >= silent:
                    self._silence()
            else:
                waited = 0.0
                self.step(arrival)
            self._obey()

    def step(self, arrival: Arrival) -> None:
        """Take one sample through preparation and estimator, and write it down."""
        counts, estimator = self.counts, self.estimator
        if not counts.taken:
            self._check(arrival)
        counts.taken += 1
        fault = self.watchdog.see(arrival)
        sample = self.preparation.update(arrival.position, arrival.force, arrival.time)
        began = time.perf_counter()
        status, predicted, prepared = Status.WAITING, math.nan, _NONE
        if sample is not None:
            prepared = (sample.time, sample[0], sample[1], sample[2])
            if not self.held:
                predicted = estimator.predict(sample[0], sample[1])
                began = time.perf_counter()
                status = estimator.update(*sample)
        elif self.preparation.status is Status.RESTARTED:
            estimator.leave_contact()
        estimate = estimator.estimate()
        took = time.perf_counter() - began
        self.laws.see(arrival.time, estimator)
        self._judge(arrival, status, fault, sampled=sample is not None)
        self._write(arrival, prepared, predicted, status, estimate, took)
        if sample is not None and not self.held:
            self.cycle.add(took)
        self.lateness.add(time.monotonic() - arrival.there)

    def _check(self, first: Arrival) -> None:
        """Refuse a source whose samples are of another form than is prepared."""
        vectors = not isinstance(first.position, float)
        if vectors and self._direction == (0.0, 0.0, 0.0):
            raise InvalidParameterError(
                f"{self.source.name} delivers vectors: say --direction, into the material, such as "
                "0,0,-1"
            )
        if not vectors and self._direction != (0.0, 0.0, 0.0):
            raise InvalidParameterError(
                f"{self.source.name} delivers numbers, of which --direction cannot be taken"
            )

    def _judge(self, arrival: Arrival, status: Status, fault: str, *, sampled: bool) -> None:
        """The state that a person sees."""
        counts = self.counts
        preparing = self.preparation.status
        refused = status in _REFUSED or preparing in _REFUSED
        starving = self.watchdog.starving(arrival, prepared=sampled or self._taring)
        if refused or fault or starving:
            self._complain(fault or ("" if refused else _STARVING), arrival)
        if status in TAKEN:
            counts.learned += 1
        if status is Status.RESTARTED:
            counts.changes += 1
            self._changed = arrival.time
        counts.refused += refused
        if self.watchdog.shows(arrival.there):
            self.state = State.INVALID
        elif self.held:
            self.state = State.HELD
        elif not sampled and preparing is Status.WAITING and self._taring:
            self.state = State.TARING
        elif 0.0 <= arrival.time - self._changed < SHOWN_FOR:
            self.state = State.CHANGED
        elif sampled:
            self.state = State.CONTACT if status in TAKEN else State.FREE

    def _complain(self, words: str, arrival: Arrival) -> None:
        if self.watchdog.fault(words or _NO_NUMBER, arrival.there):
            self.say(self.watchdog.words)

    @property
    def _taring(self) -> bool:
        return self.preparation.settings["tare_time"] > 0.0 and math.isnan(self.preparation.tare)

    def _write(
        self,
        arrival: Arrival,
        prepared: tuple[float, ...],
        predicted: float,
        status: Status,
        estimate: Any,
        took: float,
    ) -> None:
        size, flat = len(estimate.parameters), [0.0] * MOST_PARAMETERS**2
        if estimate.samples:
            parameters, covariance = estimate.parameters.tolist(), estimate.covariance.tolist()
            for i in range(size):
                flat[i * MOST_PARAMETERS : i * MOST_PARAMETERS + size] = covariance[i]
        else:  # where an estimator starts is nothing that it knows
            parameters, flat = [math.nan] * size, [math.nan] * MOST_PARAMETERS**2
        position, force = self._axes(arrival.position), self._axes(arrival.force)
        self.ring.write(
            prepared[0],
            arrival.time,
            position[0],
            force[0],
            prepared[1],
            prepared[2],
            prepared[3],
            predicted,
            status,
            self.preparation.status,
            self.state,
            estimate.offset,
            estimate.surface,
            estimate.validity_margin,
            took,
            time.monotonic() - arrival.there,
            self.generation,
            *parameters,
            *_EMPTY_PARAMETERS[size:],
            *flat,
            *position[1:],
            *force[1:],
        )

    def _axes(self, value: Value) -> tuple[float, float, float, float]:
        """Its part along the contact normal, into the material; and what came."""
        if isinstance(value, float):
            return value, value, math.nan, math.nan
        (x, y, z), (a, b, c) = self._direction, value
        return x * a + y * b + z * c, a, b, c

    def _silence(self) -> None:
        """Nothing came for a while: hold what is known."""
        if self.state is not State.LOST:
            self.state = State.LOST
            self.counts.silences += 1
            self.say("no sample comes: the estimate is held")

    def say(self, words: str) -> None:
        """Tell whoever looks on; the last few are kept."""
        self.said = [*self.said[-7:], f"{time.strftime('%H:%M:%S')} {words}"]

    def _obey(self) -> None:
        """Do what was asked for since the last sample."""
        while (command := self.commands()) is not None:
            try:
                self._do(command)
            except (PalpateError, TypeError) as error:  # of a person's request, not of data
                self.say(f"{command.name}: {error}")

    def _do(self, command: Command) -> None:
        options = command.options
        if command.name == "stop":
            self.stopped = True
        elif command.name in ("hold", "resume"):
            self.held = command.name == "hold"
            self.say("held" if self.held else "resumed")
            if self.held:
                self.estimator.leave_contact()
        elif command.name == "reset":
            self._exchange(self.estimator.replace(), "reset: all is forgotten")
        elif command.name == "tare":
            seconds = number_in("seconds", options.get("seconds", 1.0), 0.01, 60.0)
            settings = {**self.preparation.settings, "tare_time": seconds}
            self.preparation = OnlinePreparation(**settings)
            self.estimator.leave_contact()
            self.say(f"taring for {seconds:g} s: touch nothing")
        elif command.name == "estimator":
            made = chosen(self.estimator, options)
            self._exchange(made, f"estimator: {made.method}")
        elif command.name == "source":
            self.say(self.source.ask(options))
        elif command.name == "record":
            path = options.get("path")
            on = bool(options.get("on", path is not None))
            wish, since = self.record["wish"] + 1, self.ring.count
            self.record = {"wish": wish, "on": on, "path": path, "since": since}

    def _check_size(self, estimator: ContactEstimator) -> None:
        if len(estimator.law_type.symbols) > MOST_PARAMETERS:
            raise InvalidParameterError(
                f"{estimator.method} has a law of more than {MOST_PARAMETERS} parameters: the loop "
                "has no room for it"
            )

    def _exchange(self, estimator: ContactEstimator, words: str) -> None:
        self._check_size(estimator)
        self.estimator = estimator
        self.laws = LawsInForce.of(estimator)
        self.generation += 1
        self._changed = -math.inf
        self.say(words)

    def status(self) -> dict[str, Any]:
        """What is to be known beside the samples, as plain numbers and words."""
        return status_of(self)
