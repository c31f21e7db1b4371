"""USD: a physics material for Newton and PhysX, and the same numbers as Isaac Lab's configuration.

All have K x + B v, in two places. NewtonMaterialAPI has newton:contactStiffness and
newton:contactDamping, N/m and N·s/m, which Newton's SolverSemiImplicit takes as they are. Newton's
SolverMuJoCo would take them as mass-normalised; it reads mjc:solref and mjc:solimp of the two
shapes first, MuJoCo's own parameters for one effective mass. PhysxMaterialAPI has
physxMaterial:compliantContactStiffness and …Damping, N/m and N·s/m as long as
compliantContactAccelerationSpring is false: true would make them mass-normalised.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.exports.engine import Engine, Fragment, Replayed, make_warnings
from palpate.exports.motion import ExportRequest, ProbeMotion
from palpate.exports.mujoco.accelerated import written_for
from palpate.exports.mujoco.fitting import IMPRATIO, LEAST, PairRow, PairRows, drop_restitution
from palpate.exports.mujoco.fitting import single as single_row
from palpate.exports.nearest_law import is_kelvin_voigt, kelvin_voigt, stable_step
from palpate.exports.newton import NewtonScene
from palpate.exports.replay_errors import Drop, force_error
from palpate.exports.texts import digits, fill, hash_comment, percent, template
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class UsdMaterial(Fragment):
    """A material with a stiffness and a damping, and the same as MuJoCo's contact parameters.

    Attributes
    ----------
    rows : PairRows
        The law as one contact of SolverMuJoCo.
    """

    rows: PairRows

    def values(self) -> dict[str, Any]:
        """Return the values of the templates."""
        [row] = self.rows.rows
        friction = self.request.friction
        # As large as a body of this mass is stable with, in SolverSemiImplicit.
        gain = 0.5 * self.request.mass_or_one / self.request.time_step
        return {
            "law": self.engine_law,
            "friction": friction,
            "gain": gain if friction else 0.0,
            "condim": 3 if friction else 1,
            "cone": "elliptic" if friction else "pyramidal",
            "impratio": IMPRATIO if friction else 1.0,
            "solref": _listed((-row.spring, -row.damper)),
            "solimp": _listed(row.solimp),
        }

    @property
    def paste(self) -> str:
        """What to do with the files."""
        return "reference material.usda in your stage, and bind it to both shapes"

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return the material with the parameters of both shapes, and a scene that uses them."""
        comment = hash_comment(notes)
        values = {**self.values(), "comment": comment}
        body = {"radius": self.request.radius_or_any, "mass": self.request.mass_or_one}
        return {
            "material.usda": template("usd_material.usda", **values),
            "scene.usda": template("usd_scene.usda", **values, **body),
        }


class InNewton(UsdMaterial):
    """A material that Newton simulates."""

    most_samples: ClassVar[int] = 500

    def predict_force(self, motion: ProbeMotion) -> Floats:
        """Return the force of SolverMuJoCo, N: the law plus a small added mass."""
        return self.rows.force(motion.penetration, motion.velocity, motion.acceleration)

    def predict_restitution(self, drop: Drop) -> float:
        """Return the restitution in SolverMuJoCo at the time step."""
        return drop_restitution(self.rows, drop, self.request.time_step)

    @written_for("Newton 1.8")
    def replay(self, motion: ProbeMotion) -> Replayed | None:
        """Return the force in SolverMuJoCo; SolverSemiImplicit has its error in the method."""
        predicted = self.predict_force(motion)
        one_sided = damped_on_approach(self.engine_law, motion)
        force = NewtonScene(self.files(()), "SolverMuJoCo").along(motion, predicted)
        other = NewtonScene(self.files(()), "SolverSemiImplicit").along(motion, one_sided)
        off = percent(force_error(other, motion.force_by(self.request.law), motion.judged))
        return Replayed(force, f"in SolverMuJoCo, state by state; in SolverSemiImplicit {off} off")


_CONFIGURATION = (
    "NewtonMaterialCfg(contact_stiffness={law.K}, contact_damping={law.B})",
    "MujocoCollisionCfg(condim={condim}, solref=({solref}), solimp=({solimp}))",
)


class InIsaacLab(InNewton):
    """A material that Newton simulates within Isaac Lab."""

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return the lines of a configuration, and the same in USD."""
        material, collider = self.lines()
        text = template(
            "isaaclab_material.py.txt",
            comment=hash_comment(notes),
            material=material,
            collider=collider,
            **self.values(),
        )
        return {"isaaclab_material.py": text, **super().files(notes)}

    @property
    def snippet(self) -> str:
        """The lines, and what they are for."""
        material, collider = self.lines()
        there = "in both assets, Isaac Lab 3.0; replayed in Newton, not in Isaac Lab"
        return f"{material} and {collider} {there}"

    @property
    def paste(self) -> str:
        """What to do with the files."""
        return "import PHYSICS_MATERIAL and COLLISION_PROPS of the first file for both assets"

    def lines(self) -> list[str]:
        """Return the configuration of the material and of the two colliders."""
        return [fill(line, **self.values()) for line in _CONFIGURATION]


def _listed(values: Sequence[float]) -> str:
    return ", ".join(digits(value + 0.0) for value in values)


def damped_on_approach(law: GeneralisedHuntCrossley | None, motion: ProbeMotion) -> Floats:
    """Return the force of SolverSemiImplicit, N, which does not damp withdrawals."""
    assert law is not None
    approach = np.maximum(motion.velocity, 0.0)
    return np.asarray(law.K * motion.penetration + law.B * approach)


# The engines that read USD.

_ALWAYS = (
    "bind the material to both touching shapes, and give both the attributes of Collider: Newton "
    "averages what only one shape has with its own defaults",
    "the numbers are in kg, m and s: a stage with another metersPerUnit or kilogramsPerUnit does "
    "not convert them",
)


class Newton(Engine):
    """A material in USD for Newton."""

    name: ClassVar[str] = "newton"
    title: ClassVar[str] = "Newton (USD)"
    forms: ClassVar[Mapping[str, str]] = {"kelvin-voigt": "F = K x + B v"}
    distribution: ClassVar[str | None] = "newton"
    extra: ClassVar[str] = "engines"
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius", "friction"})
    material: ClassVar[type[UsdMaterial]] = InNewton

    def fit(self, request: ExportRequest) -> Fragment:
        """Return the material of the nearest Kelvin–Voigt law.

        Raises
        ------
        InvalidParameterError
            Friction is requested of a law without damping.
        """
        law = kelvin_voigt(request.law, request.motion)
        fragment = self.material(
            form="kelvin-voigt",
            request=request,
            numbers={
                "newton:contactStiffness": law.K,
                "newton:contactDamping": law.B,
                "physxMaterial:compliantContactStiffness": law.K,
                "physxMaterial:compliantContactDamping": law.B,
            },
            engine_law=law,
            exact=is_kelvin_voigt(request.law),
            rows=self.rows(law, request),
        )
        return replace(fragment, findings=make_warnings(*self.warnings(fragment)))

    def rows(self, law: GeneralisedHuntCrossley, request: ExportRequest) -> PairRows:
        """Return the law as one contact of SolverMuJoCo.

        A friction row has the damper D of its contact, so with friction d is so large that D = 1/h:
        the contact then adds a mass of B h, and a body at its limit of friction stops in one step.
        """
        mobility = 1.0 / request.mass_or_one
        rows = single_row(law, request.motion, mobility, 1)
        if not request.friction:
            return rows
        if not law.B > 0.0:
            raise InvalidParameterError(
                "friction: Newton's SolverMuJoCo has it only with damping, and that of the law is "
                f"{law.B:.3g} N·s/m: omit friction"
            )
        added = law.B * request.time_step * mobility
        d = max(added / (1.0 + added), LEAST)
        share = (1.0 - d) * mobility
        solimp = (d, d, *rows.rows[0].solimp[2:])
        return PairRows((PairRow(share * law.K, share * law.B, solimp),), mobility)

    def warnings(self, fragment: UsdMaterial) -> tuple[str, ...]:
        """Return the warnings about Newton's solvers."""
        request = fragment.request
        law = fragment.engine_law
        assert law is not None
        firm = request.motion.firm()
        off = force_error(damped_on_approach(law, firm), firm.force_by(law), firm.judged)
        limit = stable_step(law, request.mass_or_one, request.motion.deepest)
        assumed = "" if request.mass is not None else ", which is assumed: add --mass"
        warnings = [
            *_ALWAYS,
            "call SolverMuJoCo.register_custom_attributes(builder) before add_usd: without it "
            "SolverMuJoCo takes the numbers as mass-normalised, and without friction gives NaN",
            f"mjc:solref is for an effective mass of {rounded(request.mass_or_one, 4)} kg{assumed}",
            "SolverSemiImplicit of Newton 1.8.0 damps the approach only, so that its force is off "
            f"by {percent(off)} on this motion; SolverMuJoCo damps both ways",
        ]
        # SolverMuJoCo and PhysX integrate the contact implicitly.
        if request.time_step >= 0.5 * limit:
            warnings.append(
                "an explicit solver, such as SolverSemiImplicit, is unstable at time steps of "
                f"{1e3 * limit:.2g} ms or more"
            )
        if request.friction:
            gain = 0.5 * request.mass_or_one / request.time_step
            warnings.append(
                f"in SolverSemiImplicit a held body creeps, by {rounded(1e3 / gain, 2)} mm/s for "
                "1 N; SolverMuJoCo needs the cone and impratio of scene.usda, and adds "
                f"{rounded(request.friction * law.B, 2)} N of normal force per m/s of sliding"
            )
        return tuple(warnings)


class IsaacLab(Newton):
    """A material as lines of Isaac Lab's configuration, and in USD."""

    name: ClassVar[str] = "isaaclab"
    title: ClassVar[str] = "Newton (for Isaac Lab 3.0)"
    material: ClassVar[type[UsdMaterial]] = InIsaacLab


class PhysX(Newton):
    """A material in USD for PhysX, which palpate does not run."""

    name: ClassVar[str] = "physx"
    title: ClassVar[str] = "PhysX (USD)"
    distribution: ClassVar[str | None] = None
    material: ClassVar[type[UsdMaterial]] = UsdMaterial

    def rows(self, law: GeneralisedHuntCrossley, request: ExportRequest) -> PairRows:
        """Return the law as one contact: PhysX has its own friction."""
        return single_row(law, request.motion, 1.0 / request.mass_or_one, 1)

    def warnings(self, fragment: UsdMaterial) -> tuple[str, ...]:
        """Return the warnings, of which that of no replay is the first."""
        return ("palpate has not replayed PhysX: its force is that of its documentation", *_ALWAYS)


NEWTON = Newton()
ISAAC_LAB = IsaacLab()
PHYSX = PhysX()
