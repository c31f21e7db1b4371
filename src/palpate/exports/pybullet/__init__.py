"""PyBullet: contactStiffness and contactDamping, an implicit Kelvin–Voigt contact.

The solver has, of a step from x₀ that ends with v₁,

    f = K x₀ + (B + K h) v₁,

h the time step and B the dampings of both bodies together, of which one that has none has 0.1. So
the step's own K h, and the other body's damping, are taken off what is written.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from palpate.errors import InvalidParameterError
from palpate.exports.asked import Asked
from palpate.exports.engine import Engine, Fragment, Replayed
from palpate.exports.errors import Drop
from palpate.exports.implicit import rebound_by_steps, steps_down
from palpate.exports.kelvin_voigt import is_kelvin_voigt
from palpate.exports.motion import Motion
from palpate.exports.nearest import kelvin_voigt
from palpate.exports.pybullet import running
from palpate.exports.pybullet.text import SCENE, SURFACE, TIP
from palpate.exports.text import digits, hash_comment, xml_comment
from palpate.force_laws import GeneralisedHuntCrossley

#: contactDamping of a body that sets none, N·s/m: both bodies' add (btCollisionObject).
OTHERS_DAMPING = 0.1
# Of a drop on its way down, for the way up may take 20 times as many: some seconds.
_MOST_STEPS = 20_000

_HEED = (
    "Set them on one body only: on both, the stiffness would be halved and the damping doubled.",
    "setPhysicsEngineParameter(contactSlop=0): unless set, the contact begins 0.01 mm deep.",
    "enableFileCaching=0 there, or a URDF file of the same name is not read again.",
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact(Fragment):
    """A plane of one stiffness and damping."""

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return the surface, a tip, and a script that drops it."""
        mass, radius = self.asked.mass_or_one, self._radius
        said = [
            *notes,
            f"The damping is that of a time step h of {1e3 * self.asked.time_step:.4g} ms: K h and "
            f"the other body's {OTHERS_DAMPING} are taken off it.",
            *_HEED,
        ]
        sizes = {"radius": digits(radius)}
        return {
            "surface.urdf": SURFACE.format(
                comment=xml_comment(said),
                stiffness=digits(self.numbers["contactStiffness"]),
                damping=digits(self.numbers["contactDamping"]),
            ),
            "tip.urdf": TIP.format(
                comment=xml_comment(said),
                mass=digits(mass),
                inertia=digits(0.4 * mass * radius**2),
                **sizes,
            ),
            "scene.py": SCENE.format(
                comment=hash_comment(said),
                speed=digits(self.asked.motion.fastest),
                time_step=digits(self.asked.time_step),
                **sizes,
            ),
        }

    def predicted_rebound(self, drop: Drop) -> float:
        """Restitution by the engine's steps."""
        stiffness = self.numbers["contactStiffness"]
        damping = self.numbers["contactDamping"] + OTHERS_DAMPING

        def force(penetration: float, velocity: float) -> float:
            return max(stiffness * penetration + damping * velocity, 0.0)

        return rebound_by_steps(force, drop, self.asked.time_step)

    def replay(self, motion: Motion) -> Replayed:
        """Return PyBullet's force at every state of a motion."""
        step = self.asked.time_step
        force = running.forces(self.files(()), self._radius, step, motion)
        return Replayed(force, f"state by state, in steps of {1e3 * step:.3g} ms")

    def rebound(self, drop: Drop) -> float | None:
        """Restitution in PyBullet, by steps of the time step; None of a drop of too many."""
        if steps_down(drop, self.asked.time_step) > _MOST_STEPS:
            return None
        return running.rebound(self.files(()), self._radius, self.asked.time_step, drop)

    @property
    def _radius(self) -> float:
        """The tip's, m; any that is not all below the surface will do."""
        return self.asked.tip_radius or max(0.01, 2.0 * self.asked.motion.deepest)


class PyBullet(Engine):
    """A surface in URDF."""

    name: ClassVar[str] = "pybullet"
    title: ClassVar[str] = "PyBullet"
    forms: ClassVar[Mapping[str, str]] = {"kelvin-voigt": "F = K x + B v, in two numbers"}
    distribution: ClassVar[str | None] = "pybullet"
    extra: ClassVar[str] = "peers"
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius"})

    def fit(self, asked: Asked) -> Contact:
        """Return the nearest Kelvin–Voigt law, with the step's own damping taken off.

        Raises
        ------
        InvalidParameterError
            The stiffness is not above 0.
        """
        law = kelvin_voigt(asked.law, asked.motion)
        if law.stiffness <= 0.0:
            raise InvalidParameterError(
                f"a law with a stiffness of {law.stiffness:.3g} cannot be a contact of PyBullet"
            )
        damping = damping_written(law, asked.time_step)
        own = law.stiffness * asked.time_step + OTHERS_DAMPING
        there = GeneralisedHuntCrossley(law.stiffness, 1.0, damping + own, 0.0)
        return Contact(
            form="kelvin-voigt",
            asked=asked,
            numbers={"contactStiffness": law.stiffness, "contactDamping": damping},
            engine_law=there,
            exact=is_kelvin_voigt(asked.law) and damping > 0.0,
            warnings=_too_much(law, own),
        )


def damping_written(law: GeneralisedHuntCrossley, time_step: float) -> float:
    """B less the step's own damping and the other body's, N·s/m; 0 where these are more."""
    return max(law.damping - law.stiffness * time_step - OTHERS_DAMPING, 0.0)


def _too_much(law: GeneralisedHuntCrossley, own: float) -> tuple[str, ...]:
    if law.damping >= own:
        return ()
    return (
        f"the step damps by {own:.3g} N·s/m where the law has {law.damping:.3g}: take a smaller "
        "time step",
    )


ENGINE = PyBullet()
