"""Where a law predicts a force that pulls, as no contact without adhesion can."""

import math
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.finding import Quantity, WorkingDepth
from palpate.force_laws import ForceLaw
from palpate.quantities.work import Path
from palpate.validation import Floats, defined

# Standard deviations of its noise below 0: a recorded force that pulls. Of 10⁵ samples without
# force white noise makes less than one such.
PULLS = 5.0


@dataclass(frozen=True, slots=True)
class Passivity:
    """Whether the law's force is negative in the recorded motion, and the recorded one too.

    Attributes
    ----------
    fraction : float
        Of the samples below the surface, in which the law's force is negative.
    lowest_force : float
        By the law, N; 0 where it never pulls.
    lowest_depth, lowest_velocity : float
        Where that is, m and m/s; NaN where it never pulls.
    deepest : float
        Depth down to which it pulls, m; NaN where it never does.
    measured_there : float
        Mean of the recorded force where the law's is negative, N; NaN where it never is.
    measured_fraction : float
        Of the samples below the surface, in which the recorded force is more than five standard
        deviations of its noise below 0: adhesion, or a wrong zero of the force.
    limit : float
        Velocity at which the law's force at working depth is 0, −F/C, m/s: −K/B of a Hunt–Crossley
        law, at any depth. It pulls on faster withdrawals. NaN without damping.
    fastest_withdrawal : float
        Recorded below the surface, m/s, ≥ 0: 99.9 % of its samples were slower.
    """

    fraction: float
    lowest_force: float
    lowest_depth: float
    lowest_velocity: float
    deepest: float
    measured_there: float
    measured_fraction: float
    limit: float
    fastest_withdrawal: float

    def as_dict(self) -> dict[str, float | None]:
        """Return it as plain numbers; what is not defined is None."""
        return {name: defined(getattr(self, name)) for name in self.__slots__}


def passivity_of(path: Path, law: ForceLaw, there: WorkingDepth, force_noise: float) -> Passivity:
    """Return where a law pulls along a path.

    Parameters
    ----------
    path : Path
        The motion, and the force without the sensor's offset.
    law : ForceLaw
        What was identified.
    there : WorkingDepth
        Its numbers.
    force_noise : float
        Standard deviation of the force's noise, N.
    """
    below = path.depth > 0.0
    depth, velocity, measured = path.depth[below], path.velocity[below], path.force[below]
    force = path.felt(law)[below]
    pulls = force < 0.0
    lowest = int(np.argmin(force)) if pulls.any() else None
    return Passivity(
        fraction=float(np.mean(pulls)) if force.size else math.nan,
        lowest_force=0.0 if lowest is None else float(force[lowest]),
        lowest_depth=math.nan if lowest is None else float(depth[lowest]),
        lowest_velocity=math.nan if lowest is None else float(velocity[lowest]),
        deepest=float(depth[pulls].max()) if pulls.any() else math.nan,
        measured_there=float(measured[pulls].mean()) if pulls.any() else math.nan,
        measured_fraction=float(np.mean(measured < -PULLS * force_noise))
        if force.size
        else math.nan,
        limit=_limit(there.force, there.damping),
        fastest_withdrawal=fastest_of(-velocity),
    )


def _limit(force: Quantity, damping: Quantity) -> float:
    return -force.value / damping.value if damping.value > 0.0 else math.nan


def fastest_of(velocity: Floats) -> float:
    """99.9th percentile of the velocities inwards, m/s, so that a spike sets nothing; 0 of none."""
    inwards = velocity[velocity > 0.0]
    return float(np.percentile(inwards, 99.9)) if inwards.size else 0.0
