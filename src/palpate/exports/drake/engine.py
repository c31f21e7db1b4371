"""Drake: a surface and a tip on a slide in SDFormat and URDF, and the choice of contact for a law.

Forms are one point contact, nested spheres, and SAP. The text comes first, the
engine with its forms at the end.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.exports.drake.running import (
    Plant,
    Setting,
    forces,
    restitution_by_steps,
    simulate_restitution,
    steps_down,
)
from palpate.exports.drake.shapes import ROUNDING, Spheres, fit_spheres, one_sphere
from palpate.exports.engine import Engine, Fragment, Replayed, make_warnings
from palpate.exports.motion import ExportRequest, ProbeMotion
from palpate.exports.nearest_law import fit_with_one_exponent, is_kelvin_voigt, kelvin_voigt
from palpate.exports.replay_errors import Drop, force_error
from palpate.exports.texts import digits, hash_comment, template, xml_comment
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats, frozen

SDF_TIP = """\
      <collision name="{name}">
        <pose>0 0 {lift} 0 0 0</pose>
        <geometry><sphere><radius>{radius}</radius></sphere></geometry>
        {material}
      </collision>"""

URDF_TIP = """\
    <collision name="{name}">
      <origin xyz="0 0 {lift}"/>
      <geometry><sphere radius="{radius}"/></geometry>
      {material}
    </collision>"""


@frozen
class DrakeTip:
    """One sphere of the tip: its radius, and the height of its centre above the tip's, m."""

    name: str
    radius: float
    lift: float
    material: Mapping[str, float | None]


@frozen
class Parts:
    """The values of the text; a material property with value None is a flag.

    Attributes
    ----------
    surface : mapping of str to float or None
        The surface's proximity properties.
    tips : tuple of DrakeTip
        The tip's spheres.
    radius, mass : float
        Radius and mass of the tip, m and kg.
    width, height : float
        Size of the box whose top is the surface, m.
    friction : float
        Coefficient of friction of both bodies, which is then that of the contact.
    """

    surface: Mapping[str, float | None]
    tips: tuple[DrakeTip, ...]
    radius: float
    mass: float
    width: float
    height: float
    friction: float


#: By file name: the template of both bodies, the text of a sphere of the tip, the indent of
#: properties, and the format of a property.
DIALECTS = {
    "contact.sdf": ("drake.sdf", SDF_TIP, "        ", "<drake:{0}>{1}</drake:{0}>"),
    "contact.urdf": ("drake.urdf", URDF_TIP, "      ", '<drake:{0} value="{1}"/>'),
}


def bodies(parts: Parts, file: str, comment: str) -> str:
    """Return the text of a file with both bodies."""
    whole, one, indent, line = DIALECTS[file]

    friction = {"mu_dynamic": parts.friction, "mu_static": parts.friction}

    def properties(material: Mapping[str, float | None]) -> str:
        lines = [
            f"<drake:{name}/>" if value is None else line.format(name, digits(value))
            for name, value in {**material, **friction}.items()
        ]
        inside = "".join(f"\n{indent}  {each}" for each in lines)
        return f"<drake:proximity_properties>{inside}\n{indent}</drake:proximity_properties>"

    tips = [
        one.format(
            name=tip.name,
            lift=digits(tip.lift),
            radius=digits(tip.radius),
            material=properties(tip.material),
        )
        for tip in parts.tips
    ]
    # The inertia of a solid sphere; the tip cannot rotate, so it has no effect.
    worked_out = {"middle": -0.5 * parts.height, "inertia": 0.4 * parts.mass * parts.radius**2}
    texts = {"surface": properties(parts.surface), "tips": "\n".join(tips)}
    return template(whole, comment=comment, parts=parts, **texts, **worked_out)


# A law as Drake's contacts: files, predicted force, replayed force.


@frozen
class Sap:
    """One sphere with Drake's SAP solver: k (x + τ v)."""

    law: GeneralisedHuntCrossley

    def force(self, penetration: Floats, velocity: Floats, step: float) -> Floats:
        """Return the force, N; 0 unless the sphere touched at the beginning of the step [s]."""
        met = penetration - step * velocity >= -ROUNDING
        force: Floats = np.maximum(self.law.force(penetration, velocity), 0.0) * met
        return force


@dataclass(frozen=True, eq=False, kw_only=True)
class DrakeContact(Fragment):
    """A law as a contact in Drake's SDFormat and URDF.

    Attributes
    ----------
    parts : Parts
        Values of the text.
    contact : Spheres or Sap
        The predicted force by formula.
    setting : Setting
        Required settings of the plant.
    heed : tuple of str
        Common mistakes, for the comment in every file.
    """

    # Most steps on the way down; the way up may take 20 times as many, some seconds.
    most_steps: ClassVar[int] = 5000
    parts: Parts = field(repr=False)
    contact: Spheres | Sap = field(repr=False)
    setting: Setting
    heed: tuple[str, ...]

    @property
    def paste(self) -> str:
        """What to do with the files."""
        return (
            "copy the <drake:proximity_properties> of contact.sdf (or .urdf) into both bodies, and "
            "set up the plant as its comment says"
        )

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return both bodies in SDFormat and URDF, and a script that simulates an impact."""
        setting = self.setting
        remarks = [
            *notes,
            "Set up Drake's plant with:",
            f"MultibodyPlantConfig(time_step={digits(setting.time_step)}, "
            'contact_model="point", '
            f'discrete_contact_approximation="{setting.approximation}")',
            *self.heed,
        ]
        how = {"speed": self.request.motion.fastest, "setting": setting}
        scene = template("drake_scene.py.txt", comment=hash_comment(remarks), **how)
        texts = {file: bodies(self.parts, file, xml_comment(remarks)) for file in DIALECTS}
        return {**texts, "scene.py": scene}

    def predict_force(self, motion: ProbeMotion) -> Floats:
        """Return the predicted force by formula, N."""
        return self.contact.force(motion.penetration, motion.velocity, self.setting.time_step)

    def predict_restitution(self, drop: Drop) -> float:
        """Return the restitution by the formula and the plant's time steps."""
        step = self.setting.time_step

        def force(x: float, v: float) -> float:
            return float(self.contact.force(np.array([x]), np.array([v]), step)[0])

        return restitution_by_steps(force, drop, step)

    def replay(self, motion: ProbeMotion) -> Replayed:
        """Return Drake's force at every state of a motion."""
        step = self.setting.time_step
        plant = f"{1e3 * step:.3g} ms, {self.setting.approximation}" if step else "continuous time"
        force = forces(self._plant(), motion)
        return Replayed(force, f"state by state in a plant of {plant}")

    def drop_restitution(self, drop: Drop) -> float | None:
        """Return the restitution in Drake at the time step; None if that takes too many steps."""
        step = self.setting.time_step
        if step > 0.0 and steps_down(drop, step) > self.most_steps:
            return None
        return simulate_restitution(self._plant(), drop)

    def _plant(self) -> Plant:
        return Plant(self.files(())["contact.sdf"], self.setting)


# The choice of the contact for a law.

#: The approximation with the Hunt–Crossley law; "similar" and "tamsi" gave the same digits.
LAGGED = "lagged"
SAP = "sap"
#: Ratio of the other body's stiffness to the contact's; being in series, it changes the eleventh
#: digit.
RIGID = 1e10

_TWO_BODIES = (
    "Drake combines the stiffnesses of the two bodies in series and averages their dissipations:",
    "a body without properties would soften the contact, so both bodies need them.",
)
_NOT_SAP = (
    "Not for SAP, which ignores the dissipation and assumes a relaxation time of 0.1 s per body.",
)
_SAP = (
    "SAP ignores the dissipation. It combines the stiffnesses of the two bodies in series and adds",
    "their relaxation times (default: 0.1 s), so both bodies need them; that of the tip is 0.",
)


class Drake(Engine):
    """A contact in SDFormat and URDF, with Drake's proximity properties."""

    name: ClassVar[str] = "drake"
    title: ClassVar[str] = "Drake"
    forms: ClassVar[Mapping[str, str]] = {
        "point": "F = k x (1 + d v), one sphere",
        "nested-spheres": "the same with several nested spheres, for n above 1",
        "sap": "F = k (x + τ v), Kelvin–Voigt",
    }
    distribution: ClassVar[str | None] = "drake"
    extra: ClassVar[str] = "peers"
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius", "friction"})
    continuous: ClassVar[bool] = True

    def fit(self, request: ExportRequest) -> DrakeContact:
        """Return the law as contacts of Drake, in the requested form or the most accurate one.

        Raises
        ------
        InvalidParameterError
            The stiffness is not positive, or SAP was requested without a time step.
        """
        if request.form == "auto":
            return _nearest(request)
        if request.form == "sap":
            return _sap(request)
        spheres = _nearest_point(request) if request.form == "point" else _spheres(request)
        return _point(request, request.form, spheres)


def _nearest(request: ExportRequest) -> DrakeContact:
    """Return the exact contact if Drake has the law, else the one of least predicted error."""
    law = request.law
    steps = request.time_step > 0.0  # SAP needs time steps
    if steps and is_kelvin_voigt(law) and law.B > 0.0:
        return _sap(request)
    spheres = _nearest_point(request) if law.n <= 1.0 else _spheres(request)
    found = _point(request, "nested-spheres" if spheres.gaps.size > 1 else "point", spheres)
    # SAP's damper is independent of depth: skip it for a law whose damper grows like the force.
    if steps and law.B > 0.0 and law.p < 0.5 * law.n:
        return min(found, _sap(request), key=_error)
    return found


def _error(contact: DrakeContact) -> float:
    motion = contact.request.motion
    law = motion.force_by(contact.request.law)
    return force_error(contact.predict_force(motion), law, motion.judged)


def _point(request: ExportRequest, form: str, spheres: Spheres) -> DrakeContact:
    """Return one rigid sphere on a compliant surface, or compliant spheres on a rigid one.

    The spheres are concentric if they fit. In a tip smaller than the gaps the inner ones have a
    tenth of its radius and are raised instead, which is valid only for a surface below the tip.
    """

    def material(stiffness: float, dissipation: float) -> dict[str, float]:
        return {"point_contact_stiffness": stiffness, "hunt_crossley_dissipation": dissipation}

    radius = request.radius_or_any
    law = request.law
    rigid = material(RIGID * float(spheres.stiffness.sum()), 0.0)
    soft = list(map(material, spheres.stiffness.tolist(), spheres.dissipation.tolist()))
    if len(soft) == 1:
        numbers = soft[0]
        parts = _parts(request, soft[0], rigid)
    else:
        numbers = {}
        tips = []
        for number, (gap, each) in enumerate(zip(spheres.gaps.tolist(), soft, strict=True), 1):
            numbers[f"gap[{number}]"] = gap
            numbers |= {f"{name}[{number}]": value for name, value in each.items()}
            inner = max(radius - gap, 0.1 * radius)
            # Height relative to the outer sphere's lowest point.
            tips.append(DrakeTip(f"tip_{number}", inner, gap - (radius - inner), each))
        parts = replace(_parts(request, rigid, {}), tips=tuple(tips))
    exact = law.n == 1.0 and (law.B == 0.0 or law.p == 1.0)
    warnings = [*_negative(law), *_step(request)]
    if spheres.gaps[-1] > 0.9 * radius:
        warnings.append(
            "the tip was pressed deeper than its radius: its inner spheres are raised, which is "
            "valid only for a surface straight below"
        )
    return DrakeContact(
        form=form,
        request=request,
        numbers=numbers,
        exact=exact and law.B >= 0.0,
        findings=make_warnings(*warnings),
        parts=parts,
        contact=spheres,
        setting=Setting(LAGGED, request.time_step),
        heed=(*_TWO_BODIES, *_NOT_SAP),
    )


def _nearest_point(request: ExportRequest) -> Spheres:
    """Return one sphere; for p = n it keeps the law's dissipation, and so the restitution."""
    return one_sphere(_pushing(fit_with_one_exponent(request.law, request.motion, 1.0)))


def _spheres(request: ExportRequest) -> Spheres:
    motion = request.motion
    firm = motion.judged
    return fit_spheres(_dissipating(request.law), motion.penetration[firm], motion.velocity[firm])


def _dissipating(law: GeneralisedHuntCrossley) -> GeneralisedHuntCrossley:
    """Return the law without negative damping, which would generate energy."""
    if law.B >= 0.0:
        return law
    return GeneralisedHuntCrossley(K=law.K, n=law.n, B=0.0, p=law.n)


def _pushing(law: GeneralisedHuntCrossley) -> GeneralisedHuntCrossley:
    """Return the fitted law; raise unless its stiffness is positive."""
    if law.K > 0.0:
        return law
    raise InvalidParameterError(f"Drake needs a stiffness above 0; that of the law is {law.K:.3g}")


def _negative(law: GeneralisedHuntCrossley) -> tuple[str, ...]:
    if law.B >= 0.0:
        return ()
    return ("the law's damping is negative, which Drake does not allow; it is exported as 0",)


def _sap(request: ExportRequest) -> DrakeContact:
    """Return a compliant surface below a rigid tip with relaxation time 0, for SAP."""
    if request.time_step == 0.0:
        raise InvalidParameterError(
            "time_step must be above 0 for Drake's SAP, an implicit solver: add --time-step 1ms"
        )
    law = _pushing(kelvin_voigt(_dissipating(request.law), request.motion))
    surface = {
        "point_contact_stiffness": law.K,
        "relaxation_time": law.B / law.K,
    }
    tip = {"point_contact_stiffness": RIGID * law.K, "relaxation_time": 0.0}
    return DrakeContact(
        form="sap",
        request=request,
        numbers=surface,
        engine_law=law,
        exact=is_kelvin_voigt(request.law) and request.law.B >= 0.0,
        findings=make_warnings(*_negative(request.law), *_step(request)),
        parts=_parts(request, surface, tip),
        contact=Sap(law),
        setting=Setting(SAP, request.time_step),
        heed=_SAP,
    )


def _parts(
    request: ExportRequest,
    surface: Mapping[str, float | None],
    tip: Mapping[str, float | None],
) -> Parts:
    """Return a tip of one sphere on a box so large that its top stays the nearest face."""
    radius = request.radius_or_any
    deepest = request.motion.deepest
    width = max(1.0, 10.0 * (radius + deepest))
    height = max(0.2, 4.0 * deepest)
    tips = (DrakeTip("tip", radius, 0.0, tip),)
    return Parts(surface, tips, radius, request.mass_or_one, width, height, request.friction)


def _step(request: ExportRequest) -> tuple[str, ...]:
    """Return a warning if an implicit step adds much damping: h ∂F/∂x compared with B xᵖ."""
    law = request.law
    depth = request.motion.deepest
    more = request.time_step * law.n * law.K * depth ** (law.n - 1.0)
    own = max(law.B, 0.0) * depth**law.p
    # Below 2 % of the law's damping, restitution changes by less than about 1 %.
    if more < 0.02 * own:
        return ()
    return (
        f"a step of {1e3 * request.time_step:.3g} ms adds a damping of {more:.2g} N·s/m to the "
        f"law's {own:.2g} at {1e3 * depth:.3g} mm: for impacts choose a smaller --time-step, or 0 "
        "for a continuous plant",
    )


ENGINE = Drake()
