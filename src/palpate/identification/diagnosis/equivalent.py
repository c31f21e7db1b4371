"""The Hunt–Crossley law equivalent to a relaxing law at one depth and frequency."""

from copy import copy

from palpate.force_laws import GeneralisedHuntCrossley, HuntCrossley
from palpate.identification.diagnosis.recording import Data
from palpate.method.estimators.estimate import Estimate
from palpate.method.estimators.viscoelastic import dynamic_response
from palpate.validation import Floats


class EquivalentEstimate(Estimate):
    """An estimate with the equivalent Hunt–Crossley law in place of its law.

    Attributes
    ----------
    law_errors : numpy.ndarray, shape (3,)
        Standard errors of force, stiffness and damping at the depth, from the identified law.
    longest : float
        The longest relaxation time of the identified law, s; 0 for a law without relaxation.
    """

    __slots__ = ("_equivalent", "law_errors", "longest")

    def __init__(
        self, estimate: Estimate, law: HuntCrossley, depth: float, frequency: float
    ) -> None:
        super().__init__(estimate, estimate._law_type, estimate.fixed)
        self._equivalent = law
        relaxation = estimate.law.relaxation
        self.longest = 0.0 if relaxation is None else relaxation.longest_time

        def numbers(law: GeneralisedHuntCrossley) -> tuple[float, float, float]:
            stiffness, damping = dynamic_response(law, depth, frequency).tolist()
            return stiffness * depth / law.n, stiffness, damping

        self.law_errors = estimate.with_errors(numbers)[1]

    @property
    def law(self) -> HuntCrossley:
        """The equivalent Hunt–Crossley law."""
        return self._equivalent


def equivalent_hunt_crossley(
    data: Data, estimate: Estimate, depth: float, frequency: float, force: Floats
) -> tuple[Data, EquivalentEstimate]:
    """Subtract from the force the difference of a generalised law and its equivalent law.

    The equivalent Hunt–Crossley law has the same K′ and B′ at a depth [m] and a frequency ω
    [rad/s]. Compared with the corrected force it has the same residual as the generalised law.
    """
    law: GeneralisedHuntCrossley = estimate.law
    stiffness, damping = dynamic_response(law, depth, frequency).tolist()
    n = law.n
    equivalent = HuntCrossley(K=stiffness / (n * depth ** (n - 1.0)), B=damping / depth**n, n=n)
    corrected = copy(data)
    equivalent_force = equivalent.force(data.penetration - estimate.surface, data.velocity)
    corrected.force = data.force - (force - equivalent_force)
    return corrected, EquivalentEstimate(estimate, equivalent, depth, frequency)
