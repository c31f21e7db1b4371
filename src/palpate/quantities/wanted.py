"""What a person says for the numbers that are derived from a law."""

from dataclasses import dataclass

from palpate.tips import Tip
from palpate.validation import instance, number_in


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
