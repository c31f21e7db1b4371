"""What a force sensor that rounds adds to its noise.

What a motion can identify: Fisher information and the Cramér–Rao bound.

For F = f(x, v; θ) + ε with white noise of standard deviation σ, no unbiased estimator of θ has a
covariance below

    (JᵀJ)⁻¹ σ²,   J = ∂f/∂θ at every sample.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw
from palpate.validation import Floats, instance, number_in, signals

# Harmonics of the rounding error that are distinct from white noise: at least 87 % of its power.
_MOST = 4
# Smaller ones than this fraction of the noise are left in it.
_LEAST = 1e-3


def effective_noise(noise: float, resolution: float) -> float:
    """Noise of a sensor that also rounds: √(σ² + Δ²/12), N.

    Rounding to steps of Δ adds an error that is uniform over a step, of variance Δ²/12, and new at
    every sample as long as noise carries the force across steps: σ ≥ Δ/2. Below that a part of it,
    of amplitude (Δ/π) e^(−2π²σ²/Δ²), comes back whenever the force does. A motion that crosses
    many steps and does not soon repeat still averages it out; one that repeats does not, and a
    held force keeps it for ever: see ``expected_errors``.

    Parameters
    ----------
    noise : float
        σ before rounding, N, in [1e-15, 1e15].
    resolution : float
        Δ, N, in [0, 1e15]; 0 for a sensor that does not round.
    """
    sigma = number_in("noise", noise, 1e-15, 1e15)
    step = number_in("resolution", resolution, 0.0, 1e15)
    return math.hypot(sigma, step / math.sqrt(12.0))


def mean_rounding_error(noise: float, resolution: float) -> Floats:
    """Amplitudes βₖ [N] of the mean rounding error, Σ βₖ sin 2πk F/Δ, k = 1, 2, … up to four.

    βₖ = Δ/(πk) e^(−2π²k²σ²/Δ²): Gaussian noise of σ, blurring the sawtooth of a sensor of step Δ.
    Those that are small beside the noise are left out; without rounding there is none.
    """
    if resolution == 0.0:
        return np.empty(0)
    order = np.arange(1, _MOST + 1)
    # Beyond this the exponential is nothing, and its argument might overflow.
    ratio = min(noise / resolution, 10.0)
    betas: Floats = resolution / (np.pi * order) * np.exp(-2.0 * (np.pi * order * ratio) ** 2)
    count = int(np.count_nonzero(betas > _LEAST * effective_noise(noise, resolution)))
    return betas[:count]


# A planned motion of the probe: sines around a mean depth.


@dataclass(frozen=True, slots=True)
class Motion:
    """Sines around a mean depth.

    x(t) = x₀ + Σ aᵢ sin ωᵢ t,   v(t) = Σ aᵢ ωᵢ cos ωᵢ t

    Parameters
    ----------
    depth : float
        x₀, m, in (0, 10].
    amplitudes : sequence of float, shape (m,)
        aᵢ, m, each in [0, 10]. Without any, or all zero, the probe is held.
    frequencies : sequence of float, shape (m,)
        ωᵢ, rad/s (not Hz), each in (0, 1e5].

    Raises
    ------
    InvalidParameterError
        A value is out of its range, or there are not as many frequencies as amplitudes.
    """

    depth: float
    amplitudes: tuple[float, ...] = ()
    frequencies: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        depth = number_in("depth", self.depth, 0.0, 10.0, open_low=True)
        amplitudes = tuple(
            number_in(f"amplitudes[{i}]", value, 0.0, 10.0)
            for i, value in enumerate(_several("amplitudes", self.amplitudes))
        )
        frequencies = tuple(
            number_in(f"frequencies[{i}]", value, 0.0, 1e5, open_low=True)
            for i, value in enumerate(_several("frequencies", self.frequencies))
        )
        if len(amplitudes) != len(frequencies):
            raise InvalidParameterError(
                "amplitudes and frequencies must be as many, not "
                f"{len(amplitudes)} and {len(frequencies)}"
            )
        object.__setattr__(self, "depth", depth)
        object.__setattr__(self, "amplitudes", amplitudes)
        object.__setattr__(self, "frequencies", frequencies)

    @property
    def peak_penetration(self) -> float:
        """x₀ + Σ aᵢ, m: it never goes deeper, however long it runs."""
        return self.depth + math.fsum(self.amplitudes)

    @property
    def least_penetration(self) -> float:
        """x₀ − Σ aᵢ, m: it never comes higher, however long it runs."""
        return self.depth - math.fsum(self.amplitudes)

    @property
    def top_speed(self) -> float:
        """Σ aᵢ ωᵢ, m/s: the speed at t = 0, and never exceeded."""
        return math.fsum(a * w for a, w in zip(self.amplitudes, self.frequencies, strict=True))

    def at(self, time: "ArrayLike") -> tuple[Floats, Floats]:
        """Penetration [m] and velocity [m/s] at times [s], each of their shape."""
        t = np.asarray(time, dtype=np.float64)
        x, v = np.full(t.shape, self.depth), np.zeros(t.shape)
        for a, w in zip(self.amplitudes, self.frequencies, strict=True):
            x += a * np.sin(w * t)
            v += a * w * np.cos(w * t)
        return x, v

    def sampled(self, duration: float, sample_time: float) -> tuple[Floats, Floats, Floats]:
        """Time, penetration and velocity of round(duration / sample_time) samples from t = 0.

        Parameters
        ----------
        duration : float
            s, in [sample_time, 1e7 sample_time].
        sample_time : float
            s, in (0, 1e6].
        """
        step = number_in("sample_time", sample_time, 0.0, 1e6, open_low=True)
        count = round(number_in("duration", duration, step, 1e7 * step) / step)
        time = np.arange(count, dtype=np.float64) * step
        return time, *self.at(time)


def _several(name: str, values: Any) -> tuple[Any, ...]:
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InvalidParameterError(f"{name} must be a sequence of numbers, not {values!r}")
    return tuple(values)


#: The three sines of the paper's experiments; their top speed is 50.8 mm/s.
PAPER_MOTION = Motion(10e-3, (1e-3, 1.8e-3, 1.8e-3), (4.0, 11.0, 15.0))


@dataclass(frozen=True, slots=True, eq=False)
class CramerRaoBound:
    """The least standard errors that a motion allows.

    Attributes
    ----------
    names : tuple of str
        The law's parameters, then ``offset`` and ``surface`` where they are unknown too.
    standard_errors : numpy.ndarray, shape (q,)
        Lower bounds, SI; infinite where the motion does not identify it.
    covariance : numpy.ndarray, shape (q, q)
        The inverse of the information; infinite where that is singular.
    """

    names: tuple[str, ...]
    standard_errors: Floats
    covariance: Floats

    def __getitem__(self, name: str) -> float:
        """Return the bound of one quantity."""
        if name not in self.names:
            raise InvalidParameterError(
                f"name must be one of {', '.join(self.names)}, not {name!r}"
            )
        return float(self.standard_errors[self.names.index(name)])


def sensitivity(law: ForceLaw, penetration: "ArrayLike", velocity: "ArrayLike") -> Floats:
    """∂F/∂θ for the law's parameters at every sample, shape (k, p); zero out of contact.

    Parameters
    ----------
    law : force law
    penetration, velocity : array_like, shape (k,)
        m and m/s, finite.
    """
    instance("law", law, ForceLaw)
    x, v = _finite_signals(penetration, velocity)
    inside = x > 0.0
    gradient = law.parameter_gradient(np.where(inside, x, 1.0), v)
    return np.where(inside[:, None], gradient, 0.0)


def jacobian(
    law: ForceLaw,
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    *,
    offset: bool = False,
    surface: bool = False,
) -> Floats:
    """∂F/∂(θ[, offset][, surface]) at every sample, shape (k, q).

    Arguments as :func:`fisher_information`.
    """
    columns = [sensitivity(law, penetration, velocity)]
    if offset:
        columns.append(np.ones((len(columns[0]), 1)))
    if surface:
        columns.append(_by_surface(law, penetration, velocity)[:, None])
    return np.hstack(columns)


def fisher_information(
    law: ForceLaw,
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    noise: float,
    *,
    offset: bool = False,
    surface: bool = False,
) -> Floats:
    """JᵀJ/σ² of a motion for a law.

    Parameters
    ----------
    law : force law
        The material.
    penetration, velocity : array_like, shape (k,)
        The motion, m and m/s.
    noise : float
        σ of the force, N, in [1e-30, 1e30].
    offset, surface : bool
        Whether a force offset [N] and the position of the surface [m] are unknown too.

    Returns
    -------
    numpy.ndarray, shape (q, q)
        In the order of the law's parameters, the offset, the surface.
    """
    sigma = number_in("noise", noise, 1e-30, 1e30)
    rows = jacobian(law, penetration, velocity, offset=offset, surface=surface) / sigma
    information: Floats = rows.T @ rows
    return information


def cramer_rao_bound(
    law: ForceLaw,
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    noise: float,
    *,
    offset: bool = False,
    surface: bool = False,
) -> CramerRaoBound:
    """Return the least standard errors that a motion allows.

    Arguments are those of :func:`fisher_information`.
    """
    information = fisher_information(
        law, penetration, velocity, noise, offset=offset, surface=surface
    )
    names = (*law.as_dict(), *(["offset"] if offset else []), *(["surface"] if surface else []))
    covariance = inverse_information(information)
    return CramerRaoBound(names, np.sqrt(np.diag(covariance)), covariance)


def _by_surface(law: ForceLaw, penetration: "ArrayLike", velocity: "ArrayLike") -> Floats:
    """∂F/∂d where x becomes x − d."""
    x, v = _finite_signals(penetration, velocity)
    inside = x > 0.0
    return np.where(inside, -law.penetration_gradient(np.where(inside, x, 1.0), v), 0.0)


def _finite_signals(penetration: "ArrayLike", velocity: "ArrayLike") -> tuple[Floats, Floats]:
    x, v = signals(penetration=penetration, velocity=velocity)
    for name, values in (("penetration", x), ("velocity", v)):
        if not np.isfinite(values).all():
            raise InvalidParameterError(
                f"{name} must be finite, not {values[~np.isfinite(values)][0]} at sample "
                f"{int(np.argmin(np.isfinite(values)))}"
            )
    return x, v


def inverse_information(information: Floats) -> Floats:
    """Covariance from an information matrix; infinite where a direction carries nothing."""
    diagonal = np.sqrt(np.diag(information))
    unit = np.where(diagonal > 0.0, diagonal, 1.0)
    scaled = information / np.outer(unit, unit)
    # Rounding of k samples' sums leaves eigenvalues of this size where there are none.
    if np.linalg.eigvalsh(scaled).min() < 1e-13:
        return np.full_like(information, np.inf)
    inverse: Floats = np.linalg.inv(scaled) / np.outer(unit, unit)
    return inverse
