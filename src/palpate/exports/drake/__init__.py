"""Drake: point contact, spheres in one another, a hydroelastic slab, or SAP."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.exports.asked import Asked
from palpate.exports.drake.contacts import (
    DrakeContact,
    PointContact,
    SapContact,
    SlabContact,
    point_parts,
    sap_parts,
    slab_parts,
)
from palpate.exports.drake.running import Setting
from palpate.exports.drake.slab import FINEST, Slab, slab
from palpate.exports.drake.spheres import Spheres, nested_spheres, one_sphere
from palpate.exports.engine import Engine
from palpate.exports.errors import force_error
from palpate.exports.kelvin_voigt import is_kelvin_voigt
from palpate.exports.nearest import kelvin_voigt, with_exponents
from palpate.force_laws import GeneralisedHuntCrossley

#: The approximation that has Hunt and Crossley's law; "similar" and "tamsi" gave the same digits.
LAGGED = "lagged"
SAP = "sap"
# Of a tip deeper than this fraction of its radius the closed form was not tried.
_DEEPEST = 0.9

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

    def fit(self, asked: Asked) -> DrakeContact:
        """Return the law as contacts of Drake, of the form asked for or the one that is nearest.

        Raises
        ------
        InvalidParameterError
            The stiffness is not above 0; or the slab is asked for without the tip's radius, or for
            a tip that is pressed in too deep.
        """
        _pushing(asked.law)
        if asked.form == "point":
            return _point(asked, "point", _nearest_point(asked))
        if asked.form == "nested-spheres":
            return _point(asked, "nested-spheres", _spheres(asked))
        if asked.form == "hydroelastic":
            return _hydroelastic(asked)
        if asked.form == "sap":
            return _sap(asked)
        return _nearest(asked)


def _nearest(asked: Asked) -> DrakeContact:
    """By the law: exactly where it is one of Drake's, else the smallest error predicted."""
    law = asked.law
    steps = asked.time_step > 0.0  # without them there is no SAP
    if steps and is_kelvin_voigt(law) and law.damping > 0.0:
        return _sap(asked)
    found: DrakeContact
    if law.exponent <= 1.0:
        found = _point(asked, "point", _nearest_point(asked))
    else:
        spheres = _spheres(asked)
        form = "nested-spheres" if spheres.gaps.size > 1 else "point"
        found = _point(asked, form, spheres)
    # SAP's damper does not grow with depth: not for a law of which it grows nearly as the force.
    if steps and law.damping > 0.0 and law.damping_exponent < 0.5 * law.exponent:
        return min(found, _sap(asked), key=_error)
    return found


def _error(contact: DrakeContact) -> float:
    motion = contact.asked.motion
    law = motion.force_by(contact.asked.law)
    return force_error(contact.predicted(motion), law, motion.judged)


def _point(asked: Asked, form: str, spheres: Spheres) -> DrakeContact:
    radius, mass, deepest = _radius(asked), asked.mass_or_one, asked.motion.deepest
    law = asked.law
    one = spheres.gaps.size == 1
    numbers = {}
    for place in range(spheres.gaps.size):
        mark = "" if one else f"[{place + 1}]"
        if not one:
            numbers[f"gap{mark}"] = float(spheres.gaps[place])
        numbers[f"point_contact_stiffness{mark}"] = float(spheres.stiffness[place])
        numbers[f"hunt_crossley_dissipation{mark}"] = float(spheres.dissipation[place])
    exact = law.exponent == 1.0 and (law.damping == 0.0 or law.damping_exponent == 1.0)
    warnings = [*_negative(law), *_step(asked)]
    if spheres.gaps[-1] > 0.9 * radius:
        warnings.append(
            "the tip is smaller than it is pressed in: its inner spheres are raised, and hold for "
            "a surface straight below"
        )
    return PointContact(
        form=form,
        asked=asked,
        numbers=numbers,
        exact=exact and law.damping >= 0.0,
        warnings=tuple(warnings),
        parts=point_parts(spheres, radius, mass, deepest),
        setting=Setting("point", LAGGED, asked.time_step),
        heed=(*_TWO_BODIES, *_NOT_SAP),
        spheres=spheres,
    )


def _nearest_point(asked: Asked) -> Spheres:
    """One sphere: where p = n with the law's own dissipation, which keeps restitution."""
    law, motion = _dissipating(asked.law), asked.motion
    if law.damping_exponent != law.exponent and law.damping > 0.0:
        return one_sphere(_pushing(with_exponents(law, motion, 1.0, 1.0)))
    x, v = motion.penetration[motion.judged], motion.velocity[motion.judged]
    if law.exponent == 1.0:
        return one_sphere(law)
    b = law.damping / law.stiffness
    weight = np.maximum(1.0 + b * v, 0.0) ** 2
    stiffness = (
        law.stiffness
        * float((weight * x ** (law.exponent + 1.0)).sum())
        / float((weight * x**2).sum())
    )
    return one_sphere(GeneralisedHuntCrossley(stiffness, 1.0, stiffness * b, 1.0))


def _spheres(asked: Asked) -> Spheres:
    motion = asked.motion
    firm = motion.judged
    return nested_spheres(_dissipating(asked.law), motion.penetration[firm], motion.velocity[firm])


def _dissipating(law: GeneralisedHuntCrossley) -> GeneralisedHuntCrossley:
    """The law, without a damper that makes energy."""
    if law.damping >= 0.0:
        return law
    return GeneralisedHuntCrossley(law.stiffness, law.exponent, 0.0, law.exponent)


def _pushing(law: GeneralisedHuntCrossley) -> GeneralisedHuntCrossley:
    """The law, which must have a spring."""
    if law.stiffness > 0.0:
        return law
    raise InvalidParameterError(
        f"a law with a stiffness of {law.stiffness:.3g} cannot be a contact of Drake"
    )


def _negative(law: GeneralisedHuntCrossley) -> tuple[str, ...]:
    if law.damping >= 0.0:
        return ()
    return ("the law's damping is negative, which Drake does not take: it is written as 0",)


def _slab(asked: Asked) -> Slab:
    """The slab that is nearest to the law, where the tip goes with one."""
    if asked.tip_radius is None:
        raise InvalidParameterError(
            "tip_radius is needed for Drake's hydroelastic contact, whose force goes with it: give "
            "that of the tip, as in --tip-radius 5mm, or another form"
        )
    deepest = asked.motion.deepest
    if deepest > _DEEPEST * asked.tip_radius:
        raise InvalidParameterError(
            f"tip_radius of {1e3 * asked.tip_radius:.3g} mm is too small for Drake's hydroelastic "
            f"contact: the tip was pressed {1e3 * deepest:.3g} mm deep; take another form"
        )
    found = slab(_dissipating(asked.law), asked.motion, asked.tip_radius)
    if found.halvings > FINEST:
        raise InvalidParameterError(
            f"tip_radius of {1e3 * asked.tip_radius:.3g} mm is too large for Drake's hydroelastic "
            f"contact: pressed {1e3 * deepest:.3g} mm deep at most, it would need a mesh finer "
            "than can be simulated; take another form"
        )
    return found


def _hydroelastic(asked: Asked) -> DrakeContact:
    found = _slab(asked)
    return SlabContact(
        form="hydroelastic",
        asked=asked,
        numbers={
            "hydroelastic_modulus": found.modulus,
            "hunt_crossley_dissipation": found.dissipation,
            "box_height": 2.0 * found.thickness,
            "mesh_resolution_hint": found.resolution_hint,
        },
        warnings=(
            *_negative(asked.law),
            "written without friction, which would push back on the tip's flanks as it goes "
            "straight in: with a coefficient of 1 the force was nearly half higher at 50 mm/s",
            "the modulus holds for this radius and this box: pressure goes with modulus over "
            "half of its height",
            *_step(asked),
        ),
        parts=slab_parts(found, asked.mass_or_one),
        setting=Setting("hydroelastic", LAGGED, asked.time_step),
        heed=_NOT_SAP,
        slab=found,
    )


def _sap(asked: Asked) -> DrakeContact:
    if asked.time_step == 0.0:
        raise InvalidParameterError(
            "time_step must be above 0 for Drake's SAP, which solves for the end of a step"
        )
    law = _pushing(kelvin_voigt(_dissipating(asked.law), asked.motion))
    return SapContact(
        form="sap",
        asked=asked,
        numbers={
            "point_contact_stiffness": law.stiffness,
            "relaxation_time": law.damping / law.stiffness,
        },
        engine_law=law,
        exact=is_kelvin_voigt(asked.law) and asked.law.damping >= 0.0,
        warnings=(*_negative(asked.law), *_step(asked)),
        parts=sap_parts(law, _radius(asked), asked.mass_or_one, asked.motion.deepest),
        setting=Setting("point", SAP, asked.time_step),
        heed=_SAP,
    )


def _step(asked: Asked) -> tuple[str, ...]:
    """What an implicit step damps beside the law: h ∂F/∂x, against B xᵖ."""
    law, depth = asked.law, asked.motion.deepest
    more = asked.time_step * law.exponent * law.stiffness * depth ** (law.exponent - 1.0)
    own = max(law.damping, 0.0) * depth**law.damping_exponent
    # From two hundredths of the law's own on; e then changes by about a hundredth.
    if more < 0.02 * own:
        return ()
    return (
        f"a step of {1e3 * asked.time_step:.3g} ms damps a body by {more:.2g} N·s/m beside the "
        f"law's {own:.2g} at {1e3 * depth:.3g} mm: where impacts matter take a smaller step, or "
        "time_step=0, a continuous plant",
    )


def _radius(asked: Asked) -> float:
    """The tip's; point contact does not look at it, so any that is not all below the surface."""
    return asked.tip_radius or max(0.01, 2.0 * asked.motion.deepest)


ENGINE = Drake()
