"""USD: a physics material for Newton and PhysX, both Kelvin–Voigt; palpate does not run them.

NewtonMaterialAPI has newton:contactStiffness and newton:contactDamping; PhysxMaterialAPI has
physxMaterial:compliantContactStiffness and …Damping, N/m and N·s/m as long as
compliantContactAccelerationSpring is false: true would make them mass-normalised.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from palpate.exports.engine import Engine, Fragment, make_warnings
from palpate.exports.motion import ExportRequest
from palpate.exports.nearest_law import is_kelvin_voigt, kelvin_voigt, stable_step
from palpate.exports.texts import hash_comment, template

_ALWAYS = (
    "bind the material to both touching shapes: if one has no material, Newton averages this "
    "material with its own defaults",
    "use Newton's SolverSemiImplicit, which has this law: SolverMuJoCo of Newton 1.8.0 takes the "
    "numbers as mass-normalised by default, and with friction other than the exported 1 its "
    "pyramidal cone changes the normal force, to NaN at 0; that friction was not measured",
    "the numbers are in kg, m and s: a stage with another metersPerUnit or kilogramsPerUnit does "
    "not convert them",
)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Material(Fragment):
    """A material with a stiffness and a damping."""

    @property
    def paste(self) -> str:
        """What to do with the files."""
        return "reference material.usda in your stage, and bind it to both shapes"

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        law = self.engine_law
        request = self.request
        comment = hash_comment(notes)
        scene = {"radius": request.radius_or_any, "mass": request.mass_or_one}
        return {
            "material.usda": template("usd_material.usda", comment=comment, law=law),
            "scene.usda": template("usd_scene.usda", comment=comment, **scene),
        }


class Usd(Engine):
    """A material in USD, for Newton and PhysX."""

    name: ClassVar[str] = "usd"
    title: ClassVar[str] = "USD (Newton, PhysX)"
    forms: ClassVar[Mapping[str, str]] = {"kelvin-voigt": "F = K x + B v"}
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius"})

    def fit(self, request: ExportRequest) -> Fragment:
        """Return the material of the nearest Kelvin–Voigt law."""
        law = kelvin_voigt(request.law, request.motion)
        limit = stable_step(law, request.mass_or_one, request.motion.deepest)
        # PhysX and Newton's SolverMuJoCo integrate the contact implicitly and have no such limit.
        explicit = (
            "an explicit solver, such as Newton's SolverSemiImplicit, is unstable at time steps of "
            f"{1e3 * limit:.2g} ms or more"
        )
        return _Material(
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
            findings=make_warnings(
                *_ALWAYS,
                *([explicit] if request.time_step >= 0.5 * limit else []),
            ),
        )


ENGINE = Usd()
