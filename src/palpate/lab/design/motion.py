"""A planned motion, its command for a robot from rest to rest, and its file."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError
from palpate.validation import Floats, check_field, frozen, instance, number_in
from palpate.writing import write_formatted


@frozen
class Motion:
    """Sines around a mean depth.

    x(t) = x₀ + Σ aᵢ sin ωᵢ t,   v(t) = Σ aᵢ ωᵢ cos ωᵢ t

    Parameters
    ----------
    depth : float
        x₀, m, in (0, 10].
    amplitudes : sequence of float, shape (m,)
        aᵢ, m, each in [0, 10]. Without sines, or if all aᵢ are 0, the probe is held still.
    frequencies : sequence of float, shape (m,)
        ωᵢ, rad/s (not Hz), each in (0, 1e5].

    Raises
    ------
    InvalidParameterError
        A value is out of its range, or the numbers of amplitudes and frequencies differ.
    """

    depth: float
    amplitudes: tuple[float, ...] = ()
    frequencies: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_field(self, "depth", 0.0, 10.0, open_low=True)
        for name, highest in (("amplitudes", 10.0), ("frequencies", 1e5)):
            values = tuple(
                number_in(f"{name}[{i}]", value, 0.0, highest, open_low=name == "frequencies")
                for i, value in enumerate(_several(name, getattr(self, name)))
            )
            object.__setattr__(self, name, values)
        if len(self.amplitudes) != len(self.frequencies):
            raise InvalidParameterError(
                "amplitudes and frequencies must be equal in number, not "
                f"{len(self.amplitudes)} and {len(self.frequencies)}"
            )

    @property
    def peak_penetration(self) -> float:
        """x₀ + Σ aᵢ, m: upper bound of the penetration."""
        return self.depth + math.fsum(self.amplitudes)

    @property
    def least_penetration(self) -> float:
        """x₀ − Σ aᵢ, m: lower bound of the penetration."""
        return self.depth - math.fsum(self.amplitudes)

    @property
    def top_speed(self) -> float:
        """Σ aᵢ ωᵢ, m/s: the speed at t = 0, which is the highest."""
        return math.fsum(a * w for a, w in zip(self.amplitudes, self.frequencies, strict=True))

    def at(self, time: "ArrayLike") -> tuple[Floats, Floats]:
        """Penetration [m] and velocity [m/s] at times [s], each of their shape."""
        t = np.asarray(time, dtype=np.float64)
        x = np.full(t.shape, self.depth)
        v = np.zeros(t.shape)
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


# The command for a robot: rest, approach, the sines, retreat, rest.

#: Rest before the motion, s, in which the force sensor's bias is measured.
PAUSE = 2.0
# Rest after the retreat, s, for the velocity filter.
_REST = 0.5
# Start height over the peak penetration; to plan a motion, one must know the surface as precisely.
_CLEARANCE = 0.1
# Points per period of the fastest sine in the search for the start of the retreat, and at most.
_POINTS = 64
_MOST_POINTS = 1_000_000
_MOST_SAMPLES = 10_000_000


@frozen
class MotionCommand:
    """A motion from rest above the surface and back to it, with continuous acceleration.

    The sines begin at their mean depth x₀ at their highest speed V and zero acceleration. The
    approach ends at that speed and never exceeds it:

        v = V (3s² − 2s³),  x = −c + V T (s³ − s⁴/2),  T = 2 (x₀ + c)/V,  s from 0 to 1 in T.

    The retreat is the reverse, from a time at which the sines withdraw fastest.

    Parameters
    ----------
    motion : Motion
        The sines; at least one amplitude is above 0.
    seconds : float
        Minimum duration of the sines, s, in (0, 1e5]. Default: 20. They last at most one period of
        the slowest sine longer.

    Attributes
    ----------
    clearance : float
        c, m above the surface at both ends: a tenth of the peak penetration.
    start, stop : float
        Start and end of the sines, s, from the first sample.
    duration : float
        Duration of the whole motion, s.

    Raises
    ------
    InvalidParameterError
        The probe is held still, or an argument is out of its range.
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
            raise InvalidParameterError("the probe is held still: make an amplitude larger than 0")
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
            x[moved], v[moved] = self._approach_or_retreat(t[moved], begins=begins)
        return x, v

    def _approach_or_retreat(self, time: Floats, *, begins: bool) -> tuple[Floats, Floats]:
        """The approach, or the retreat, which is an approach reversed in time."""
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
            s, in [1e-5, 1], with at most 1e7 samples in total.
        """
        step = number_in("sample_time", sample_time, 1e-5, 1.0)
        count = math.ceil(self.duration / step) + 1
        if count > _MOST_SAMPLES:
            raise InvalidParameterError(
                f"a motion of {self.duration:.4g} s in steps of {step:g} s has {count} samples, "
                f"more than {_MOST_SAMPLES}: make it shorter, or the steps longer"
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
    """Write a motion as CSV with the columns time_s, penetration_m and velocity_m_s.

    ``palpate lab --trajectory`` and robots can play it. A write error leaves no partial file.

    Parameters
    ----------
    command : MotionCommand
        The motion.
    path : str or Path
        The file.
    sample_time : float
        s, in [1e-5, 1].
    notes : mapping, optional
        Comment lines above the header, before the lines on start and end of the sines.

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
    """The time, within a period of the slowest sine, at which the sines withdraw fastest.

    The acceleration is zero there. Only times below the surface count.
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
            "the sines never withdraw below the surface: increase the depth"
        )
    first = turning[good][np.argmin(v[good])]
    low = float(time[first])
    high = float(time[first + 1])
    for _ in range(60):  # bisections: to machine precision
        middle = 0.5 * (low + high)
        falling = _acceleration(motion, np.array(middle)) < 0.0
        low, high = (middle, high) if falling else (low, middle)
    return high


def _acceleration(motion: Motion, time: Floats) -> Floats:
    rate = np.zeros(time.shape)
    for a, w in zip(motion.amplitudes, motion.frequencies, strict=True):
        rate -= a * w * w * np.sin(w * time)
    return rate
