"""What an estimator knows now."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from palpate._core import EstimateValue, Status
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw
from palpate.validation import Floats

# By the bits of IdentifiabilityFlag in include/palpate/estimate.hpp.
ADVICE = {
    1: "exponent not identifiable from this motion: reach shallow and deep penetrations in turn",
    2: "damping not identifiable: pass the same depths at different speeds, both ways",
    4: "exponent at the edge of its range: widen exponent_range, or check the surface",
    8: "surface at the edge of its range: widen surface_range, or record the approach",
    128: "the samples begin in contact: what the material remembered nobody saw, and a law without "
    "memory is all that they say yet",
    64: "offset beyond what the tare left: tare again out of contact, or check the surface",
    16: "not tracking yet: the start still waits for a motion that makes the exponent identifiable",
    32: "the material drifts faster than the walk allows, or the noise is correlated: the error "
    "bars are too narrow; raise stiffness_drift, or the dissipation's and the exponent's",
}


class Estimate:
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
    flags : tuple of str
        What is not identifiable from this motion, and what motion would help.
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

    __slots__ = ("_fixed", "_law_type", "_value")

    def __init__(
        self, value: EstimateValue, law_type: type[ForceLaw], fixed: tuple[str, ...] = ()
    ) -> None:
        self._value = value
        self._law_type = law_type
        self._fixed = fixed

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
        return self._law_type.from_parameters(self._value.parameters)

    @property
    def parameters(self) -> Floats:
        """The law's parameters in its own order, SI."""
        return self._value.parameters

    @property
    def covariance(self) -> Floats:
        """Joint covariance of the law's parameters, SI."""
        return self._value.covariance

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of the law's parameters, SI."""
        return self._value.standard_errors

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
    def joint_covariance(self) -> Floats:
        """Covariance of the law's parameters and, last, the offset, SI."""
        return self._value.joint_covariance

    @property
    def offset(self) -> float:
        """Force without contact, N."""
        return self._value.offset

    @property
    def offset_standard_error(self) -> float:
        """Its standard error, N; 0 where it is not estimated."""
        return float(max(self._value.offset_variance, 0.0) ** 0.5)

    @property
    def surface(self) -> float:
        """Where the material begins, m."""
        return self._value.surface

    @property
    def surface_standard_error(self) -> float:
        """Its standard error, m; 0 where it is not searched for."""
        return float(max(self._value.surface_variance, 0.0) ** 0.5)

    @property
    def flags(self) -> tuple[str, ...]:
        """What is not identifiable from this motion, and what motion would help."""
        bits = self._value.flags
        return tuple(words for bit, words in ADVICE.items() if bits & bit)

    @property
    def fixed(self) -> tuple[str, ...]:
        """The law's parameters that were given, and not identified."""
        return self._fixed

    @property
    def valid(self) -> bool:
        """Whether condition 10 held at the last sample taken."""
        return self._value.validity_margin > 0.0

    @property
    def validity_margin(self) -> float:
        """Condition 10 as a margin: 1 at rest, 0 at the limit, negative beyond it."""
        return self._value.validity_margin

    @property
    def status(self) -> Status:
        """Of the last sample that was neither refused nor left out."""
        return self._value.status

    @property
    def samples(self) -> int:
        """Samples taken."""
        return self._value.samples

    @property
    def guarded(self) -> int:
        """Of them, those that the guard touched."""
        return self._value.guarded

    @property
    def restarts(self) -> int:
        """How often the estimate was reinitialised after a change of the material."""
        return self._value.restarts

    @property
    def rejected(self) -> int:
        """Samples left out as outliers."""
        return self._value.rejected

    def __repr__(self) -> str:
        return (
            f"Estimate({self.law!r}, standard_errors={self.standard_errors.tolist()}, "
            f"samples={self.samples}, status={self.status.name})"
        )
