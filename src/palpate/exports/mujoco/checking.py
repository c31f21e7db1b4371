"""``palpate export --check``: the exported contacts of a finished model, as it now is.

An export writes its law, its pairs and the mass it is for into a text of the model, which MuJoCo
keeps. The check compiles the model, moves each contact over the recorded depths and speeds, and
compares the force of MuJoCo's forward dynamics with the law. Then it puts back one thing after the
other as it was exported, and reports what moves the error.
"""

import json
import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.exports.motion import ExportRequest, ProbeMotion
from palpate.exports.mujoco.fitting import PairRows
from palpate.exports.mujoco.robot import (
    ContactNames,
    Placement,
    PressableModel,
    Robot,
    chain,
    chain_ids,
    compile_spec,
    engine_here,
    normals,
    read_spec,
)
from palpate.exports.nearest_law import stable_step
from palpate.exports.replay_errors import force_error
from palpate.exports.texts import law_numbers, length
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats, finite_or_none, frozen

#: Largest force error, %, of a contact that passes the check.
MOST_PERCENT = 5.0
# States at which the force is compared.
_STATES = 400
# A cause is reported if the error is lower by more than this without it, percentage points.
_MOVES = 0.5
# MuJoCo writes six digits of a number.
_SAME = 1e-4
# Distance beyond which a tip is not looked for, m.
_FAR_AWAY = 100.0

# What an export writes into a model, and how it is found again.


def write_law(request: ExportRequest, rows: PairRows, robot: Robot | None) -> str:
    """Return the law of an export, its pairs, and the mass and motion it is for, as JSON."""
    motion = request.motion
    mass = 1.0 / rows.mobility
    return json.dumps(
        {
            "material": request.material,
            **law_numbers(request.law),
            "depths": [motion.shallowest, motion.deepest],
            "speed": motion.fastest,
            "mobility": rows.mobility,
            "masses": [mass] if robot is None else robot.masses,
            "armature": [0.0] if robot is None else robot.armature,
            "friction": request.friction,
            "pairs": [
                [-row.spring, -row.damper, *row.solimp, -row.inset, row.adhesion]
                for row in rows.rows
            ],
        }
    )


@frozen
class WrittenLaw:
    """An exported contact as its model's text has it.

    Attributes
    ----------
    names : ContactNames
        The names of its surfaces and pairs.
    material : str
        What the law is of.
    law : GeneralisedHuntCrossley
        The exported law.
    speed : float
        Largest speed of the recorded motion, m/s.
    mobility : float
        Â that the pairs are for, 1/kg.
    depths : tuple of float
        Smallest and largest penetration of that motion, m.
    masses, armature : tuple of float
        Of the bodies, kg, and of the joints, from the world to the tip.
    pairs : tuple of tuple of float
        solref, solimp, margin and adhesion of each pair.
    friction : float
        Coefficient of friction of the pairs without adhesion.
    """

    names: ContactNames
    material: str
    law: GeneralisedHuntCrossley
    speed: float
    mobility: float
    depths: tuple[float, ...]
    masses: tuple[float, ...]
    armature: tuple[float, ...]
    pairs: tuple[tuple[float, ...], ...]
    friction: float

    @classmethod
    def read(cls, name: str, text: str) -> "WrittenLaw":
        """Return the contact of a text of a model.

        Raises
        ------
        InvalidParameterError
            The text is damaged.
        """
        try:
            found = json.loads(text)
            k, n, b, p = (float(found[each]) for each in "KnBp")
            depths, masses, armature = (tuple(map(float, found[each])) for each in _LISTS)
            pairs = tuple(tuple(map(float, pair)) for pair in found["pairs"])
            speed = float(found["speed"])
            mobility = float(found["mobility"])
            friction = float(found["friction"])
            positive = *depths, mobility, k
            sound = 0.0 < min(positive) and max(*positive, speed, friction) < _HUGE
            sound = sound and min(speed, friction) >= 0.0
            shaped = len(depths) == 2 and {len(pair) for pair in pairs} == {9}
            if not (sound and shaped and 0.0 < n < _STEEPEST and abs(p) < _STEEPEST):
                raise ValueError("its numbers are out of range")
            names = ContactNames(name.removesuffix(_SUFFIX))
            law = GeneralisedHuntCrossley(K=k, n=n, B=b, p=p)
            made = names, str(found["material"]), law, speed, mobility
            return cls(*made, depths, masses, armature, pairs, friction)
        except (ValueError, LookupError, TypeError, RecursionError) as error:
            raise InvalidParameterError(
                f"the text {name} of the model is damaged ({error}): export the law again"
            ) from None

    @property
    def title(self) -> str:
        """Name for the user: the material, and its names' prefix if it has its own."""
        own = self.names.prefix != ContactNames().prefix
        return " ".join([self.material or "a law", *([f"({self.names.prefix})"] if own else [])])

    def motion(self) -> ProbeMotion:
        """Return the paper's motion, scaled to the recorded depths and the largest speed."""
        paper = ProbeMotion.of_paper().firm(_STATES)
        shallowest, deepest = self.depths
        size = (deepest - shallowest) / (paper.deepest - paper.shallowest)
        scaled = replace(
            paper,
            penetration=shallowest + size * (paper.penetration - paper.shallowest),
            velocity=size * paper.velocity,
            acceleration=size * paper.acceleration,
        )
        moves = size > 0.0 and self.speed > 0.0
        return scaled.faster(self.speed / scaled.fastest) if moves else scaled


_SUFFIX = "_law"
_LISTS = ("depths", "masses", "armature")
_HUGE = 1e30
_STEEPEST = 10.0  # exponent of a law


def _read_laws(spec: Any, path: Path) -> list[WrittenLaw]:
    mark = ContactNames().prefix
    texts = [t for t in spec.texts if mark in t.name and t.name.endswith(_SUFFIX)]
    if not texts:
        raise InvalidParameterError(
            f"{path.name} has no contact that palpate export wrote: its text {mark}{_SUFFIX} is "
            "missing (a callback has none); include contact.xml"
        )
    return [WrittenLaw.read(text.name, text.data) for text in texts]


# The force of the contact in the model, by forward dynamics.


def _press(model: Any, tip: str, pads: Sequence[str]) -> PressableModel | None:
    """Return the model with its surfaces against the tip; None if the tip cannot be pressed."""
    mujoco = engine_here()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)  # the replay drives
    pressed = PressableModel(model, tip, Placement(), pads)
    turned = pressed.data.geom_xmat[pressed.tip].reshape(3, 3)
    pad = pressed.data.geom_xmat[pressed.pads[0]].reshape(3, 3)
    own_first = np.vstack([pad[:, 2], normals(pressed.shape, turned)])
    return pressed if pressed.touches(own_first) else None


def _forward_force(pressed: PressableModel, motion: ProbeMotion) -> Floats:
    """Return the force at every state of a motion, N, by the model's own solver.

    The force that inverse dynamics needs for the motion is applied, and forward dynamics solves for
    the contacts: solver, iterations, flags and cone count as in a simulation.
    """
    mujoco = pressed.mujoco
    data = pressed.data
    out = pressed.along()
    force = np.zeros(len(motion))
    states = zip(motion.penetration, motion.velocity, motion.acceleration, strict=True)
    for k, (x, v, a) in enumerate(states):
        pressed.sink(float(x))
        data.qvel[:] = -v * out
        data.qacc[:] = -a * out
        mujoco.mj_inverse(pressed.model, data)
        data.qfrc_applied[:] = data.qfrc_inverse
        mujoco.mj_forward(pressed.model, data)
        force[k] = pressed.force()
    return force


# What can differ from the export; each puts one thing back in a model and returns what it was.


def _put_back_armature(model: Any, contact: WrittenLaw, tip: int) -> str:
    _, joints = chain_ids(model, tip)
    now = chain(model, tip)[1]
    was = contact.armature if len(contact.armature) == len(joints) else (0.0,) * len(joints)
    if np.allclose(now, was, rtol=_SAME, atol=1e-12):
        return ""
    model.dof_armature[joints] = was
    engine_here().mj_setConst(model, engine_here().MjData(model))
    return f"armature {_list(was)} when exported, {_list(now)} now"


def _put_back_masses(model: Any, contact: WrittenLaw, tip: int) -> str:
    bodies, _ = chain_ids(model, tip)
    now = chain(model, tip)[0]
    was = contact.masses
    if len(now) != len(was) or np.allclose(now, was, rtol=_SAME):
        return ""
    scale = np.divide(was, now, out=np.ones(len(now)), where=np.asarray(now) > 0.0)
    model.body_mass[bodies] = was
    model.body_inertia[bodies] *= scale[:, None]
    engine_here().mj_setConst(model, engine_here().MjData(model))
    return f"mass {_list(was)} kg when exported, {_list(now)} kg now"


def _put_back_effective_mass(model: Any, contact: WrittenLaw, tip: int) -> str:
    pair = engine_here().mj_name2id(model, engine_here().mjtObj.mjOBJ_PAIR, contact.names.pairs[0])
    both = model.geom_bodyid[[model.pair_geom1[pair], model.pair_geom2[pair]]]
    now = float(model.body_invweight0[both, 0].sum())
    if math.isclose(now, contact.mobility, rel_tol=_SAME):
        return ""
    model.body_invweight0[both, 0] = 0.0
    model.body_invweight0[model.geom_bodyid[tip], 0] = contact.mobility
    is_now = f"{rounded(1.0 / now, 3)} kg" if now > 0.0 else "fixed to the world"
    return f"the effective mass was {rounded(1.0 / contact.mobility, 3)} kg, and is now {is_now}"


def _put_back_pairs(model: Any, contact: WrittenLaw, tip: int) -> str:
    changed = []
    for pair, numbers in zip(contact.names.pairs, contact.pairs, strict=False):
        k = engine_here().mj_name2id(model, engine_here().mjtObj.mjOBJ_PAIR, pair)
        if k < 0:
            continue
        was = {
            "solref": numbers[:2],
            "solimp": numbers[2:7],
            "margin": numbers[7:8],
            "gap": (0.0,),
            "adhesion": numbers[8:],
            "dim": (3.0 if contact.friction and not numbers[8] else 1.0,),
        }
        for name, values in was.items():
            array = getattr(model, f"pair_{name}", None)
            if array is None:  # an older MuJoCo
                continue
            here = np.atleast_1d(array[k])
            if not np.allclose(here, values, rtol=_SAME, atol=0.0):
                shown = "condim" if name == "dim" else name
                changed.append(f"{shown} of {pair}: {_list(values)} now {_list(here.tolist())}")
                array[k] = values if here.size > 1 else values[0]
    return ", ".join(changed)


def _put_back_flags(model: Any, contact: WrittenLaw, tip: int) -> str:
    mujoco = engine_here()
    off = mujoco.mjtDisableBit
    found = []
    for name in ("CONTACT", "CONSTRAINT", "SPRING", "DAMPER"):
        bit = int(getattr(off, f"mjDSBL_{name}"))
        if model.opt.disableflags & bit:
            found.append(f'{name.lower()}="disable"')
            model.opt.disableflags &= ~bit
    bit = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
    if model.opt.enableflags & bit:
        found.append('override="enable"')
        model.opt.enableflags &= ~bit
    return f"<flag {' '.join(found)}>" if found else ""


def _put_back_solver(model: Any, contact: WrittenLaw, tip: int) -> str:
    usual = engine_here().MjSpec().option
    found = []
    for name in ("integrator", "solver", "iterations", "tolerance", "noslip_iterations"):
        now = getattr(model.opt, name)
        default = getattr(usual, name)
        if now != default:
            found.append(f"{name}={rounded(float(now), 3)} (default: {rounded(float(default), 3)})")
            setattr(model.opt, name, default)
    elliptic = engine_here().mjtCone.mjCONE_ELLIPTIC
    if contact.friction and model.opt.cone != elliptic:  # a pyramid multiplies the force
        found.append("cone=pyramidal (exported: elliptic)")
        model.opt.cone = elliptic
    return f"<option> {', '.join(found)}" if found else ""


_PUT_BACK: tuple[Callable[[Any, WrittenLaw, int], str], ...] = (
    _put_back_armature,
    _put_back_masses,
    _put_back_pairs,
    _put_back_flags,
    _put_back_solver,
    _put_back_effective_mass,
)


def _list(values: Sequence[float]) -> str:
    each = [rounded(value, 3) for value in values]
    return each[0] if len(set(each)) == 1 else " ".join(each)


@frozen
class CheckedContact:
    """A contact of a finished model, compared with the law that was exported.

    Attributes
    ----------
    material : str
        What the law is of, with the contact's names.
    percent : float
        Rms error of the model's force against the law, over the recorded depths and speeds, %.
    causes : tuple of (str, float)
        What changed since the export and moves the error, and the error, %, with it put back.
    refusals : tuple of str
        What fails the check; empty if the contact is right.
    overlaps : tuple of str
        Other exports' surfaces that the same tip touches in the same place.
    depths : tuple of float
        Smallest and largest penetration of the replay, m.
    fastest : float
        Its largest speed, m/s.
    tip : str
        Name of the touching geom.
    """

    material: str
    percent: float
    causes: tuple[tuple[str, float], ...]
    refusals: tuple[str, ...]
    overlaps: tuple[str, ...]
    depths: tuple[float, ...]
    fastest: float
    tip: str

    @property
    def passes(self) -> bool:
        """Whether the force is within 5 % of the law and the simulation is stable."""
        return not self.refusals

    def short_answer(self) -> list[tuple[str, str]]:
        """Return the result in lines, each with its label: error, causes, failures, what to do."""
        shallow, deep = (length(depth, 3) for depth in self.depths)
        where = f"at {shallow} to {deep} and up to {length(self.fastest, 2)}/s"
        error = f"{rounded(self.percent, 3)} %" if math.isfinite(self.percent) else "unknown"
        lines = [(f"{self.material}: the force is {error} off the exported law, {where}", "")]
        lines += [
            ("moved by", f"{what}; put back: {rounded(off, 3)} %") for what, off in self.causes
        ]
        lines += [("fails", refusal) for refusal in self.refusals]
        if self.overlaps:
            there = ", ".join(self.overlaps)
            lines.append(("note", f"{there} is in the same place, and pushes the same tip"))
        if self.refusals:
            again = (
                "put it back, or remove these pads, pairs and text, and export again: palpate "
                f"export RESULT --to mujoco --model MODEL.xml --geom {self.tip}"
            )
            lines.append(("next", again))
        return lines

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers and text, SI."""
        causes = [{"change": what, "error_percent_put_back": off} for what, off in self.causes]
        error = finite_or_none(self.percent)
        return {**asdict(self), "percent": error, "causes": causes, "passes": self.passes}


def check_model(path: str | Path) -> tuple[CheckedContact, ...]:
    """Compare the exported contacts of a finished MuJoCo model with their laws.

    The masses, armatures, options and defaults are those that the model has now. The model may be
    edited by hand: its contacts are found by the texts and pairs that ``palpate export`` named.

    Parameters
    ----------
    path : str or Path
        MuJoCo's XML.

    Returns
    -------
    tuple of CheckedContact
        One for each export in the model.

    Raises
    ------
    InvalidParameterError
        MuJoCo cannot read or compile the model, or it has no contact that palpate wrote.
    MissingExtraError
        MuJoCo is not installed.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from palpate import KelvinVoigt, exports
    >>> made = exports.export(KelvinVoigt(K=2000.0, B=20.0), "mujoco", mass=1.0)
    >>> with TemporaryDirectory() as folder:
    ...     _ = made.save(folder)
    ...     [contact] = exports.check_model(f"{folder}/scene.xml")
    >>> contact.passes, round(contact.percent, 1)
    (True, 0.0)
    """
    path = Path(path)
    spec = read_spec(path)
    laws = _read_laws(spec, path)
    model = compile_spec(spec, path)
    return tuple(_check(spec, model, contact) for contact in laws)


def _check(spec: Any, model: Any, contact: WrittenLaw) -> CheckedContact:
    pairs = {pair.name: pair for pair in spec.pairs}
    wanted = contact.names.pairs[: len(contact.pairs)]
    present = [pairs[name] for name in wanted if name in pairs]
    refusals = [f"its pair {name} is missing" for name in wanted if name not in pairs]
    where = contact.depths, contact.speed
    if not present:
        missing = tuple(refusals)
        return CheckedContact(contact.title, math.nan, (), missing, (), *where, "TIP")
    # The pads may be renamed, and a pair's geoms swapped: the tip is in each pair.
    geoms = [{pair.geomname1, pair.geomname2} for pair in present]
    shared = set.intersection(*geoms) - set(contact.names.pads)
    tip = present[0].geomname2 if len(shared) != 1 else shared.pop()
    pads = [name for pair in geoms for name in pair - {tip}]
    motion = contact.motion()
    law = np.maximum(motion.force_by(contact.law), 0.0)

    def error(tried: Any) -> float:
        pressed = _press(tried, tip, pads)
        if pressed is None:
            return math.nan
        return force_error(_forward_force(pressed, motion), law, motion.judged)

    now = error(deepcopy(model))
    causes = _find_causes(model, contact, tip, error, now)
    surfaces = _surfaces_at_pads(deepcopy(model), contact, tip, pads)
    written = [pair for pair in spec.pairs if ContactNames().prefix in pair.name]
    exported = {name for pair in written for name in (pair.geomname1, pair.geomname2)}
    overlaps = [name for name in surfaces if name in exported]
    refusals += [
        f"geom {name} collides with {tip} at the pads too, so both push: set its contype and "
        "conaffinity, or <exclude> the two bodies"
        for name in surfaces
        if name not in exported
    ]
    pressed = _press(deepcopy(model), tip, pads)
    limit = math.inf
    if pressed is None:
        refusals.append(f"no joint moves {tip} against its surface in the model's first pose")
    else:
        limit = stable_step(contact.law, pressed.mass(), contact.depths[-1])
        if not now <= MOST_PERCENT:
            refusals.append(f"more than {MOST_PERCENT:g} % of force")
    if not 0.0 < model.opt.timestep < limit:
        refusals.append(
            f"the simulation is unstable at a time step of {1e3 * model.opt.timestep:g} ms; choose "
            f"one below {rounded(1e3 * limit, 2)} ms"
        )
    found = causes, tuple(refusals), tuple(overlaps)
    return CheckedContact(contact.title, now, *found, *where, tip)


def _find_causes(
    model: Any,
    contact: WrittenLaw,
    tip: str,
    error: Callable[[Any], float],
    now: float,
) -> tuple[tuple[str, float], ...]:
    """Return what moves the error, and the error, %, with each put back, smallest first."""
    causes: list[tuple[str, float]] = []
    for put_back in _PUT_BACK:
        tried = deepcopy(model)
        what = put_back(tried, contact, tried.geom(tip).id)
        off = error(tried) if what else math.nan
        known = min((each for _, each in causes), default=math.inf)
        explained = put_back is _put_back_effective_mass and known <= off + _MOVES
        if off < now - _MOVES and not explained:
            causes.append((what, off))
    return tuple(sorted(causes, key=lambda each: each[1]))


def _surfaces_at_pads(
    model: Any,
    contact: WrittenLaw,
    tip_name: str,
    pads: Sequence[str],
) -> list[str]:
    """Return the fixed geoms that the tip touches too, where it presses the pads."""
    mujoco = engine_here()
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    tip = model.geom(tip_name).id
    pad = model.geom(pads[0]).id
    gap = mujoco.mj_geomDistance(model, data, pad, tip, _FAR_AWAY, np.zeros(6))
    normal = data.geom_xmat[pad].reshape(3, 3)[:, 2]
    rotation = data.xmat[model.geom_bodyid[tip]].reshape(3, 3)
    model.geom_sameframe[tip] = 0  # else MuJoCo does not move it
    # The tree of the bodies' geoms has the tip where it was.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    model.geom_pos[tip] -= (gap + contact.depths[-1]) * normal @ rotation
    mujoco.mj_forward(model, data)
    touched = {
        other
        for k in range(data.ncon)
        if tip in (both := data.contact.geom[k].tolist()) and data.contact.dist[k] < 0.0
        for other in both
        if other != tip and not model.body_weldid[model.geom_bodyid[other]]
    }
    names = [model.geom(k).name or f"number {k}" for k in sorted(touched)]
    return [name for name in names if name not in pads]
