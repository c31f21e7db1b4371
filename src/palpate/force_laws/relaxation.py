"""Stress relaxation: spectra of relaxation times, and the state of a relaxing material."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.validation import Floats, all_good, check_field, frozen, number, same_length, signal

#: Range of relaxation times, s: it includes 4096 sample times of any allowed sample time.
SHORTEST = 1e-12
LONGEST = 1e12
#: Largest number of relaxation times.
MOST = 128
#: Names of the two descriptions of a relaxation: by a formula, or by times and stiffnesses.
FORMULA = ("spectrum_exponent", "shortest_time", "longest_time")
LISTS = ("relaxation_times", "relaxation_stiffnesses")


class Relaxation:
    """A spectrum of relaxation times: one of the classes below."""

    __slots__ = ()

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α of w ∝ τ^−α d(ln τ), and the shortest and the longest time, s."""
        raise NotImplementedError

    @property
    def longest_time(self) -> float:
        """The longest relaxation time, s."""
        return self.spectrum[2]

    @property
    def resolution(self) -> float:
        """Relative standard error of :attr:`GeneralisedHuntCrossley.relaxation_time`."""
        return 0.0

    def branches(self) -> tuple[Floats, Floats]:
        """Relaxation times [s] and weights, with the sum 1, of the branches that approximate it.

        Two branches per factor of two in time.
        """
        times, weights = _core.relaxation_branches(*self.spectrum)
        return times, weights

    def description(self) -> dict[str, Any]:
        """Return its numbers by name, as :func:`palpate.force_laws.law_from` reads them."""
        return dict(zip(FORMULA, self.spectrum, strict=True))


@frozen
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

    Examples
    --------
    >>> import palpate
    >>> memory = palpate.FlatSpectrum(shortest=0.01, longest=100.0)
    >>> law = palpate.GeneralisedHuntCrossley(
    ...     K=800.0, n=1.0, B=0.0, p=0.0, M=200.0, relaxation=memory
    ... )
    >>> force = law.force_along([0.0] + 9999 * [0.01], 10000 * [0.0], 0.001)  # N, 10 s at 10 mm
    >>> force[[1, 1000, -1]].round(1).tolist()
    [10.0, 8.9, 8.4]
    """

    shortest: float
    longest: float

    def __post_init__(self) -> None:
        _check_times(self)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α = 0, and the shortest and the longest time, s."""
        return 0.0, self.shortest, self.longest


@frozen
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

    Examples
    --------
    >>> import palpate
    >>> memory = palpate.SingleRelaxation(time=0.5)
    >>> law = palpate.GeneralisedHuntCrossley(
    ...     K=800.0, n=1.0, B=0.0, p=0.0, M=200.0, relaxation=memory
    ... )
    >>> force = law.force_along([0.0] + 9999 * [0.01], 10000 * [0.0], 0.001)  # N, 10 s at 10 mm
    >>> force[[1, 1000, -1]].round(1).tolist()
    [10.0, 8.3, 8.0]
    """

    time: float

    def __post_init__(self) -> None:
        check_field(self, "time", SHORTEST, LONGEST)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α = 0, no shortest time, and the time, s."""
        return 0.0, 0.0, self.time


@frozen
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

    Examples
    --------
    >>> import palpate
    >>> memory = palpate.PowerLawRelaxation(exponent=0.2, shortest=0.01, longest=100.0)
    >>> law = palpate.GeneralisedHuntCrossley(
    ...     K=800.0, n=1.0, B=0.0, p=0.0, M=200.0, relaxation=memory
    ... )
    >>> force = law.force_along([0.0] + 9999 * [0.01], 10000 * [0.0], 0.001)  # N, 10 s at 10 mm
    >>> force[[1, 1000, -1]].round(1).tolist()
    [10.0, 8.5, 8.2]
    """

    exponent: float
    shortest: float
    longest: float

    def __post_init__(self) -> None:
        check_field(self, "exponent", -2.0, 2.0)
        _check_times(self)

    @property
    def spectrum(self) -> tuple[float, float, float]:
        """α, and the shortest and the longest time, s."""
        return self.exponent, self.shortest, self.longest


# A group of neighbouring times with this share of the stiffness is one relaxation time, if it is
# no broader (standard deviation of log₁₀ τ): two times a decade apart have 0.5.
_ONE_GROUP = 0.95
_ONE_TIME = 0.5


@frozen
class RelaxationSpectrum(Relaxation):
    """Relaxation times, each with a separate stiffness (Wiechert's model, a Prony series).

    G(t) = Σ mᵢ e^(−t/τᵢ) / Σ mᵢ

    Parameters
    ----------
    times : sequence of float, shape (k,)
        τᵢ, s, in [1e-12, 1e12], ascending; 1 to 128 of them.
    stiffnesses : sequence of float, shape (k,)
        mᵢ, N/mⁿ, ≥ 0. Their sum is the law's relaxation stiffness.

    Raises
    ------
    InvalidParameterError
        A number is outside its range, the times do not ascend, or the lengths differ.

    Examples
    --------
    >>> import palpate
    >>> memory = palpate.RelaxationSpectrum(times=(0.1, 1.0), stiffnesses=(50.0, 30.0))
    >>> law = palpate.GeneralisedHuntCrossley(K=800.0, n=1.0, B=0.0, p=0.0, relaxation=memory)
    >>> law.M  # N/m
    80.0
    """

    times: tuple[float, ...]
    stiffnesses: tuple[float, ...]

    def __post_init__(self) -> None:
        times = signal("times", self.times)
        stiffnesses = signal("stiffnesses", self.stiffnesses)
        same_length(times=times.size, stiffnesses=stiffnesses.size)
        if not 1 <= times.size <= MOST:
            raise InvalidParameterError(f"times must be 1 to {MOST} numbers, not {times.size}")
        within = (times >= SHORTEST) & (times <= LONGEST)
        all_good("times", times, within, f"in [{SHORTEST:g}, {LONGEST:g}]")
        all_good("times", times, np.diff(times, prepend=0.0) > 0.0, "ascending")
        within = (stiffnesses >= 0.0) & np.isfinite(stiffnesses)
        all_good("stiffnesses", stiffnesses, within, "finite and ≥ 0")
        object.__setattr__(self, "times", tuple(times.tolist()))
        object.__setattr__(self, "stiffnesses", tuple(stiffnesses.tolist()))

    @property
    def stiffness(self) -> float:
        """Σ mᵢ, N/mⁿ."""
        return math.fsum(self.stiffnesses)

    @property
    def longest_time(self) -> float:
        """The longest relaxation time with a stiffness above 0, s; 0 if there is none."""
        return max((t for t, m in zip(self.times, self.stiffnesses, strict=True) if m), default=0.0)

    @property
    def time(self) -> float | None:
        """The single relaxation time, s; None without any or with several.

        exp of the mean of ln τ, weighted by m, over a group of neighbouring times with m > 0 that
        has over 95 % of Σ m and a standard deviation of log₁₀ τ below 0.5.
        """
        m = np.array(self.stiffnesses)
        ends = np.flatnonzero(np.diff(m > 0.0, prepend=False, append=False)).reshape(-1, 2)
        for group in (slice(*pair) for pair in ends.tolist()):
            if m[group].sum() > _ONE_GROUP * self.stiffness:
                logs = np.log(self.times[group])
                m = m[group]
                mean = float(np.average(logs, weights=m))
                deviation = math.sqrt(float(np.average((logs - mean) ** 2, weights=m)))
                return math.exp(mean) if deviation < _ONE_TIME * math.log(10.0) else None
        return None

    @property
    def resolution(self) -> float:
        """Relative standard error of :attr:`time`: half the distance of neighbours in ln τ."""
        return 0.5 * float(np.diff(np.log(self.times)).max(initial=0.0))

    def branches(self) -> tuple[Floats, Floats]:
        """Relaxation times [s] and weights m/Σ m."""
        return np.array(self.times), np.array(self.stiffnesses) / (self.stiffness or 1.0)

    def scaled(self, stiffness: float) -> "RelaxationSpectrum":
        """Return the spectrum of the same shape with another Σ m, N/mⁿ."""
        ratio = stiffness / (self.stiffness or 1.0)
        return RelaxationSpectrum(self.times, tuple(ratio * m for m in self.stiffnesses))

    def description(self) -> dict[str, Any]:
        """Return times and stiffnesses by name."""
        return dict(zip(LISTS, (list(self.times), list(self.stiffnesses)), strict=True))


@frozen
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


def relaxation_from(description: Mapping[str, Any]) -> Relaxation | None:
    """Return the relaxation of a :meth:`Relaxation.description`; None without a longest time.

    If the shortest time is 0, the longest is the only one.

    Raises
    ------
    InvalidParameterError
        The numbers are outside their ranges, or of two kinds of relaxation.
    """
    known = {name: value for name, value in description.items() if value is not None}
    if present := [name for name in LISTS if name in known]:
        if len(present) < 2 or any(name in known for name in FORMULA):
            raise InvalidParameterError(
                f"{' and '.join(LISTS)} must be given together, without {', '.join(FORMULA)}"
            )
        return RelaxationSpectrum(*(known[name] for name in LISTS))
    exponent, shortest, longest = (number(name, known.get(name, 0.0)) for name in FORMULA)
    if longest == 0.0:
        return None
    if shortest == 0.0:
        return SingleRelaxation(longest)
    if exponent == 0.0:
        return FlatSpectrum(shortest, longest)
    return PowerLawRelaxation(exponent, shortest, longest)


def _check_times(spectrum: FlatSpectrum | PowerLawRelaxation) -> None:
    low = check_field(spectrum, "shortest", SHORTEST, LONGEST)
    high = check_field(spectrum, "longest", SHORTEST, LONGEST)
    if not low < high:
        raise InvalidParameterError(
            f"longest must be above shortest = {low:g} s, not {high:g}: use "
            "SingleRelaxation for a single time"
        )


# Longest gap, in previous steps; over a longer one the probe's path is unknown.
_GAP = 20.0


def steps_over_breaks(time: Floats, depth: Floats, usual: float) -> Floats:
    """Time since the previous sample, s, also over breaks, during which a material relaxes.

    The steps are the same as in an estimator: if the probe was in the material before and after a
    long gap, contact most likely continued as before, and the relaxation state is kept.

    Parameters
    ----------
    time, depth : numpy.ndarray, shape (k,)
        s and m.
    usual : float
        Time between samples, s: the step of the first sample, over a long gap in the material, and
        at a time that joined recordings repeat.
    """
    steps = np.diff(time, prepend=-np.inf)
    inside = depth > 0.0
    gap = steps > _GAP * np.maximum(np.nan_to_num(np.roll(steps, 1), posinf=0.0), usual)
    kept = gap & inside & np.roll(inside, 1)
    return np.where((steps > 0.0) & np.isfinite(steps) & ~kept, steps, usual)
