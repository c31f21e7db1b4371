"""OpenSim: a sphere on a half-space by ``HuntCrossleyForce``, exact at n = p = 3/2.

Simbody has F = 4/3 √R E x^(3/2) (1 + 3/2 c v)₊, see :func:`palpate.force_laws.engines.simbody`: so
E = K/(4/3 √R), which OpenSim calls stiffness, and c = (B/K)/1.5. Each body has parameters of its
own, from a file; set from Python both would be given the same material.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.exports.asked import Asked
from palpate.exports.engine import Engine, Fragment, Replayed
from palpate.exports.errors import Drop
from palpate.exports.motion import Motion
from palpate.exports.nearest import with_exponents
from palpate.exports.opensim.running import Scene
from palpate.exports.opensim.text import MODEL, SCENE
from palpate.exports.text import digits, hash_comment, xml_comment
from palpate.force_laws import GeneralisedHuntCrossley

#: The tip's modulus over the surface's. They combine by their powers 2/3: it changes the ninth
#: digit.
RIGID = 1e13
_EXPONENT = 1.5
_HEED = (
    "A sphere of this radius on a half-space. Each geometry has parameters of its own: set from",
    "Python both would have the same material, and the force would be softer by the root of 8.",
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact(Fragment):
    """One sphere on a half-space."""

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return a model, with the force to paste, and a script that drops the tip."""
        radius, mass = self.asked.tip_radius, self.asked.mass_or_one
        assert radius is not None
        modulus = self.numbers["stiffness"]
        model = MODEL.format(
            comment=xml_comment([*notes, *_HEED]),
            mass=digits(mass),
            # Of a solid sphere; on its slide the tip does not turn.
            inertia=digits(0.4 * mass * radius**2),
            above=digits(-radius),
            radius=digits(radius),
            stiffness=digits(modulus),
            dissipation=digits(self.numbers["dissipation"]),
            rigid=digits(RIGID * modulus),
        )
        scene = SCENE.format(
            comment=hash_comment([*notes, *_HEED]),
            speed=digits(self.asked.motion.fastest),
            time_step=digits(self.asked.time_step),
        )
        return {"contact.osim": model, "scene.py": scene}

    def replay(self, motion: Motion) -> Replayed:
        """Return OpenSim's force at every state of a motion."""
        return Replayed(self._scene().forces(motion), "state by state")

    def rebound(self, drop: Drop) -> float:
        """Restitution in OpenSim, whose integrator keeps to an accuracy and not to a step."""
        return self._scene().rebound(drop)

    def _scene(self) -> Scene:
        return Scene(self.files(())["contact.osim"])


class OpenSim(Engine):
    """A model with a HuntCrossleyForce."""

    name: ClassVar[str] = "opensim"
    title: ClassVar[str] = "OpenSim"
    forms: ClassVar[Mapping[str, str]] = {
        "hunt-crossley": "F = 4/3 √R E x^1.5 (1 + 1.5 c v), of a sphere of the tip's radius"
    }
    distribution: ClassVar[str | None] = "opensim"
    extra: ClassVar[str] = "peers"
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius"})

    def fit(self, asked: Asked) -> Contact:
        """Return the law as a HuntCrossleyForce: exactly at n = p = 3/2, else the nearest.

        Raises
        ------
        InvalidParameterError
            The tip's radius is not given, or the stiffness is not above 0.
        """
        if asked.tip_radius is None:
            raise InvalidParameterError(
                "tip_radius is needed for OpenSim, whose force goes with its root: give that of "
                "the tip, as in --tip-radius 5mm"
            )
        if asked.law.stiffness <= 0.0:
            raise InvalidParameterError(
                f"a law with a stiffness of {asked.law.stiffness:.3g} cannot be a force of OpenSim"
            )
        law = nearest(asked)
        stiffness = law.stiffness / (4.0 / 3.0 * asked.tip_radius**0.5)
        return Contact(
            form="hunt-crossley",
            asked=asked,
            numbers={
                "stiffness": stiffness,
                "dissipation": law.damping / law.stiffness / 1.5,
                "radius": asked.tip_radius,
            },
            engine_law=law,
            exact=law == asked.law,
            warnings=tuple(_warnings(asked)),
        )


def nearest(asked: Asked) -> GeneralisedHuntCrossley:
    """The law with n = p = 3/2; where p = n with its own B/K, which keeps restitution."""
    law, motion = asked.law, asked.motion
    if law.damping > 0.0 and law.damping_exponent != law.exponent:
        return with_exponents(law, motion, _EXPONENT, _EXPONENT)
    b = max(law.damping, 0.0) / law.stiffness
    if law.exponent == _EXPONENT:
        return GeneralisedHuntCrossley(law.stiffness, _EXPONENT, law.stiffness * b, _EXPONENT)
    x, v = motion.penetration[motion.judged], motion.velocity[motion.judged]
    weight = np.maximum(1.0 + b * v, 0.0) ** 2 * x**_EXPONENT
    stiffness = law.stiffness * float(weight @ x**law.exponent) / float(weight @ x**_EXPONENT)
    return GeneralisedHuntCrossley(stiffness, _EXPONENT, stiffness * b, _EXPONENT)


def _warnings(asked: Asked) -> list[str]:
    radius = asked.tip_radius
    assert radius is not None
    warnings = [
        f"for a tip of {1e3 * radius:.4g} mm only: the force goes with the root of the radius"
    ]
    if asked.motion.deepest > radius:
        warnings.append(
            "the tip was pressed deeper than its radius: OpenSim takes the law as it stands there"
        )
    if asked.law.damping < 0.0:
        warnings.append("the law's damping is negative: it is written as 0")
    return warnings


ENGINE = OpenSim()
