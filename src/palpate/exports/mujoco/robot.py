"""MuJoCo's XML and models: surfaces and pairs to paste, and a tip pressed on the surfaces.

First a compiled model whose tip is moved by inverse dynamics; then the user's own model and its
effective mass; and at the end reading back an exported scene.
"""

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from palpate.errors import InvalidParameterError, RecordingError, require_mujoco
from palpate.exports.engine import make_refusals, make_warnings
from palpate.exports.exporting import STATEMENT
from palpate.exports.motion import ProbeMotion
from palpate.exports.mujoco.fitting import IMPRATIO, PairRow
from palpate.exports.texts import digits, template, xml_comment
from palpate.findings import Finding
from palpate.validation import Floats, frozen

TIP = "tip"


@frozen
class ContactNames:
    """The names in MJCF of one exported contact; they contain the name of the export.

    Attributes
    ----------
    prefix : str
        What all of them begin with.
    """

    prefix: str = "palpate"

    @classmethod
    def of(cls, name: str) -> "ContactNames":
        """Return the names of an export of this name; "" is the only export of a model."""
        return cls(f"palpate_{name}" if name else "palpate")

    @property
    def pads(self) -> tuple[str, str]:
        """Names of the coincident surfaces, one per row."""
        return f"{self.prefix}_pad", f"{self.prefix}_pad_damper"

    @property
    def pairs(self) -> tuple[str, str]:
        """Names of the pairs, one per row."""
        return f"{self.prefix}_contact", f"{self.prefix}_contact_damper"

    @property
    def law(self) -> str:
        """Name of the text that has the exported law."""
        return f"{self.prefix}_law"


@frozen
class Placement:
    """Position and orientation of a surface.

    Attributes
    ----------
    position, normal : tuple of float
        Position, m; unit normal, out of the material.
    """

    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    normal: tuple[float, ...] = (0.0, 0.0, 1.0)


def sections(
    rows: Sequence[PairRow],
    tip: str,
    place: Placement,
    names: ContactNames,
    law: str,
) -> dict[str, str]:
    """Return the XML of the surfaces, one per row (at least one), of contacts, and of the cone.

    Surfaces are massless and static, and collide only through the pairs. The text ``law``, from
    which ``palpate export --check`` knows the exported law, follows the ``<contact>`` section.
    """
    # Round to a picometre to remove rounding errors.
    position = _numbers(np.round(place.position, 12).tolist())
    normal = _numbers(place.normal)
    turned = "" if place.normal == (0.0, 0.0, 1.0) else f' zaxis="{normal}"'
    surfaces = (
        f'    <geom name="{name}" type="plane" pos="{position}"{turned} size="0.1 0.1 0.01" '
        'contype="0" conaffinity="0"/>'
        for name in names.pads[: max(len(rows), 1)]
    )
    lines = []
    what = ("spring", "damper") if len(rows) > 1 else ("spring and damper",)
    for row, pad, pair_name, name in zip(rows, names.pads, names.pairs, what, strict=False):
        attributes = {
            "name": pair_name,
            "geom1": pad,
            "geom2": tip,
            "condim": "3" if row.friction else "1",
            # Not "0": a solref that is not negative has another meaning.
            "solref": _numbers((-row.spring, -row.damper)),
            "solimp": _numbers(row.solimp),
            # Set explicitly, since a model's <default> for pairs would move the surface.
            "margin": _numbers([-row.inset]),
            "gap": "0",
        }
        if row.friction:
            attributes["friction"] = _numbers(_friction(row))
            attributes["solreffriction"] = _numbers((-1.0, -row.friction_damper))
        if row.adhesion:
            attributes["adhesion"] = digits(row.adhesion)
        pair = ElementTree.Element("pair", attributes)
        lines.append(f"    <!-- The {name}. -->")
        lines.append(f"    {ElementTree.tostring(pair, encoding='unicode')}")
    text = f"    <text name={quoteattr(names.law)} data={quoteattr(law)}/>"
    custom = [
        "  <custom>",
        "    <!-- For palpate export --check: keep it. -->",
        text,
        "  </custom>",
    ]
    contact = "\n".join(["  <contact>", *lines, "  </contact>", *custom]) if lines else ""
    rubs = any(row.friction for row in rows)
    cone = f' cone="elliptic" impratio="{digits(IMPRATIO)}"' if rubs else ""
    return {"pads": "\n".join(surfaces), "contact": contact, "cone": cone}


def _friction(row: PairRow) -> tuple[float, ...]:
    """Return a pair's friction: twice sliding; torsion and rolling, which condim 3 ignores."""
    return (row.friction, row.friction, 0.005, 0.0001, 0.0001)


def _numbers(values: Sequence[float]) -> str:
    # + 0.0 turns a negative zero into 0.
    return " ".join(digits(value + 0.0) for value in values)


# A tip of a compiled model on a surface, moved by inverse dynamics.


def engine_here() -> Any:
    """Return the MuJoCo module; raise with the install command if it is absent."""
    return require_mujoco("reading a MuJoCo model", "exports")


class PressableModel:
    """A compiled model in its first pose, whose geom can be pressed into the surfaces.

    The surfaces are moved instead of the geom.

    Parameters
    ----------
    model : mujoco.MjModel
        Model that contains the surfaces.
    geom : str
        Name of the tip's geom.
    place : Placement
        Placement of the surfaces at first touch.
    pads : sequence of str
        Names of the surfaces.
    """

    def __init__(self, model: Any, geom: str, place: Placement, pads: Sequence[str]) -> None:
        self.mujoco = mujoco = engine_here()
        # Inverse dynamics in continuous time, whatever the model's integrator.
        model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)
        self.model = model
        self.data = mujoco.MjData(model)
        self.place = place
        names = {model.geom(k).name: k for k in range(model.ngeom)}
        self.tip = names[geom]
        self.pads = [names[pad] for pad in pads if pad in names]
        model.geom_sameframe[self.pads] = 0  # else MuJoCo does not move them
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, self.data, 0)
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(model, self.data)

    def face(self, position: Floats, normal: Floats) -> None:
        """Move the surfaces to another place."""
        self.place = Placement(tuple(position.tolist()), tuple(normal.tolist()))
        turned = np.zeros(4)
        for pad in self.pads:
            inverse = self.data.xquat[self.model.geom_bodyid[pad]] * (1.0, -1.0, -1.0, -1.0)
            self.mujoco.mju_mulQuat(turned, inverse, _turn(normal))
            self.model.geom_quat[pad] = turned
        self.sink(0.0)
        self.mujoco.mj_forward(self.model, self.data)

    def sink(self, penetration: float) -> None:
        """Raise the surfaces to a penetration of the tip, m."""
        raised = np.asarray(self.place.position) + penetration * np.asarray(self.place.normal)
        for pad in self.pads:
            body = self.model.geom_bodyid[pad]
            rotation = self.data.xmat[body].reshape(3, 3)
            self.model.geom_pos[pad] = (raised - self.data.xpos[body]) @ rotation

    def along(self) -> Floats:
        """Return the joint velocities that move the tip at 1 m/s out of the material."""
        point = np.asarray(self.place.position)
        tip, pad = np.zeros((2, 3, self.model.nv))
        for across, geom in ((tip, self.tip), (pad, self.pads[0])):
            body = self.model.geom_bodyid[geom]
            self.mujoco.mj_jac(self.model, self.data, across, None, point, body)
        row = np.asarray(self.place.normal) @ (tip - pad)
        size = float(row @ row)
        return row / size if size > 0.0 else np.full(self.model.nv, np.nan)

    @property
    def shape(self) -> str:
        """Shape of the tip's geom, such as SPHERE."""
        kind = self.mujoco.mjtGeom(int(self.model.geom_type[self.tip]))
        return str(kind.name.removeprefix("mjGEOM_"))

    def touches(self, normals: Floats) -> bool:
        """Place the surfaces against the geom, with the first normal along which it can move.

        Return False if the geom can move along none of them.
        """
        centre = np.array(self.data.geom_xpos[self.tip])
        line = np.zeros(6)
        for normal in normals:
            self.face(centre - _FAR * normal, normal)
            gap = self.mujoco.mj_geomDistance(
                self.model,
                self.data,
                self.pads[0],
                self.tip,
                2.0 * _FAR,
                line,
            )
            self.face(centre + (gap - _FAR) * normal, normal)
            out = self.along()
            if out.size and np.isfinite(out).all() and float(out @ out) < _STUCK**-2:
                return True
        return False

    def mass(self) -> float:
        """Return the effective mass of the model along the normal, kg: 1/(J M⁻¹ Jᵀ)."""
        out = self.along()
        row = np.array([out / float(out @ out)])
        answer = np.zeros_like(row)
        self.mujoco.mj_solveM(self.model, self.data, answer, row)
        return 1.0 / float(row[0] @ answer[0])

    def contacts(self, pad: int) -> list[int]:
        """Return the indices of the contacts between a surface and the tip."""
        both = {pad, self.tip}
        contact = self.data.contact
        return [k for k in range(self.data.ncon) if set(contact.geom[k].tolist()) == both]

    def force(self) -> float:
        """Return the force of the surfaces, N, from MuJoCo's contacts."""
        felt = np.zeros(6)
        total = 0.0
        for pad in self.pads:
            for k in self.contacts(pad):
                self.mujoco.mj_contactForce(self.model, self.data, k, felt)
                total += float(felt[0])
        return total

    def counts(self, depths: Floats) -> set[int]:
        """Return the numbers of contacts of the tip with one surface, over depths [m]."""
        seen = set()
        for depth in depths.tolist():
            self.sink(depth)
            self.mujoco.mj_forward(self.model, self.data)
            seen.add(len(self.contacts(self.pads[0])))
        return seen

    def along_motion(self, motion: ProbeMotion, callback: Any = None) -> Floats:
        """Return the force at every state of a motion, N, by inverse dynamics, without integration.

        At each state the surface is set to the penetration, and the joints to the velocity and
        acceleration of the motion. The force is that of the contacts, or of an installed callback.
        """
        out = self.along()
        force = np.zeros(len(motion))
        x = motion.penetration
        v = motion.velocity
        a = motion.acceleration
        for k in range(len(motion)):
            self.sink(float(x[k]))
            self.data.qvel[:] = -v[k] * out
            self.data.qacc[:] = -a[k] * out
            self.mujoco.mj_inverse(self.model, self.data)
            force[k] = self.force() if callback is None else callback.force
        return force


# The user's own model with the fragment, and its effective mass at the contact.

# Distance at which a surface touches no geom, m.
_FAR = 10.0
_FARTHEST = 1e6  # m, of a place or a size in a model; MuJoCo's distances overflow far above
_LONGEST_STEP = 10.0  # s
# A tip counts as fixed if joint speeds of 1 move it along the normal by less than this, m/s.
_STUCK = 1e-6
#: Shapes whose number of contacts with a plane varies with depth in MuJoCo.
_WITHOUT_LAW = ("MESH", "HFIELD", "SDF")
#: Why a form with passive forces is refused for a model without them.
NOTHING_PASSIVE = (
    "the model disables springs and dampers (<flag spring, damper>), and with them MuJoCo disables "
    "every passive force: a pair that pulls, or a callback, would have another force"
)
# Shapes that can touch with an end or a side.
_LONG = ("CAPSULE", "CYLINDER")
# A placeholder with any parameters, to find contacts before the law is fitted.
_ANY = PairRow(1.0, 1.0, (1e-4, 1e-4, 1.0, 0.5, 2.0))


@frozen
class Robot:
    """The properties of a user's model that a fragment needs.

    Attributes
    ----------
    path : Path
        File of the model.
    geom : str
        Name of the touching geom.
    mobility : float
        Â, 1/kg: translational body_invweight0 of the geom's body; that of the world is 0.
    mass : float
        Effective mass along the surface's normal in the model's first pose, kg.
    contacts : int
        Number of contacts of the geom with a plane; 1 if it varies.
    place : Placement
        Surface that just touches the geom in the model's first pose.
    time_step : float
        Time step of the model, s.
    asset_folders : tuple of str
        Folders of its meshes and textures, relative to its own.
    passive : bool
        Whether passive forces are enabled, which pulling pairs and callbacks need. Default: True.
    masses, armature : tuple of float
        Masses [kg] of the bodies, and armatures of the joints, from the world to the geom.
    findings : tuple of Finding
        Warnings and refusals for the geom's shape and the model's options.
    """

    path: Path
    geom: str
    mobility: float
    mass: float
    contacts: int
    place: Placement
    time_step: float
    asset_folders: tuple[str, str]
    passive: bool = True
    masses: tuple[float, ...] = ()
    armature: tuple[float, ...] = ()
    findings: tuple[Finding, ...] = ()

    def scene(self, notes: Sequence[str]) -> str:
        """Return a scene that includes the model by its path, and the fragment in this folder."""
        whole = self.path.absolute()
        meshes, textures = (str(whole.parent / asset_folder) for asset_folder in self.asset_folders)
        folders = {"meshdir": meshes, "texturedir": textures}
        include = ElementTree.Element("include", file=str(whole))
        parts = (include, ElementTree.Element("compiler", folders))
        model, assets = (ElementTree.tostring(part, encoding="unicode") for part in parts)
        comment = xml_comment(notes)
        return template("mujoco_robot.xml", comment=comment, model=model, assets=assets)


def read(path: Path, geom: str | None, deepest: float, names: ContactNames) -> Robot:
    """Return the properties of a model whose geom is pressed to a depth [m].

    Raises
    ------
    InvalidParameterError
        MuJoCo cannot compile the model, it has no such geom, or the geom cannot move.
    """
    mujoco = engine_here()
    if geom is None:
        known = _geom_names(_spec(path))
        raise InvalidParameterError(
            "the touching geom is missing: add --geom NAME; "
            f"{path.name} has {', '.join(known) or 'no named geom'}"
        )
    first = pressable(path, geom, (_ANY,), Placement((0.0, 0.0, -_FAR)), names)
    model = first.model
    own = (model.geom_pos[first.tip], model.geom_size[first.tip], model.body_pos)
    reach = max(float(np.abs(each).max()) for each in own)
    if not reach <= _FARTHEST:
        raise InvalidParameterError(
            f"geom {geom} of {path.name} has a size or place of {reach:g} m: correct the model"
        )
    if not 0.0 < model.opt.timestep <= _LONGEST_STEP:
        raise InvalidParameterError(
            f"{path.name} has a time step of {model.opt.timestep:g} s: set its <option timestep>, "
            f"s, above 0 and at most {_LONGEST_STEP:g}"
        )
    kind = first.shape
    if kind == "PLANE":
        raise InvalidParameterError(f"geom {geom} is a plane: choose the geom that touches it")
    spec = _spec(path)
    mobility = float(model.body_invweight0[model.geom_bodyid[first.tip], 0])
    if not mobility > 0.0:
        raise InvalidParameterError(
            f"geom {geom} of {path.name} is fixed to the world: choose one of a moving body"
        )
    turned = first.data.geom_xmat[first.tip].reshape(3, 3)
    if not first.touches(normals(kind, turned)):
        raise InvalidParameterError(f"geom {geom} of {path.name} cannot move against a surface")
    counts = first.counts(deepest * np.array([0.05, 0.25, 0.5, 0.75, 1.0]))
    mass = first.mass()
    contacts = max(1, *counts) if len(counts) == 1 else 1
    # With springs and dampers disabled MuJoCo disables every passive force.
    both = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
    passive = int(model.opt.disableflags) & both != both
    own = float(model.opt.timestep), (spec.meshdir, spec.texturedir), passive
    felt = mobility, mass, contacts, first.place
    findings = (
        *make_refusals(*_refusals(mujoco, model, kind, geom, counts)),
        *make_warnings(*_warnings(kind, geom, counts, mass, mobility)),
    )
    return Robot(path, geom, *felt, *own, *chain(model, first.tip), findings)


def chain(model: Any, geom: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the masses of the bodies, and armatures of the joints, from the world to a geom."""
    bodies, joints = chain_ids(model, geom)
    return tuple(model.body_mass[bodies].tolist()), tuple(model.dof_armature[joints].tolist())


def chain_ids(model: Any, geom: int) -> tuple[list[int], list[int]]:
    """Return the ids of the moving bodies and of the degrees of freedom that carry a geom."""
    body = int(model.geom_bodyid[geom])
    bodies: list[int] = []
    while body:
        bodies.insert(0, body)
        body = int(model.body_parentid[body])
    first = model.body_dofadr[bodies]
    count = model.body_dofnum[bodies]
    joints = [k for at, many in zip(first, count, strict=True) for k in range(at, at + many)]
    return bodies, joints


def _spec(path: Path) -> Any:
    spec = read_spec(path)
    if getattr(spec.default.pair, "adhesion", 0.0):
        # A row that only pushes does not set it, since older versions lack the attribute.
        raise InvalidParameterError(
            f"model: {path.name} has an adhesion in its <default> for pairs, so every contact "
            "would pull: move it to the model's own pairs"
        )
    return spec


# Files that MuJoCo decodes as a model.
_SUFFIXES = (".xml", ".urdf")


def read_spec(path: Path) -> Any:
    """Return the MjSpec of a file.

    Raises
    ------
    InvalidParameterError
        The file does not exist, or MuJoCo cannot read it.
    """
    mujoco = engine_here()
    if not path.is_file():
        raise InvalidParameterError(f"model: file {path} does not exist")
    if path.suffix.lower() not in _SUFFIXES:  # MuJoCo would write a log into the user's folder
        raise InvalidParameterError(f"model: {path.name} is not called .xml, as a model must be")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except Exception as error:  # the engine's own classes, of several kinds
        raise InvalidParameterError(f"model: {path.name}: MuJoCo cannot read it: {error}") from None


def compile_spec(spec: Any, path: Path) -> Any:
    """Return the compiled model of a file.

    Raises
    ------
    InvalidParameterError
        MuJoCo cannot compile it.
    """
    try:
        return spec.compile()
    except Exception as error:
        raise InvalidParameterError(
            f"model: {path.name}: MuJoCo cannot compile it: {error}"
        ) from None


def _geom_names(spec: Any) -> list[str]:
    return [geom.name for geom in spec.geoms if geom.name][:20]


def pressable(
    path: Path,
    geom: str,
    rows: Sequence[PairRow],
    place: Placement,
    names: ContactNames,
) -> PressableModel:
    """Compile a model with a surface for each row, and a pair of each with the geom."""
    mujoco = engine_here()
    spec = _spec(path)
    if geom not in [each.name for each in spec.geoms]:
        known = _geom_names(spec)
        raise InvalidParameterError(
            f"geom: {path.name} has no geom {geom!r}; it has {', '.join(known) or 'no named geom'}"
        )
    if set(names.pads) & {each.name for each in spec.geoms}:
        raise InvalidParameterError(
            f"model: {path.name} already has a geom {names.pads[0]}: remove the earlier export, or "
            "give this one another --name"
        )
    where = {"pos": place.position, "quat": _turn(np.asarray(place.normal))}
    plane = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": (0.1, 0.1, 0.01)}
    for pad in names.pads[: max(len(rows), 1)]:
        spec.worldbody.add_geom(name=pad, **plane, **where, contype=0, conaffinity=0)
    for row, pad in zip(rows, names.pads, strict=False):
        more: dict[str, Any] = {"adhesion": row.adhesion} if row.adhesion else {}
        if row.friction:
            spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
            spec.option.impratio = IMPRATIO
            more["friction"] = _friction(row)
            more["solreffriction"] = (-1.0, -row.friction_damper)
        solref = (-row.spring, -row.damper)
        spec.add_pair(
            geomname1=pad, geomname2=geom, solref=solref, solimp=row.solimp,
            condim=3 if row.friction else 1,
            margin=-row.inset, gap=0.0, **more,
        )  # fmt: skip
    return PressableModel(compile_spec(spec, path), geom, place, names.pads)


def normals(kind: str, turned: Floats) -> Floats:
    """Return normals for a surface, best first: the ends of long shapes before their sides."""
    axes = {"BOX": [turned.T]}.get(kind, [np.eye(3)])
    if kind in _LONG:
        axes = [turned.T[2:], turned.T[:2]]
    both = [np.round(np.concatenate([each, -each]), 15) for each in axes]
    return np.concatenate([each[np.argsort(-each[:, 2], kind="stable")] for each in both])


def _turn(normal: Floats) -> Floats:
    """Return the quaternion that rotates z to a normal."""
    if normal[2] < -1.0 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    quaternion = np.array([1.0 + normal[2], -normal[1], normal[0], 0.0])
    return np.asarray(quaternion / np.linalg.norm(quaternion))


def _warnings(
    kind: str,
    geom: str,
    counts: set[int],
    mass: float,
    mobility: float,
) -> Iterator[str]:
    if kind == "CAPSULE" and counts == {1}:
        yield (
            f"geom {geom} is a capsule that touches with its end: on its side it has two contacts "
            "and twice the force"
        )
    elif len(counts) == 1 and max(counts) > 1:
        yield (
            f"geom {geom} is a {kind.lower()} with {max(counts)} contacts when it lies flat: the "
            "parameters are those of one contact, and on an edge or a corner the force is lower"
        )
    if not math.isclose(mass * mobility, 1.0, rel_tol=0.01):
        yield (
            f"the effective mass in impacts is {mass:.4g} kg in the model's first pose and differs "
            "in others: restitution and the stability limit are for the first pose; scene.xml has "
            f"the {1.0 / mobility:.4g} kg that the parameters are for"
        )


def _refusals(mujoco: Any, model: Any, kind: str, geom: str, counts: set[int]) -> Iterator[str]:
    if kind in _WITHOUT_LAW:
        yield (
            f"geom {geom} is a {kind.lower()}, for which MuJoCo makes 1 to 3 contacts and so up to "
            "3 times the force: choose a sphere, capsule or box as the touching geom"
        )
    elif counts == {0}:
        yield f"geom {geom} makes no contact with a surface in this model"
    elif len(counts) > 1:
        yield (
            f"geom {geom} has {min(counts)} to {max(counts)} contacts, depending on depth, each of "
            "which pushes: choose a sphere as the touching geom"
        )
    if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        yield "the model overrides solref and solimp of every contact: remove its <flag override>"
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        yield "the model disables contacts: remove its <flag contact>"


# An exported MuJoCo scene, read from its file as a material of the laboratory.


class Scene:
    """A material of the laboratory: the contact of ``scene.xml``, simulated state by state.

    Parameters
    ----------
    path : str or Path
        The scene's file.

    Raises
    ------
    RecordingError
        MuJoCo cannot read the file, or it lacks palpate's contact of a tip and a surface.
    """

    def __init__(self, path: str | Path) -> None:
        path = Path(path)
        self.name = f"{path.parent.name or 'a'} scene of MuJoCo".removeprefix(".")
        self._model = _read(path)
        try:
            law = json.loads(path.with_name(STATEMENT[0]).read_bytes())["exported_law"]
            self._truth = {**law, "engine": "mujoco"}
        except (OSError, ValueError, LookupError, TypeError):  # no statement in the scene's folder
            self._truth = {"kind": "a scene of MuJoCo", "file": path.name}

    def describe(self) -> dict[str, Any]:
        """Return the exported law, SI, and the engine."""
        return self._truth

    def touch(self) -> NoReturn:
        """Raise: an engine's contact force depends on the probe's acceleration.

        Raises
        ------
        InvalidParameterError
            Always.
        """
        raise InvalidParameterError(
            f"{self.name} needs a probe with prescribed motion, --probe ideal: the "
            "engine's contact force depends on the acceleration"
        )

    def force(
        self,
        time: Floats,
        lateral_position: Floats,
        penetration: Floats,
        velocity: Floats,
    ) -> Floats:
        """Return the engine's force [N] along a whole motion, shape (k,); 0 out of contact."""
        force = np.zeros_like(time)
        below = np.flatnonzero(penetration > 0.0)
        if below.size:
            acceleration = np.gradient(velocity, time)
            t, x, v, a = (each[below] for each in (time, penetration, velocity, acceleration))
            inside = ProbeMotion(t, x, v, a, np.ones(below.size, dtype=bool))
            force[below] = self._model.along_motion(inside)
        return force


def _read(path: Path) -> PressableModel:
    mujoco = engine_here()
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except Exception as error:  # the engine's own classes, of several kinds
        raise RecordingError(f"{path}: MuJoCo cannot read it: {error}") from None
    names = {model.geom(k).name for k in range(model.ngeom)}
    pads = sorted(name for name in names if name.startswith(ContactNames().prefix))
    if TIP not in names or not pads or model.npair != len(pads):
        raise RecordingError(f"{path}: not a scene of palpate export with pairs of {TIP} and a pad")
    return PressableModel(model, TIP, Placement(tuple(model.geom(pads[0]).pos.tolist())), pads)
