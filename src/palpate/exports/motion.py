"""The motion of a probe that an export replays, and what is asked of an export."""

import math
from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from palpate import lab
from palpate.digits import rounded
from palpate.errors import InvalidParameterError, RecordingError
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.identifying import Identification
from palpate.output.results.saved import SavedResult
from palpate.validation import Floats, Integers, Mask, frozen

#: Most states at which an engine computes the force; slow engines have a lower limit.
MOST_SAMPLES = 20_000
#: Depth, m, above which the paper's motion counts for errors.
FIRM = 2e-3
#: Standard gravity, m/s².
GRAVITY = 9.80665
# Mean depth of the paper's motion, m.
_PAPER_DEPTH = 10e-3
# Largest force at that depth, in weights of the body.
_MOST_WEIGHTS = 100.0


@frozen(eq=False)
class ProbeMotion:
    """A motion of a probe, with penetration measured from the surface of the identified law.

    Attributes
    ----------
    time, penetration, velocity, acceleration : numpy.ndarray, shape (k,)
        s, m, m/s and m/s².
    judged : numpy.ndarray of bool, shape (k,)
        Samples in firm contact, over which errors are computed.
    starts : tuple of int
        First sample of each continuous part of the motion. Default: (0,).
    force : numpy.ndarray, shape (k,), optional
        Measured force without its offset, N.
    source : str
        Description of the motion.
    """

    time: Floats
    penetration: Floats
    velocity: Floats
    acceleration: Floats
    judged: Mask
    starts: tuple[int, ...] = (0,)
    force: Floats | None = None
    source: str = "a motion"

    @classmethod
    def of_paper(cls, scale: float = 1.0) -> "ProbeMotion":
        """Return that of the paper: an approach, then 10 + sin 4t + 1.8 sin 11t + 1.8 sin 15t mm.

        Samples deeper than 2 mm count for errors. ``scale`` multiplies the depths (default: 1).
        """
        time: Floats = 1e-3 * np.arange(6000, dtype=np.float64)
        command = lab.Probing(pause=0.0).at(time)
        x = scale * command.penetration
        v = scale * command.velocity
        source = "the paper's motion"
        if scale != 1.0:
            source += f", scaled by {rounded(scale, 2)}"
        return cls(time, x, v, np.gradient(v, time), x > scale * FIRM, source=source)

    @classmethod
    def for_law(cls, law: ForceLaw, mass: float) -> "ProbeMotion":
        """Return the paper's motion, or a smaller one at depths that a body's weight reaches.

        On a stiff law, such as that of metal, the paper's 10 mm would take more than 100 times the
        weight of a body of this mass [kg]. The motion is then about the depth of twice its weight,
        as 10 mm is for 1 kg on the paper's ball.
        """
        resting = law.relaxed() if isinstance(law, GeneralisedHuntCrossley) else law
        load = mass * GRAVITY
        if not float(resting.force(_PAPER_DEPTH, 0.0)) > _MOST_WEIGHTS * load:
            return cls.of_paper()
        depths = np.geomspace(1e-12, _PAPER_DEPTH, 4000)
        force = resting.force(depths, np.zeros_like(depths))
        reached = float(depths[int(np.argmax(force >= 2.0 * load))])
        return cls.of_paper(reached / _PAPER_DEPTH)

    def faster(self, factor: float) -> "ProbeMotion":
        """Return the same depths at this multiple of the speed, without a measured force."""
        return replace(
            self,
            time=self.time / factor,
            velocity=factor * self.velocity,
            acceleration=factor**2 * self.acceleration,
            force=None,
        )

    @classmethod
    def recorded(cls, result: Identification | SavedResult) -> "ProbeMotion":
        """Return the motion of a recording; the samples used by the estimate count for errors.

        Raises
        ------
        RecordingError
            The estimate used no sample.
        """
        contact = result.contact
        if isinstance(result, Identification):
            surface = result.estimate.surface
            offset = result.estimate.offset
        else:
            [found] = result.description["results"]
            surface, offset = (float(found.get(name, 0.0)) for name in ("surface", "offset"))
        good = np.isfinite(contact.penetration) & np.isfinite(contact.velocity)
        good &= np.isfinite(contact.force)
        parts = [np.flatnonzero(good[segment]) + segment.start for segment in contact.segments()]
        kept = [part for part in parts if part.size > 1]
        whole = np.concatenate(kept) if kept else np.empty(0, dtype=np.int64)
        time = contact.time[whole]
        velocity = contact.velocity[whole]
        parts = [np.gradient(contact.velocity[part], contact.time[part]) for part in kept]
        penetration = contact.penetration[whole] - surface
        judged = result.trace.taken[whole] & (penetration > 0.0)
        if not judged.any():
            raise RecordingError(f"{contact.source}: no sample was used; identify it again")
        starts = tuple(np.cumsum([0, *(part.size for part in kept[:-1])]).tolist())
        motion = cls(time, penetration, velocity, np.concatenate(parts), judged, starts)
        return replace(motion, force=contact.force[whole] - offset, source="the recorded motion")

    def __len__(self) -> int:
        return len(self.time)

    @property
    def deepest(self) -> float:
        """Largest penetration of the judged samples, m."""
        return float(self.penetration[self.judged].max())

    @property
    def shallowest(self) -> float:
        """Smallest penetration of the judged samples, m."""
        return float(self.penetration[self.judged].min())

    @property
    def fastest(self) -> float:
        """Largest absolute velocity of the judged samples, m/s."""
        return float(np.abs(self.velocity[self.judged]).max())

    @property
    def frequency(self) -> float:
        """Dominant ω of the judged samples, rad/s: rms speed over rms distance from their mean."""
        speed = float(np.sqrt(np.mean(self.velocity[self.judged] ** 2)))
        way = float(np.std(self.penetration[self.judged]))
        return speed / way if way > 0.0 else math.nan

    def force_by(self, law: ForceLaw) -> Floats:
        """Return a law's force at every sample, N."""
        if not law.remembers:
            # Without relaxation the times do not matter, which joined recordings may repeat.
            return law.force(self.penetration, self.velocity)
        inside = np.delete(np.diff(self.time, prepend=0.0), list(self.starts))
        usual = float(np.median(inside)) if inside.size else 1e-3
        return law.force_over(self.time, self.penetration, self.velocity, usual)

    def firm(self, most: int = MOST_SAMPLES) -> "ProbeMotion":
        """Return the judged samples only, at most so many, evenly chosen.

        They are independent states for an engine's force, no longer a motion in time.
        """
        places = self.firm_places(most)
        names = ("time", "penetration", "velocity", "acceleration", "judged")
        kept = {name: getattr(self, name)[places] for name in names}
        force = None if self.force is None else self.force[places]
        return replace(self, **kept, force=force, starts=(0,))

    def firm_places(self, most: int = MOST_SAMPLES) -> Integers:
        """Return the indices of the samples that :meth:`firm` chooses."""
        places = np.flatnonzero(self.judged)
        return places[:: -(-places.size // most)]


@frozen(eq=False)
class ExportRequest:
    """A law to export to an engine, with the motion, body and options.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        F = K xⁿ + B xᵖ v, without relaxation.
    motion : ProbeMotion
        The motion on which the error is measured.
    mass : float, optional
        Effective mass of the pressing body at the contact, kg.
    model : Path, optional
        The user's own model, for engines that can read it.
    geom : str, optional
        Name of the touching geom in the model.
    tip_radius : float, optional
        Radius of a spherical tip, m, for engines whose law contains it.
    time_step : float
        Time step of the simulation, s. Default: 1e-3.
    form : str
        Form of the contact in the engine. Default: "auto", chosen by the engine.
    friction : float
        Coefficient of friction. Default: 0, frictionless.
    name : str
        Part of the names that the export gives in a model. Default: "", the only export there.
    material : str
        What the law is of, such as the name of a recording. Default: "".
    """

    law: GeneralisedHuntCrossley
    motion: ProbeMotion = field(repr=False)
    mass: float | None = None
    model: Path | None = None
    geom: str | None = None
    tip_radius: float | None = None
    time_step: float = 1e-3
    form: str = "auto"
    friction: float = 0.0
    name: str = ""
    material: str = ""

    def __post_init__(self) -> None:
        if not self.law.K > 0.0:
            raise InvalidParameterError(f"law must have a stiffness above 0, not {self.law.K:.3g}")

    @property
    def mass_or_one(self) -> float:
        """The mass, kg; 1 kg if none was set, for engines whose law does not depend on it."""
        return 1.0 if self.mass is None else self.mass

    @property
    def radius_or_any(self) -> float:
        """Radius of the tip, m; if unknown, one larger than the depth, where it has no effect."""
        return self.tip_radius or max(0.01, 2.0 * self.motion.deepest)


#: Force [N] at a penetration [m] and a velocity [m/s].
Pointwise: TypeAlias = Callable[[float, float], float]
