"""MuJoCo: which of its ways carries a law, and what it needs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.exports.asked import Asked
from palpate.exports.engine import Engine, Fragment
from palpate.exports.errors import force_error
from palpate.exports.kelvin_voigt import is_kelvin_voigt, stable_step
from palpate.exports.mujoco.fitting import FITS, badness
from palpate.exports.mujoco.fragments import AsCallback, InRows
from palpate.exports.mujoco.robot import NOTHING_PASSIVE, Robot, read
from palpate.exports.mujoco.rows import Rows
from palpate.exports.nearest import kelvin_voigt, with_exponents
from palpate.exports.text import length, percent
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import above_zero

#: The first MuJoCo whose contacts may pull (adhesion of a pair).
PULLS = (3, 11)
# A spring that is off by more than this is worth a word, where it is not at all deep.
_OFF = 0.1
# As is an added mass whose force is more than this, %: a fifth of what is refused.
_HEAVY = 1.0

# %: an exponent below 1 is taken for 1 where that costs less than a pair's own error may be, 0.6.
_NEARLY_ONE = 0.5

_FRICTIONLESS = (
    "the contact is frictionless (condim 1): a condim of 3 would change the force along the normal "
    "under a pyramidal cone, and friction would grow with a pair's adhesion"
)


class MuJoCo(Engine):
    """A law as one contact, as a pair of them, or exactly as a callback."""

    name: ClassVar[str] = "mujoco"
    title: ClassVar[str] = "MuJoCo"
    forms: ClassVar[Mapping[str, str]] = {
        "kelvin-voigt": "F = K x + B v, in one contact",
        "pair": "F = K x^n + B x^p v, in two contacts that may pull (MuJoCo 3.11 and later)",
        "two-contacts": "the same in two contacts that only push, for older versions",
        "callback": "the exact law, in a Python function that is called at every step",
    }
    distribution: ClassVar[str | None] = "mujoco"
    extra: ClassVar[str] = "exports"
    takes: ClassVar[frozenset[str]] = frozenset({"model", "geom"})

    def fit(self, asked: Asked) -> Fragment:
        """Return the law in MuJoCo's numbers, for one body that presses.

        Raises
        ------
        InvalidParameterError
            Neither a mass nor a model and geom are given; a model cannot be used; or the form has
            no such law.
        """
        robot, mobility = _felt(asked)
        asked, lifted = _lifted(_pressed_by(asked, robot, mobility))
        if not asked.law.stiffness > 0.0:
            raise InvalidParameterError(
                f"law must have a stiffness above 0 for MuJoCo, not {asked.law.stiffness:g}"
            )
        form, rows = self._chosen(asked, mobility, 1 if robot is None else robot.contacts)
        if rows is None:
            return _as_callback(asked, mobility, robot)
        made = _in_rows(form, asked, rows, robot)
        made = replace(made, warnings=(*made.warnings, *lifted))
        if self.pulls() or not any(row.adhesion for row in rows.rows):
            return made
        words = f"MuJoCo {self.version()} is too old for the adhesion of a pair: not replayed here"
        return replace(made, runs=False, warnings=(*made.warnings, words))

    def _chosen(self, asked: Asked, mobility: float, contacts: int) -> tuple[str, Rows | None]:
        """The form, and its rows; None of the callback."""
        if asked.form == "callback":
            return asked.form, None
        why = _not_in_rows(asked.law)
        if asked.form == "auto":
            if why:
                return "callback", None
            tried = self._ways(asked.law)
        else:
            if why and asked.form != "kelvin-voigt":
                raise InvalidParameterError(f"form {asked.form}: {why}")
            tried = (asked.form,)
        made = {form: FITS[form](asked.law, asked.motion, mobility, contacts) for form in tried}
        if len(made) == 1:
            return tried[0], made[tried[0]]
        form = min(made, key=lambda each: badness(made[each], asked.law, asked.motion))
        return form, made[form]

    def _ways(self, law: GeneralisedHuntCrossley) -> tuple[str, ...]:
        if is_kelvin_voigt(law):
            return ("kelvin-voigt",)
        if law.damping == 0.0:
            return ("pair",)
        if not self.pulls():
            return ("two-contacts",)
        # A law whose damper is stronger than its spring near the surface pulls there, and so does a
        # pair: where a body leaves, rows that only push may be nearer.
        return ("pair",) if law.damping_exponent >= law.exponent else ("pair", "two-contacts")

    def pulls(self) -> bool:
        """Whether the contacts of the installed version may pull; of the newest, without any."""
        found = self.version()
        if found is None:
            return True
        numbers = [int(part) for part in found.split(".")[:2] if part.isdigit()]
        return tuple(numbers) >= PULLS


def _felt(asked: Asked) -> tuple[Robot | None, float]:
    """The user's model, and Â [1/kg]."""
    if asked.model is not None:
        robot = read(asked.model, asked.geom, asked.motion.deepest)
        return robot, robot.mobility
    if asked.mass is None:
        raise InvalidParameterError(
            "MuJoCo scales a contact by the mass that it feels: give the mass (--mass 1.0), or the "
            "model and the geom that touches (--model robot.xml --geom tip)"
        )
    return None, 1.0 / above_zero("mass", asked.mass)


def _pressed_by(asked: Asked, robot: Robot | None, mobility: float) -> Asked:
    """With the mass that an impact feels, and the time step of the user's model."""
    if robot is None:
        return replace(asked, mass=1.0 / mobility)
    return replace(asked, mass=robot.mass, time_step=robot.time_step)


def _lifted(asked: Asked) -> tuple[Asked, tuple[str, ...]]:
    """With n = 1 where it is just below, as of a law that is identified with n = 1 it may be.

    Rows have n ≥ 1; without this a scatter of n would turn a contact into a callback.
    """
    law, motion = asked.law, asked.motion
    if law.exponent >= 1.0 or asked.form in ("callback", "kelvin-voigt"):
        return asked, ()
    p = 1.0 if law.damping_exponent == law.exponent else law.damping_exponent
    near = with_exponents(law, motion, 1.0, p)
    off = force_error(motion.force_by(near), motion.force_by(law), motion.judged)
    if off > _NEARLY_ONE:
        return asked, ()
    words = f"an exponent of {law.exponent:.4g} is written as 1: {percent(off)} of force from it"
    return replace(asked, law=near), (words,)


def _not_in_rows(law: GeneralisedHuntCrossley) -> str:
    """Why no row carries a law; empty where one does."""
    offered = "take the callback (--form callback), which has the exact law"
    if law.exponent < 1.0:
        return f"a contact of MuJoCo's has no exponent below 1, as {law.exponent:g} is: {offered}"
    if law.damping < 0.0:
        return f"a contact of MuJoCo's has no damping below 0: {offered}"
    if law.damping > 0.0 and law.damping_exponent < 0.0:
        return f"a contact of MuJoCo's has no damper that falls with depth: {offered}"
    return ""


def _as_callback(asked: Asked, mobility: float, robot: Robot | None) -> AsCallback:
    law = asked.law
    chosen = _not_in_rows(law) if asked.form == "auto" else ""
    warnings = [f"{chosen.partition(':')[0]}: so it is a callback"] if chosen else []
    warnings.append(
        "mjcb_passive is one for all models, and none can be compiled while it is installed; it is "
        "Python at every step, some 20 µs of it"
    )
    refusals = () if robot is None else robot.refusals
    if robot is not None and robot.contacts > 1:
        refusals = (*refusals, "the callback pushes at one point: give it a round tip")
    if robot is not None and not robot.passive:
        refusals = (*refusals, NOTHING_PASSIVE)
    numbers = {"K": law.stiffness, "n": law.exponent, "B": law.damping, "p": law.damping_exponent}
    return AsCallback(
        form="callback",
        asked=asked,
        numbers=numbers,
        engine_law=law,
        exact=True,
        largest_step=stable_step(law, asked.mass_or_one, asked.motion.deepest),
        warnings=tuple(warnings),
        refusals=refusals,
        mobility=mobility,
        robot=robot,
    )


def _in_rows(form: str, asked: Asked, rows: Rows, robot: Robot | None) -> InRows:
    law, deepest = asked.law, asked.motion.deepest
    engine_law = kelvin_voigt(law, asked.motion) if form == "kelvin-voigt" else law
    warnings = [_FRICTIONLESS, *_about(form, asked, rows)]
    refusals = _too_narrow(rows, deepest)
    if robot is not None:
        warnings += robot.warnings
        refusals += robot.refusals
        if not robot.passive and any(row.adhesion for row in rows.rows):
            refusals += (NOTHING_PASSIVE,)
    return InRows(
        form=form,
        asked=asked,
        numbers=_numbers(rows),
        engine_law=engine_law,
        largest_step=stable_step(engine_law, asked.mass_or_one, deepest),
        warnings=tuple(warnings),
        refusals=refusals,
        mobility=rows.mobility,
        robot=robot,
        rows=rows,
    )


def _numbers(rows: Rows) -> dict[str, float]:
    """Every number of the pairs by its name in MJCF."""
    found = {"inverse mass": rows.mobility}
    for k, row in enumerate(rows.rows):
        found |= {f"pair{k} solref[0]": -row.spring, f"pair{k} solref[1]": -row.damper}
        found |= {f"pair{k} solimp[{i}]": value for i, value in enumerate(row.solimp)}
        found |= {f"pair{k} margin": -row.inset, f"pair{k} adhesion": row.adhesion}
    return found


def _about(form: str, asked: Asked, rows: Rows) -> tuple[str, ...]:
    """What is peculiar to a form."""
    mass = (
        f"the numbers hold for a contact of {1.0 / rows.mobility:.4g} kg (the inverse of "
        "body_invweight0 of both bodies): another body needs another export"
    )
    if form == "kelvin-voigt":
        return (mass,)
    words = [mass]
    rising = [row for row in rows.rows if row.solimp[0] < row.solimp[1]]
    if rising:
        widest = min(row.solimp[2] + row.inset for row in rising)
        words.append(f"deeper than {length(widest, 3)} the force no longer follows the law")
    law = asked.law
    heavy = _added(asked, rows)
    if heavy > _HEAVY:
        words.append(
            f"the mass that the contacts add comes to {percent(heavy)} of force on this motion: a "
            "lighter body, a slower motion or the callback has less of it"
        )
    if form == "pair" and law.damping:
        words += _pulls(law, float(np.median(asked.motion.penetration[asked.motion.judged])), rows)
    shallow = _shallow(asked.law, rows, asked.motion.deepest)
    if shallow:
        words.append(
            f"shallower than {length(shallow, 2)} the force at rest is off by more than "
            f"{100 * _OFF:.0f} %"
        )
    return tuple(words)


def _pulls(law: GeneralisedHuntCrossley, depth: float, rows: Rows) -> tuple[str, ...]:
    """From which speed on a pair pulls, with what, and what does not."""
    rising = law.exponent - law.damping_exponent
    speed = law.stiffness / law.damping * depth**rising
    where = " (K/B)" if rising == 0.0 else f" from a depth of {length(depth, 2)}"
    where += " or, nearer the surface, at less" if rising > 0.0 else ""
    most = rows.contacts * max(row.adhesion for row in rows.rows)
    return (
        f"withdrawn faster than {rounded(speed, 2)} m/s{where}, the pair pulls, by up to "
        f"{rounded(most, 2)} N, which a real contact does not: for such motions take the callback, "
        "or two-contacts (--form), whose force is never below 0",
        "MJX ignores the adhesion of a pair: the form for MJX is two-contacts (--form)",
    )


def _added(asked: Asked, rows: Rows) -> float:
    """Of Σ m_a ẍ against the law's force on the motion, %."""
    motion = asked.motion
    pushed = rows.added_mass(motion.penetration) * motion.acceleration
    law = motion.force_by(asked.law)
    return force_error(law + pushed, law, motion.judged)


def _shallow(law: GeneralisedHuntCrossley, rows: Rows, deepest: float) -> float:
    """Depth [m] above which the force at rest is off by a tenth and more; 0 where it is not."""
    depths = np.geomspace(1e-3, 1.0, 300) * deepest
    still = np.zeros_like(depths)
    off = np.abs(rows.force(depths, still, still) / law.force(depths, still) - 1.0) > _OFF
    # A body that rests so near the surface has a hundredth of the depth at most to be off by.
    off &= depths > 0.01 * deepest
    return float(depths[off].max()) if off.any() else 0.0


def _too_narrow(rows: Rows, deepest: float) -> tuple[str, ...]:
    """Refuse a width within the recording, beyond which the impedance stands still."""
    for row in rows.rows:
        low, high, width = row.solimp[:3]
        if low < high and width + row.inset < deepest:
            return (
                f"the width of solimp, {1e3 * width:.3g} mm, is less than the recorded depth of "
                f"{1e3 * deepest:.3g} mm",
            )
    return ()


ENGINE = MuJoCo()
