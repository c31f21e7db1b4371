"""The user's own model: how it moves where it touches, and the fragment in it."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.exports.mujoco.pressing import Pressed, engine_here
from palpate.exports.mujoco.rows import Row
from palpate.exports.mujoco.texts import PADS, Place
from palpate.validation import Floats

# The body of the surfaces while they are tried.
_SURFACE = "palpate_surface"
# As far away a surface touches no geom, as large as that may be, m.
_FAR = 10.0
# A tip that moves by less than this along the normal at joint speeds of 1 does not move, m/s.
_STUCK = 1e-6
#: Shapes whose contacts with a plane MuJoCo makes differently from one depth to the next.
_WITHOUT_LAW = ("MESH", "HFIELD", "SDF")
#: Why a form with passive forces is refused to a model without.
NOTHING_PASSIVE = (
    "the model switches springs and dampers off (<flag spring, damper>), and MuJoCo with both of "
    "them every passive force: a pair that pulls, or a callback, would push with another force"
)
# Shapes that touch with an end or with a side.
_LONG = ("CAPSULE", "CYLINDER")
# What finds contacts until the law is fitted; any numbers.
_ANY = Row(1.0, 1.0, (1e-4, 1e-4, 1.0, 0.5, 2.0))


@dataclass(frozen=True, slots=True)
class Robot:
    """What a fragment has to know of a model.

    Attributes
    ----------
    path : Path
        Of the model.
    geom : str
        What touches.
    mobility : float
        Â, 1/kg: translational body_invweight0 of the geom's body; the world has none.
    mass : float
        Of the model along the surface's normal, in its first pose, kg: what an impact feels.
    contacts : int
        Of the geom with a plane; 1 where they vary.
    place : Place
        Where a surface just touches it in the model's first pose.
    time_step : float
        The model's own, s.
    asset_folders : tuple of str
        Of its meshes and textures, from its own folder on.
    passive : bool
        Whether it has passive forces, which a pair that pulls and a callback are among.
    warnings, refusals : tuple of str
        Of the geom's shape, and of the model's options.
    """

    path: Path
    geom: str
    mobility: float
    mass: float
    contacts: int
    place: Place
    time_step: float
    asset_folders: tuple[str, str]
    passive: bool = True
    warnings: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()

    def pressed(self, rows: tuple[Row, ...]) -> Pressed:
        """Return the model with the fragment in it, compiled."""
        return _pressed(self.path, self.geom, rows, self.place)


def read(path: Path, geom: str | None, deepest: float) -> Robot:
    """Return what a model says of a geom, pressed to a depth [m].

    Raises
    ------
    InvalidParameterError
        It is no model that MuJoCo compiles, has no such geom, or the geom cannot move.
    """
    mujoco = engine_here()
    if geom is None:
        names = _names(_spec(path))
        raise InvalidParameterError(
            "geom must say what touches (--geom NAME): "
            f"{path.name} has {', '.join(names) or 'none'}"
        )
    first = _pressed(path, geom, (_ANY,), Place((0.0, 0.0, -_FAR)))
    model = first.model
    kind = mujoco.mjtGeom(int(model.geom_type[first.tip])).name.removeprefix("mjGEOM_")
    if kind == "PLANE":
        raise InvalidParameterError(f"geom {geom} is a plane: name the one that touches it")
    spec = _spec(path)
    mobility = float(model.body_invweight0[model.geom_bodyid[first.tip], 0])
    if not mobility > 0.0:
        raise InvalidParameterError(
            f"geom {geom} of {path.name} stands in the world: name one of a body that moves"
        )
    there = _touching(first, kind)
    if there is None:
        raise InvalidParameterError(f"geom {geom} of {path.name} cannot move against a surface")
    counts = there.counts(deepest * np.array([0.05, 0.25, 0.5, 0.75, 1.0]))
    mass = there.mass()
    return Robot(
        path,
        geom,
        mobility,
        mass,
        max(1, *counts) if len(counts) == 1 else 1,
        there.place,
        float(model.opt.timestep),
        (spec.meshdir, spec.texturedir),
        _passive(mujoco, model),
        (*_warnings(kind, geom, counts), *_felt_otherwise(mass, mobility)),
        _refusals(mujoco, model, kind, geom, counts),
    )


def _spec(path: Path) -> Any:
    mujoco = engine_here()
    if not path.is_file():
        raise InvalidParameterError(f"model: there is no file {path}")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except Exception as error:  # the engine's own classes, of several kinds
        raise InvalidParameterError(f"model: {path.name}: MuJoCo cannot read it: {error}") from None
    if getattr(spec.default.pair, "adhesion", 0.0):
        # A row that only pushes says nothing of it, for older versions know no such word.
        raise InvalidParameterError(
            f"model: {path.name} has an adhesion in its <default> for pairs, with which every "
            "contact pulls: give it to its own pairs"
        )
    return spec


def _names(spec: Any) -> list[str]:
    return [geom.name for geom in spec.geoms if geom.name][:20]


def _pressed(path: Path, geom: str, rows: tuple[Row, ...], place: Place) -> Pressed:
    """Compile a model with a surface for each row, and a pair of each with the geom."""
    mujoco, spec = engine_here(), _spec(path)
    if geom not in [each.name for each in spec.geoms]:
        names = _names(spec)
        raise InvalidParameterError(
            f"geom: {path.name} has no {geom!r}; there are {', '.join(names) or 'none with a name'}"
        )
    if {*PADS, _SURFACE} & {each.name for each in [*spec.geoms, *spec.bodies]}:
        raise InvalidParameterError(
            f"model: {path.name} has a {PADS[0]} already: take the earlier export out of it"
        )
    # A body that is moved by hand has no mass and no inverse mass: to a contact it is the world.
    surface = spec.worldbody.add_body(
        name=_SURFACE, mocap=True, pos=place.position, quat=_turn(np.asarray(place.normal))
    )
    for pad in PADS[: max(len(rows), 1)]:
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        surface.add_geom(name=pad, type=plane, size=(0.1, 0.1, 0.01), contype=0, conaffinity=0)
    for row, pad in zip(rows, PADS, strict=False):
        more = {"adhesion": row.adhesion} if row.adhesion else {}
        solref = (-row.spring, -row.damper)
        spec.add_pair(
            geomname1=pad, geomname2=geom, condim=1, solref=solref, solimp=row.solimp,
            margin=-row.inset, gap=0.0, **more,
        )  # fmt: skip
    try:
        model = spec.compile()
    except Exception as error:
        raise InvalidParameterError(
            f"model: {path.name}: MuJoCo cannot compile it: {error}"
        ) from None
    return compiled(mujoco, model, geom, max(len(rows), 1), place)


def compiled(mujoco: Any, model: Any, geom: str, count: int, place: Place) -> Pressed:
    """Return a compiled model in its first pose, ready to be pressed."""
    # Inverse dynamics of the continuous law, whatever the model integrates with.
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel[:] = 0.0
    surface = None
    if model.nmocap and _SURFACE in [model.body(k).name for k in range(model.nbody)]:
        body = model.body(_SURFACE).id
        surface = int(model.body_mocapid[body])
        data.mocap_pos[surface], data.mocap_quat[surface] = (
            model.body_pos[body],
            model.body_quat[body],
        )
    mujoco.mj_forward(model, data)
    pads = tuple(model.geom(pad).id for pad in PADS[:count])
    return Pressed(mujoco, model, data, model.geom(geom).id, pads, place, surface)


def _touching(pressed: Pressed, kind: str) -> Pressed | None:
    """Put the surface where it touches the geom, facing as far up as the geom can move against it.

    None where the geom moves against none.
    """
    centre = np.array(pressed.data.geom_xpos[pressed.tip])
    for normal in _normals(kind, pressed.data.geom_xmat[pressed.tip].reshape(3, 3)):
        far = _faced(pressed, Place(_triple(centre - _FAR * normal), _triple(normal)))
        pads, line = far.pads[0], np.zeros(6)
        gap = far.mujoco.mj_geomDistance(far.model, far.data, pads, far.tip, 2.0 * _FAR, line)
        there = _faced(far, Place(_triple(centre + (gap - _FAR) * normal), _triple(normal)))
        out = there.along()
        if np.isfinite(out).all() and float(out @ out) < _STUCK**-2:
            return there
    return None


def _normals(kind: str, turned: Floats) -> Floats:
    """Which way a surface may face, the best first: the ends of what is long before its sides."""
    axes = {"BOX": [turned.T]}.get(kind, [np.eye(3)])
    if kind in _LONG:
        axes = [turned.T[2:], turned.T[:2]]
    both = [np.round(np.concatenate([each, -each]), 15) for each in axes]
    return np.concatenate([each[np.argsort(-each[:, 2], kind="stable")] for each in both])


def _faced(pressed: Pressed, place: Place) -> Pressed:
    """Move the surface to another place."""
    pressed.data.mocap_pos[pressed.surface] = place.position
    pressed.data.mocap_quat[pressed.surface] = _turn(np.asarray(place.normal))
    pressed.mujoco.mj_forward(pressed.model, pressed.data)
    return replace(pressed, place=place)


def _triple(values: Floats) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _turn(normal: Floats) -> Floats:
    """The quaternion that turns z to a normal."""
    if normal[2] < -1.0 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    quaternion = np.array([1.0 + normal[2], -normal[1], normal[0], 0.0])
    return np.asarray(quaternion / np.linalg.norm(quaternion))


def _passive(mujoco: Any, model: Any) -> bool:
    """Whether any passive force is computed: without springs and dampers MuJoCo leaves out all."""
    both = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
    return int(model.opt.disableflags) & both != both


def _felt_otherwise(mass: float, mobility: float) -> tuple[str, ...]:
    """A word on a model that is another mass to an impact than MuJoCo scales its numbers by."""
    if math.isclose(mass * mobility, 1.0, rel_tol=0.01):
        return ()
    return (
        f"an impact feels {mass:.4g} kg of the model in its first pose, and another mass in "
        "another pose: restitution and the largest time step are those of this one; scene.xml has "
        f"the {1.0 / mobility:.4g} kg that the numbers are for",
    )


def _warnings(kind: str, geom: str, counts: set[int]) -> tuple[str, ...]:
    if kind == "CAPSULE" and counts == {1}:
        return (
            f"{geom} is a capsule, which touches with its end here: lying on its side it has two "
            "contacts, and twice the force",
        )
    if len(counts) > 1 or max(counts) <= 1:
        return ()
    [count] = counts
    return (
        f"{geom} is a {kind.lower()} that touches with {count} contacts as long as it lies flat: "
        "its numbers are those of one of them, and on an edge or a corner the force is less",
    )


def _refusals(mujoco: Any, model: Any, kind: str, geom: str, counts: set[int]) -> tuple[str, ...]:
    found = []
    if kind in _WITHOUT_LAW:
        found.append(
            f"{geom} is a {kind.lower()}, with which MuJoCo makes 1 to 3 contacts as it likes, and "
            "up to 3 times the force: give it a sphere, a capsule or a box to touch with"
        )
    elif counts == {0}:
        found.append(f"{geom} makes no contact with a surface in this model")
    elif len(counts) > 1:
        found.append(
            f"{geom} touches with {min(counts)} to {max(counts)} contacts, depending on depth, "
            "each of which pushes: give it a sphere to touch with"
        )
    if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        found.append("the model overrides every contact's solref and solimp: <flag override>")
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        found.append("the model switches contacts off: <flag contact>")
    return tuple(found)
