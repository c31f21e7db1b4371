"""A generalised law as the Hunt–Crossley law that its checks know how to check."""

from copy import copy

import numpy as np

from palpate.diagnosis.data import Data
from palpate.estimate import Estimate
from palpate.force_laws import GeneralisedHuntCrossley, HuntCrossley, force_over_breaks


class Alike(Estimate):
    """An estimate of which the law is taken for another.

    Attributes
    ----------
    own_errors : tuple of float
        Standard errors of force, stiffness and damping at the depth, by the law that it was.
    longest : float
        The longest time that the law relaxed over, s; 0 for one without memory.
    """

    __slots__ = ("_alike", "longest", "own_errors")

    def __init__(self, estimate: Estimate, law: HuntCrossley, depth: float) -> None:
        super().__init__(estimate._value, estimate._law_type, estimate.fixed)
        self._alike = law
        self.longest = float(estimate.law.parameters[7])
        self.own_errors = (
            estimate.with_error(lambda law: float(law.force(depth, 0.0)))[1],
            estimate.stiffness_at(depth)[1],
            estimate.damping_at(depth)[1],
        )

    @property
    def law(self) -> HuntCrossley:
        """The law that it is taken for."""
        return self._alike


def as_hunt_crossley(data: Data, estimate: Estimate, depth: float) -> tuple[Data, Estimate]:
    """Take out of the force what a generalised law has beside a Hunt–Crossley law.

    F − M Σ w g − (B xᵖ − B′ xⁿ) v, with B′ xⁿ = B xᵖ at a depth [m], is to be K xⁿ + B′ xⁿ v: what
    is left beside it no less than before, and force, stiffness and damping at that depth are the
    same, those of the relaxed material.
    """
    law: GeneralisedHuntCrossley = estimate.law
    x, v = data.penetration - estimate.surface, data.velocity
    damping = law.damping * depth ** (law.damping_exponent - law.exponent)
    alike = HuntCrossley(law.stiffness, damping, law.exponent)
    steps = np.diff(data.time, prepend=data.time[:1])
    starts = [part.start for part in data.segments()]
    steps[starts] = data.sample_time
    beside = force_over_breaks(law, x, v, steps, starts) - alike.force(x, v)
    corrected = copy(data)
    corrected.force = data.force - beside
    return corrected, Alike(estimate, alike, depth)
