"""Penetration, velocity and force on one clock."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.errors import InvalidParameterError, RecordingError
from palpate.preparation.velocity import velocity_of
from palpate.validation import Floats, signals


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Contact:
    """What identification needs, in SI and on one clock, and how it was made.

    Parameters
    ----------
    time : array_like, shape (k,)
        s; strictly increasing within a segment.
    penetration : array_like, shape (k,)
        m, positive inside the material.
    velocity : array_like, shape (k,), optional
        m/s, positive while penetrating. None: from the penetration, by
        :func:`palpate.preparation.velocity.velocity_of`, a segment at a time.
    force : array_like, shape (k,)
        N, compression positive.
    segment : array_like, shape (k,), optional
        A label a sample; where it changes, another contact begins after a free or unknown time.
    source : str
        Where it came from: a file's name.
    made : mapping
        How each channel was made, in words.
    velocity_window : float, optional
        Length of the velocity filter, s, where ``velocity`` is None; 15 samples but at most 15 ms
        unless given.

    Raises
    ------
    InvalidParameterError
        Arrays of different length or type, or time that does not increase within a segment.
    """

    time: Floats
    penetration: Floats
    velocity: Floats
    force: Floats
    segment: NDArray[np.int64]
    source: str
    made: Mapping[str, str]

    def __init__(
        self,
        time: ArrayLike,
        penetration: ArrayLike,
        velocity: ArrayLike | None = None,
        force: ArrayLike | None = None,
        *,
        segment: ArrayLike | None = None,
        source: str = "",
        made: Mapping[str, str] | None = None,
        velocity_window: float | None = None,
    ) -> None:
        if force is None:
            raise InvalidParameterError("force must be given: an array in N, not None")
        t, x, f = signals(time=time, penetration=penetration, force=force)
        labels = _labels(segment, t.size)
        _check_time(t, labels)
        history = dict(made or {})
        if velocity is None:
            v = np.concatenate(
                [velocity_of(t[part], x[part], velocity_window) for part in _parts(labels)]
                or [np.empty(0)]
            )
            history.setdefault("velocity", "centred quadratic Savitzky–Golay filter")
        else:
            v = signals(time=t, velocity=velocity)[1]
        for name, value in {
            "time": t,
            "penetration": x,
            "velocity": v,
            "force": f,
            "segment": labels,
            "source": source,
            "made": history,
        }.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.time)

    def segments(self) -> Iterator[slice]:
        """Slices of the separate contacts, in order."""
        yield from _parts(self.segment)

    @property
    def sample_time(self) -> float:
        """Median time between samples within a segment, s."""
        steps = np.concatenate(
            [np.diff(self.time[part]) for part in self.segments()] or [np.empty(0)]
        )
        return float(np.median(steps)) if steps.size else 1e-3

    @property
    def time_steps(self) -> Floats:
        """Time since the previous sample, s; the median one at the start of a segment."""
        steps = np.diff(self.time, prepend=0.0)
        steps[[part.start for part in self.segments()]] = self.sample_time
        return steps

    def window(self, start: float | None = None, stop: float | None = None) -> "Contact":
        """Return the samples with start ≤ time ≤ stop, s; velocity stays as it is."""
        low = -np.inf if start is None else start
        high = np.inf if stop is None else stop
        keep = (self.time >= low) & (self.time <= high)
        if not keep.any():
            where = f"{self.source}: " if self.source else ""
            raise RecordingError(
                f"{where}no sample between {low:g} s and {high:g} s; time runs from "
                f"{self.time.min(initial=np.inf):g} s to {self.time.max(initial=-np.inf):g} s"
            )
        return Contact(
            self.time[keep],
            self.penetration[keep],
            self.velocity[keep],
            self.force[keep],
            segment=self.segment[keep],
            source=self.source,
            made={**self.made, "window": f"{low:g} s to {high:g} s"},
        )


def _labels(segment: ArrayLike | None, samples: int) -> NDArray[np.int64]:
    """Consecutive numbers for the runs of equal labels."""
    if segment is None or samples == 0:
        return np.zeros(samples, dtype=np.int64)
    given = np.asarray(segment)
    if given.shape != (samples,):
        raise InvalidParameterError(
            f"arrays must have the same length: time has {samples}, segment has {given.size}"
        )
    return np.concatenate([[0], np.cumsum(given[1:] != given[:-1])])


def _parts(labels: NDArray[np.int64]) -> list[slice]:
    borders = np.flatnonzero(np.diff(labels)) + 1
    edges = [0, *borders.tolist(), labels.size]
    return [slice(a, b) for a, b in itertools.pairwise(edges) if b > a]


def _check_time(time: Floats, labels: NDArray[np.int64]) -> None:
    wrong = ~np.isfinite(time)
    wrong[1:] |= (time[1:] <= time[:-1]) & (labels[1:] == labels[:-1])
    if wrong.any():
        first = int(np.argmax(wrong))
        before = f" after {time[first - 1]} s" if first else ""
        raise InvalidParameterError(
            "time must be finite and increase within a segment; "
            f"sample {first} is {time[first]} s{before}"
        )
