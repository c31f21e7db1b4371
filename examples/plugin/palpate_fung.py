"""Fung's exponential law, and recordings that end in .fung: three numbers in each line."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from palpate import ForceLaw, Recording
from palpate.input.recordings import Format, Request

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fung(ForceLaw):
    """F = A (exp(x/d) − 1) + B x v for x > 0, else 0."""

    A: float
    d: float
    B: float
    kind: ClassVar[str] = "fung"
    units: ClassVar[tuple[str, ...]] = ("N", "m", "N·s/m²")
    symbols: ClassVar[tuple[str, ...]] = ("A", "d", "B")

    def _force(self, x: Floats, v: Floats) -> Floats:
        """A (exp(x/d) − 1) + B x v."""
        force: Floats = self.A * np.expm1(x / self.d) + self.B * x * v
        return force

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(A, d, B)."""
        grown = np.exp(penetration / self.d)
        by_length = -self.A * penetration / self.d**2 * grown
        return np.stack([grown - 1.0, by_length, penetration * velocity], axis=-1)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = A/d exp(x/d) + B v."""
        slope: Floats = self.A / self.d * np.exp(penetration / self.d) + self.B * velocity
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B x."""
        return self.B * penetration


#: palpate imports the module, and calls ``read``, when it meets a file with this ending.
FORMAT = Format("Fung recording", (".fung",), __name__)


def read(path: Path, request: Request) -> Recording:
    """Return time [s], penetration [m] and force [N] of a file."""
    with request.explain_damage("it has no rows of three numbers", "record it again"):
        time, penetration, force = np.loadtxt(path, unpack=True, ndmin=2)
    return Recording(
        {"time": time, "penetration": penetration, "force": force},
        {"time": "s", "penetration": "m", "force": "N"},
        source=request.source,
    )
