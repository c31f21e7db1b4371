"""MuJoCo: the choice of a form of contact for a law, its files, its predicted and replayed force.

A law becomes one contact or two coincident ones (rows of MuJoCo's solver), or a Python callback.
The fragments come first, then the engine with its forms and warnings.
"""

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.exports.engine import Engine, Fragment, Replayed, make_refusals, make_warnings
from palpate.exports.motion import ExportRequest, ProbeMotion
from palpate.exports.mujoco import callback
from palpate.exports.mujoco.checking import write_law
from palpate.exports.mujoco.fitting import FITS, MOST_STEPS, PairRows, drop_restitution, misfit_to
from palpate.exports.mujoco.robot import (
    NOTHING_PASSIVE,
    TIP,
    ContactNames,
    Placement,
    PressableModel,
    Robot,
    engine_here,
    pressable,
    read,
    sections,
)
from palpate.exports.nearest_law import (
    fit_with_exponents,
    is_kelvin_voigt,
    kelvin_voigt,
    stable_step,
)
from palpate.exports.replay_errors import Drop, drop_to, force_error, half_period
from palpate.exports.texts import law_numbers, length, percent, template, xml_comment
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats, above_zero


@dataclass(frozen=True, eq=False, kw_only=True)
class InMuJoCo(Fragment):
    """The common part of contacts and callback: the surface's placement and the minimal scene.

    Attributes
    ----------
    rows : PairRows
        The law as one contact or several coincident ones; empty for a callback.
    robot : Robot, optional
        The user's own model.
    runs : bool
        Whether the installed MuJoCo supports the contact. Default: True.
    """

    rows: PairRows
    robot: Robot | None = None
    runs: bool = True

    @property
    def paste(self) -> str:
        """What to do with the files."""
        begin = "load robot_scene.xml, which includes your model and contact.xml"
        if self.robot is None:
            begin = f'include contact.xml in your model, name its geom "{TIP}"'
        return f"{begin}, put the pads on your surface, which must not collide with the tip itself"

    @property
    def mobility(self) -> float:
        """Â, 1/kg; for the body of the minimal scene 1/mass."""
        return self.rows.mobility

    @property
    def tip(self) -> str:
        """Name of the touching geom."""
        return TIP if self.robot is None else self.robot.geom

    @property
    def names(self) -> ContactNames:
        """Names of its surfaces and pairs."""
        return ContactNames.of(self.request.name)

    def scene(self, speed: float, notes: Sequence[str] = ()) -> str:
        """Return the minimal scene, a body that arrives at a speed [m/s]."""
        n = self.rows.contacts
        depth = self.request.motion.deepest
        rows = [
            replace(row, spring=n * row.spring, damper=n * row.damper, adhesion=n * row.adhesion)
            for row in self.rows.rows
        ]
        numbers = {"time_step": self.request.time_step, "radius": max(0.03, 2.0 * depth)}
        numbers |= {"mass": 1.0 / self.mobility, "velocity": -speed}
        law = write_law(self.request, PairRows(tuple(rows), self.mobility), None)
        both = sections(rows, TIP, Placement(), self.names, law)
        return template("mujoco_scene.xml", comment=xml_comment(notes), **both, **numbers)

    def fragment(self, notes: Sequence[str]) -> str:
        """Return the XML to paste or include into a model; without rows the surface only."""
        place = Placement() if self.robot is None else self.robot.place
        law = write_law(self.request, self.rows, self.robot)
        both = sections(self.rows.rows, self.tip, place, self.names, law)
        option = f"  <option{both['cone']}/>\n" if both["cone"] else ""
        return template("mujoco_fragment.xml", comment=xml_comment(notes), option=option, **both)

    def pressable(self) -> PressableModel:
        """Return the user's model with the fragment, or the minimal scene."""
        if (robot := self.robot) is not None:
            return pressable(robot.path, robot.geom, self.rows.rows, robot.place, self.names)
        model = engine_here().MjModel.from_xml_string(self.scene(0.0))
        return PressableModel(model, TIP, Placement(), self.names.pads)

    def contact(self, model: Any, tip: str) -> AbstractContextManager[Any]:
        """Return a context that installs what the XML cannot contain; here nothing."""
        return nullcontext()

    def replay(self, motion: ProbeMotion) -> Replayed | None:
        """Return the force by inverse dynamics, in the user's own model if there is one."""
        if not self.runs:
            return None
        pressable = self.pressable()
        with self.contact(pressable.model, self.tip) as contact:
            force = pressable.along_motion(motion, contact)
        where = "" if self.robot is None else f", in {self.robot.path.name}"
        return Replayed(force, f"by mj_inverse, state by state{where}")

    def drop_restitution(self, drop: Drop) -> float | None:
        """Return the restitution in the minimal scene, for a body of mass 1/Â; 0 if it stays.

        None if the impact would take more steps than palpate simulates.
        """
        if not self.runs or not math.isclose(drop.mass * self.mobility, 1.0, rel_tol=1e-6):
            return None
        duration = half_period(self.request.law, drop.mass, drop.depth)
        if 4.0 * duration > MOST_STEPS * self.request.time_step:
            return None
        mujoco = engine_here()
        model = mujoco.MjModel.from_xml_string(self.scene(drop.speed))
        with self.contact(model, TIP):
            data = mujoco.MjData(model)
            mujoco.mj_resetDataKeyframe(model, data, 0)
            first = float(data.qvel[0])
            for _ in range(MOST_STEPS):
                mujoco.mj_step(model, data)
                if data.qpos[0] >= 0.0:
                    return max(float(data.qvel[0]), 0.0) / -first
        return 0.0

    def _files(self, first: Mapping[str, str], notes: Sequence[str]) -> Mapping[str, str]:
        law = self.request.law
        deepest = self.request.motion.deepest
        speed = drop_to(law, 1.0 / self.mobility, deepest).speed if law.K > 0.0 else 0.1
        files = {**first, "scene.xml": self.scene(speed, notes)}
        if self.robot is not None and self.robot.path.suffix == ".xml":
            here = [
                *notes,
                'Load it with mujoco.MjModel.from_xml_path("robot_scene.xml"); it includes '
                f"{self.robot.path.name} and contact.xml.",
                "Remove your own surface or exclude its collision with the tip: else both push.",
            ]
            files["robot_scene.xml"] = self.robot.scene(here)
        return files


@dataclass(frozen=True, eq=False, kw_only=True)
class InRows(InMuJoCo):
    """A law as one contact, or as several coincident ones."""

    @property
    def paste(self) -> str:
        """What to do with the files."""
        return f"{super().paste}; then palpate export --check MODEL.xml"

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return the XML of surfaces and pairs, and scenes that contain it."""
        return self._files({"contact.xml": self.fragment(notes)}, notes)

    def predict_force(self, motion: ProbeMotion) -> Floats:
        """Return the force of the rows, N: the fitted law plus Σ m_a ẍ."""
        return self.rows.force(motion.penetration, motion.velocity, motion.acceleration)

    def predict_restitution(self, drop: Drop) -> float:
        """Return the restitution of the rows at the time step, or at a longer one if that is fine.

        A step of a thousandth of an impact has no effect on it.
        """
        fine = half_period(self.request.law, drop.mass, drop.depth) / 1000.0
        return drop_restitution(self.rows, drop, max(self.request.time_step, fine))


@dataclass(frozen=True, eq=False, kw_only=True)
class AsCallback(InMuJoCo):
    """The exact law as a Python callback, called at every step."""

    @property
    def paste(self) -> str:
        """What to do with the files."""
        return f"{super().paste}; step inside palpate_contact.ExactContact(model)"

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return the Python module, its parameters as JSON, and a scene."""
        # Names from a model are untrusted: none of them enters the source, not even as a comment.
        source = Path(str(callback.__file__)).read_text(encoding="utf-8")
        numbers = json.dumps({**self._numbers(self.tip), "notes": list(notes)}, indent=1)
        files = {"palpate_contact.py": source, "palpate_contact.json": numbers + "\n"}
        if self.robot is not None:
            files["contact.xml"] = self.fragment(notes)
        return self._files(files, notes)

    def _numbers(self, tip: str) -> dict[str, Any]:
        return {**law_numbers(self.request.law), "tip": tip, "pad": self.names.pads[0]}

    def contact(self, model: Any, tip: str) -> AbstractContextManager[Any]:
        """Return a context with the callback installed, which adds a passive force."""
        return callback.ExactContact(model, self._numbers(tip))


# The choice of the form, and its warnings.

#: First version of MuJoCo whose contacts can pull (adhesion of a pair).
PULLS = (3, 11)
# Relative error of the spring at shallow depths above which palpate warns.
_OFF = 0.1
# Force error by the added mass, %, above which palpate warns: a fifth of the limit for refusals.
_HEAVY = 1.0

# An exponent below 1 is replaced by 1 if that changes the force by less, %.
_NEARLY_ONE = 0.5

_FRICTIONLESS = (
    "the contact is frictionless (condim 1): add --friction; with condim 3 alone a pyramidal cone "
    "changes the normal force"
)
_CONE = (
    'the friction needs cone="elliptic" and a large impratio, which contact.xml sets for the whole '
    "model: other contacts there creep less"
)
_OF_THE_SPRING = "the friction of a pair is that of its spring's force, without the damper's"
_NO_FRICTION = "the callback is frictionless: omit friction, or export to drake"
_ONE_FOR_ALL = (
    "MuJoCo has one mjcb_passive for all models, and Python cannot compile a model while it is "
    "installed; the callback takes some 20 µs of Python per step"
)


class MuJoCo(Engine):
    """A law as one contact, as a pair of them, or exactly as a callback."""

    name: ClassVar[str] = "mujoco"
    title: ClassVar[str] = "MuJoCo"
    forms: ClassVar[Mapping[str, str]] = {
        "kelvin-voigt": "F = K x + B v, in one contact",
        "pair": "F = K x^n + B x^p v, in two contacts that can pull (MuJoCo 3.11 and later)",
        "two-contacts": "the same in two contacts that only push, for older versions",
        "callback": "the exact law, in a Python function called at every step",
    }
    distribution: ClassVar[str | None] = "mujoco"
    extra: ClassVar[str] = "exports"
    exact_form: ClassVar[str] = "callback"
    rows_class: ClassVar[type[InRows]] = InRows
    takes: ClassVar[frozenset[str]] = frozenset({"model", "geom", "friction", "name"})

    def fit(self, request: ExportRequest) -> Fragment:
        """Return the law in MuJoCo's parameters, for one pressing body.

        Raises
        ------
        InvalidParameterError
            Both the mass and the model with its geom are missing; the model cannot be used; or the
            form cannot represent the law.
        """
        request, robot, mobility = _effective_mass(request)
        request, lifted = _raise_exponent(request)
        form, rows = self._chosen(request, mobility, 1 if robot is None else robot.contacts)
        rows = rows.with_friction(request.friction, request.time_step)
        law = request.law
        deepest = request.motion.deepest
        engine_law = kelvin_voigt(law, request.motion) if form == "kelvin-voigt" else law
        pulls = any(row.adhesion for row in rows.rows)
        runs = self.pulls() or not pulls
        refusals = _too_narrow(rows, deepest)
        if robot is not None:
            if form == "callback" and robot.contacts > 1:
                refusals.append("the callback pushes at one point: choose a spherical tip geom")
            if not robot.passive and (pulls or form == "callback"):
                refusals.append(NOTHING_PASSIVE)
        if form == "callback":
            numbers = dict(zip("KnBp", law_numbers(law).values(), strict=True))
            warnings = []
            if request.form == "auto":
                warnings.append(f"{_not_in_rows(law).partition(':')[0]}; exported as a callback")
            warnings.append(_ONE_FOR_ALL)
        else:
            numbers = _numbers(rows)
            warnings = [*_about(form, request, rows), *lifted]
            if not runs:
                warnings.append(
                    f"MuJoCo {self.version()} is too old for the adhesion of a pair, so palpate "
                    "did not replay it"
                )
        own = () if robot is None else robot.findings
        if form == "callback":  # warnings about rows do not apply to its one point
            own = tuple(each for each in own if each.severity == "do-not-trust")
        return (AsCallback if form == "callback" else self.rows_class)(
            form=form,
            request=request,
            numbers=numbers,
            engine_law=engine_law,
            exact=form == "callback",
            largest_step=stable_step(engine_law, request.mass_or_one, deepest),
            findings=(*own, *make_warnings(*warnings), *make_refusals(*refusals)),
            rows=rows,
            robot=robot,
            runs=runs,
        )

    def _chosen(
        self,
        request: ExportRequest,
        mobility: float,
        contacts: int,
    ) -> tuple[str, PairRows]:
        """Return the form and its rows; a callback has no rows."""
        why = _not_in_rows(request.law)
        auto = request.form == "auto" and "callback" in self.forms
        if request.form == "callback" or (auto and why):
            if request.friction:
                raise InvalidParameterError(f"friction: {_NO_FRICTION}")
            return "callback", PairRows((), mobility)
        if why and request.form != "kelvin-voigt":
            raise InvalidParameterError(f"form {request.form}: {why}")
        tried = self._ways(request.law) if request.form == "auto" else (request.form,)
        made = {form: FITS[form](request.law, request.motion, mobility, contacts) for form in tried}
        if len(made) == 1:
            return tried[0], made[tried[0]]
        misfit = misfit_to(request.law, request.motion, 1.0 / mobility)
        form = min(made, key=lambda each: misfit(made[each]))
        return form, made[form]

    def _ways(self, law: GeneralisedHuntCrossley) -> tuple[str, ...]:
        if is_kelvin_voigt(law):
            return ("kelvin-voigt",)
        if law.B == 0.0:
            return ("pair",)
        if not self.pulls():
            return ("two-contacts",)
        # A law whose damper exceeds its spring near the surface is adhesive there, and so is a
        # pair: when a body leaves, rows that only push may be nearer.
        return ("pair",) if law.p >= law.n else ("pair", "two-contacts")

    def pulls(self) -> bool:
        """Whether contacts can pull in the installed version, or without one in the newest."""
        found = self.version()
        if found is None:
            return True
        numbers = [int(part) for part in found.split(".")[:2] if part.isdigit()]
        return tuple(numbers) >= PULLS


def _effective_mass(request: ExportRequest) -> tuple[ExportRequest, Robot | None, float]:
    """Return the request with effective mass and time step; the user's model; and Â [1/kg]."""
    if request.model is not None:
        names = ContactNames.of(request.name)
        robot = read(request.model, request.geom, request.motion.deepest, names)
        return replace(request, mass=robot.mass, time_step=robot.time_step), robot, robot.mobility
    if request.mass is None:
        raise InvalidParameterError(
            "MuJoCo scales a contact with the effective mass: add --mass, such as --mass 1.0, or "
            "your model and its touching geom, such as --model robot.xml --geom tip"
        )
    mobility = 1.0 / above_zero("mass", request.mass)
    return replace(request, mass=1.0 / mobility), None, mobility


def _raise_exponent(request: ExportRequest) -> tuple[ExportRequest, tuple[str, ...]]:
    """Return the request with n = 1 if n is just below 1, and a warning.

    Rows have n ≥ 1; without this a small statistical error of n would turn contacts into callbacks.
    """
    law = request.law
    motion = request.motion
    if law.n >= 1.0 or request.form in ("callback", "kelvin-voigt"):
        return request, ()
    p = 1.0 if law.p == law.n else law.p
    with_exponents = fit_with_exponents(law, motion, 1.0, p)
    off = force_error(motion.force_by(with_exponents), motion.force_by(law), motion.judged)
    if off > _NEARLY_ONE:
        return request, ()
    text = f"exponent {law.n:.4g} is exported as 1: the force changes by {percent(off)}"
    return replace(request, law=with_exponents), (text,)


def _not_in_rows(law: GeneralisedHuntCrossley) -> str:
    """Return why rows cannot represent a law; empty if they can."""
    offered = "use --to mujoco --form callback, which has the exact law"
    if law.n < 1.0:
        return f"a MuJoCo contact needs an exponent of at least 1, not {law.n:g}: {offered}"
    if law.B < 0.0:
        return f"a MuJoCo contact cannot have negative damping: {offered}"
    if law.B > 0.0 and law.p < 0.0:
        return f"a MuJoCo contact cannot have a damper that decreases with depth: {offered}"
    return ""


def _numbers(rows: PairRows) -> dict[str, float]:
    """Return the parameters of the pairs by their names in MJCF."""
    found = {"inverse mass": rows.mobility}
    for k, row in enumerate(rows.rows):
        found |= {f"pair{k} solref[0]": -row.spring, f"pair{k} solref[1]": -row.damper}
        found |= {f"pair{k} solimp[{i}]": value for i, value in enumerate(row.solimp)}
        found |= {f"pair{k} margin": -row.inset, f"pair{k} adhesion": row.adhesion}
    return found


def _about(form: str, request: ExportRequest, rows: PairRows) -> list[str]:
    """Return the warnings of a form."""
    phrases = [
        _CONE if request.friction else _FRICTIONLESS,
        f"the parameters are for an effective mass of {1.0 / rows.mobility:.4g} kg (the inverse of "
        "body_invweight0 of both bodies): export again for another body",
    ]
    if form == "kelvin-voigt":
        return phrases
    law = request.law
    motion = request.motion
    widths = (row.solimp[2] + row.inset for row in rows.rows if row.solimp[0] < row.solimp[1])
    if widest := min(widths, default=0.0):
        phrases.append(
            f"at depths of more than {length(widest, 3)} the force does not follow the law"
        )
    force = motion.force_by(law)
    pushed = rows.added_mass(motion.penetration) * motion.acceleration
    heavy = force_error(force + pushed, force, motion.judged)
    if heavy > _HEAVY:
        phrases.append(
            f"the mass that the contacts add changes the force by {percent(heavy)} on this motion: "
            "a lighter body, a slower motion or --form callback reduces it"
        )
    if form == "pair" and request.friction:
        phrases.append(_OF_THE_SPRING)
    if form == "pair" and law.B:
        phrases += _pulls(law, motion, rows)
    if shallow := _shallow(law, rows, motion.deepest):
        phrases.append(
            f"at depths of less than {length(shallow, 2)} the force at rest is off by more than "
            f"{100 * _OFF:.0f} %"
        )
    return phrases


def _pulls(
    law: GeneralisedHuntCrossley,
    motion: ProbeMotion,
    rows: PairRows,
) -> tuple[str, ...]:
    """Return warnings about the speed from which a pair pulls and its largest adhesive force."""
    rising = law.n - law.p
    depth = float(np.median(motion.penetration[motion.judged]))
    speed = law.K / law.B * depth**rising
    where = " (K/B)" if rising == 0.0 else f" from a depth of {length(depth, 2)}"
    where += " (nearer the surface at lower speeds)" if rising > 0.0 else ""
    most = rows.contacts * max(row.adhesion for row in rows.rows)
    withdrawn = -float(motion.velocity[motion.judged].min())
    near = "; twice the recorded speed is faster" if 2.0 * withdrawn > speed else ""
    return (
        f"when withdrawn faster than {rounded(speed, 2)} m/s{where}, the pair pulls with up to "
        f"{rounded(most, 2)} N, unlike a real contact: for such motions use --form callback or "
        f"--form two-contacts, which never pull{near}",
        "MJX ignores the adhesion of a pair: for MJX export --to mjx",
    )


def _shallow(law: GeneralisedHuntCrossley, rows: PairRows, deepest: float) -> float:
    """Return the depth [m] up to which the force at rest is off by more than a tenth; else 0."""
    depths = np.geomspace(1e-3, 1.0, 300) * deepest
    still = np.zeros_like(depths)
    off = np.abs(rows.force(depths, still, still) / law.force(depths, still) - 1.0) > _OFF
    # Ignore the first hundredth of the depth, where a resting body can be off by no more than that.
    off &= depths > 0.01 * deepest
    return float(depths[off].max()) if off.any() else 0.0


def _too_narrow(rows: PairRows, deepest: float) -> list[str]:
    """Refuse a width less than the recorded depth, beyond which the impedance is constant."""
    for row in rows.rows:
        low, high, width = row.solimp[:3]
        if low < high and width + row.inset < deepest:
            return [
                f"the width of solimp, {1e3 * width:.3g} mm, is less than the recorded depth of "
                f"{1e3 * deepest:.3g} mm"
            ]
    return []


ENGINE = MuJoCo()
