"""What may be wrong with a source, seen at the times of its samples."""

import math
from dataclasses import dataclass, field

from palpate.live.arrivals import Arrival
from palpate.preparation import OnlinePreparation
from palpate.preparation.velocity import window_samples

#: s that a fault stays to be seen, though its sample may have been the only one.
SHOWN_FOR = 0.5
#: Samples of which none could be prepared, after which they come too seldom for the window.
STARVED = 200
_SAID_EVERY = 1.0  # s


@dataclass(slots=True)
class Faults:
    """What was wrong with the samples' times.

    Attributes
    ----------
    repeated : int
        Samples of the same time as the one before; refused.
    disordered : int
        Samples that are earlier than the one before, by less than a window; refused.
    jumps : int
        How often the source's clock was set: back, or further ahead than time went.
    gaps : int
        How often samples were missing for longer than a window.
    """

    repeated: int = 0
    disordered: int = 0
    jumps: int = 0
    gaps: int = 0


@dataclass(slots=True)
class Watchdog:
    """Compares the source's clock with this machine's, a sample at a time.

    Parameters
    ----------
    longest_gap : float
        s; a longer time between samples begins a new window.
    pace : float
        How fast the source's clock goes: that of a recording may be replayed faster.
    """

    longest_gap: float
    pace: float = 1.0
    faults: Faults = field(default_factory=Faults)
    #: In words, what was wrong last.
    words: str = ""
    _time: float = math.nan
    _there: float = 0.0
    _unprepared: int = 0
    _shown_until: float = -math.inf
    _said: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, preparation: OnlinePreparation, pace: float = 1.0) -> "Watchdog":
        """Return one that knows how long the windows are."""
        settings = preparation.settings
        gap = settings["longest_gap"]
        if gap is None:
            step = settings["sample_time"]
            gap = step * window_samples(step, settings["velocity_window"])
        return cls(gap, pace)

    def see(self, arrival: Arrival) -> str:
        """Return what is wrong with a sample's time, in words; or nothing."""
        step, elapsed = arrival.time - self._time, arrival.there - self._there
        if 0.0 < step <= self.longest_gap:
            self._time, self._there = arrival.time, arrival.there
            return ""
        return self._judge(arrival, step, elapsed * self.pace)

    def _judge(self, arrival: Arrival, step: float, elapsed: float) -> str:
        faults = self.faults
        if not math.isfinite(arrival.time):
            return "a sample has no time"
        if step == 0.0:
            faults.repeated += 1
            return "samples come repeatedly: they are refused"
        if -self.longest_gap <= step < 0.0:
            faults.disordered += 1
            return "samples come out of order: the late ones are refused"
        self._time, self._there = arrival.time, arrival.there
        if step < 0.0:
            faults.jumps += 1
            return f"the source's clock went back by {-step:.3g} s"
        if step > 2.0 * elapsed + self.longest_gap:
            faults.jumps += 1
            return f"the source's clock went ahead by {step:.3g} s in {elapsed:.3g} s"
        # Of the first sample of all the step is not a number.
        faults.gaps += not math.isnan(step)
        return ""

    def starving(self, arrival: Arrival, *, prepared: bool) -> bool:
        """Whether samples come, but too seldom for any to be prepared."""
        self._unprepared = 0 if prepared else self._unprepared + 1
        return self._unprepared > STARVED

    def fault(self, words: str, there: float) -> bool:
        """Note a fault, which is shown for a while; whether it is to be said, not too often."""
        self.words, self._shown_until = words, there + SHOWN_FOR
        kind = words.partition(" by ")[0]
        said = there - self._said.get(kind, -math.inf) < _SAID_EVERY
        if not said:
            self._said[kind] = there
        return not said

    def shows(self, there: float) -> bool:
        """Whether the last fault is still to be seen."""
        return there < self._shown_until
