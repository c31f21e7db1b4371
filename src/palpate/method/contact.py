"""A contact: penetration, velocity and force on one clock, and how each was obtained."""

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Finding
from palpate.method.rows import median
from palpate.method.rows import run_slices as run_slices
from palpate.validation import (
    Floats,
    Integers,
    Mask,
    Plain,
    check_field,
    frozen,
    number,
    same_length,
    shown,
    signals,
)

# s. A metre in less time is a velocity above 1e100 m/s, which every estimator rejects.
SHORTEST_STEP = 1e-100
VELOCITY_NOTE = "velocity filter"
_LABELS = "segment must be an array of one label per sample, such as [0, 0, 1]"


@frozen
class VelocityFilter(Plain):
    """How a velocity was computed: the slope of a smoothing spline, or of windowed polynomials.

    Parameters
    ----------
    samples : int
        Samples in the centred window, ≥ 3; for a spline, in the window of the parabola with equal
        noise.
    degree : int
        Degree of the polynomial, 1 to 9; 3 for a spline.
    penalty : float, optional
        Penalty of a spline, λ/h³ > 0 with h the usual time step. None: polynomials in a window.

    Raises
    ------
    InvalidParameterError
        A number is outside its range.

    Examples
    --------
    >>> import palpate
    >>> palpate.prepare("examples/recordings/ball.csv", velocity_window=0.015).velocity_filter
    VelocityFilter(samples=15, degree=2, penalty=None)
    """

    samples: int
    degree: int
    penalty: float | None = None

    def __post_init__(self) -> None:
        check_field(self, "samples", 3, 1e300, whole=True)
        check_field(self, "degree", 1, 9, whole=True)
        if self.penalty is not None:
            check_field(self, "penalty", 0.0, 1e300, open_low=True)

    def as_note(self) -> dict[str, str]:
        """Return the note for a file with this velocity."""
        return {VELOCITY_NOTE: json.dumps(self.as_dict())}

    @classmethod
    def from_notes(cls, notes: Mapping[str, str]) -> "VelocityFilter | None":
        """Return the filter from the notes of a file; None without a valid one."""
        try:
            return cls(**json.loads(notes[VELOCITY_NOTE]))
        except (KeyError, TypeError, ValueError):
            return None


@frozen
class Delay:
    """The delay that was taken out of a force, all of it.

    Parameters
    ----------
    seconds : float
        s; negative if the force was early.
    standard_error : float
        Its standard error, s.
    found : bool
        Whether palpate found it; otherwise the user specified it.
    from_contact : bool
        Whether it is the delay by which a force law fits the contact best. Otherwise something else
        showed it: a spring, the payload in free air, or one clock.

    Examples
    --------
    >>> import palpate
    >>> contact = palpate.prepare("examples/recordings/ball.csv", delay=(2e-3, 1e-4))
    >>> contact.delay
    Delay(seconds=0.002, standard_error=0.0001, found=False, from_contact=False)
    """

    seconds: float
    standard_error: float
    found: bool = False
    from_contact: bool = False


def add_step(made: dict[str, str], channel: str, step: str) -> None:
    """Add a step to the description of how a channel was obtained."""
    made[channel] = f"{made[channel]}, {step}" if channel in made else step


@frozen(eq=False, init=False, repr=False)
class Contact:
    """The input of identification, in SI units on one clock, and how it was obtained.

    An immutable value. :func:`palpate.prepare` makes one from a recording, a data frame or arrays
    and computes the velocity if the data have none.

    Parameters
    ----------
    time : array_like, shape (k,)
        s; strictly increasing within a segment.
    penetration : array_like, shape (k,)
        m, positive inside the material.
    velocity : array_like, shape (k,)
        m/s, positive while penetrating.
    force : array_like, shape (k,)
        N, compression positive.
    segment : array_like, shape (k,), optional
        One label per sample; a new label starts a new contact, after free air or a gap.
    source : str
        The name of the file.
    provenance : mapping
        How each channel was obtained, and other notes on its origin, as text.
    tare_deviation : float, optional
        Standard deviation of the force offset that is left after taring, N, > 0. None: the offset
        is unknown.
    surface_deviation : float, optional
        Standard deviation of the position of the surface, m, > 0. None: unknown.
    delay : Delay, optional
        The delay of the force that was taken out of it; its error is part of the damping's error.
    moving_mass : float, optional
        Mass between force sensor and material whose inertia was added to the force, kg, ≥ 0. None:
        unknown.
    findings : sequence of Finding
        Problems, assumptions and excluded samples that the preparation reports.
    prepared : Prepared, optional
        The recording and the settings from which the contact was made, and the results of the
        preparation.
    velocity_filter : VelocityFilter, optional
        How the velocity was computed from the penetration. None: it was recorded.
    stated_units : set of str
        Channels whose unit was stated by an option, or in the recording: in a row of units, in
        brackets, as an attribute, or as a unit other than SI. The diagnosis does not question them.
    assumed_units : set of str
        Channels of a file that states their unit nowhere, not even in their name: SI is assumed.
    timeless : bool
        Whether no time was recorded, and ``time`` counts the samples. Default: False.

    Raises
    ------
    InvalidParameterError
        The arrays differ in length or type, or time does not increase within a segment.

    Examples
    --------
    >>> import palpate
    >>> contact = palpate.Contact(
    ...     [0.0, 0.001, 0.002],
    ...     penetration=[1e-3, 1.1e-3, 1.2e-3],
    ...     velocity=[0.1, 0.1, 0.1],
    ...     force=[2.0, 2.2, 2.4],
    ... )
    >>> len(contact), contact.sample_time
    (3, 0.001)
    """

    time: Floats
    penetration: Floats
    velocity: Floats
    force: Floats
    segment: Integers
    source: str
    provenance: Mapping[str, str]
    tare_deviation: float | None
    surface_deviation: float | None
    delay: Delay | None
    moving_mass: float | None
    findings: tuple[Finding, ...]
    prepared: Any
    velocity_filter: VelocityFilter | None
    stated_units: frozenset[str]
    assumed_units: frozenset[str]
    timeless: bool

    def __init__(
        self,
        time: "ArrayLike",
        *,
        penetration: "ArrayLike",
        velocity: "ArrayLike",
        force: "ArrayLike",
        segment: "ArrayLike | None" = None,
        source: str = "",
        provenance: Mapping[str, str] | None = None,
        tare_deviation: float | None = None,
        surface_deviation: float | None = None,
        delay: Delay | None = None,
        moving_mass: float | None = None,
        findings: Sequence[Finding] = (),
        prepared: Any = None,
        velocity_filter: VelocityFilter | None = None,
        stated_units: Iterable[str] = (),
        assumed_units: Iterable[str] = (),
        timeless: bool = False,
    ) -> None:
        t, x, v, f = signals(time=time, penetration=penetration, velocity=velocity, force=force)
        labels = number_runs(segment, t.size)
        _check_time(t, labels)
        own = t, x, v, f, labels, source, dict(provenance or {})
        rest = tare_deviation, surface_deviation, delay, moving_mass, tuple(findings), prepared
        units = frozenset(stated_units), frozenset(assumed_units)
        about = velocity_filter, *units, bool(timeless)
        for each, value in zip(fields(self), (*own, *rest, *about), strict=True):
            object.__setattr__(self, each.name, value)
        for name in ("tare_deviation", "surface_deviation"):
            if getattr(self, name) is not None:
                check_field(self, name, 0.0, 1e30, open_low=True)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = f" from {self.time[0]:g} s to {self.time[-1]:g} s" if len(self) else ""
        parts = int(self.segment[-1]) - int(self.segment[0]) + 1 if len(self) else 0
        segments = f" in {parts} segments" if parts > 1 else ""
        source = shown(", ".join(Path(each).name for each in self.source.split(", ")), 40)
        return textwrap.fill(f"<Contact {source}: {len(self)} samples{span}{segments}>", 80)

    def segments(self) -> Iterator[slice]:
        """Slices of the separate contacts, in order."""
        return run_slices(self.segment)

    @property
    def sample_time(self) -> float:
        """Median time between samples within a segment, s."""
        steps = np.diff(self.time)[np.diff(self.segment) == 0]
        return median(steps) if steps.size else 1e-3

    @property
    def time_steps(self) -> Floats:
        """Time since the previous sample, s; the median one at the start of a segment."""
        steps = np.diff(self.time, prepend=0.0)
        steps[np.diff(self.segment, prepend=self.segment[:1] - 1) != 0] = self.sample_time
        return steps

    def window(self, start: float | None = None, stop: float | None = None) -> "Contact":
        """Return the samples with start ≤ time ≤ stop, s; the velocity is not recomputed."""
        low = -np.inf if start is None else number("start", start)
        high = np.inf if stop is None else number("stop", stop)
        keep = between(self.time, low, high, self.source)
        text = f"{low:g} s to {high:g} s"
        return replace(self.taken(keep), provenance={**self.provenance, "window": text})

    def taken(self, samples: "slice | Mask") -> "Contact":
        """Return a contact of the selected samples, otherwise unchanged."""
        cut = ("time", "penetration", "velocity", "force", "segment")
        return replace(self, **{name: getattr(self, name)[samples] for name in cut})


def between(time: Floats, low: float, high: float, source: str) -> Mask:
    """Mask of the samples between two times, s; raise RecordingError if no sample is there."""
    keep = (time >= low) & (time <= high)
    if not keep.any():
        first = time.min(initial=np.inf)
        last = time.max(initial=-np.inf)
        text = f"there is no sample between {low:g} s and {high:g} s; the recording runs from"
        raise RecordingError.of(source, f"{text} {first:g} s to {last:g} s")
    return keep


def number_runs(segment: "ArrayLike | None", samples: int) -> Integers:
    """Consecutive numbers of the runs of equal labels; NaN labels count as equal."""
    if segment is None:
        return np.zeros(samples, dtype=np.int64)
    try:
        given = np.asarray(segment)
        missing = given != given
    except (TypeError, ValueError):
        raise InvalidParameterError(_LABELS) from None
    if given.shape != (samples,):
        same_length(time=samples, segment=given.size)
        raise InvalidParameterError(_LABELS)
    other = (given[1:] != given[:-1]) & ~(missing[1:] & missing[:-1])
    return np.concatenate([np.zeros(min(samples, 1), dtype=np.int64), np.cumsum(other)])


def _check_time(time: Floats, labels: Integers) -> None:
    """Reject times that are not finite or that increase by less than 1e-100 s in a segment."""
    with np.errstate(invalid="ignore", over="ignore"):  # NaN, infinite or huge times
        late = np.diff(time) >= SHORTEST_STEP
    wrong = ~np.isfinite(time)
    wrong[1:] |= ~late & (labels[1:] == labels[:-1])
    if wrong.any():
        first = int(np.argmax(wrong))
        before = f" after {time[first - 1]} s" if first else ""
        raise InvalidParameterError(
            "time must be finite and increase within a segment; "
            f"sample {first} is {time[first]} s{before}"
        )
