"""A motion as it is planned, as a robot plays it from rest to rest, and its file."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError
from palpate.recordings.opening import write_formatted
from palpate.validation import Floats, instance, kept, number_in


@dataclass(frozen=True, slots=True)
class Motion:
    """Sines around a mean depth.

    x(t) = x₀ + Σ aᵢ sin ωᵢ t,   v(t) = Σ aᵢ ωᵢ cos ωᵢ t

    Parameters
    ----------
    depth : float
        x₀, m, in (0, 10].
    amplitudes : sequence of float, shape (m,)
        aᵢ, m, each in [0, 10]. Without any, or all zero, the probe is held.
    frequencies : sequence of float, shape (m,)
        ωᵢ, rad/s (not Hz), each in (0, 1e5].

    Raises
    ------
    InvalidParameterError
        A value is out of its range, or there are not as many frequencies as amplitudes.
    """

    depth: float
    amplitudes: tuple[float, ...] = ()
    frequencies: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        kept(self, "depth", 0.0, 10.0, open_low=True)
        for name, highest in (("amplitudes", 10.0), ("frequencies", 1e5)):
            values = tuple(
                number_in(f"{name}[{i}]", value, 0.0, highest, open_low=name == "frequencies")
                for i, value in enumerate(_several(name, getattr(self, name)))
            )
            object.__setattr__(self, name, values)
        if len(self.amplitudes) != len(self.frequencies):
            raise InvalidParameterError(
                "amplitudes and frequencies must be as many, not "
                f"{len(self.amplitudes)} and {len(self.frequencies)}"
            )

    @property
    def peak_penetration(self) -> float:
        """x₀ + Σ aᵢ, m: it never goes deeper, however long it runs."""
        return self.depth + math.fsum(self.amplitudes)

    @property
    def least_penetration(self) -> float:
        """x₀ − Σ aᵢ, m: it never comes higher, however long it runs."""
        return self.depth - math.fsum(self.amplitudes)

    @property
    def top_speed(self) -> float:
        """Σ aᵢ ωᵢ, m/s: the speed at t = 0, and never exceeded."""
        return math.fsum(a * w for a, w in zip(self.amplitudes, self.frequencies, strict=True))

    def at(self, time: "ArrayLike") -> tuple[Floats, Floats]:
        """Penetration [m] and velocity [m/s] at times [s], each of their shape."""
        t = np.asarray(time, dtype=np.float64)
        x, v = np.full(t.shape, self.depth), np.zeros(t.shape)
        for a, w in zip(self.amplitudes, self.frequencies, strict=True):
            x += a * np.sin(w * t)
            v += a * w * np.cos(w * t)
        return x, v

    def sampled(self, duration: float, sample_time: float) -> tuple[Floats, Floats, Floats]:
        """Time, penetration and velocity of round(duration / sample_time) samples from t = 0.

        Parameters
        ----------
        duration : float
            s, in [sample_time, 1e7 sample_time].
        sample_time : float
            s, in (0, 1e6].
        """
        step = number_in("sample_time", sample_time, 0.0, 1e6, open_low=True)
        count = round(number_in("duration", duration, step, 1e7 * step) / step)
        time = np.arange(count, dtype=np.float64) * step
        return time, *self.at(time)


def _several(name: str, values: Any) -> tuple[Any, ...]:
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InvalidParameterError(f"{name} must be a sequence of numbers, not {values!r}")
    return tuple(values)


#: The three sines of the paper's experiments; their top speed is 50.8 mm/s.
PAPER_MOTION = Motion(10e-3, (1e-3, 1.8e-3, 1.8e-3), (4.0, 11.0, 15.0))


# As a robot plays it: rest, approach, the sines, retreat, rest.

#: Before anything moves, s: the force sensor's bias is measured in it.
PAUSE = 2.0
# After the retreat, s: what a filter of the velocity still asks for.
_REST = 0.5
# How high above the surface a motion begins, over the depth that it reaches: as well as a surface
# has to be known to plan a motion at all.
_CLEARANCE = 0.1
# Points a period of the fastest sine among which the moment to leave is looked for, and at most.
_POINTS, _MOST_POINTS = 64, 1_000_000
_MOST_SAMPLES = 10_000_000


@dataclass(frozen=True, slots=True)
class MotionCommand:
    """A motion from rest above the surface and back to it, without a jump in its acceleration.

    The sines begin at their mean depth x₀ at their highest speed V, where they do not accelerate.
    The approach has that speed at its end, and never exceeds it:

        v = V (3s² − 2s³),  x = −c + V T (s³ − s⁴/2),  T = 2 (x₀ + c)/V,  s from 0 to 1 in T.

    The retreat is the same backwards, from a moment at which the sines come out fastest.

    Parameters
    ----------
    motion : Motion
        The sines; they have to move.
    seconds : float
        How long they last at least, s, in (0, 1e5]: at most a period of the slowest longer.

    Attributes
    ----------
    clearance : float
        c, m above the surface at either end: a tenth of the peak penetration.
    start, stop : float
        When the sines begin and end, s, from the first sample on.
    duration : float
        Of the whole, s.

    Raises
    ------
    InvalidParameterError
        The probe is held, or an argument is out of its range.
    """

    motion: Motion
    seconds: float = 20.0
    clearance: float = field(init=False)
    start: float = field(init=False)
    stop: float = field(init=False)
    duration: float = field(init=False)

    def __post_init__(self) -> None:
        instance("motion", self.motion, Motion)
        number_in("seconds", self.seconds, 0.0, 1e5, open_low=True)
        speed = self.motion.top_speed
        if speed == 0.0:
            raise InvalidParameterError("the probe is held: there is no motion to write")
        clearance = _CLEARANCE * self.motion.peak_penetration
        start = PAUSE + 2.0 * (self.motion.depth + clearance) / speed
        leaving = _outward(self.motion, self.seconds)
        x, v = self.motion.at(leaving)
        retreat = 2.0 * (float(x) + clearance) / -float(v)
        for name, value in (
            ("clearance", clearance),
            ("start", start),
            ("stop", start + leaving),
            ("duration", start + leaving + retreat + _REST),
        ):
            object.__setattr__(self, name, value)

    def at(self, time: "ArrayLike") -> tuple[Floats, Floats]:
        """Penetration [m] and velocity [m/s] at times [s], each of their shape."""
        t = np.asarray(time, dtype=np.float64)
        sines = np.clip(t, self.start, self.stop) - self.start
        x, v = self.motion.at(sines)
        for moved, begins in ((t < self.start, True), (t > self.stop, False)):
            x[moved], v[moved] = self._at_an_end(t[moved], begins=begins)
        return x, v

    def _at_an_end(self, time: Floats, *, begins: bool) -> tuple[Floats, Floats]:
        """The approach, or the retreat, which is one with the time turned round."""
        moment = 0.0 if begins else self.stop - self.start
        x, v = (float(each) for each in self.motion.at(moment))
        length = 2.0 * (x + self.clearance) / abs(v)
        since = time - self.start + length if begins else self.stop + length - time
        s = np.clip(since / length, 0.0, 1.0)
        depth = abs(v) * length * s**3 * (1.0 - 0.5 * s) - self.clearance
        return depth, v * s * s * (3.0 - 2.0 * s)

    def sampled(self, sample_time: float) -> tuple[Floats, Floats, Floats]:
        """Time, penetration and velocity from rest to rest.

        Parameters
        ----------
        sample_time : float
            s, in [1e-5, 1], and so long that there are at most 1e7 samples.
        """
        step = number_in("sample_time", sample_time, 1e-5, 1.0)
        count = math.ceil(self.duration / step) + 1
        if count > _MOST_SAMPLES:
            raise InvalidParameterError(
                f"a motion of {self.duration:.4g} s in steps of {step:g} s has {count} samples; "
                f"at most {_MOST_SAMPLES} are written: make it shorter, or the steps longer"
            )
        time = np.arange(count, dtype=np.float64) * step
        return time, *self.at(time)


def write_motion(
    command: MotionCommand,
    path: str | Path,
    *,
    sample_time: float = 1e-3,
    notes: Mapping[str, str] | None = None,
) -> None:
    """Write a motion as CSV, whole or not at all: time_s, penetration_m and velocity_m_s.

    ``palpate lab --trajectory`` plays it, and so can a robot.

    Parameters
    ----------
    command : MotionCommand
        The motion.
    path : str or Path
        The file.
    sample_time : float
        s, in [1e-5, 1].
    notes : mapping, optional
        Lines above the header, before those that say when the sines begin and end.

    Raises
    ------
    InvalidParameterError
        The sample time is out of its range.
    RecordingError
        The path cannot be written.
    """
    names = ("time_s", "penetration_m", "velocity_m_s")
    sampled = zip(names, command.sampled(sample_time), strict=True)
    columns = {name: (values + 0.0, "%.9g") for name, values in sampled}  # no -0
    ends = (
        f"at rest {1e3 * command.clearance:.4g} mm above the surface until {PAUSE:g} s and at the "
        f"end; the sines from {command.start:.6g} s to {command.stop:.6g} s"
    )
    write_formatted(columns, Path(path), {**(notes or {}), "phases": ends})


def _outward(motion: Motion, earliest: float) -> float:
    """When the sines come out fastest within a period of the slowest: there is no acceleration.

    Above the surface they have left already, so only moments below it count.
    """
    moving = [w for a, w in zip(motion.amplitudes, motion.frequencies, strict=True) if a > 0.0]
    period = 2.0 * math.pi / min(moving)
    count = min(int(_POINTS * max(moving) / min(moving)) + 2, _MOST_POINTS)
    time = np.linspace(earliest, earliest + period, count)
    rate = _acceleration(motion, time)
    turning = np.flatnonzero((rate[:-1] < 0.0) & (rate[1:] >= 0.0))
    x, v = motion.at(time[turning])
    good = (x > 0.0) & (v < 0.0)
    if not good.any():
        raise InvalidParameterError(
            "the sines come out of the material nowhere below its surface: a larger depth helps"
        )
    first = turning[good][np.argmin(v[good])]
    low, high = float(time[first]), float(time[first + 1])
    for _ in range(60):  # halvings: to the last digit
        middle = 0.5 * (low + high)
        falling = _acceleration(motion, np.array(middle)) < 0.0
        low, high = (middle, high) if falling else (low, middle)
    return high


def _acceleration(motion: Motion, time: Floats) -> Floats:
    rate = np.zeros(time.shape)
    for a, w in zip(motion.amplitudes, motion.frequencies, strict=True):
        rate -= a * w * w * np.sin(w * time)
    return rate
