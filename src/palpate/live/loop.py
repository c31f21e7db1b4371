"""The loop: it prepares, learns and stores each sample before the next one arrives.

It runs in one thread, which waits only for the source. Everything that shows or records its results
reads them from shared memory, in another process.
"""

import math
import time
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from palpate import _core
from palpate._core import Status
from palpate.digits import format_quantity
from palpate.errors import InvalidParameterError, PalpateError
from palpate.findings import LOOP_CHECKS
from palpate.input.channels.frames import UNIT_LENGTH
from palpate.input.preparation.online import OnlinePreparation
from palpate.input.wrench import PayloadCompensation
from palpate.live.choices import LiveCommand, LoopCounts, State, chosen, main_settings
from palpate.live.ring import MOST_PARAMETERS, Writer
from palpate.live.sources import Arrival, EndOfSourceError, Source, Value
from palpate.method.estimators import ContactEstimator
from palpate.validation import Floats, finite_or_none, number_in

# Upper ends of the bins, s: 20 per decade, so that a percentile is accurate to 12 %.
_ENDS: list[float] = [1e-7 * 10.0 ** (k / 20.0) for k in range(181)]


class Histogram:
    """Histogram of durations in logarithmic bins, with their maximum and a limit.

    Parameters
    ----------
    limit : float
        Longest duration in time, s.
    """

    def __init__(self, limit: float) -> None:
        self._bins = [0] * (len(_ENDS) + 1)
        self.limit = limit
        self.count = 0
        self.over = 0
        self.largest = 0.0

    def add(self, seconds: float) -> None:
        """Add one duration, s."""
        self.count += 1
        if seconds > self.largest:
            self.largest = seconds
        if seconds > self.limit:
            self.over += 1
        self._bins[bisect_left(_ENDS, seconds)] += 1

    def percentile(self, percent: float) -> float:
        """Return the upper end of the bin that contains a percentile, s; NaN if empty."""
        if not self.count:
            return math.nan
        reached = np.cumsum(self._bins) >= percent / 100.0 * self.count
        return min([*_ENDS, math.inf][int(np.argmax(reached))], self.largest)

    def as_dict(self) -> dict[str, Any]:
        """Return p50, p99, p99.9, maximum and limit, s, and the fraction within the limit."""
        within = 1.0 - self.over / self.count if self.count else math.nan
        percentiles = {f"p{each:g}": self.percentile(each) for each in (50.0, 99.0, 99.9)}
        whole = {"max": self.largest, "limit": self.limit, "within": within}
        return {"count": self.count, **percentiles, **whole}


# The preferred law after each sample, and when it changed.

# Changes of the preferred law that are kept; more within seconds mean that it is unsettled.
_REMEMBERED = 6


@dataclass(slots=True)
class LawsInForce:
    """The preferred law and its history.

    When the evidence is discarded, as after a change of material, there is no preferred law until
    the next verdict, and the count of changes restarts.

    Attributes
    ----------
    shown : list of int
        Indices of the parameters that at least one compared law has.
    now : object, optional
        The preferred law, as the estimator's ``candidate``.
    changes : int
        Changes of the preferred law since the evidence was last discarded.
    time : float
        Time of the latest sample, s: a verdict speaks of the samples up to it.
    turns : deque
        Time, s, of each change; the law preferred from then on, or None; the number of samples.
    """

    shown: list[int]
    now: object = None
    changes: int = 0
    time: float = math.nan
    turns: deque[Any] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    @classmethod
    def of(cls, estimator: ContactEstimator) -> "LawsInForce":
        """Return the initial state for an estimator without samples."""
        names = estimator.law_type.names()
        if not estimator.chooses_law:
            return cls(list(range(len(names))))
        own = {name for law in estimator.offered for name in law.own}
        return cls([place for place, name in enumerate(names) if name in own])

    def see(self, time: float, estimator: ContactEstimator) -> None:
        """Note the preferred law after a sample, if the estimator compares laws."""
        self.time = time
        if not estimator.chooses_law:
            return
        if (now := estimator.candidate) is self.now:
            return
        self.changes = 0 if now is None or self.now is None else self.changes + 1
        self.now = now
        samples = estimator.evidence().samples
        self.turns.append((time, None if now is None else str(now), samples))

    def page(self, estimator: ContactEstimator) -> dict[str, Any] | None:
        """Return the data for a verdict, ready for JSON; None if the estimator compares no laws.

        :func:`palpate.live.view.verdict_on` computes the verdict in the process that shows it,
        because the loop has no time for that.
        """
        if not estimator.chooses_law:
            return None
        learned = len(self.turns) > 0  # an initial estimate is not a result
        return {
            **estimator.pack_verdict(with_estimate=learned),
            "flags": [each.titled for each in estimator.estimate().findings],
            "time": finite_or_none(self.time),
            "changes": self.changes,
            "turns": list(self.turns),
        }


# Faults of a source, detected from the times of its samples.

#: s for which a fault is shown, even if it concerned a single sample.
FAULT_SHOWN_FOR = 0.5
#: Consecutive unprepared samples after which the sample rate is too low for the filter window.
STARVED = 200
_SAID_EVERY = 1.0  # s


class Fault(Enum):
    """A fault of the source, with its description."""

    NO_TIME = "rejecting samples without a time"
    REPEATED = "rejecting samples that repeat the time of the one before"
    DISORDERED = "rejecting samples that arrive out of order"
    CLOCK_BACK = "the source's clock went back by {back:.3g} s"
    CLOCK_AHEAD = "the source's clock went ahead by {ahead:.3g} s in {elapsed:.3g} s"
    NO_NUMBER = "rejecting samples that are NaN, infinite or out of range"
    NO_ORIENTATION = "rejecting samples whose orientation is not a unit quaternion"
    STARVING = "sample rate too low for the velocity filter: pass --rate"


@dataclass(slots=True)
class Watchdog:
    """Compares the source's clock with this machine's, sample by sample.

    Parameters
    ----------
    longest_gap : float
        s; a longer time between samples restarts the filter window.
    counts : LoopCounts
        Counts of the faults.
    pace : float
        Speed of the source's clock; a recording may be replayed faster than real time.
    """

    longest_gap: float
    counts: LoopCounts
    pace: float
    #: Description of the last fault.
    text: str = ""
    _time: float = math.nan
    _there: float = 0.0
    _unprepared: int = 0
    _shown_until: float = -math.inf
    _reported: dict[Fault, float] = field(default_factory=dict)
    _numbers: dict[str, float] = field(default_factory=dict)

    def check(self, arrival: Arrival) -> Fault | None:
        """Return the fault in a sample's time; None without one."""
        step = arrival.time - self._time
        elapsed = arrival.there - self._there
        if 0.0 < step <= self.longest_gap:
            self._time = arrival.time
            self._there = arrival.there
            return None
        return self._find_fault(arrival, step, elapsed * self.pace)

    def _find_fault(self, arrival: Arrival, step: float, elapsed: float) -> Fault | None:
        counts = self.counts
        if not math.isfinite(arrival.time):
            return Fault.NO_TIME
        if step == 0.0:
            counts.repeated += 1
            return Fault.REPEATED
        if -self.longest_gap <= step < 0.0:
            counts.disordered += 1
            return Fault.DISORDERED
        self._time = arrival.time
        self._there = arrival.there
        self._numbers = {"back": -step, "ahead": step, "elapsed": elapsed}
        if step < 0.0:
            counts.jumps += 1
            return Fault.CLOCK_BACK
        if step > 2.0 * elapsed + self.longest_gap:
            counts.jumps += 1
            return Fault.CLOCK_AHEAD
        # The first sample has no step (NaN).
        counts.gaps += not math.isnan(step)
        return None

    def starving(self, *, prepared: bool) -> bool:
        """Whether the sample rate is too low for the velocity filter."""
        self._unprepared = 0 if prepared else self._unprepared + 1
        return self._unprepared > STARVED

    def show(self, fault: Fault, there: float) -> bool:
        """Show a fault for a while; return whether to report it, at most once a second."""
        self.text = fault.value.format(**self._numbers)
        self._shown_until = there + FAULT_SHOWN_FOR
        if there - self._reported.get(fault, -math.inf) < _SAID_EVERY:
            return False
        self._reported[fault] = there
        return True

    def shows(self, there: float) -> bool:
        """Whether the last fault is still shown."""
        return there < self._shown_until


#: s for which a check counts as a fault after it was last found: until a diagnosis contains it.
FAULT_KEPT_FOR = 10.0
#: Estimates in which a check was found before it counts as a fault.
FEWEST_FAULTY = 20


@dataclass(slots=True)
class RecentChecks:
    """The estimator's checks that were found repeatedly within the last seconds."""

    _counts: dict[int, int] = field(default_factory=dict)
    _last: dict[int, float] = field(default_factory=dict)

    def see(self, bits: int, time: float) -> None:
        """Note the bits of an estimate at a time, s."""
        for bit in LOOP_CHECKS if bits else ():
            if bits & bit:
                self._counts[bit] = self._counts.get(bit, 0) + 1 if self._recent(bit, time) else 1
                self._last[bit] = time

    def bits(self, time: float) -> int:
        """Return the checks that count as faults at a time, s."""
        return sum(
            bit
            for bit, count in self._counts.items()
            if count >= FEWEST_FAULTY and self._recent(bit, time)
        )

    def _recent(self, bit: int, time: float) -> bool:
        return 0.0 <= time - self._last.get(bit, -math.inf) < FAULT_KEPT_FOR


# Check of a tare: it is refused if the probe presses already.

#: Part of the samples inside the material; changes of the force over its noise; their share of the
#: force's variance that depth or time explains. At rest in free air noise explains next to nothing.
INSIDE = 0.1
CHANGE = 10.0
EXPLAINED = 0.8
FEWEST_OF_TARE = 20  # samples
_MOST_OF_TARE = 100_000  # samples that are kept


def pressing(depth: Floats, force: Floats, *, below_surface: bool) -> str:
    """Return why the probe seems to press during a tare; empty if it does not seem to.

    Parameters
    ----------
    depth, force : numpy.ndarray, shape (k,)
        m and N, finite.
    below_surface : bool
        Whether a positive depth is known to be inside the material.
    """
    if len(depth) < FEWEST_OF_TARE:
        return ""
    resolution = max(3.0 * _core.noise_of(depth), _core.step_of(depth))
    inside = depth[depth > resolution]
    if below_surface and len(inside) > INSIDE * len(depth):
        return f"the probe is {format_quantity(float(np.median(inside)), 'm')} inside the material"
    least = CHANGE * max(_core.noise_of(force), _core.step_of(force) / math.sqrt(12.0))
    time = np.arange(float(len(force)))
    for by, words in ((depth, " as the probe moves"), (time, ", so it is not steady")):
        offset = by - by.mean()
        apart = force - force.mean()
        square = float(offset @ offset)
        along = float(offset @ apart)
        if not (square > 0.0 and (by is time or np.ptp(by) > resolution)):
            continue
        changes = abs(along) / square * float(np.ptp(by))
        if changes > least and along**2 > EXPLAINED * square * float(apart @ apart):
            return f"the force changes by {format_quantity(changes, 'N')}{words}"
    return ""


_USUAL = OnlinePreparation().settings
IN_TIME = 1e-3  # s from a sample's arrival to its result: later is late
SHOWN_FOR = 1.0  # s for which the state is "changed"
SILENT = 20  # sample times without a sample, but at least SILENT_TIME, are a silence
SILENT_TIME = 0.2  # s
PATIENCE = 1.0  # s: longest wait for a sample before the loop looks for commands
#: s of the samples' clock between estimates, if no sink needs one at every sample.
ESTIMATED_EVERY = 0.02
_NONE = (math.nan,) * 4
#: Statuses of a sample that updated the estimate.
TAKEN = frozenset({Status.UPDATED, Status.GUARDED, Status.RESTARTED})
_REFUSED = frozenset({Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE})


@dataclass(slots=True)
class Loop:
    """Passes samples from a source through preparation and estimator into shared memory.

    Parameters
    ----------
    source : Source
        An open source.
    preparation : OnlinePreparation
        Computes penetration, velocity and force of each sample.
    estimator : ContactEstimator
        Identifies the contact.
    samples, estimates : Writer
        Shared memory for the samples and the estimates.
    commands : callable
        Returns the next pending command, or None; called between samples.
    every_sample : bool
        Whether to compute the estimate at every sample; otherwise every 20 ms of the samples'
        clock, and whenever the state, the law, the material or the estimator changes.
    compensation : PayloadCompensation, optional
        Subtracts the tool's weight and inertia before the preparation. Default: none.
    """

    source: Source
    preparation: OnlinePreparation
    estimator: ContactEstimator
    samples: Writer
    estimates: Writer
    commands: Callable[[], LiveCommand | None] = field(default=lambda: None)
    every_sample: bool = False
    compensation: PayloadCompensation | None = None
    counts: LoopCounts = field(default_factory=LoopCounts)
    cycle: Histogram = field(default_factory=lambda: Histogram(20e-6))
    lateness: Histogram = field(default_factory=lambda: Histogram(IN_TIME))
    state: State = State.FREE
    held: bool = False
    stopped: bool = False
    said: list[str] = field(default_factory=list)
    #: The last request to the recorder, and how many there were.
    record: dict[str, Any] = field(default_factory=lambda: {"wish": 0, "on": False})
    #: Chosen working depth, m; None for the median of the motion.
    depth: float | None = None
    laws: LawsInForce = field(init=False)
    watchdog: Watchdog = field(init=False)
    recent_checks: RecentChecks = field(default_factory=RecentChecks)
    generation: int = 0
    #: Why the tare at the start is refused so far; empty without.
    tare_refused: str = ""
    #: Depth and force of each sample of the tare; None if no tare is in progress.
    _resting: deque[tuple[float, float]] | None = None
    _before_tare: OnlinePreparation | None = None
    _bias_tared: bool = False
    _changed: float = -math.inf
    _estimated: tuple[Any, ...] = ()  # time, state, law … at the newest estimate
    _arrived: float = math.nan  # time of the newest sample, s
    _learned: float = math.nan  # time of the newest sample in the estimate, s
    _there: float = 0.0  # time at which the newest sample was there, s, monotonic
    _updated: float = math.nan  # that of the newest sample in the estimate
    _silence: float = 0.0  # s since the newest sample
    _direction: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        settings = self.preparation.settings
        if (given := settings["direction"]) is not None:
            self._direction = tuple(float(each) / math.hypot(*given) for each in given)
        if (gap := settings["longest_gap"]) is None:
            gap = settings["sample_time"] * self.preparation.velocity_filter.samples
        if self._taring:
            self._start_tare()
        self.watchdog = Watchdog(gap, self.counts, getattr(self.source, "pace", 1.0))
        self._begin(self.estimator)

    def run(self) -> None:
        """Run until the source ends or a command stops the loop.

        Raises
        ------
        InvalidParameterError
            The source delivers vectors but no direction is set, or numbers although one is.
        """
        silent = max(SILENT * self.source.sample_time, SILENT_TIME)
        patience = min(silent, PATIENCE)
        while not self.stopped:
            try:
                arrival = self.source.take(patience)
            except EndOfSourceError as end:
                if str(end):
                    self.say(str(end))
                break
            if arrival is None:
                self._silence += patience
                if self._silence >= silent and self.state is not State.LOST:
                    self.state = State.LOST
                    self.counts.silences += 1
                    self.say("no samples arrive: the estimate is held")
            else:
                self._silence = 0.0
                self.step(arrival)
            self._obey()
        self._estimate()

    def step(self, arrival: Arrival) -> None:
        """Prepare one sample, update the estimator with it, and store the result."""
        counts = self.counts
        estimator = self.estimator
        if not counts.taken:
            self._check(arrival)
        counts.taken += 1
        self._arrived = arrival.time
        self._there = arrival.there
        fault = self.watchdog.check(arrival)
        if self.compensation is not None:
            wrench: Any = arrival.force  # a vector, with an orientation: _check
            pose: Any = arrival.position, arrival.orientation
            preparing = self.compensation.update(pose[0], pose[1], wrench, arrival.time)
            if preparing is not Status.UPDATED:
                if preparing in _REFUSED and fault is None:
                    fault = _fault_of_pose(arrival)
                self._judge(arrival, Status.WAITING, preparing, fault, sampled=False)
                return
            arrival = arrival._replace(
                time=self.compensation.time,
                position=self.compensation.position,
                force=self.compensation.force,
            )
        sample = self.preparation.update(arrival.position, arrival.force, arrival.time)
        if self._resting is not None and self._refuses_tare(arrival, self._resting):
            sample = None
        status = Status.WAITING
        predicted = math.nan
        prepared = _NONE
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
        preparing = self.preparation.status
        self._judge(arrival, status, preparing, fault, sampled=sample is not None)
        tick = arrival.time // ESTIMATED_EVERY
        moment = (tick, self.state, self.laws.now, counts.changes, self.generation)
        if self.every_sample or moment != self._estimated:
            self._estimated = moment
            took += self._estimate(updated=prepared[0] if status is not Status.WAITING else None)
        position = self._axes(arrival.position)
        force = self._axes(arrival.force)
        late = time.monotonic() - arrival.there
        came = prepared[0], arrival.time, position[0], force[0]
        seen = status, preparing, self.state, took, late, self.estimates.count - 1
        self.samples.write(*came, *prepared[1:], predicted, *seen, *position[1:], *force[1:])
        if sample is not None and not self.held:
            self.cycle.add(took)
        self.lateness.add(late)

    def _estimate(self, updated: float | None = None) -> float:
        """Store the present estimate; return how long it took to compute, s.

        ``updated`` is the time of the sample that the estimator received just before, s.
        """
        began = time.perf_counter()
        estimate = self.estimator.estimate()
        took = time.perf_counter() - began
        known = np.full(MOST_PARAMETERS * (1 + MOST_PARAMETERS), math.nan)
        if estimate.samples:  # an initial estimate is not a result
            parameters = estimate.parameters
            size = len(parameters)
            known[:size] = parameters
            known[MOST_PARAMETERS:] = 0.0
            known[MOST_PARAMETERS:].reshape(MOST_PARAMETERS, -1)[:size, :size] = estimate.covariance
            if updated is not None:  # a method written in Python has no age
                self._learned = updated - (estimate.age if math.isfinite(estimate.age) else 0.0)
                self._updated = self._there
        checks = estimate._checks
        self.recent_checks.see(checks, self._arrived)
        stiffness = estimate.stiffness
        damping = estimate.damping
        self.estimates.write(
            self.generation,
            estimate.offset,
            estimate.surface,
            estimate.validity_margin,
            self._learned,
            self._age(),
            stiffness.value,
            stiffness.standard_error,
            stiffness.usable,
            damping.value,
            damping.standard_error,
            damping.usable,
            estimate.depth,
            estimate.frequency,
            checks,
            *known.tolist(),
        )
        return took

    def _age(self) -> float:
        """Return the time from the newest sample in the estimate to the newest sample, s.

        By the source's clock, or by this machine's where that of the source stands or goes back.
        """
        age = self._arrived - self._learned
        waited = (self._there - self._updated) * self.watchdog.pace
        return max(age, waited) if math.isfinite(waited) else age

    def _check(self, arrival: Arrival) -> None:
        """Raise if the source delivers vectors without a direction, or numbers with one."""
        if self.compensation is not None and arrival.orientation is None:
            raise InvalidParameterError(
                f"{self.source.name} delivers no orientation, which --payload needs"
            )
        vectors = not isinstance(arrival.position, float)
        if vectors is not (self._direction == (0.0, 0.0, 0.0)):
            return
        advice = "numbers, not vectors: omit --direction"
        if vectors:
            advice = "vectors: pass --direction, into the material, such as 0,0,-1"
        raise InvalidParameterError(f"{self.source.name} delivers {advice}")

    def _judge(
        self,
        arrival: Arrival,
        status: Status,
        preparing: Status,
        fault: Fault | None,
        *,
        sampled: bool,
    ) -> None:
        """Update the counts and the state after a sample."""
        counts = self.counts
        refused = status in _REFUSED or preparing in _REFUSED
        starving = self.watchdog.starving(prepared=sampled or self._taring)
        if refused or fault or starving:
            fault = fault or (Fault.NO_NUMBER if refused else Fault.STARVING)
            if self.watchdog.show(fault, arrival.there):
                self.say(self.watchdog.text)
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

    def _refuses_tare(self, arrival: Arrival, resting: "deque[tuple[float, float]]") -> bool:
        """Note a sample of the tare; at its end refuse it if the probe presses.

        The tare at the start then begins again; a tare on command keeps the earlier zero.
        """
        settings = self.preparation.settings
        sign = {
            name: -1.0 if name in settings["flip"] else 1.0 for name in ("penetration", "force")
        }
        depth = sign["penetration"] * self._axes(arrival.position)[0] - settings["surface"]
        force = sign["force"] * self._axes(arrival.force)[0]
        if math.isfinite(depth) and math.isfinite(force):
            resting.append((depth, force))
        if self._taring:
            return False
        known = self.estimator.settings.get("surface") != "estimate"
        why = pressing(*np.array(resting).reshape(-1, 2).T, below_surface=known)
        self._resting, self._before_tare, before = None, None, self._before_tare
        if not why:
            self.tare_refused = ""
            if self.compensation is None:
                return False
            # Its bias turns with the sensor; the preparation's tare would not.
            self._bias_tared = self.compensation.finish_tare()
            self.preparation = OnlinePreparation(**{**settings, "tare_time": 0.0})
            return True
        text = f"tare refused: {why}; lift the probe out of the material"
        if before is None:
            if not self.tare_refused:
                self.say(f"{text}, and palpate tares then")
            self.tare_refused = text
            self._start_tare()
            before = OnlinePreparation(**settings)
        else:
            self.say(f"{text} and tare again: the earlier zero holds")
        self.preparation = before
        return True

    def _start_tare(self) -> None:
        self._resting = deque(maxlen=_MOST_OF_TARE)
        if self.compensation is not None:
            self.compensation.start_tare()

    @property
    def _taring(self) -> bool:
        return self.preparation.settings["tare_time"] > 0.0 and math.isnan(self.preparation.tare)

    def _axes(self, value: Value) -> tuple[float, float, float, float]:
        """Return the component along the direction into the material, then the value itself."""
        if isinstance(value, float):
            return value, value, math.nan, math.nan
        (x, y, z) = self._direction
        (a, b, c) = value
        return x * a + y * b + z * c, a, b, c

    def say(self, text: str) -> None:
        """Report a message to the sinks; the last eight are kept."""
        self.said = [*self.said[-7:], f"{time.strftime('%H:%M:%S')} {text}"]

    def _obey(self) -> None:
        """Execute the pending commands."""
        while (command := self.commands()) is not None:
            try:
                self._do(command)
            except (PalpateError, TypeError) as error:  # caused by the command, not by the data
                self.say(f"{command.name}: {error}")

    def _do(self, command: LiveCommand) -> None:
        options = command.options
        if command.name == "stop":
            self.stopped = True
        elif command.name in ("hold", "resume"):
            self.held = command.name == "hold"
            self.say("on hold" if self.held else "resumed")
            if self.held:
                self.estimator.leave_contact()
        elif command.name == "reset":
            self._exchange(self.estimator.replace(), "reset: the estimate starts again")
        elif command.name == "tare":
            seconds = number_in("seconds", options.get("seconds", 1.0), 0.01, 60.0)
            settings = {**self.preparation.settings, "tare_time": seconds}
            if not self._taring:  # a first tare that is refused has no earlier zero
                self._before_tare = self.preparation
            self._start_tare()
            self.preparation = OnlinePreparation(**settings)
            self.estimator.leave_contact()
            self.say(f"taring for {seconds:g} s: keep the probe out of contact")
        elif command.name == "estimator":
            made = chosen(self.estimator, options)
            self._exchange(made, f"estimator: {made.method}")
        elif command.name == "source":
            ask = getattr(self.source, "ask", None)
            if ask is None:
                raise InvalidParameterError(f"{self.source.name} has no options to change")
            self.say(ask(options))
        elif command.name == "depth":
            self.depth = options["value"]
        elif command.name == "record":
            on = bool(options["on"])
            # Stays on: the recorder ends a little after the command to end.
            self.every_sample = self.every_sample or on
            wish = self.record["wish"] + 1
            since = self.samples.count
            self.record = {"wish": wish, "on": on, "since": since}

    def _begin(self, estimator: ContactEstimator) -> None:
        self.estimator = estimator
        self.laws = LawsInForce.of(estimator)

    def _exchange(self, estimator: ContactEstimator, text: str) -> None:
        self._begin(estimator)
        self.generation += 1
        self._changed = -math.inf
        self._learned = math.nan
        self.say(text)

    def status(self) -> dict[str, Any]:
        """Return the loop's status as numbers and text, ready for JSON."""
        source = self.source
        estimator = self.estimator
        law = self.estimator.law_type
        delay = self.preparation.delay
        payload = ""
        if self.compensation is not None:
            delay += self.compensation.delay
            mass = self.compensation.settings["payload"].mass
            payload = f"less the weight and inertia of {mass:.4g} kg"
            payload += ", and the bias in free air" * self._bias_tared
        settings = self.preparation.settings
        unusual = [name for name in settings if repr(settings[name]) != repr(_USUAL[name])]
        removed_delay = self.preparation.removed_delay
        came = asdict(source.counts)
        own = {"late": self.lateness.over, **asdict(self.counts)}
        estimate = estimator.estimate()
        return {
            "source": source.name,
            "sample_time": source.sample_time,
            "delay": delay,
            "tare": finite_or_none(self.preparation.tare),
            "tare_refused": self.tare_refused,
            "preparation": ", ".join(f"{name}={settings[name]!r}" for name in unusual),
            "payload": payload,
            "velocity_filter": self.preparation.velocity_filter.as_dict(),
            "force_delay": removed_delay and [removed_delay.seconds, removed_delay.standard_error],
            "method": estimator.method,
            "settings": main_settings(estimator),
            "exponent": estimator.settings.get("exponent"),
            "depth": self.depth,
            "generation": self.generation,
            "law": {
                "kind": law.kind,
                "names": law.names(),
                "symbols": law.symbols,
                "units": law.units,
                # Indices of the parameters that at least one compared law has.
                "shown": self.laws.shown,
            },
            "verdict": self.laws.page(estimator),
            "flags": estimate.flags,
            "findings": list(map(str, estimate.findings)),
            "checks": estimate._checks,
            "recent_checks": self.recent_checks.bits(self._arrived),
            # s since the newest sample in the estimate.
            "age": finite_or_none(self._age() + self._silence),
            "needs_condition_10": estimator.needs_condition_10,
            "state": self.state.name.lower(),
            "held": self.held,
            # The present fault; earlier ones are among the messages.
            "fault": self.watchdog.text if self.state is State.INVALID else "",
            # Options of the source and their choices: {"material": [...], ...}.
            "offers": getattr(source, "offers", {}),
            "chosen": getattr(source, "chosen", {}),
            "origin": getattr(source, "origin", 0),
            "record": self.record,
            # Counts that both the source and the loop have are added.
            "counts": came | own | {name: came[name] + own[name] for name in came.keys() & own},
            "cycle": self.cycle.as_dict(),
            "lateness": self.lateness.as_dict(),
            "said": self.said,
        }


def _fault_of_pose(arrival: Arrival) -> Fault:
    """Return the fault of a sample that the compensation of the payload refused."""
    length = math.hypot(*(arrival.orientation or ()))
    return Fault.NO_NUMBER if abs(length - 1.0) <= UNIT_LENGTH else Fault.NO_ORIENTATION
