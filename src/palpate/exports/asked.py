"""What is asked of an engine."""

from dataclasses import dataclass, field
from pathlib import Path

from palpate.exports.motion import Motion
from palpate.force_laws import GeneralisedHuntCrossley


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """A law to be carried into an engine, and for what.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        F = K xⁿ + B xᵖ v, without memory.
    motion : Motion
        That it has to be right on.
    mass : float, optional
        Of the body that presses, as the contact feels it, kg.
    model : Path, optional
        The user's own model, for engines that read theirs.
    geom : str, optional
        The geom in it that touches.
    tip_radius : float, optional
        Of a round tip, m, for engines whose law has its radius in it.
    time_step : float
        Of the simulation, s.
    form : str
        Which of the engine's ways; "auto" leaves it to the engine.
    """

    law: GeneralisedHuntCrossley
    motion: Motion = field(repr=False)
    mass: float | None = None
    model: Path | None = None
    geom: str | None = None
    tip_radius: float | None = None
    time_step: float = 1e-3
    form: str = "auto"

    @property
    def mass_or_one(self) -> float:
        """The mass, kg; 1 kg where none is given, for engines whose law does not depend on it."""
        return 1.0 if self.mass is None else self.mass
