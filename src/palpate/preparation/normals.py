"""The contact normal: given, an axis, or found from the forces."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.errors import InvalidParameterError, RecordingError
from palpate.preparation.suggestions import noise_of
from palpate.validation import Floats, shown

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
NOISES = 10.0  # σ of the force's size, above which it has a direction


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """The direction in which the material presses on the probe.

    Attributes
    ----------
    vector : numpy.ndarray, shape (3,)
        Of length 1, out of the material, in the frame of the position.
    spread : float
        Angle of the forces to it, rad, weighted by their size (rms); 0 where it was given.
    turned : bool
        The forces are those of the probe on the material: their sign has to be turned.
    """

    vector: Floats
    spread: float = 0.0
    turned: bool = False

    def __str__(self) -> str:
        x, y, z = self.vector
        words = f"({x:.4g}, {y:.4g}, {z:.4g})"
        return f"{words} ± {math.degrees(self.spread):.1f}°" if self.spread else words


def normal_given(given: str | Sequence[float]) -> Normal:
    """Return the normal that was given: ``"z"``, ``"-z"``, ``"0.8,0.25,0.54"`` or three numbers.

    Raises
    ------
    InvalidParameterError
        It is none of these, or has no length.
    """
    if isinstance(given, str):
        name = given.strip().lower()
        axis = AXES.get(name.lstrip("+-"))
        if axis is not None and len(name) <= 2:
            return Normal(np.array(axis) * (-1.0 if name[0] == "-" else 1.0))
    try:
        parts = given.split(",") if isinstance(given, str) else given
        vector = np.array([float(part) for part in parts])
        length = float(np.linalg.norm(vector))
        if vector.shape != (3,) or not math.isfinite(length) or length == 0.0:
            raise ValueError
    except (TypeError, ValueError):
        raise InvalidParameterError(
            f"normal must be x, y, z, -x, -y, -z or three numbers such as 0.8,0.25,0.54, not "
            f"{shown(given)}"
        ) from None
    return Normal(vector / length)


def normal_found(force: Floats, position: Floats, source: str = "") -> Normal:
    """Find the contact normal: the mean direction of the forces, weighted by their size.

    n = Σ |F| F / |Σ |F| F|,  spread² = Σ |F|² ∠(F, n)² / Σ |F|²

    Where the force grows as the probe goes *along* n it is the probe's on the material; where it
    grows against n, as it should, the material's on the probe.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        N, in the frame of the position, tared as well as can be.
    position : numpy.ndarray, shape (k, 3)
        m.
    source : str
        For messages.

    Raises
    ------
    RecordingError
        No force is above the noise.
    """
    known = np.isfinite(force).all(axis=1) & np.isfinite(position).all(axis=1)
    f, p = force[known], position[known]
    size = np.linalg.norm(f, axis=1)
    noise = math.sqrt(sum(noise_of(component) ** 2 for component in f.T)) if len(f) else 0.0
    firm = size > NOISES * noise
    where = f"{source}: " if source else ""
    if not firm.any():
        raise RecordingError(
            f"{where}no force stands out of the noise, so that the contact normal cannot be found; "
            "give it with --normal, such as --normal z"
        )
    total = (f[firm] * size[firm, None]).sum(axis=0)
    length = float(np.linalg.norm(total))
    if not 0.0 < length < math.inf:
        raise RecordingError(
            f"{where}the forces point everywhere, so that the contact normal cannot be found; give "
            "it with --normal, such as --normal z"
        )
    n = total / length
    across = np.linalg.norm(np.cross(f[firm], n), axis=1)
    angle = np.arctan2(across, f[firm] @ n)
    weight = size[firm] ** 2
    spread = math.sqrt(float((weight * angle**2).sum() / weight.sum()))
    if grows(p @ n, f @ n):
        return Normal(-n, spread, turned=True)
    return Normal(n, spread)


def grows(position: Floats, force: Floats) -> bool:
    """Whether the force grows with the position, from one moment to the next.

    By the changes over five samples, not by the values: a probe that travels over a hill goes up
    and down without pressing.
    """
    if len(force) < 20:
        steps = np.diff(position), np.diff(force)
    else:
        smooth = np.ones(5) / 5.0
        moved, felt = (np.convolve(each, smooth, "valid") for each in (position, force))
        steps = moved[5:] - moved[:-5], felt[5:] - felt[:-5]
    return float(np.sum(steps[0] * steps[1])) > 0.0
