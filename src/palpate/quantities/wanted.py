"""What a person says for the numbers that are derived from a law."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from palpate.contact import Contact
from palpate.diagnosis import Data, Diagnosis, WorkingDepth
from palpate.estimate import Estimate
from palpate.estimators import ContactEstimator
from palpate.tips import Tip
from palpate.trace import Trace
from palpate.validation import Floats, instance, number_in

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True)
class Wanted:
    """For which impact, tip and oscillation the derived numbers are.

    Parameters
    ----------
    impact_speed : float, optional
        Of the restitution, m/s, in (0, 1e6]; the fastest approach recorded in contact unless given.
    tip : Tip, optional
        :class:`Sphere`, :class:`FlatPunch` or :class:`Cone`; without one there is no modulus.
    poisson_ratio : float, optional
        Of the material, in (−1, 0.5]; 0.5, incompressible as soft tissue, assumed unless given.
    frequency : float, optional
        Of a small oscillation, rad/s, > 0; the motion's own unless given.
    """

    impact_speed: float | None = None
    tip: Tip | None = None
    poisson_ratio: float | None = None
    frequency: float | None = None

    def __post_init__(self) -> None:
        if self.impact_speed is not None:
            number_in("impact_speed", self.impact_speed, 0.0, 1e6, open_low=True)
        instance("tip", self.tip, (Tip, type(None)))
        if self.poisson_ratio is not None:
            number_in("poisson_ratio", self.poisson_ratio, -1.0, 0.5, open_low=True)
        if self.frequency is not None:
            number_in("frequency", self.frequency, 0.0, 1e12, open_low=True)


class Derivable(Protocol):
    """What a quantity follows from: a contact, its estimator, and what they gave."""

    @property
    def contact(self) -> Contact:
        """What was identified."""

    @property
    def data(self) -> Data | None:
        """With the checks of its channels."""

    @property
    def trace(self) -> Trace:
        """Every sample."""

    @property
    def estimator(self) -> ContactEstimator:
        """As it stood after the last sample."""

    @property
    def estimate(self) -> Estimate:
        """What it knew then."""

    @property
    def law(self) -> Any:
        """The contact model, SI."""

    @property
    def fixed(self) -> tuple[str, ...]:
        """The law's parameters that were given."""

    @property
    def covariance(self) -> Floats:
        """Of the law's parameters, SI."""

    @property
    def standard_errors(self) -> Floats:
        """Of the law's parameters, SI."""

    @property
    def diagnosis(self) -> Diagnosis:
        """What may be wrong."""

    @property
    def wanted(self) -> Wanted:
        """For which impact, tip and oscillation."""

    def at(self, depth: "ArrayLike") -> WorkingDepth:
        """Force, stiffness and damping at a depth, m."""
