"""What a replay wrote down, sample by sample."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate._core import Status
from palpate.errors import InvalidParameterError
from palpate.validation import Floats, number_in, shown, whole_in

#: How much of a trace is requested: the estimate after every sample, after at most so many of them
#: (an int), every so many seconds (a float), or never.
Traced: TypeAlias = Literal[False, "full"] | int | float


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Every sample of a replay: what was predicted, what was done with it, what was known after.

    A full trace has the estimate after each of k samples, a thinned one after m of them, down to
    none; all else is known of each sample, and the same whichever estimates are there.

    Attributes
    ----------
    parameters : numpy.ndarray, shape (m, p)
        The law's parameters, SI, in the law's order.
    standard_errors : numpy.ndarray, shape (m, p)
        Their standard errors.
    predicted_force : numpy.ndarray, shape (k,)
        N, a priori: from the estimate before the sample; by variable projection, of which each
        estimate costs several samples, from its latest search, at most 64 samples before. NaN where
        a sample is not finite.
    validity_margin : numpy.ndarray, shape (k,)
        Condition 10 as 1 − |v B/K| / 0.1, with the same estimates in place of the truth.
    status : numpy.ndarray of uint8, shape (k,)
        A :class:`Status` each.
    time : numpy.ndarray, shape (m,)
        Of the estimates, s, by :func:`palpate.identify`; empty where a replay was given no clock.
    samples : numpy.ndarray of int, shape (m,), optional
        The samples after which the estimates were known. None: a full trace, after every one.
    """

    parameters: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    predicted_force: NDArray[np.float64]
    validity_margin: NDArray[np.float64]
    status: NDArray[np.uint8]
    time: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    samples: NDArray[np.int64] | None = None

    @classmethod
    def empty(cls, samples: int, size: int, at: NDArray[np.int64] | None = None) -> "Trace":
        """Room for ``samples`` samples of a law with ``size`` parameters, estimates ``at`` some."""
        # One block: the fewer new pages, the faster a replay.
        rows = samples if at is None else len(at)
        block = np.empty(2 * rows * size + 2 * samples)
        parameters, errors, predicted, margin = np.split(
            block, np.cumsum([rows * size, rows * size, samples])
        )
        return cls(
            parameters.reshape(rows, size),
            errors.reshape(rows, size),
            predicted,
            margin,
            np.empty(samples, dtype=np.uint8),
            samples=at,
        )

    @classmethod
    def joined(cls, traces: "Sequence[Trace]", size: int) -> "Trace":
        """Return traces one behind the other, as one."""
        if not traces:
            return cls.empty(0, size)
        parts = {
            name: np.concatenate([getattr(trace, name) for trace in traces])
            for name in cls.__dataclass_fields__
            if name != "samples"
        }
        if not all(trace.full for trace in traces):
            before = np.cumsum([0, *map(len, traces)]).tolist()
            parts["samples"] = np.concatenate(
                [trace.after + first for trace, first in zip(traces, before, strict=False)]
            )
        return cls(**parts)

    def __len__(self) -> int:
        return len(self.status)

    def __getitem__(self, window: slice) -> "Trace":
        """Part of the trace, sharing its memory where it is full."""
        rows, samples = self._rows(window)
        return Trace(
            self.parameters[rows],
            self.standard_errors[rows],
            self.predicted_force[window],
            self.validity_margin[window],
            self.status[window],
            self.time[rows] if len(self.time) else self.time,
            samples,
        )

    def _rows(self, window: slice) -> tuple[Any, NDArray[np.int64] | None]:
        """Which estimates are in a part of the samples, and after which of that part's samples."""
        if self.samples is None:
            return window, None
        place = np.full(len(self), -1, dtype=np.int64)
        kept = place[window]
        kept[:] = np.arange(len(kept))  # a view
        there = place[self.samples]
        rows = np.flatnonzero(there >= 0)
        rows = rows[np.argsort(there[rows])]
        return rows, there[rows]

    @property
    def full(self) -> bool:
        """Whether the estimate is there after every sample."""
        return self.samples is None

    @property
    def after(self) -> NDArray[np.int64]:
        """The samples after which the estimates were known; shape (m,)."""
        return np.arange(len(self)) if self.samples is None else self.samples

    def everywhere(self, values: Floats) -> Floats:
        """Numbers of the estimates in a row for each sample, NaN where there is no estimate.

        Parameters
        ----------
        values : numpy.ndarray, shape (m,) or (m, p)
            Such as :attr:`parameters`.
        """
        if self.samples is None:
            return values
        spread = np.full((len(self), *values.shape[1:]), np.nan)
        spread[self.samples] = values
        return spread

    @property
    def validity(self) -> NDArray[np.bool_]:
        """Where condition 10, |v| < 0.1 K/B, holds; shape (k,)."""
        return self.validity_margin > 0.0

    @property
    def taken(self) -> NDArray[np.bool_]:
        """Which samples entered the estimate; shape (k,)."""
        taken: NDArray[np.bool_] = np.isin(
            self.status, (Status.UPDATED, Status.GUARDED, Status.RESTARTED)
        )
        return taken

    @property
    def rejected(self) -> NDArray[np.bool_]:
        """Which samples were left out as outliers; shape (k,)."""
        rejected: NDArray[np.bool_] = self.status == Status.REJECTED
        return rejected


def checked_trace(trace: Any) -> Traced:
    """Return how much of a trace is requested, once it is known to be sound.

    Raises
    ------
    InvalidParameterError
        It is none of False, "full", a number of rows and a time in [1e-9, 1e9] s.
    """
    if trace is False or (isinstance(trace, str) and trace == "full"):
        return trace  # type: ignore[return-value]  # a str that equals it
    if trace is True or isinstance(trace, str):
        raise InvalidParameterError(
            "trace must be 'full', False, an int (at most so many estimates) or a float (seconds "
            f"between estimates), not {shown(trace)}"
        )
    if isinstance(trace, int | np.integer):
        return whole_in("trace", int(trace), 1, 10**9)
    return number_in("trace", trace, 1e-9, 1e9)


def thinned(trace: Traced, time: Floats, segments: "Sequence[slice]") -> NDArray[np.int64] | None:
    """Return after which samples of a contact a trace has the estimate; None: after each.

    At most so many, evenly spread, of which the last sample is one; or of each segment the first
    sample of each interval of seconds, and the last sample.
    """
    if trace == "full":
        return None
    if trace is False or not len(time):
        return np.empty(0, dtype=np.int64)
    if isinstance(trace, int):
        if len(time) <= trace:
            return None
        return np.linspace(len(time) - 1, 0, trace).round()[::-1].astype(np.int64)
    first = [np.empty(0, dtype=np.int64)]
    for part in segments:
        interval = np.floor((time[part] - time[part.start]) / float(trace))
        begins = np.diff(interval, prepend=-1.0) > 0.0
        begins[-1] = True
        first.append(part.start + np.flatnonzero(begins))
    after = np.concatenate(first)
    return None if len(after) == len(time) else after
