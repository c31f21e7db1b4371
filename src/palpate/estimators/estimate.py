"""What an estimator knows now, what a replay wrote down, and the figures of merit of that."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate._core import EstimateValue, Status
from palpate.errors import InvalidParameterError
from palpate.findings import Finding
from palpate.force_laws import ForceLaw
from palpate.validation import Floats, number_in, shown, signals, whole_in

# By the bits of IdentifiabilityFlag in include/palpate/estimate.hpp.
ADVICE = {
    1: Finding(
        "exponent",
        "exponent not identifiable from this motion",
        "reach shallow and deep penetrations in turn",
    ),
    2: Finding(
        "damping",
        "damping not identifiable",
        "pass the same depths at different speeds, both ways",
    ),
    4: Finding(
        "exponent range",
        "exponent at the edge of its range",
        "widen exponent_range, or check the surface",
    ),
    8: Finding(
        "surface range",
        "surface at the edge of its range",
        "widen surface_range, or record the approach",
    ),
    128: Finding(
        "memory",
        "the samples begin in contact: what the material remembered nobody saw, and a law without "
        "memory is all that they say yet",
    ),
    64: Finding(
        "offset",
        "offset beyond what the tare left",
        "tare again out of contact, or check the surface",
    ),
    16: Finding(
        "tracking",
        "not tracking yet: the start still waits for a motion that makes the exponent identifiable",
    ),
    32: Finding(
        "tracking",
        "the material drifts faster than the walk allows, or the noise is correlated: the error "
        "bars are too narrow",
        "raise stiffness_drift, or the dissipation's and the exponent's",
    ),
}


def findings_of(bits: int) -> tuple[Finding, ...]:
    """Return what the bits of an estimate's flags say."""
    return tuple(finding for bit, finding in ADVICE.items() if bits & bit)


class Estimate(EstimateValue):
    """What an estimator knows now, in SI.

    Estimators make it; :meth:`from_law` is for a method of one's own.

    Attributes
    ----------
    law : force law
        The contact model.
    parameters : numpy.ndarray, shape (p,)
        The law's parameters in its own order.
    covariance : numpy.ndarray, shape (p, p)
        Joint covariance of the law's parameters, in their order: the recursion's P times the
        variance of its residual, taken from θ to the law by the delta method.
    standard_errors : numpy.ndarray, shape (p,)
        Square roots of its diagonal. Variable projection makes them so wide that ± 1.96 of them
        hold the truth in 95 of 100 although the noise is correlated and itself only estimated:
        they contain the factor t₀.₉₇₅(ν)/1.96. The paper's methods take the noise for white here;
        :attr:`Identification.standard_errors` does not.
    offset, offset_standard_error : float
        Force that the sensor shows without contact, N, by methods that estimate it; else 0.
    surface, surface_standard_error : float
        Where the material begins, in the coordinate of the penetration, m, by methods that search
        for it; else 0.
    joint_covariance : numpy.ndarray, shape (p + 1, p + 1)
        Covariance of the law's parameters and, last, the offset.
    findings : tuple of Finding
        What is not identifiable from this motion, and what motion would help; ``flags`` has them
        in words.
    fixed : tuple of str
        Names of the law's parameters that were given, such as a known exponent; the others were
        identified with them, and the standard errors of these are 0.
    valid : bool
        Condition 10, |v| < 0.1 K/B, at the last sample taken. Always true for laws without a
        logarithm.
    validity_margin : float
        1 − |v B/K| / 0.1: 1 at rest, 0 at the limit, negative beyond it.
    status : Status
        Of the last sample that was neither refused nor left out.
    samples : int
        Samples taken.
    guarded : int
        Of them, how many the covariance guard touched (``docs/numerics.md``).
    restarts : int
        How often a change of the material was detected and the estimate reinitialised.
    rejected : int
        Samples left out as outliers.
    """

    __slots__ = ("_law_type", "fixed")

    def __init__(
        self, value: EstimateValue, law_type: type[ForceLaw], fixed: tuple[str, ...] = ()
    ) -> None:
        super().__init__(value)
        self._law_type, self.fixed = law_type, fixed

    @classmethod
    def from_law(
        cls,
        law: ForceLaw,
        covariance: Floats,
        *,
        status: Status,
        samples: int,
        validity_margin: float = 1.0,
        fixed: tuple[str, ...] = (),
    ) -> "Estimate":
        """Return the estimate of a method of one's own.

        Parameters
        ----------
        law : force law
            The contact model.
        covariance : array_like, shape (p, p)
            Joint covariance of the law's parameters, p at most 8.
        status : Status
            Of the last sample that was not refused.
        samples : int
            Samples taken.
        validity_margin : float
            Condition 10, where it concerns the law.
        fixed : tuple of str
            The law's parameters that were given.

        Raises
        ------
        InvalidParameterError
            The covariance is not a matrix of the law's size, or the law has more than 8 parameters.
        """
        matrix = np.ascontiguousarray(covariance, dtype=np.float64).reshape(-1)
        try:
            value = EstimateValue(law.parameters, matrix, status, samples, validity_margin)
        except ValueError as error:
            raise InvalidParameterError(f"{type(law).__name__}: {error}") from None
        return cls(value, type(law), fixed)

    @property
    def law(self) -> Any:  # of the estimator's law_type
        """The contact model, SI."""
        return self._law_type.from_parameters(self.parameters)

    def stiffness_at(self, depth: float) -> tuple[float, float]:
        """∂F/∂x at a depth [m] and at rest, and its standard error, N/m."""
        return self.with_error(lambda law: law.stiffness_at(depth))

    def damping_at(self, depth: float) -> tuple[float, float]:
        """∂F/∂v at a depth [m], and its standard error, N·s/m."""
        return self.with_error(lambda law: law.damping_at(depth))

    def with_error(self, number: Callable[[Any], float]) -> tuple[float, float]:
        """Any number by the law, and its standard error by the delta method: √(gᵀ C g).

        Parameters
        ----------
        number : callable
            Of the law, to a float.
        """
        values, errors = self.with_errors(lambda law: (number(law),))
        return float(values[0]), float(errors[0])

    def with_errors(self, numbers: Callable[[Any], Sequence[float]]) -> tuple[Floats, Floats]:
        """Several numbers by the law, and their standard errors, as :meth:`with_error` has them.

        Parameters
        ----------
        numbers : callable
            Of the law, to m floats.

        Returns
        -------
        tuple of numpy.ndarray, shape (m,)
            The numbers, and their standard errors.
        """
        law, parameters = self.law, self.parameters
        of = law.from_parameters
        values = np.array(numbers(law), dtype=np.float64)
        # By differences over a hundredth of an error, in which a law is as good as linear; what has
        # none does not count. Where an error is tens of times the number, this keeps its sign.
        errors, sizes = self.standard_errors, np.abs(parameters)
        steps = np.where(np.isfinite(errors), 0.01 * errors, 1.0)
        steps = np.where(sizes > 0.0, np.minimum(steps, 0.5 * sizes), steps)
        # Nor is an exponent moved by more than a half, where it may have left its range.
        plain = [not unit for unit in law.units]
        steps = np.where(plain, np.minimum(steps, 0.5), steps)
        gradient = np.zeros((len(values), len(steps)))
        with np.errstate(all="ignore"):  # of a start that knows nothing the error may be infinite
            for k in np.flatnonzero(steps).tolist():
                up, down = parameters.copy(), parameters.copy()
                up[k], down[k] = up[k] + steps[k], down[k] - steps[k]
                change = np.subtract(numbers(of(up)), numbers(of(down)))
                gradient[:, k] = change / (2.0 * steps[k])
            covariance = self.covariance
            variances = np.array([each @ covariance @ each for each in gradient])
            return values, np.sqrt(np.where(variances >= 0.0, variances, np.nan))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is not identifiable from this motion, and what motion would help."""
        return findings_of(self._flags)

    @property
    def flags(self) -> tuple[str, ...]:
        """The findings in words."""
        return tuple(map(str, self.findings))

    @property
    def valid(self) -> bool:
        """Whether condition 10 held at the last sample taken."""
        return self.validity_margin > 0.0

    def __repr__(self) -> str:
        return (
            f"Estimate({self.law!r}, standard_errors={self.standard_errors.tolist()}, "
            f"samples={self.samples}, status={self.status.name})"
        )


# What a replay wrote down, sample by sample.

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
        block, ends = np.empty(2 * rows * size + 2 * samples), [rows * size, 2 * rows * size]
        parameters, errors, rest = np.split(block, ends)
        predicted, margin = rest.reshape(2, -1)
        status = np.empty(samples, dtype=np.uint8)
        learned = parameters.reshape(rows, size), errors.reshape(rows, size)
        return cls(*learned, predicted, margin, status, samples=at)

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
        kept = np.arange(len(self))[window]
        _, there, rows = np.intersect1d(kept, self.samples, return_indices=True)
        order = np.argsort(there)
        return rows[order], there[order]

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


# Figures of merit, as the paper takes them.

# The paper's Tables II, IV and VI leave out the first 0.2 s of contact.
START_UP = 0.2  # s


def rmse_percent(measured: "ArrayLike", predicted: "ArrayLike") -> float:
    """100 √(Σ (F − F̂)² / Σ F²), the paper's RMSE%; NaN without samples or without force."""
    force, estimate = signals(measured=measured, predicted=predicted)
    energy = float(np.dot(force, force))
    error = force - estimate
    return 100.0 * float(np.sqrt(np.dot(error, error) / energy)) if energy > 0.0 else float("nan")


def prediction_rmse_percent(trace: Trace, force: Floats, time_steps: Floats) -> float:
    """RMSE% of the a-priori force over the samples taken after the first 0.2 s of contact.

    NaN where there was less contact than that.
    """
    taken = trace.taken
    late = taken & (np.cumsum(np.where(taken, time_steps, 0.0)) > START_UP)
    return rmse_percent(force[late], trace.predicted_force[late])


def violated_fraction(trace: Trace) -> float:
    """Share of the samples taken at which condition 10 did not hold; NaN without samples."""
    margin = trace.validity_margin[trace.taken]
    return float(np.mean(~(margin > 0.0))) if margin.size else float("nan")
