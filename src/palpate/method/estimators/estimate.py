"""An estimator's current estimate, the trace of a replay, and the errors of that trace."""

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate._core import EstimateValue, Status
from palpate.digits import with_error
from palpate.errors import InvalidParameterError
from palpate.findings import Check, Finding, NextStep, Remedy, loop_checks
from palpate.force_laws import ForceLaw
from palpate.validation import Floats, Integers, Mask, frozen, number_in, shown, signals, whole_in

# Keys: the bits of IdentifiabilityFlag in include/palpate/estimate.hpp.
ADVICE = {
    1: Check.EXPONENT.finding(
        "exponent not identifiable from this motion",
        "alternate between shallow and deep penetrations",
    ),
    2: Check.DAMPING.finding("damping not identifiable", Remedy(NextStep.VARY_SPEED)),
    4: Check.EXPONENT_RANGE.finding(
        "exponent at the edge of its range",
        "check that the penetration is 0 at the surface",
    ),
    8: Check.SURFACE_RANGE.finding(
        "surface at the edge of its range",
        "record the approach through free air",
    ),
    64: Check.OFFSET_PRIOR.finding(
        "force offset larger than the tare's uncertainty allows",
        "tare again out of contact",
    ),
    16: Check.TRACKING.finding(
        "not tracking yet: the exponent is not yet identifiable from this motion",
        "alternate between shallow and deep penetrations",
    ),
    32: Check.TRACKING.finding(
        "the material drifts faster than the random walk allows, or the noise is correlated: the "
        "standard errors may be too small",
        "raise stiffness_drift",
    ),
    256: Check.LIGHT_CONTACT.finding(
        "light contact biases the logarithm of the force: the standard errors are too small",
        "raise the gate's forces well above the noise, or identify by variable projection",
    ),
}


def flag_findings(bits: int) -> tuple[Finding, ...]:
    """Return the findings of an estimate's flag bits."""
    return tuple(finding for bit, finding in ADVICE.items() if bits & bit)


class Estimate(EstimateValue):
    """An estimator's current estimate, in SI.

    Estimators return it; :meth:`from_law` makes one in your own method.

    Parameters
    ----------
    value : EstimateValue
        Numbers of the compiled estimator.
    law_type : type of ForceLaw
        Class of ``law``.
    fixed : tuple of str
        Names of the law's parameters that were specified, such as a known exponent; their standard
        errors are 0. Default: none.

    Attributes
    ----------
    law : force law
        The contact model.
    parameters : numpy.ndarray, shape (p,)
        The law's parameters, in the law's order.
    covariance : numpy.ndarray, shape (p, p)
        Joint covariance of the law's parameters: the recursion's P times the variance of its
        residual, converted from θ to the law by the delta method.
    standard_errors : numpy.ndarray, shape (p,)
        Square roots of the covariance's diagonal. Variable projection allows for correlated noise
        of unknown variance: its standard errors contain the factor t₀.₉₇₅(ν)/1.96, so that ± 1.96
        standard errors cover the truth in 95 % of cases. The paper's methods assume white noise
        here; :attr:`Identification.standard_errors` does not.
    offset, offset_standard_error : float
        Force that the sensor shows without contact, N; 0 if the method does not estimate it.
    surface, surface_standard_error : float
        Surface position in the coordinate of the penetration, m; 0 if the method does not estimate
        it.
    joint_covariance : numpy.ndarray, shape (p + 1, p + 1)
        Covariance of the law's parameters and, last, the offset.
    stiffness, damping : ResponseNumber
        K′ = ∂F/∂x [N/m] and B′ = ∂F/∂v [N·s/m] of small oscillations at ``depth`` and
        ``frequency``, each with its ``value``, ``standard_error`` and whether it is ``usable``:
        what a controller may act on (``docs/how-to/controller.md``). NaN for a method written in
        Python.
    depth, frequency : float
        Penetration, m, and angular frequency of the motion so far, rad/s.
    age : float
        Time since the latest sample that ``stiffness`` and ``damping`` contain, s.
    findings : tuple of Finding
        Parameters that this motion does not identify, and a motion that would.
    flags : tuple of str
        The text of the findings, and the ids of the loop's checks: stuck force, saturation, spikes,
        late force, lost contact, baseline (the force in free air has moved), change.
    valid : bool
        Whether condition 10, abs(v) < 0.1 K/B, held at the last sample taken. Always true for laws
        without a logarithm.
    validity_margin : float
        1 − abs(v B/K) / 0.1: 1 at rest, 0 at the limit, negative beyond it.
    status : Status
        Status of the last sample that was neither refused nor rejected as an outlier.
    samples : int
        Number of samples taken.
    guarded : int
        Number of samples at which the covariance guard acted (``docs/reference/numerics.md``).
    restarts : int
        Number of detected changes of the material, each of which restarts the estimate.
    rejected : int
        Number of samples rejected as outliers.

    Examples
    --------
    >>> import palpate
    >>> estimate = palpate.identify("examples/recordings/ball.csv").estimate
    >>> stiffness, standard_error = estimate.stiffness_at(5e-3)  # N/m
    >>> round(stiffness, -1), standard_error < 1.0
    (2000.0, True)
    """

    __slots__ = ("_law", "_law_type", "fixed")

    def __init__(
        self,
        value: EstimateValue,
        law_type: type[ForceLaw],
        fixed: tuple[str, ...] = (),
    ) -> None:
        super().__init__(value)
        self._law_type = law_type
        self.fixed = fixed
        self._law: ForceLaw | None = None

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
        """Return the estimate of your own method.

        Parameters
        ----------
        law : force law
            The contact model.
        covariance : array_like, shape (p, p)
            Joint covariance of the law's parameters, p at most 8.
        status : Status
            Status of the last sample that was not refused.
        samples : int
            Number of samples taken.
        validity_margin : float
            Margin of condition 10. Default: 1, for laws that it does not concern.
        fixed : tuple of str
            Names of the law's parameters that were specified. Default: none.

        Raises
        ------
        InvalidParameterError
            The covariance has the wrong size, or the law has more than 8 parameters.
        """
        matrix = np.ascontiguousarray(covariance, dtype=np.float64).reshape(-1)
        try:
            value = EstimateValue(law.parameters, matrix, status, samples, validity_margin)
        except ValueError as error:
            raise InvalidParameterError(f"{type(law).__name__}: {error}") from None
        estimate = cls(value, type(law), fixed)
        estimate._law = law  # the parameters alone do not contain relaxation times
        return estimate

    @property
    def law(self) -> Any:  # an instance of law_type
        """The contact model, SI."""
        return self._law or self._law_type.from_parameters(self.parameters)

    def stiffness_at(self, depth: float) -> tuple[float, float]:
        """∂F/∂x at a depth [m] and zero velocity, and its standard error, N/m."""
        return self.with_error(lambda law: law.stiffness_at(depth))

    def damping_at(self, depth: float) -> tuple[float, float]:
        """∂F/∂v at a depth [m], and its standard error, N·s/m."""
        return self.with_error(lambda law: law.damping_at(depth))

    def with_error(self, number: Callable[[Any], float]) -> tuple[float, float]:
        """Any function of the law, and its standard error by the delta method: √(gᵀ C g).

        Parameters
        ----------
        number : callable
            Takes the law, returns a float.
        """
        values, errors = self.with_errors(lambda law: (number(law),))
        return float(values[0]), float(errors[0])

    def with_errors(self, numbers: Callable[[Any], Sequence[float]]) -> tuple[Floats, Floats]:
        """Several functions of the law, and their standard errors, as in :meth:`with_error`.

        Parameters
        ----------
        numbers : callable
            Takes the law, returns m floats.

        Returns
        -------
        tuple of numpy.ndarray, shape (m,)
            The numbers, and their standard errors.
        """
        parameters, covariance, law_from, unitless = self._numbers()
        values = np.array(numbers(self.law), dtype=np.float64)
        # Central differences over 1 % of each standard error, where a law is nearly linear. The
        # limit keeps the parameter's sign where its error is tens of times its value.
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        sizes = np.abs(parameters)
        steps = np.where(np.isfinite(errors), 0.01 * errors, 1.0)
        steps = np.where(sizes > 0.0, np.minimum(steps, 0.5 * sizes), steps)
        # An exponent changes by a half at most, to stay in its range.
        steps = np.where(unitless, np.minimum(steps, 0.5), steps)
        gradient = np.zeros((len(values), len(steps)))
        with np.errstate(all="ignore"):  # before the first fit an error may be infinite
            for k in np.flatnonzero(steps).tolist():
                up = parameters.copy()
                down = parameters.copy()
                up[k] = up[k] + steps[k]
                down[k] = down[k] - steps[k]
                change = np.subtract(numbers(law_from(up)), numbers(law_from(down)))
                gradient[:, k] = change / (2.0 * steps[k])
            variances = np.array([each @ covariance @ each for each in gradient])
            return values, np.sqrt(np.where(variances >= 0.0, variances, np.nan))

    def _numbers(self) -> tuple[Floats, Floats, Callable[[Floats], ForceLaw], Sequence[bool]]:
        """The law's numbers, their covariance, the law from them, and which have no unit."""
        unitless = [not unit for unit in self._law_type.units]
        return self.parameters, self.covariance, self.law.with_parameters, unitless

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Parameters that this motion does not identify, and a motion that would."""
        return self.motion_findings

    @property
    def motion_findings(self) -> tuple[Finding, ...]:
        """The findings on the motion, without those on the method's standard errors."""
        return flag_findings(self._flags)

    @property
    def flags(self) -> tuple[str, ...]:
        """The findings as text, and the ids of what the loop's checks found."""
        return (*map(str, self.findings), *loop_checks(self._checks))

    @property
    def valid(self) -> bool:
        """Whether condition 10 held at the last sample taken."""
        return self.validity_margin > 0.0

    def __repr__(self) -> str:
        law = self._law_type
        rows = zip(law.symbols, self.parameters, self.standard_errors, law.units, strict=True)
        words = [f"{symbol} = {with_error(*pair, unit=unit)}" for symbol, *pair, unit in rows]
        counts = f"samples={self.samples}, status={self.status.name}"
        return f"Estimate({law.__name__}: {', '.join(words)}; {counts})"


# The trace of a replay, sample by sample.

#: When a trace contains the estimate: after every sample ("full"), at most this often (int), once
#: per this many seconds (float), or never (False).
Traced: TypeAlias = Literal[False, "full"] | int | float


@frozen(eq=False)
class Trace:
    """Predicted force, status and estimate at each sample of a replay.

    A full trace contains the estimate after each of its k samples, a thinned one after m of them (m
    may be 0). Predicted force, margin and status cover every sample in both.

    Parameters
    ----------
    parameters : numpy.ndarray, shape (m, p)
        The law's parameters, SI, in the law's order.
    standard_errors : numpy.ndarray, shape (m, p)
        Their standard errors.
    predicted_force : numpy.ndarray, shape (k,)
        One-step prediction, N: from the estimate before the sample. Variable projection predicts
        from its latest search, at most 64 samples earlier. NaN where a sample is not finite.
    validity_margin : numpy.ndarray, shape (k,)
        Condition 10 as 1 − abs(v B/K) / 0.1, from the same estimates.
    status : numpy.ndarray of uint8, shape (k,)
        The :class:`Status` of each sample.
    time : numpy.ndarray, shape (m,)
        Times of the estimates, s, from :func:`palpate.identify`; empty for a replay without times.
    samples : numpy.ndarray of int, shape (m,), optional
        Indices of the samples after which the trace contains the estimates. None: all samples.

    Examples
    --------
    >>> import palpate
    >>> trace = palpate.identify("examples/recordings/ball.csv", trace=100).trace
    >>> trace
    Trace(7000 samples: 4917 taken, 100 estimates)
    >>> trace.parameters.shape, trace.predicted_force.shape
    ((100, 3), (7000,))
    """

    parameters: Floats
    standard_errors: Floats
    predicted_force: Floats
    validity_margin: Floats
    status: NDArray[np.uint8]
    time: Floats = field(default_factory=lambda: np.empty(0))
    samples: Integers | None = None

    @classmethod
    def empty(cls, samples: int, size: int, at: Integers | None = None) -> "Trace":
        """An empty trace of ``samples`` samples and ``size`` parameters, with estimates ``at``."""
        # One allocation: fewer new memory pages make a replay faster.
        rows = samples if at is None else len(at)
        block = np.empty(2 * rows * size + 2 * samples)
        ends = [rows * size, 2 * rows * size]
        parameters, errors, rest = np.split(block, ends)
        predicted, margin = rest.reshape(2, -1)
        status = np.empty(samples, dtype=np.uint8)
        learned = parameters.reshape(rows, size), errors.reshape(rows, size)
        return cls(*learned, predicted, margin, status, samples=at)

    @classmethod
    def joined(cls, traces: "Sequence[Trace]", size: int) -> "Trace":
        """Return consecutive traces joined into one."""
        if not traces:
            return cls.empty(0, size)
        parts = {
            name: np.concatenate([getattr(trace, name) for trace in traces])
            for name in cls.__dataclass_fields__
            if name != "samples"
        }
        if not all(trace.full for trace in traces):
            offsets = np.cumsum([0, *map(len, traces)]).tolist()
            parts["samples"] = np.concatenate(
                [trace.after + first for trace, first in zip(traces, offsets, strict=False)]
            )
        return cls(**parts)

    def __len__(self) -> int:
        return len(self.status)

    def __repr__(self) -> str:
        counts = f"{self.taken.sum()} taken, {len(self.parameters)} estimates"
        return f"Trace({len(self)} samples: {counts})"

    def __getitem__(self, window: slice) -> "Trace":
        """Part of the trace; a part of a full trace shares its memory."""
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

    def _rows(self, window: slice) -> tuple[Any, Integers | None]:
        """Rows of the estimates within a window, and their sample indices in that window."""
        if self.samples is None:
            return window, None
        window_samples = np.arange(len(self))[window]
        _, places, rows = np.intersect1d(window_samples, self.samples, return_indices=True)
        order = np.argsort(places)
        return rows[order], places[order]

    @property
    def full(self) -> bool:
        """Whether the trace contains the estimate after every sample."""
        return self.samples is None

    @property
    def after(self) -> Integers:
        """Indices of the samples after which the trace contains the estimates; shape (m,)."""
        return np.arange(len(self)) if self.samples is None else self.samples

    def everywhere(self, values: Floats) -> Floats:
        """Spread the estimates' numbers over one row per sample; NaN in rows without an estimate.

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
    def validity(self) -> Mask:
        """Whether condition 10, abs(v) < 0.1 K/B, holds at each sample; shape (k,)."""
        return self.validity_margin > 0.0

    @property
    def taken(self) -> Mask:
        """Whether each sample entered the estimate; shape (k,)."""
        status = self.status
        taken: Mask = (
            (status == Status.UPDATED) | (status == Status.GUARDED) | (status == Status.RESTARTED)
        )
        return taken

    @property
    def rejected(self) -> Mask:
        """Whether each sample was rejected as an outlier; shape (k,)."""
        rejected: Mask = self.status == Status.REJECTED
        return rejected


def check_trace(trace: Any) -> Traced:
    """Check the ``trace`` argument and return it.

    Raises
    ------
    InvalidParameterError
        It is not False, "full", a number of rows or a time in [1e-9, 1e9] s.
    """
    if trace is False or (isinstance(trace, str) and trace == "full"):
        return trace  # type: ignore[return-value]  # a str that equals it
    if trace is True or isinstance(trace, str):
        raise InvalidParameterError(
            "trace must be 'full', False, an int (the largest number of estimates) or a float "
            f"(seconds between estimates), not {shown(trace)}"
        )
    if isinstance(trace, int | np.integer):
        return whole_in("trace", int(trace), 1, 10**9)
    return number_in("trace", trace, 1e-9, 1e9)


def choose_trace_samples(
    trace: Traced,
    time: Floats,
    segments: "Sequence[slice]",
) -> Integers | None:
    """Return the samples after which a contact's trace contains the estimate; None: all samples.

    If ``trace`` is an int: at most that many, evenly spread, up to the last sample. If it is in
    seconds: in each segment the first sample of every interval, and the last sample.
    """
    if trace == "full":
        return None
    if trace is False or not len(time):
        return np.empty(0, dtype=np.int64)
    if isinstance(trace, int):
        if len(time) <= trace:
            return None
        return np.linspace(len(time) - 1, 0, trace).round()[::-1].astype(np.int64)
    begin_indices = [np.empty(0, dtype=np.int64)]
    for segment in segments:
        interval = np.floor((time[segment] - time[segment.start]) / float(trace))
        begins = np.diff(interval, prepend=-1.0) > 0.0
        begins[-1] = True
        begin_indices.append(segment.start + np.flatnonzero(begins))
    indices = np.concatenate(begin_indices)
    return None if len(indices) == len(time) else indices


# The error measures of the paper.

# The paper's Tables II, IV and VI exclude the first 0.2 s of contact.
START_UP = 0.2  # s


def rmse_percent(measured: "ArrayLike", predicted: "ArrayLike") -> float:
    """100 √(Σ (F − F̂)² / Σ F²), the paper's RMSE%; NaN without samples or without force."""
    force, estimate = signals(measured=measured, predicted=predicted)
    energy = float(np.dot(force, force))
    error = force - estimate
    return 100.0 * float(np.sqrt(np.dot(error, error) / energy)) if energy > 0.0 else float("nan")


def prediction_rmse_percent(trace: Trace, force: Floats, time_steps: Floats) -> float:
    """RMSE% of the one-step prediction over the samples taken after the first 0.2 s of contact.

    NaN if the contact was shorter.
    """
    taken = trace.taken
    after_start_up = taken & (np.cumsum(np.where(taken, time_steps, 0.0)) > START_UP)
    return rmse_percent(force[after_start_up], trace.predicted_force[after_start_up])


def samples_in_estimate(trace: Trace) -> Mask:
    """Return which samples the last estimate uses: those taken since the last restart."""
    taken = trace.taken
    restarts = np.flatnonzero(trace.status == Status.RESTARTED)
    taken[: max(restarts, default=0)] = False
    return taken


def violated_fraction(trace: Trace) -> float:
    """Fraction of the samples taken that violate condition 10; NaN without samples."""
    margin = trace.validity_margin[trace.taken]
    return float(np.mean(~(margin > 0.0))) if margin.size else float("nan")
