"""A generalised law as the Hunt–Crossley law that its checks know how to check."""

from copy import copy

import numpy as np

from palpate.diagnosis.data import Data
from palpate.estimate import Estimate
from palpate.force_laws import GeneralisedHuntCrossley, HuntCrossley


class Alike(Estimate):
    """An estimate of which the law is taken for another.

    Attributes
    ----------
    own_errors : tuple of float
        Standard errors of force, stiffness and damping at the depth, by the law that it was.
    """

    __slots__ = ("_alike", "own_errors")

    def __init__(self, estimate: Estimate, law: HuntCrossley, depth: float) -> None:
        super().__init__(estimate._value, estimate._law_type, estimate.fixed)
        self._alike = law
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
    beside = np.zeros_like(x)
    steps = np.diff(data.time, prepend=data.time[:1])
    for part in data.segments():
        own = steps[part].copy()
        own[0] = data.sample_time
        beside[part] = law.force_along(x[part], v[part], own) - alike.force(x[part], v[part])
    corrected = copy(data)
    corrected.force = data.force - beside
    return corrected, Alike(estimate, alike, depth)
