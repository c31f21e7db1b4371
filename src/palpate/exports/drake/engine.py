"""Drake: a surface and a tip on a slide, in SDFormat and in URDF; and which contacts carry a law.

They are one point contact, spheres in one another, a hydroelastic slab, or SAP. The text that is
made of them comes first, and the engine with its ways at the end.
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
    simulated_restitution,
    steps_down,
)
from palpate.exports.drake.shapes import (
    FINEST,
    ROUNDING,
    Slab,
    Spheres,
    nested_spheres,
    one_sphere,
    slab,
)
from palpate.exports.engine import (
    Drop,
    Engine,
    ExportRequest,
    Fragment,
    ProbeMotion,
    Replayed,
    digits,
    force_error,
    hash_comment,
    is_kelvin_voigt,
    kelvin_voigt,
    template,
    warned,
    with_one_exponent,
    xml_comment,
)
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats

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


@dataclass(frozen=True, slots=True)
class DrakeTip:
    """One sphere of the tip: radius, and how far its centre is above the tip's, m."""

    name: str
    radius: float
    lift: float
    material: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class Parts:
    """What the text is made of; a material's property without a number is a flag.

    Attributes
    ----------
    surface : mapping of str to float or None
        The surface's proximity properties.
    tips : tuple of DrakeTip
        The tip's spheres.
    radius, mass : float
        Of the tip, m and kg.
    width, height : float
        Of the box whose top is the surface, m.
    """

    surface: Mapping[str, float | None]
    tips: tuple[DrakeTip, ...]
    radius: float
    mass: float
    width: float
    height: float


#: By the file: the template of both bodies, the text of a sphere of the tip, the indent of
#: properties, and how one of them is written.
DIALECTS = {
    "contact.sdf": ("drake.sdf", SDF_TIP, "        ", "<drake:{0}>{1}</drake:{0}>"),
    "contact.urdf": ("drake.urdf", URDF_TIP, "      ", '<drake:{0} value="{1}"/>'),
}


def bodies(parts: Parts, file: str, comment: str) -> str:
    """Return both bodies as the text of a file."""
    whole, one, indent, line = DIALECTS[file]

    def properties(material: Mapping[str, float | None]) -> str:
        lines = [
            f"<drake:{name}/>" if value is None else line.format(name, digits(value))
            for name, value in material.items()
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
    # Of a solid sphere; on its slide the tip does not turn.
    worked_out = {"middle": -0.5 * parts.height, "inertia": 0.4 * parts.mass * parts.radius**2}
    texts = {"surface": properties(parts.surface), "tips": "\n".join(tips)}
    return template(whole, comment=comment, parts=parts, **texts, **worked_out)


# A law as Drake's contacts: what is written, what it will do, and what it does.


@dataclass(frozen=True, slots=True)
class Sap:
    """Drake's SAP of one sphere: k (x + τ v)."""

    law: GeneralisedHuntCrossley

    def force(self, penetration: Floats, velocity: Floats, step: float) -> Floats:
        """Return the force, N, once the surface was met where the step [s] began."""
        met = penetration - step * velocity >= -ROUNDING
        force: Floats = np.maximum(self.law.force(penetration, velocity), 0.0) * met
        return force


@dataclass(frozen=True, eq=False, kw_only=True)
class DrakeContact(Fragment):
    """A contact in Drake's text.

    Attributes
    ----------
    parts : Parts
        What the text is made of.
    contact : Spheres, Slab or Sap
        Its force by formula.
    setting : Setting
        How the plant has to be set up beside it.
    heed : tuple of str
        What is easily got wrong with it; a comment in every file.
    """

    # Of a drop on its way down, for the way up may take 20 times as many: some seconds.
    most_steps: ClassVar[int] = 5000
    parts: Parts = field(repr=False)
    contact: Spheres | Slab | Sap = field(repr=False)
    setting: Setting
    heed: tuple[str, ...]

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return both bodies in SDFormat and in URDF, and a script that drops the tip."""
        setting = self.setting
        said = [
            *notes,
            "Drake's plant must be set up beside it:",
            f"MultibodyPlantConfig(time_step={digits(setting.time_step)}, "
            f'contact_model="{setting.contact_model}", '
            f'discrete_contact_approximation="{setting.approximation}")',
            *self.heed,
        ]
        how = {"speed": self.request.motion.fastest, "setting": setting}
        scene = template("drake_scene.py.txt", comment=hash_comment(said), **how)
        texts = {file: bodies(self.parts, file, xml_comment(said)) for file in DIALECTS}
        return {**texts, "scene.py": scene}

    def predicted(self, motion: ProbeMotion) -> Floats:
        """Force by formula, N."""
        return self.contact.force(motion.penetration, motion.velocity, self.setting.time_step)

    def predicted_restitution(self, drop: Drop) -> float:
        """Restitution by the formula and by the plant's own steps."""
        step = self.setting.time_step

        def force(x: float, v: float) -> float:
            return float(self.contact.force(np.array([x]), np.array([v]), step)[0])

        return restitution_by_steps(force, drop, step)

    def replay(self, motion: ProbeMotion) -> Replayed:
        """Return Drake's force at every state of a motion."""
        step = self.setting.time_step
        plant = f"{1e3 * step:.3g} ms, {self.setting.approximation}" if step else "continuous time"
        force = forces(self._plant(self.setting), motion)
        return Replayed(force, f"state by state in a plant of {plant}")

    def drop_restitution(self, drop: Drop) -> float | None:
        """Restitution in Drake, by steps of the time step; None of a drop that takes too many."""
        step = self.setting.time_step
        if step > 0.0 and steps_down(drop, step) > self.most_steps:
            return None
        return simulated_restitution(self._plant(self.setting), drop)

    def _plant(self, setting: Setting) -> Plant:
        return Plant(self.files(())["contact.sdf"], setting)


@dataclass(frozen=True, eq=False, kw_only=True)
class SlabContact(DrakeContact):
    """A rigid sphere on a hydroelastic slab, of which a state takes 3 to 5 ms."""

    most_samples: ClassVar[int] = 500
    most_steps: ClassVar[int] = 200

    def replay(self, motion: ProbeMotion) -> Replayed:
        """Return Drake's force at every state of a motion, which a continuous plant has as such."""
        continuous = replace(self.setting, time_step=0.0)
        return Replayed(forces(self._plant(continuous), motion), "state by state")


# Which contacts carry a law, and how near.

#: The approximation that has Hunt and Crossley's law; "similar" and "tamsi" gave the same digits.
LAGGED = "lagged"
SAP = "sap"
# Of a tip deeper than this fraction of its radius the closed form was not tried.
_DEEPEST = 0.9
#: The other body's stiffness, as a multiple of the contact's: they are in series, and so it changes
#: the eleventh digit.
RIGID = 1e10

_TWO_BODIES = (
    "Stiffnesses of the two bodies are in series, and their dissipations averaged: a body without",
    "properties of its own would soften the contact, so both are written.",
)
_NOT_SAP = (
    "Not for SAP, which ignores the dissipation and takes 0.1 s of relaxation time for each body.",
)
_SAP = (
    "SAP ignores the dissipation. Stiffnesses of the two bodies are in series and their relaxation",
    "times add, 0.1 s each unless set: so both are written, the tip's as 0.",
)


class Drake(Engine):
    """A contact in SDFormat and URDF, with Drake's proximity properties."""

    name: ClassVar[str] = "drake"
    title: ClassVar[str] = "Drake"
    forms: ClassVar[Mapping[str, str]] = {
        "point": "F = k x (1 + d v), one sphere",
        "nested-spheres": "the same from spheres in one another, for n above 1",
        "hydroelastic": "a rigid sphere of the tip's radius on a slab: F near x²",
        "sap": "F = k (x + τ v), Kelvin and Voigt's",
    }
    distribution: ClassVar[str | None] = "drake"
    extra: ClassVar[str] = "peers"
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius"})
    continuous: ClassVar[bool] = True

    def fit(self, request: ExportRequest) -> DrakeContact:
        """Return the law as contacts of Drake, of the form asked for or the one that is nearest.

        Raises
        ------
        InvalidParameterError
            No contact pushes back; or the slab is asked for without the tip's radius, or for a tip
            that is pressed in too deep.
        """
        if request.form == "auto":
            return _nearest(request)
        if request.form == "hydroelastic":
            return _hydroelastic(request)
        if request.form == "sap":
            return _sap(request)
        spheres = _nearest_point(request) if request.form == "point" else _spheres(request)
        return _point(request, request.form, spheres)


def _nearest(request: ExportRequest) -> DrakeContact:
    """By the law: exactly where it is one of Drake's, else the smallest error predicted."""
    law = request.law
    steps = request.time_step > 0.0  # without them there is no SAP
    if steps and is_kelvin_voigt(law) and law.damping > 0.0:
        return _sap(request)
    spheres = _nearest_point(request) if law.exponent <= 1.0 else _spheres(request)
    found = _point(request, "nested-spheres" if spheres.gaps.size > 1 else "point", spheres)
    # SAP's damper does not grow with depth: not for a law of which it grows nearly as the force.
    if steps and law.damping > 0.0 and law.damping_exponent < 0.5 * law.exponent:
        return min(found, _sap(request), key=_error)
    return found


def _error(contact: DrakeContact) -> float:
    motion = contact.request.motion
    law = motion.force_by(contact.request.law)
    return force_error(contact.predicted(motion), law, motion.judged)


def _point(request: ExportRequest, form: str, spheres: Spheres) -> DrakeContact:
    """One sphere on a surface that gives way; or spheres that give way on one that does not.

    Spheres have one centre as long as they fit; of a tip smaller than the gaps the inner ones, a
    tenth of its radius, are raised instead, and hold for a surface below the tip only.
    """

    def material(stiffness: float, dissipation: float) -> dict[str, float]:
        return {"point_contact_stiffness": stiffness, "hunt_crossley_dissipation": dissipation}

    radius, law = request.radius_or_any, request.law
    rigid = material(RIGID * float(spheres.stiffness.sum()), 0.0)
    soft = list(map(material, spheres.stiffness.tolist(), spheres.dissipation.tolist()))
    if len(soft) == 1:
        numbers, parts = soft[0], _parts(request, soft[0], rigid)
    else:
        numbers, tips = {}, []
        for number, (gap, each) in enumerate(zip(spheres.gaps.tolist(), soft, strict=True), 1):
            numbers[f"gap[{number}]"] = gap
            numbers |= {f"{name}[{number}]": value for name, value in each.items()}
            inner = max(radius - gap, 0.1 * radius)
            # From the outer sphere's lowest point upwards.
            tips.append(DrakeTip(f"tip_{number}", inner, gap - (radius - inner), each))
        parts = replace(_parts(request, rigid, {}), tips=tuple(tips))
    exact = law.exponent == 1.0 and (law.damping == 0.0 or law.damping_exponent == 1.0)
    warnings = [*_negative(law), *_step(request)]
    if spheres.gaps[-1] > 0.9 * radius:
        warnings.append(
            "the tip is smaller than it is pressed in: its inner spheres are raised, and hold for "
            "a surface straight below"
        )
    return DrakeContact(
        form=form,
        request=request,
        numbers=numbers,
        exact=exact and law.damping >= 0.0,
        findings=warned(*warnings),
        parts=parts,
        contact=spheres,
        setting=Setting("point", LAGGED, request.time_step),
        heed=(*_TWO_BODIES, *_NOT_SAP),
    )


def _nearest_point(request: ExportRequest) -> Spheres:
    """One sphere: where p = n with the law's own dissipation, which keeps restitution."""
    return one_sphere(_pushing(with_one_exponent(request.law, request.motion, 1.0)))


def _spheres(request: ExportRequest) -> Spheres:
    motion = request.motion
    firm = motion.judged
    return nested_spheres(
        _dissipating(request.law), motion.penetration[firm], motion.velocity[firm]
    )


def _dissipating(law: GeneralisedHuntCrossley) -> GeneralisedHuntCrossley:
    """The law, without a damper that makes energy."""
    if law.damping >= 0.0:
        return law
    return GeneralisedHuntCrossley(law.stiffness, law.exponent, 0.0, law.exponent)


def _pushing(law: GeneralisedHuntCrossley) -> GeneralisedHuntCrossley:
    """The law fitted, which must have a spring."""
    if law.stiffness > 0.0:
        return law
    raise InvalidParameterError(
        f"a law with a stiffness of {law.stiffness:.3g} cannot be a contact of Drake"
    )


def _negative(law: GeneralisedHuntCrossley) -> tuple[str, ...]:
    if law.damping >= 0.0:
        return ()
    return ("the law's damping is negative, which Drake does not take: it is written as 0",)


def _slab(request: ExportRequest) -> Slab:
    """The slab that is nearest to the law, where the tip goes with one."""
    if request.tip_radius is None:
        raise InvalidParameterError(
            "tip_radius is needed for Drake's hydroelastic contact, whose force goes with it: give "
            "that of the tip, as in --tip-radius 5mm, or another form"
        )
    deepest = request.motion.deepest
    if deepest > _DEEPEST * request.tip_radius:
        raise InvalidParameterError(
            f"tip_radius of {1e3 * request.tip_radius:.3g} mm is too small for Drake's "
            f"hydroelastic contact: the tip was pressed {1e3 * deepest:.3g} mm deep; take "
            "another form"
        )
    found = slab(_dissipating(request.law), request.motion, request.tip_radius)
    if found.halvings > FINEST:
        raise InvalidParameterError(
            f"tip_radius of {1e3 * request.tip_radius:.3g} mm is too large for Drake's "
            f"hydroelastic contact: pressed {1e3 * deepest:.3g} mm deep at most, it would need a "
            "mesh finer than can be simulated; take another form"
        )
    return found


def _hydroelastic(request: ExportRequest) -> DrakeContact:
    """A rigid sphere on a compliant box whose medial plane is the slab's bottom.

    Without friction, which would push back on the sphere's flanks as it goes straight in: with the
    coefficient 1 that Drake takes where none is given, by nearly half of the force at 50 mm/s.
    """
    found = _slab(request)
    law = {
        "hydroelastic_modulus": found.modulus,
        "hunt_crossley_dissipation": found.dissipation,
    }
    mesh = {"mesh_resolution_hint": found.resolution_hint}
    smooth = {"mu_dynamic": 0.0, "mu_static": 0.0}
    surface = {"compliant_hydroelastic": None, **law, **smooth}
    tip = {"rigid_hydroelastic": None, **mesh, "hunt_crossley_dissipation": 0.0, **smooth}
    # The medial plane reaches as far as H from the rim.
    width, height = 2.0 * (found.radius + 2.0 * found.thickness), 2.0 * found.thickness
    return SlabContact(
        form="hydroelastic",
        request=request,
        numbers={**law, "box_height": height, **mesh},
        findings=warned(
            *_negative(request.law),
            "written without friction, which would push back on the tip's flanks as it goes "
            "straight in: with a coefficient of 1 the force was nearly half higher at 50 mm/s",
            "the modulus holds for this radius and this box: pressure goes with modulus over "
            "half of its height",
            *_step(request),
        ),
        parts=replace(_parts(request, surface, tip), width=width, height=height),
        contact=found,
        setting=Setting("hydroelastic", LAGGED, request.time_step),
        heed=_NOT_SAP,
    )


def _sap(request: ExportRequest) -> DrakeContact:
    """A surface that gives way, below a tip that does not and whose relaxation time is 0."""
    if request.time_step == 0.0:
        raise InvalidParameterError(
            "time_step must be above 0 for Drake's SAP, which solves for the end of a step"
        )
    law = _pushing(kelvin_voigt(_dissipating(request.law), request.motion))
    surface = {
        "point_contact_stiffness": law.stiffness,
        "relaxation_time": law.damping / law.stiffness,
    }
    tip = {"point_contact_stiffness": RIGID * law.stiffness, "relaxation_time": 0.0}
    return DrakeContact(
        form="sap",
        request=request,
        numbers=surface,
        engine_law=law,
        exact=is_kelvin_voigt(request.law) and request.law.damping >= 0.0,
        findings=warned(*_negative(request.law), *_step(request)),
        parts=_parts(request, surface, tip),
        contact=Sap(law),
        setting=Setting("point", SAP, request.time_step),
        heed=_SAP,
    )


def _parts(
    request: ExportRequest, surface: Mapping[str, float | None], tip: Mapping[str, float | None]
) -> Parts:
    """A tip of one sphere on a box of which the top is the nearest face, as deep as it goes."""
    radius, deepest = request.radius_or_any, request.motion.deepest
    width, height = max(1.0, 10.0 * (radius + deepest)), max(0.2, 4.0 * deepest)
    tips = (DrakeTip("tip", radius, 0.0, tip),)
    return Parts(surface, tips, radius, request.mass_or_one, width, height)


def _step(request: ExportRequest) -> tuple[str, ...]:
    """What an implicit step damps beside the law: h ∂F/∂x, against B xᵖ."""
    law, depth = request.law, request.motion.deepest
    more = request.time_step * law.exponent * law.stiffness * depth ** (law.exponent - 1.0)
    own = max(law.damping, 0.0) * depth**law.damping_exponent
    # From two hundredths of the law's own on; e then changes by about a hundredth.
    if more < 0.02 * own:
        return ()
    return (
        f"a step of {1e3 * request.time_step:.3g} ms damps a body by {more:.2g} N·s/m beside the "
        f"law's {own:.2g} at {1e3 * depth:.3g} mm: where impacts matter take a smaller step, or "
        "time_step=0, a continuous plant",
    )


ENGINE = Drake()
