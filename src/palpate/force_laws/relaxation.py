"""How a material that is held relaxes: the spectrum of its relaxation times, and its state."""

from dataclasses import dataclass

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.force_laws.laws import ForceLaw
from palpate.validation import Floats, kept

#: Of relaxation times, s: wide enough for 4096 of any sample time that estimators take.
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
    """As much relaxes in each decade of time as in the next (Fung's box spectrum).

    G(t) = ∫ e^(−t/τ) d(ln τ) / ln(longest/shortest),  shortest ≤ τ ≤ longest

    What is left after a step falls with the logarithm of time, and the loss hardly depends on the
    frequency, as of tissue and of many polymers (Fung, *Biomechanics*, 1981).

    Parameters
    ----------
    shortest, longest : float
        Relaxation times, s, in [1e-12, 1e12], shortest < longest.

    Raises
    ------
    InvalidParameterError
        A time is outside its range, or there is nothing between them.
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
    """One relaxation time: a Maxwell branch beside the spring (the standard linear solid).

    G(t) = e^(−t/time)

    Parameters
    ----------
    time : float
        s, in [1e-12, 1e12].

    Raises
    ------
    InvalidParameterError
        It is outside its range.
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
    """Relaxation by a power of time, between a shortest and a longest one.

    G(t) ∝ ∫ τ^−α e^(−t/τ) d(ln τ),  which goes as t^−α well within the two

    Parameters
    ----------
    exponent : float
        α, in [−2, 2]; 0.05 to 0.3 for cells and tissue, and 0 is a flat spectrum.
    shortest, longest : float
        Relaxation times, s, in [1e-12, 1e12], shortest < longest.

    Raises
    ------
    InvalidParameterError
        A number is outside its range, or there is nothing between the times.
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
    """What a material remembers: made by :meth:`GeneralisedHuntCrossley.rest`, and never changed.

    Attributes
    ----------
    elastic : float
        xⁿ at the last penetration.
    branches : tuple of float
        How far each branch is stretched, in units of xⁿ.
    """

    elastic: float
    branches: tuple[float, ...]


def relaxation_of(exponent: float, shortest: float, longest: float) -> Relaxation | None:
    """Return the kind of relaxation of a spectrum; None where its longest time is 0.

    Where the shortest is 0, the longest is the only one.

    Raises
    ------
    InvalidParameterError
        There is no such spectrum.
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
            f"longest must be above shortest = {low:g} s, not {high:g}; of one time there is "
            "SingleRelaxation"
        )


def force_over_breaks(
    law: ForceLaw, penetration: Floats, velocity: Floats, steps: Floats, starts: list[int]
) -> Floats:
    """Force by a law at every sample, N, as an estimator has it.

    A material that is in contact before a break and after it was not left alone in between: what
    it remembers is carried over. Else it is at rest where samples begin.

    Parameters
    ----------
    law : ForceLaw
        With memory or without.
    penetration, velocity, steps : numpy.ndarray, shape (k,)
        m, m/s, and the time since the sample before, s, > 0.
    starts : list of int
        Places of the samples that do not follow upon the one before, the first among them.
    """
    fresh = [k for k in starts if k > 0 and not min(penetration[k - 1], penetration[k]) > 0.0]
    force = np.empty(len(penetration))
    for part in np.split(np.arange(len(penetration)), fresh):
        if part.size:
            own = slice(int(part[0]), int(part[-1]) + 1)
            force[own] = law.force_along(penetration[own], velocity[own], steps[own])
    return force
