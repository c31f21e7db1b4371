"""A planned motion of the probe: sines around a mean depth."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError
from palpate.validation import Floats, number_in


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
