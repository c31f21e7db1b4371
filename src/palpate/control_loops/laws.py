"""What is known of a contact: laws with their errors, and the range in which they were recorded."""

import math
from dataclasses import replace
from typing import Any, Self

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.findings import Mark
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import Floats, check_field, frozen

# Steps of the derivatives, in standard errors, where a law is nearly linear.
_STEP = 0.01
# Limits of drawn exponents: those that a law may have.
_EXPONENTS = (0.3, 4.0)


@frozen(eq=False)
class LawDraws:
    """Laws as likely as the identified one, the identified one first; arrays of shape (draws,).

    F = K xⁿ + B xᵖ v + M Σ wᵢ gᵢ, as in :class:`palpate.GeneralisedHuntCrossley`.

    Attributes
    ----------
    K, n, B, p, M : numpy.ndarray
        The coefficients, SI.
    times, weights : numpy.ndarray
        Relaxation times [s], and weights with the sum 1; the same for all draws.
    slow : float
        Frequency below which the material counts as at rest, rad/s.
    """

    K: Floats
    n: Floats
    B: Floats
    p: Floats
    M: Floats
    times: Floats
    weights: Floats
    slow: float

    def first(self, count: int) -> "LawDraws":
        """Return the first of them."""
        return self.some(slice(count))

    def some(self, some: slice) -> "LawDraws":
        """Return a part of them."""
        return replace(
            self,
            K=self.K[some],
            n=self.n[some],
            B=self.B[some],
            p=self.p[some],
            M=self.M[some],
        )

    @property
    def remembers(self) -> bool:
        """Whether the material relaxes."""
        return bool(len(self.times)) and bool(self.M.any())

    def depth(self, force: float) -> Floats:
        """Depth at which each law has a force [N] after a slow approach, m."""
        storage, _ = self._memory(np.array(self.slow))
        depth: Floats = (force / (self.K + self.M * storage)) ** (1.0 / self.n)
        return depth

    def stiffness_and_damping(self, depth: Floats, frequency: Floats) -> tuple[Floats, Floats]:
        """K′ [N/m] and B′ [N·s/m] of small oscillations, at depths [m] and frequencies [rad/s]."""
        storage, loss = self._memory(frequency)
        slope = self.n * depth ** (self.n - 1.0)
        stiffness = slope * (self.K + self.M * storage)
        return stiffness, self.B * depth**self.p + slope * self.M * loss

    def _memory(self, frequency: Floats) -> tuple[Floats, Floats]:
        """Storage and loss (over the frequency) of the branches, relative to M."""
        angle = np.multiply.outer(frequency, self.times)
        storage = (self.weights * angle**2 / (1.0 + angle**2)).sum(axis=-1)
        loss = (self.weights * self.times / (1.0 + angle**2)).sum(axis=-1)
        return storage, loss


@frozen(eq=False)
class KnownLaw:
    """A law with its errors at a depth.

    Parameters
    ----------
    law : ForceLaw
        Its spring must be a single power of the depth.
    covariance : numpy.ndarray, shape (p, p)
        Joint covariance of the law's parameters, SI.
    depth : float
        Working depth, at which the errors are nearly normal, m.
    stiffness_error, damping_error : float
        Systematic errors at this depth, relative, which the covariance does not include.
        Default: 0.

    Raises
    ------
    InvalidParameterError
        The spring of the law is not a single power of the depth, or the depth is not in (0, 10].

    Examples
    --------
    >>> import palpate
    >>> from palpate import control_loops
    >>> estimate = palpate.identify("examples/recordings/ball.csv").estimate
    >>> known = control_loops.KnownLaw(estimate.law, estimate.covariance, depth=8.8e-3)
    >>> known.law.kind
    'hunt-crossley'
    """

    law: ForceLaw
    covariance: Floats
    depth: float
    stiffness_error: float = 0.0
    damping_error: float = 0.0

    def __post_init__(self) -> None:
        if self.law.powers is None:
            raise InvalidParameterError(
                f"the spring of law must be a single power of depth; it is {self.law!r}"
            )
        check_field(self, "depth", 0.0, 10.0, open_low=True)

    def draws(self, count: int, slow: float) -> LawDraws:
        """Return the law, and others as likely, drawn at the working depth.

        Force and damping at the depth, exponents and share of the relaxing part are nearly normal;
        K and B are not, as they are correlated with n to 0.99 and more.
        """
        parameters = self.law.parameters
        here = self._at_depth(parameters)
        errors = np.sqrt(np.maximum(np.nan_to_num(np.diag(self.covariance)), 0.0))
        slopes = np.zeros((len(here), len(parameters)))
        for k in np.flatnonzero(errors).tolist():
            moved = np.zeros(len(parameters))
            moved[k] = min(_STEP * errors[k], 0.01 * abs(parameters[k]) or math.inf)
            up = self._at_depth(parameters + moved)
            down = self._at_depth(parameters - moved)
            slopes[:, k] = (up - down) / (2.0 * moved[k])
        covariance = slopes @ np.nan_to_num(self.covariance) @ slopes.T
        covariance[0, 0] += self.stiffness_error**2
        covariance[1, 1] += (self.damping_error * here[1]) ** 2
        drawn = here + _normal(covariance, count)
        force = np.exp(drawn[:, 0])
        damping = np.maximum(drawn[:, 1], 0.0)
        n = np.clip(drawn[:, 2], min(here[2], _EXPONENTS[0]), max(here[2], _EXPONENTS[1]))
        p = np.clip(drawn[:, 3], min(here[3], -0.5), max(here[3], _EXPONENTS[1]))
        share = np.clip(drawn[:, 4], 0.0, 1.0)
        whole = force / self.depth**n
        times, weights = GeneralisedHuntCrossley.of(self.law).branches()
        kept = weights > 0.0
        return LawDraws(
            (1.0 - share) * whole,
            n,
            damping / self.depth**p,
            p,
            share * whole,
            times[kept],
            weights[kept],
            slow,
        )

    def _at_depth(self, parameters: Floats) -> Floats:
        """Logarithm of the unrelaxed force, damping, exponents, and share of the relaxing part."""
        law = GeneralisedHuntCrossley.of(self.law.with_parameters(parameters))
        whole = law.K + law.M
        force = whole * self.depth**law.n
        damping = law.B * self.depth**law.p
        return np.array([math.log(max(force, 1e-300)), damping, law.n, law.p, law.M / whole])


def _normal(covariance: Floats, count: int) -> Floats:
    """Return normal numbers of a covariance, shape (count, p), seeded; the first are 0."""
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(deviations > 0.0, deviations, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    standard = np.random.default_rng(0).normal(size=(count, len(scale)))
    standard[0] = 0.0
    drawn: Floats = (standard * np.sqrt(np.maximum(values, 0.0))) @ vectors.T * scale
    return drawn


@frozen(eq=False)
class ContactKnowledge:
    """What is known of a contact for the choice of gains.

    Parameters
    ----------
    laws : tuple of KnownLaw
        The identified law first, then the other laws that the recording does not exclude.
    frequency : float
        Mean frequency of the recorded motion, rad/s.
    largest_force : float
        Recorded in contact, N.
    stiffness_mark : str
        Mark of the stiffness: "trust", "with-care" or "do-not-trust". Default: "trust".
    highest_frequency : float, optional
        Highest frequency of the recorded motion, rad/s. Default: the mean.

    Examples
    --------
    >>> import palpate
    >>> from palpate import control_loops
    >>> result = palpate.identify("examples/recordings/ball.csv")
    >>> knowledge = control_loops.ContactKnowledge.of(result.estimate, largest_force=30.0)
    >>> round(knowledge.damping_limit), len(knowledge.laws)  # rad/s
    (20, 1)
    """

    laws: tuple[KnownLaw, ...]
    frequency: float
    largest_force: float
    stiffness_mark: Mark = "trust"
    highest_frequency: float | None = None

    @classmethod
    def of(
        cls,
        *estimates: Any,
        largest_force: float,
        depth: float | None = None,
        stiffness_mark: Mark = "trust",
    ) -> Self:
        """Return what running estimates know, of the same samples, the preferred law first.

        Parameters
        ----------
        *estimates : Estimate
            Of one or several estimators; the frequency is that of the first.
        largest_force : float
            The largest force so far, N.
        depth : float, optional
            Working depth, m. Default: the present depth of the first.
        stiffness_mark : str
            Mark of the stiffness. Default: "trust".

        Returns
        -------
        ContactKnowledge
            For :func:`gains_for`.
        """
        first = estimates[0]
        working_depth = first.depth if depth is None else depth
        laws = (KnownLaw(each.law, each.covariance, working_depth) for each in estimates)
        return cls(tuple(laws), first.frequency, largest_force, stiffness_mark)

    @property
    def recorded_frequency(self) -> float:
        """Highest frequency of the recorded motion, rad/s."""
        return self.frequency if self.highest_frequency is None else self.highest_frequency

    @property
    def damping_limit(self) -> float:
        """Frequency up to which the damping is that of the laws, rad/s: twice the recorded one."""
        return 2.0 * self.recorded_frequency

    @property
    def lowest_frequency(self) -> float:
        """Frequency below which the contact counts as at rest, rad/s: half the mean."""
        return 0.5 * self.frequency
