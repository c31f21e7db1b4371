"""A cause of misfit: how significant it is, what it explains and how far it moves the numbers."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from palpate.covariance import robust_covariance
from palpate.diagnosis.fit import Fit
from palpate.validation import Floats

# The largest z of a cause that moves any number is 3.7 on 196 clean recordings, of probe and robot.
SIGNIFICANT = 4.5
# A column of which less than this is left beside the fit's own is the fit's own.
COLLINEAR = 1e-5


@dataclass(frozen=True, slots=True)
class Cause:
    """What one cause would explain, beside the law.

    Attributes
    ----------
    name : str
        Of the cause.
    z : float
        Its coefficient in standard errors, for a correlated residual.
    gain : float
        Fraction of the residual's energy that it removes.
    stiffness, damping : float
        How far it moves them at working depth, of their size.
    parameter : float
        How far it moves the law's stiffness parameter, of its size.
    sentence : str
        For a person.
    remedy : str or None
        What to do.
    moves : callable
        Gives stiffness and damping for a fit, at its working depth.
    """

    name: str
    z: float
    gain: float
    stiffness: float
    damping: float
    parameter: float
    sentence: str
    remedy: str | None
    moves: "Moves"

    def moving(self, fit: Fit, moves: "Moves") -> "Cause":
        """Return the same that moves stiffness and damping otherwise."""
        stiffness, damping = moves(fit)
        return replace(self, stiffness=stiffness, damping=damping, moves=moves)

    @property
    def family(self) -> str:
        """Drift and change are one: a slow change of the material."""
        return "change" if self.name in ("gain drift", "change") else self.name

    @property
    def small(self) -> bool:
        """Whether it moves next to nothing: S and C under 2 %, K under 3 %.

        Half an encoder count is a dead band; it is significant on a stiff material and moves the
        damping by 1 %: 18 of 200 clean runs of the robot, which are not to be blamed.
        """
        moved = max(abs(self.stiffness), abs(self.damping))
        return moved < 0.02 and abs(self.parameter) < 0.03


@dataclass(frozen=True, slots=True)
class Beside:
    """A column fitted beside the law's own.

    Attributes
    ----------
    change : numpy.ndarray
        Of the fit's parameters, with the column against without.
    amount : float
        Coefficient of the column.
    z, gain : float
        As in :class:`Cause`.
    """

    change: Floats
    amount: float
    z: float
    gain: float


def beside(fit: Fit, column: Floats) -> Beside | None:
    """Fit a column beside the law's Jacobian; None where the law has it already."""
    jacobian, residual = fit.solution.jacobian, fit.solution.residual
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = 1.0
    own = np.linalg.lstsq(jacobian / size, column, rcond=None)[0] / size
    left = column - jacobian @ own
    if not np.isfinite(left).all() or float(left @ left) <= COLLINEAR**2 * float(column @ column):
        return None
    amount = float(left @ residual / (left @ left))
    wide = np.column_stack([jacobian, column])
    after = residual - amount * left
    error = math.sqrt(robust_covariance(wide, after, fit.band.shared)[-1, -1])
    before = max(fit.solution.energy, np.finfo(float).tiny)
    gain = 1.0 - float(after @ after) / before
    return Beside(-amount * own, amount, abs(amount) / max(error, 1e-300), gain)


def of_parameter(fit: Fit, change: Floats) -> float:
    """Relative move of the law's first parameter, SI: Δk/k − Δn ln x_r for a power law."""
    law = fit.solution.law
    size = max(abs(float(law.parameters[0])), 1e-300)
    moved = float(change[0]) / size
    if hasattr(law, "exponent"):
        moved -= float(change[2]) * math.log(fit.units.depth)
    return moved


#: How far something moves stiffness and damping at a fit's working depth, of their size.
Moves = Callable[[Fit], tuple[float, float]]
Search = Callable[[Fit], list[Cause]]
