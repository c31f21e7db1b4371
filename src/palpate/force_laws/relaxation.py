"""Stress relaxation: spectra of relaxation times, and the state of a relaxing material."""

from dataclasses import dataclass

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.force_laws.laws import ForceLaw
from palpate.validation import Floats, kept

#: Range of relaxation times, s: it includes 4096 sample times of any allowed sample time.
SHORTEST, LONGEST = 1e-12, 1e12


class Relaxation:
    """A spectrum of relaxation times: one of the classes below."""

    __slots__ = ()

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α of w ∝ τ^−α d(ln τ), and the shortest and the longest time, s."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class FlatSpectrum(Relaxation):
    """Flat relaxation spectrum: equal relaxation in each decade of time (Fung's box spectrum).

    G(t) = ∫ e^(−t/τ) d(ln τ) / ln(longest/shortest),  shortest ≤ τ ≤ longest

    After a step the force falls with the logarithm of time, and the loss tangent is nearly
    constant, as in tissue and many polymers (Fung, *Biomechanics*, 1981).

    Parameters
    ----------
    shortest, longest : float
        Relaxation times, s, in [1e-12, 1e12], shortest < longest.

    Raises
    ------
    InvalidParameterError
        A time is outside its range, or ``shortest`` is not below ``longest``.
    """

    shortest: float
    longest: float

    def __post_init__(self) -> None:
        _check_times(self)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α = 0, and the shortest and the longest time, s."""
        return 0.0, self.shortest, self.longest


@dataclass(frozen=True, slots=True)
class SingleRelaxation(Relaxation):
    """One relaxation time: a Maxwell branch parallel to the spring (the standard linear solid).

    G(t) = e^(−t/time)

    Parameters
    ----------
    time : float
        Relaxation time, s, in [1e-12, 1e12].

    Raises
    ------
    InvalidParameterError
        The time is outside its range.
    """

    time: float

    def __post_init__(self) -> None:
        kept(self, "time", SHORTEST, LONGEST)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α = 0, no shortest time, and the time, s."""
        return 0.0, 0.0, self.time


@dataclass(frozen=True, slots=True)
class PowerLawRelaxation(Relaxation):
    """Power-law relaxation between a shortest and a longest time.

    G(t) ∝ ∫ τ^−α e^(−t/τ) d(ln τ),  proportional to t^−α well between the two

    Parameters
    ----------
    exponent : float
        α, in [−2, 2]; 0.05 to 0.3 for cells and tissue, and 0 is a flat spectrum.
    shortest, longest : float
        Relaxation times, s, in [1e-12, 1e12], shortest < longest.

    Raises
    ------
    InvalidParameterError
        A number is outside its range, or ``shortest`` is not below ``longest``.
    """

    exponent: float
    shortest: float
    longest: float

    def __post_init__(self) -> None:
        kept(self, "exponent", -2.0, 2.0)
        _check_times(self)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α, and the shortest and the longest time, s."""
        return self.exponent, self.shortest, self.longest


@dataclass(frozen=True, slots=True)
class RelaxationState:
    """Relaxation state of a material, immutable; :meth:`GeneralisedHuntCrossley.rest` makes one.

    Attributes
    ----------
    elastic : float
        xⁿ at the last penetration.
    branches : tuple of float
        Elastic deformation of each branch, in units of xⁿ.
    """

    elastic: float
    branches: tuple[float, ...]


def relaxation_of(exponent: float, shortest: float, longest: float) -> Relaxation | None:
    """Return the kind of relaxation of a spectrum; None if its longest time is 0.

    If the shortest time is 0, the longest is the only one.

    Raises
    ------
    InvalidParameterError
        The numbers are outside their ranges.
    """
    if longest == 0.0:
        return None
    if shortest == 0.0:
        return SingleRelaxation(longest)
    if exponent == 0.0:
        return FlatSpectrum(shortest, longest)
    return PowerLawRelaxation(exponent, shortest, longest)


def _check_times(spectrum: FlatSpectrum | PowerLawRelaxation) -> None:
    low = kept(spectrum, "shortest", SHORTEST, LONGEST)
    high = kept(spectrum, "longest", SHORTEST, LONGEST)
    if not low < high:
        raise InvalidParameterError(
            f"longest must be above shortest = {low:g} s, not {high:g}: use "
            "SingleRelaxation for a single time"
        )


def force_over_breaks(
    law: ForceLaw, penetration: Floats, velocity: Floats, steps: Floats, starts: list[int]
) -> Floats:
    """Force of a law at every sample, N, as an estimator computes it.

    If the probe is in contact before and after a gap, it was in contact during the gap, and the
    relaxation state continues. Otherwise the material is fully relaxed after the gap.

    Parameters
    ----------
    law : ForceLaw
        Any law, with or without memory.
    penetration, velocity, steps : numpy.ndarray, shape (k,)
        m, m/s, and the time since the previous sample, s, > 0.
    starts : list of int
        Indices of the samples that follow a gap, including the first sample.
    """
    fresh = [k for k in starts if k > 0 and not min(penetration[k - 1], penetration[k]) > 0.0]
    force = np.empty(len(penetration))
    for part in np.split(np.arange(len(penetration)), fresh):
        if part.size:
            own = slice(int(part[0]), int(part[-1]) + 1)
            force[own] = law.force_along(penetration[own], velocity[own], steps[own])
    return force
