"""A law as Drake's contacts: what is written, what it will do, and what it does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from palpate.exports.drake.running import Plant, Setting, forces, rebound
from palpate.exports.drake.slab import Slab
from palpate.exports.drake.spheres import Spheres
from palpate.exports.drake.text import SCENE, Parts, Tip, sdf, urdf
from palpate.exports.engine import Fragment, Replayed
from palpate.exports.errors import Drop
from palpate.exports.implicit import rebound_by_steps, steps_down
from palpate.exports.motion import Motion
from palpate.exports.text import digits, hash_comment, xml_comment
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats

#: The other body's stiffness, as a multiple of the contact's: they are in series, and so it changes
#: the eleventh digit.
RIGID = 1e10


@dataclass(frozen=True, eq=False, kw_only=True)
class DrakeContact(Fragment):
    """A contact in Drake's text.

    Attributes
    ----------
    parts : Parts
        What the text is made of.
    setting : Setting
        How the plant has to be set up beside it.
    heed : tuple of str
        What is easily got wrong with it; a comment in every file.
    """

    # Of a drop on its way down, for the way up may take 20 times as many: some seconds.
    most_steps: ClassVar[int] = 5000
    parts: Parts = field(repr=False)
    setting: Setting
    heed: tuple[str, ...]

    def force_at(self, penetration: float, velocity: float) -> float:
        """Force at one state, N, by formula."""
        raise NotImplementedError

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return both bodies in SDFormat and in URDF, and a script that drops the tip."""
        said = [*notes, *self._asked_of_plant(), *self.heed]
        return {
            "contact.sdf": sdf(self.parts, xml_comment(said)),
            "contact.urdf": urdf(self.parts, xml_comment(said)),
            "scene.py": SCENE.format(
                comment=hash_comment(said),
                speed=digits(self.asked.motion.fastest),
                time_step=digits(self.setting.time_step),
                contact_model=self.setting.contact_model,
                approximation=self.setting.approximation,
            ),
        }

    def predicted_rebound(self, drop: Drop) -> float:
        """Restitution by the formula and by the plant's own steps."""
        return rebound_by_steps(self.force_at, drop, self.setting.time_step)

    def replay(self, motion: Motion) -> Replayed:
        """Return Drake's force at every state of a motion."""
        force = forces(Plant(self._text(), self.setting), motion)
        how = f"state by state in a plant of {self._plant_in_words()}"
        return Replayed(force, how)

    def rebound(self, drop: Drop) -> float | None:
        """Restitution in Drake, by steps of the time step; None of a drop that takes too many."""
        step = self.setting.time_step
        if step > 0.0 and steps_down(drop, step) > self.most_steps:
            return None
        return rebound(Plant(self._text(), self.setting), drop)

    def _text(self) -> str:
        return self.files(())["contact.sdf"]

    def _asked_of_plant(self) -> tuple[str, ...]:
        return (
            "Drake's plant must be set up beside it:",
            f"MultibodyPlantConfig(time_step={digits(self.setting.time_step)}, "
            f'contact_model="{self.setting.contact_model}", '
            f'discrete_contact_approximation="{self.setting.approximation}")',
        )

    def _plant_in_words(self) -> str:
        if self.setting.time_step == 0.0:
            return "continuous time"
        return f"{1e3 * self.setting.time_step:.3g} ms, {self.setting.approximation}"


@dataclass(frozen=True, eq=False, kw_only=True)
class PointContact(DrakeContact):
    """One sphere, or some in one another, by Drake's point contact of Hunt and Crossley."""

    spheres: Spheres = field(repr=False)

    def predicted(self, motion: Motion) -> Floats:
        """Force of all spheres, N."""
        return self.spheres.force(motion.penetration, motion.velocity, self.setting.time_step)

    def force_at(self, penetration: float, velocity: float) -> float:
        """Force at one state, N."""
        return self.spheres.at(penetration, velocity, self.setting.time_step)


@dataclass(frozen=True, eq=False, kw_only=True)
class SapContact(DrakeContact):
    """One sphere by Drake's SAP: k (x + τ v)."""

    def predicted(self, motion: Motion) -> Floats:
        """Force of its law, N, once the surface was met where the step began."""
        before = motion.penetration - self.setting.time_step * motion.velocity
        force: Floats = super().predicted(motion) * (before >= 0.0)
        return force

    def force_at(self, penetration: float, velocity: float) -> float:
        """Force at one state, N."""
        law = self.engine_law
        assert law is not None
        return max(law.stiffness * penetration + law.damping * velocity, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class SlabContact(DrakeContact):
    """A rigid sphere on a hydroelastic slab."""

    # A state takes 3 to 5 ms.
    most_samples: ClassVar[int] = 500
    most_steps: ClassVar[int] = 200
    slab: Slab

    def predicted(self, motion: Motion) -> Floats:
        """Force of the pressure on the sphere's mesh, N."""
        return self.slab.force(motion.penetration, motion.velocity)

    def force_at(self, penetration: float, velocity: float) -> float:
        """Force at one state, N."""
        return self.slab.at(penetration, velocity)

    def replay(self, motion: Motion) -> Replayed:
        """Return Drake's force at every state of a motion, which a continuous plant has as such."""
        continuous = Setting(self.setting.contact_model, self.setting.approximation, 0.0)
        return Replayed(forces(Plant(self._text(), continuous), motion), "state by state")


def point_parts(spheres: Spheres, radius: float, mass: float, deepest: float) -> Parts:
    """One sphere on a surface that gives way; or spheres that give way on one that does not.

    Spheres have one centre as long as they fit; of a tip smaller than the gaps the inner ones, a
    tenth of its radius, are raised instead, and hold for a surface below the tip only.
    """
    rigid = _point_material(RIGID * float(spheres.stiffness.sum()), 0.0)
    soft = [
        _point_material(float(k), float(d))
        for k, d in zip(spheres.stiffness, spheres.dissipation, strict=True)
    ]
    if len(soft) == 1:
        tip = Tip("tip", radius, 0.0, rigid)
        return Parts(soft[0], (tip,), radius, mass, *_box(radius, deepest))
    tips = []
    for number, gap in enumerate(spheres.gaps.tolist()):
        inner = max(radius - gap, 0.1 * radius)
        # From the outer sphere's lowest point upwards.
        tips.append(Tip(f"tip_{number + 1}", inner, gap - (radius - inner), soft[number]))
    return Parts(rigid, tuple(tips), radius, mass, *_box(radius, deepest))


def _point_material(stiffness: float, dissipation: float) -> dict[str, float]:
    return {"point_contact_stiffness": stiffness, "hunt_crossley_dissipation": dissipation}


def sap_parts(law: GeneralisedHuntCrossley, radius: float, mass: float, deepest: float) -> Parts:
    """A surface that gives way, below a tip that does not and whose relaxation time is 0."""
    tip = {"point_contact_stiffness": RIGID * law.stiffness, "relaxation_time": 0.0}
    surface = {
        "point_contact_stiffness": law.stiffness,
        "relaxation_time": law.damping / law.stiffness,
    }
    return Parts(surface, (Tip("tip", radius, 0.0, tip),), radius, mass, *_box(radius, deepest))


def slab_parts(slab: Slab, mass: float) -> Parts:
    """A rigid sphere on a compliant box whose medial plane is the slab's bottom.

    Without friction, which would push back on the sphere's flanks as it goes straight in: with the
    coefficient 1 that Drake takes where none is given, by nearly half of the force at 50 mm/s.
    """
    smooth = {"mu_dynamic": 0.0, "mu_static": 0.0}
    surface = {
        "compliant_hydroelastic": None,
        "hydroelastic_modulus": slab.modulus,
        "hunt_crossley_dissipation": slab.dissipation,
        **smooth,
    }
    tip = {
        "rigid_hydroelastic": None,
        "mesh_resolution_hint": slab.resolution_hint,
        "hunt_crossley_dissipation": 0.0,
        **smooth,
    }
    # The medial plane reaches as far as H from the rim.
    width = 2.0 * (slab.radius + 2.0 * slab.thickness)
    tips = (Tip("tip", slab.radius, 0.0, tip),)
    return Parts(surface, tips, slab.radius, mass, width, 2.0 * slab.thickness)


def _box(radius: float, deepest: float) -> tuple[float, float]:
    """Width and height of a box of which the top is the nearest face, as deep as it goes, m."""
    return max(1.0, 10.0 * (radius + deepest)), max(0.2, 4.0 * deepest)
