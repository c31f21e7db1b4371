"""OpenSim: a sphere on a half-space as a ``HuntCrossleyForce``, exact for n = p = 3/2.

Simbody has F = 4/3 √R E x^(3/2) (1 + 3/2 c v)₊, see :func:`palpate.force_laws.engines.simbody`: so
E = K/(4/3 √R), which OpenSim calls stiffness, and c = (B/K)/1.5. Each body needs its own
parameters, which only a file can set; from Python both would get the same material.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from palpate.errors import InvalidParameterError
from palpate.exports.engine import Engine, Fragment, Replayed, make_warnings
from palpate.exports.motion import ExportRequest, ProbeMotion
from palpate.exports.nearest_law import fit_with_one_exponent
from palpate.exports.replay_errors import Drop, came_back, state_by_state
from palpate.exports.texts import hash_comment, template, xml_comment
from palpate.writing import temporary_file

# Running OpenSim: the force and restitution of the exported model.

# States looked at on the way down, and the longest time as a multiple of the time down.
_LOOKS = 100
_LONGEST = 20
# This accuracy reproduced the exact restitution to seven digits.
_ACCURACY = 1e-8


class OpenSimScene:
    """A tip on a slide above a half-space."""

    def __init__(self, text: str) -> None:
        self._opensim = quiet_opensim()
        with temporary_file("contact.osim", [text.encode()]) as path:
            self._model = self._opensim.Model(str(path))
        self._state = self._model.initSystem()
        self._coordinate = self._model.getCoordinateSet().get("penetration")
        self._force = self._opensim.HuntCrossleyForce.safeDownCast(
            self._model.getForceSet().get("contact")
        )
        self._column = self._force.getRecordLabels().findIndex("contact.tip.force.X")

    def force(self, penetration: float, velocity: float) -> float:
        """Return the force at a state, N."""
        self._coordinate.setValue(self._state, penetration)
        self._coordinate.setSpeedValue(self._state, velocity)
        self._model.realizeDynamics(self._state)
        return -float(self._force.getRecordValues(self._state).get(self._column))

    def drop_restitution(self, drop: Drop) -> float:
        """Return the restitution of the drop's body; 0 if it does not rebound."""
        step = drop.depth / drop.speed / _LOOKS
        self._model.getBodySet().get("tip").setMass(drop.mass)
        state = self._model.initSystem()
        self._coordinate.setValue(state, 0.0)
        self._coordinate.setSpeedValue(state, drop.speed)
        manager = self._opensim.Manager(self._model)
        manager.setIntegratorAccuracy(_ACCURACY)
        manager.setIntegratorMaximumStepSize(step)
        manager.initialize(state)
        states = (manager.integrate(k * step) for k in range(1, _LOOKS * _LONGEST))
        slide = self._coordinate
        return came_back(((slide.getValue(s), slide.getSpeedValue(s)) for s in states), drop)


def quiet_opensim() -> Any:
    """Return the OpenSim module, which then writes no log."""
    with warnings.catch_warnings():
        # Python 3.12 warns like this when it imports an extension made by an older SWIG.
        warnings.filterwarnings(
            "ignore",
            "builtin type .* has no __module__ attribute",
            DeprecationWarning,
        )
        import opensim
    # By default OpenSim writes a log to the current folder.
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("Off")
    return opensim


#: Ratio of the tip's modulus to the surface's; it changes the combined modulus in the ninth digit.
RIGID = 1e13
_EXPONENT = 1.5
# m/s. A held body creeps by up to this, at the limit of friction; OpenSim's default is 10 mm/s.
_TRANSITION = 1e-3
_HEED = (
    "A sphere of this radius on a half-space. Each geometry has its own parameters: from Python",
    "both would have the same material, and the force would be lower by a factor of root 8.",
)


@dataclass(frozen=True, eq=False, kw_only=True)
class SphereOnHalfSpace(Fragment):
    """A sphere on a half-space."""

    @property
    def paste(self) -> str:
        """What to do with the files."""
        return "copy the HuntCrossleyForce and both geometries of contact.osim into your model"

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return a model with the force to paste, and a script that simulates an impact."""
        mass = self.request.mass_or_one
        radius = self.numbers["radius"]
        # The inertia of a solid sphere; the tip cannot rotate, so it has no effect.
        tip = {"mass": mass, "inertia": 0.4 * mass * radius**2, "above": -radius}
        contact = {**self.numbers, "rigid": RIGID * self.numbers["stiffness"]}
        contact |= {"friction": self.request.friction, "transition": _TRANSITION}
        comment = xml_comment([*notes, *_HEED])
        model = template("opensim.osim", comment=comment, **tip, **contact)
        comment = hash_comment([*notes, *_HEED])
        how = {"speed": self.request.motion.fastest, "time_step": self.request.time_step}
        scene = template("opensim_scene.py.txt", comment=comment, **how)
        return {"contact.osim": model, "scene.py": scene}

    def replay(self, motion: ProbeMotion) -> Replayed:
        """Return OpenSim's force at each state of a motion."""
        scene = OpenSimScene(self.files(())["contact.osim"])
        return Replayed(state_by_state(motion, scene.force), "state by state")

    def drop_restitution(self, drop: Drop) -> float:
        """Return the restitution in OpenSim, whose integrator adapts its step to an accuracy."""
        return OpenSimScene(self.files(())["contact.osim"]).drop_restitution(drop)


class OpenSim(Engine):
    """A model with a HuntCrossleyForce."""

    name: ClassVar[str] = "opensim"
    title: ClassVar[str] = "OpenSim"
    forms: ClassVar[Mapping[str, str]] = {
        "hunt-crossley": "F = 4/3 √R E x^1.5 (1 + 1.5 c v), a sphere of the tip's radius"
    }
    distribution: ClassVar[str | None] = "opensim"
    extra: ClassVar[str] = "peers"
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius", "friction"})

    def fit(self, request: ExportRequest) -> SphereOnHalfSpace:
        """Return the law as a HuntCrossleyForce: exact for n = p = 3/2, else the nearest one.

        Raises
        ------
        InvalidParameterError
            The tip's radius is missing.
        """
        if request.tip_radius is None:
            raise InvalidParameterError(
                "OpenSim needs the tip's radius, to whose root its force is proportional: add "
                "--tip-radius, such as --tip-radius 5mm"
            )
        law = fit_with_one_exponent(request.law, request.motion, _EXPONENT)
        radius = request.tip_radius
        warnings = [
            f"for a tip radius of {1e3 * radius:.4g} mm only: the force scales with its root"
        ]
        if request.motion.deepest > radius:
            warnings.append(
                "the tip was pressed deeper than its radius; OpenSim applies the same formula there"
            )
        if request.law.B < 0.0:
            warnings.append("the law's damping is negative; it is exported as 0")
        return SphereOnHalfSpace(
            form="hunt-crossley",
            request=request,
            numbers={
                "stiffness": law.K / (4.0 / 3.0 * radius**0.5),
                "dissipation": law.B / law.K / 1.5,
                "radius": radius,
            },
            engine_law=law,
            exact=law == request.law,
            findings=make_warnings(*warnings),
        )


ENGINE = OpenSim()
