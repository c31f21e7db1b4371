"""The loop: each sample is prepared, learned and written down before the next one comes.

It runs in one thread, which waits nowhere but in the source. Whatever shows or stores what it found
reads the ring, in another process.
"""

import math
import time
from base64 import b64encode
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.errors import InvalidParameterError, PalpateError
from palpate.estimators import ContactEstimator
from palpate.estimators.law_verdicts import Candidate
from palpate.live.choices import LiveCommand, LoopCounts, State, chosen, main_settings
from palpate.live.ring import MOST_PARAMETERS, Writer
from palpate.live.sources import Arrival, EndOfSourceError, Source, Value
from palpate.preparation import OnlinePreparation
from palpate.preparation.velocity import window_samples
from palpate.validation import defined, number_in

# Ends of the bins, s: a twentieth of a decade apart, so that a percentile is known to 12 %.
_ENDS: list[float] = [1e-7 * 10.0 ** (k / 20.0) for k in range(181)]


class Histogram:
    """Times in s, counted into logarithmic bins; their maximum and how many exceed a limit.

    Parameters
    ----------
    limit : float
        s.
    """

    def __init__(self, limit: float) -> None:
        self._bins = [0] * (len(_ENDS) + 1)
        self.limit, self.count, self.over, self.largest = limit, 0, 0, 0.0

    def add(self, seconds: float) -> None:
        """Count one time."""
        self.count += 1
        if seconds > self.largest:
            self.largest = seconds
        if seconds > self.limit:
            self.over += 1
        self._bins[bisect_left(_ENDS, seconds)] += 1

    def percentile(self, percent: float) -> float:
        """The upper end of the bin that holds a percentile, s; NaN of none."""
        if not self.count:
            return math.nan
        reached = np.cumsum(self._bins) >= percent / 100.0 * self.count
        return min([*_ENDS, math.inf][int(np.argmax(reached))], self.largest)

    def as_dict(self) -> dict[str, Any]:
        """Return p50, p99, p99.9 and the maximum, s, and what is within the limit."""
        within = 1.0 - self.over / self.count if self.count else math.nan
        percentiles = {f"p{each:g}": self.percentile(each) for each in (50.0, 99.0, 99.9)}
        whole = {"max": self.largest, "limit": self.limit, "within": within}
        return {"count": self.count, **percentiles, **whole}


# Which law it is, as the loop sees it: the law in force after each sample, and when it changed.

# Turns of the verdict that are remembered: more than that in a few seconds is one that flickers.
_REMEMBERED = 6


@dataclass(slots=True)
class LawsInForce:
    """The law in force, since when, and which were before it.

    Where the evidence is given up, as when the material changes, there is none until the next
    verdict, and the count of changes starts again.

    Attributes
    ----------
    shown : list of int
        Places of the law's parameters that some law on offer has as its own.
    remembers : bool
        Whether a law on offer has memory, so that K is the stiffness once it has relaxed.
    now : Candidate, optional
        The law in force.
    changes : int
        How often it changed since the evidence began.
    turns : deque
        A time, s; what was in force from then on, None of none; and of how many samples.
    """

    shown: list[int]
    remembers: bool
    now: Candidate | None = None
    changes: int = 0
    turns: deque[Any] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    @classmethod
    def of(cls, estimator: ContactEstimator) -> "LawsInForce":
        """Return that of an estimator which has learned nothing yet."""
        names = estimator.law_type.names()
        if not estimator.chooses_law:
            return cls(list(range(len(names))), remembers=False)
        own = {name for law in estimator.offered for name in law.own}
        shown = [place for place, name in enumerate(names) if name in own]
        return cls(shown, remembers=any(law.memory != "none" for law in estimator.offered))

    def see(self, time: float, estimator: ContactEstimator) -> None:
        """Look at an estimator after a sample; at one that offers a single law there is nothing."""
        if not estimator.chooses_law:
            return
        if (now := estimator.candidate) is self.now:
            return
        self.changes = 0 if now is None or self.now is None else self.changes + 1
        self.now, samples = now, estimator.evidence().samples
        self.turns.append((time, None if now is None else str(now), samples))

    def page(self, estimator: ContactEstimator) -> dict[str, Any] | None:
        """Return what a verdict is worked out from, as JSON takes it; None where there is none.

        It is worked out where it is shown, by :func:`palpate.live.view.verdict_on`: the
        loop has not the time.
        """
        if not estimator.chooses_law:
            return None
        estimate = estimator.estimate()
        learned = len(self.turns) > 0  # where an estimator starts is nothing that it knows
        return {
            "evidence": estimator.evidence(),
            "fixed": estimate.fixed,
            "parameters": estimate.parameters.tolist() if learned else None,
            # Of 64 numbers: as digits they would take JSON ten times as long.
            "covariance": b64encode(estimate.covariance.tobytes()).decode() if learned else None,
            "flags": estimate.flags,
            "changes": self.changes,
            "turns": list(self.turns),
        }


# What may be wrong with a source, seen at the times of its samples.

#: s that a fault stays to be seen, though its sample may have been the only one.
FAULT_SHOWN_FOR = 0.5
#: Samples of which none could be prepared, after which they come too seldom for the window.
STARVED = 200
_SAID_EVERY = 1.0  # s


@dataclass(slots=True)
class Watchdog:
    """Compares the source's clock with this machine's, a sample at a time.

    Parameters
    ----------
    longest_gap : float
        s; a longer time between samples begins a new window.
    counts : LoopCounts
        Where it counts what is wrong.
    pace : float
        How fast the source's clock goes: that of a recording may be replayed faster.
    """

    longest_gap: float
    counts: LoopCounts
    pace: float
    #: In words, what was wrong last.
    text: str = ""
    _time: float = math.nan
    _there: float = 0.0
    _unprepared: int = 0
    _shown_until: float = -math.inf
    _said: dict[str, float] = field(default_factory=dict)

    def see(self, arrival: Arrival) -> str:
        """Return what is wrong with a sample's time, in words; or nothing."""
        step, elapsed = arrival.time - self._time, arrival.there - self._there
        if 0.0 < step <= self.longest_gap:
            self._time, self._there = arrival.time, arrival.there
            return ""
        return self._judge(arrival, step, elapsed * self.pace)

    def _judge(self, arrival: Arrival, step: float, elapsed: float) -> str:
        counts = self.counts
        if not math.isfinite(arrival.time):
            return "a sample has no time"
        if step == 0.0:
            counts.repeated += 1
            return "samples come repeatedly: they are refused"
        if -self.longest_gap <= step < 0.0:
            counts.disordered += 1
            return "samples come out of order: the late ones are refused"
        self._time, self._there = arrival.time, arrival.there
        if step < 0.0:
            counts.jumps += 1
            return f"the source's clock went back by {-step:.3g} s"
        if step > 2.0 * elapsed + self.longest_gap:
            counts.jumps += 1
            return f"the source's clock went ahead by {step:.3g} s in {elapsed:.3g} s"
        # Of the first sample of all the step is not a number.
        counts.gaps += not math.isnan(step)
        return ""

    def starving(self, *, prepared: bool) -> bool:
        """Whether samples come, but too seldom for any to be prepared."""
        self._unprepared = 0 if prepared else self._unprepared + 1
        return self._unprepared > STARVED

    def fault(self, text: str, there: float) -> bool:
        """Note a fault, which is shown for a while; whether it is to be said, not too often."""
        self.text, self._shown_until = text, there + FAULT_SHOWN_FOR
        kind = text.partition(" by ")[0]
        if there - self._said.get(kind, -math.inf) < _SAID_EVERY:
            return False
        self._said[kind] = there
        return True

    def shows(self, there: float) -> bool:
        """Whether the last fault is still to be seen."""
        return there < self._shown_until


_USUAL = OnlinePreparation().settings
IN_TIME = 1e-3  # s: a cycle is in time when it is done so long after its sample was there
SHOWN_FOR = 1.0  # s: how long a change is a state
SILENT = 20  # sample times without a sample, but at least SILENT_TIME, are a silence
SILENT_TIME = 0.2  # s
PATIENCE = 1.0  # s: of a slow source too, a person who asks for something is heard meanwhile
#: s of the samples' clock between estimates, where nobody asks for one at every sample.
ESTIMATED_EVERY = 0.02
_NONE = (math.nan,) * 4
#: Of a sample that was learned.
TAKEN = frozenset({Status.UPDATED, Status.GUARDED, Status.RESTARTED})
_REFUSED = frozenset({Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE})
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
    samples, estimates : Writer
        Where each sample is written down, and the estimates.
    commands : callable
        Returns the next command that waits, or None; asked between samples.
    every_sample : bool
        Whether the estimate is computed at every sample; else every 20 ms of the samples' clock,
        and at once where the state, the law, the material or the estimator is another.
    """

    source: Source
    preparation: OnlinePreparation
    estimator: ContactEstimator
    samples: Writer
    estimates: Writer
    commands: Callable[[], LiveCommand | None] = field(default=lambda: None)
    every_sample: bool = False
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
    _estimated: tuple[Any, ...] = ()  # what was known of the moment of the newest estimate
    _direction: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        settings = self.preparation.settings
        if (given := settings["direction"]) is not None:
            self._direction = tuple(float(each) / math.hypot(*given) for each in given)
        if (gap := settings["longest_gap"]) is None:
            step = settings["sample_time"]
            gap = step * window_samples(step, settings["velocity_window"])
        self.watchdog = Watchdog(gap, self.counts, getattr(self.source, "pace", 1.0))
        self._begin(self.estimator)

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
                break
            if arrival is None:
                waited += patience
                if waited >= silent and self.state is not State.LOST:
                    self.state = State.LOST
                    self.counts.silences += 1
                    self.say("no sample comes: the estimate is held")
            else:
                waited = 0.0
                self.step(arrival)
            self._obey()
        self._estimate()

    def step(self, arrival: Arrival) -> None:
        """Take one sample through preparation and estimator, and write it down."""
        counts, estimator = self.counts, self.estimator
        if not counts.taken:
            self._check(arrival)
        counts.taken += 1
        fault = self.watchdog.see(arrival)
        sample = self.preparation.update(arrival.position, arrival.force, arrival.time)
        status, predicted, prepared = Status.WAITING, math.nan, _NONE
        began = time.perf_counter()
        if sample is not None:
            prepared = (sample.time, sample[0], sample[1], sample[2])
            if not self.held:
                predicted = estimator.predict(sample[0], sample[1])
                began = time.perf_counter()
                status = estimator.update(*sample)
        elif self.preparation.status is Status.RESTARTED:
            estimator.leave_contact()
        took = time.perf_counter() - began
        self.laws.see(arrival.time, estimator)
        self._judge(arrival, status, fault, sampled=sample is not None)
        tick = arrival.time // ESTIMATED_EVERY
        moment = (tick, self.state, self.laws.now, counts.changes, self.generation)
        if self.every_sample or moment != self._estimated:
            self._estimated = moment
            took += self._estimate()
        position, force = self._axes(arrival.position), self._axes(arrival.force)
        late = time.monotonic() - arrival.there
        came = prepared[0], arrival.time, position[0], force[0]
        seen = status, self.preparation.status, self.state, took, late, self.estimates.count - 1
        self.samples.write(*came, *prepared[1:], predicted, *seen, *position[1:], *force[1:])
        if sample is not None and not self.held:
            self.cycle.add(took)
        self.lateness.add(late)

    def _estimate(self) -> float:
        """Write down what the estimator knows now; how long it took to say so, s."""
        began = time.perf_counter()
        estimate = self.estimator.estimate()
        took = time.perf_counter() - began
        known = np.full(MOST_PARAMETERS * (1 + MOST_PARAMETERS), math.nan)
        if estimate.samples:  # where an estimator starts is nothing that it knows
            parameters = estimate.parameters
            size = len(parameters)
            known[:size], known[MOST_PARAMETERS:] = parameters, 0.0
            known[MOST_PARAMETERS:].reshape(MOST_PARAMETERS, -1)[:size, :size] = estimate.covariance
        margin = estimate.validity_margin
        self.estimates.write(
            self.generation, estimate.offset, estimate.surface, margin, *known.tolist()
        )
        return took

    def _check(self, first: Arrival) -> None:
        """Refuse a source whose samples are of another form than is prepared."""
        vectors = not isinstance(first.position, float)
        if vectors is not (self._direction == (0.0, 0.0, 0.0)):
            return
        advice = "numbers, of which --direction cannot be taken"
        if vectors:
            advice = "vectors: say --direction, into the material, such as 0,0,-1"
        raise InvalidParameterError(f"{self.source.name} delivers {advice}")

    def _judge(self, arrival: Arrival, status: Status, fault: str, *, sampled: bool) -> None:
        """The state that a person sees."""
        counts = self.counts
        preparing = self.preparation.status
        refused = status in _REFUSED or preparing in _REFUSED
        starving = self.watchdog.starving(prepared=sampled or self._taring)
        if refused or fault or starving:
            text = fault or (_NO_NUMBER if refused else _STARVING)
            if self.watchdog.fault(text, arrival.there):
                self.say(text)
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

    @property
    def _taring(self) -> bool:
        return self.preparation.settings["tare_time"] > 0.0 and math.isnan(self.preparation.tare)

    def _axes(self, value: Value) -> tuple[float, float, float, float]:
        """Its part along the contact normal, into the material; and what came."""
        if isinstance(value, float):
            return value, value, math.nan, math.nan
        (x, y, z), (a, b, c) = self._direction, value
        return x * a + y * b + z * c, a, b, c

    def say(self, text: str) -> None:
        """Tell whoever looks on; the last few are kept."""
        self.said = [*self.said[-7:], f"{time.strftime('%H:%M:%S')} {text}"]

    def _obey(self) -> None:
        """Do what was asked for since the last sample."""
        while (command := self.commands()) is not None:
            try:
                self._do(command)
            except (PalpateError, TypeError) as error:  # of a person's request, not of data
                self.say(f"{command.name}: {error}")

    def _do(self, command: LiveCommand) -> None:
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
            ask = getattr(self.source, "ask", None)
            if ask is None:
                raise InvalidParameterError(f"of {self.source.name} nothing can be chosen")
            self.say(ask(options))
        elif command.name == "record":
            path = options.get("path")
            on = bool(options.get("on", path is not None))
            wish, since = self.record["wish"] + 1, self.samples.count
            # From here on: the recorder hears a little later that it is to end.
            self.every_sample = self.every_sample or on
            self.record = {"wish": wish, "on": on, "path": path, "since": since}

    def _begin(self, estimator: ContactEstimator) -> None:
        if len(estimator.law_type.symbols) > MOST_PARAMETERS:
            raise InvalidParameterError(
                f"{estimator.method} has a law of more than {MOST_PARAMETERS} parameters: the loop "
                "has no room for it"
            )
        self.estimator, self.laws = estimator, LawsInForce.of(estimator)

    def _exchange(self, estimator: ContactEstimator, text: str) -> None:
        self._begin(estimator)
        self.generation += 1
        self._changed = -math.inf
        self.say(text)

    def status(self) -> dict[str, Any]:
        """What is to be known beside the samples, in numbers and words, as JSON takes it."""
        source, estimator, law = self.source, self.estimator, self.estimator.law_type
        settings = self.preparation.settings
        unusual = [name for name in settings if repr(settings[name]) != repr(_USUAL[name])]
        came, own = asdict(source.counts), {"late": self.lateness.over, **asdict(self.counts)}
        return {
            "source": source.name,
            "sample_time": source.sample_time,
            "delay": self.preparation.delay,
            "tare": defined(self.preparation.tare),
            "preparation": ", ".join(f"{name}={settings[name]!r}" for name in unusual),
            "method": estimator.method,
            "settings": main_settings(estimator),
            "generation": self.generation,
            "law": {
                "kind": law.kind,
                "names": law.names(),
                "symbols": law.symbols,
                "units": law.units,
                # Places of those that are shown: some law on offer has them as its own.
                "shown": self.laws.shown,
                "remembers": self.laws.remembers,
            },
            "verdict": self.laws.page(estimator),
            "flags": estimator.estimate().flags,
            "needs_condition_10": estimator.needs_condition_10,
            "state": self.state.name.lower(),
            "held": self.held,
            # What is wrong now; one that is past was said.
            "fault": self.watchdog.text if self.state is State.INVALID else "",
            # What a person may choose of the source itself: {"material": [...], ...}.
            "offers": getattr(source, "offers", {}),
            "chosen": getattr(source, "chosen", {}),
            "origin": getattr(source, "origin", 0),
            "record": self.record,
            # What both the source and the loop count is added.
            "counts": came | own | {name: came[name] + own[name] for name in came.keys() & own},
            "cycle": self.cycle.as_dict(),
            "lateness": self.lateness.as_dict(),
            "said": self.said,
        }
