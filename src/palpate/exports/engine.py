"""Base classes of engines, and their registry."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pkgutil import resolve_name
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from palpate.digits import rounded
from palpate.errors import ExportRefusedError
from palpate.exports.motion import MOST_SAMPLES, ExportRequest, ProbeMotion
from palpate.exports.replay_errors import Drop, restitution_by
from palpate.findings import Check, Finding
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats, check_choice, frozen


@frozen(eq=False)
class Replayed:
    """The force of an engine along a motion.

    Attributes
    ----------
    force : numpy.ndarray, shape (k,)
        Force on the probe, positive out of the material, N, at every sample of the motion.
    how : str
        Method of the replay, in words.
    """

    force: Floats
    how: str


def make_warnings(*messages: str, effect: float = 0.0) -> tuple[Finding, ...]:
    """Return messages as warnings; ``effect`` is their change of force or rebound here, %."""
    return tuple(
        Check.ENGINE.finding(message, severity="with-care", moves_percent=(effect, math.nan))
        for message in messages
    )


def make_refusals(*messages: str) -> tuple[Finding, ...]:
    """Return messages as refusals."""
    return tuple(Check.ENGINE.finding(message, severity="do-not-trust") for message in messages)


@dataclass(frozen=True, eq=False, kw_only=True)
class Fragment(ABC):
    """A law in an engine's parameters: text to paste, and the engine's force with it.

    Attributes
    ----------
    form : str
        Form of the contact in the engine.
    request : ExportRequest
        The request it was made for.
    numbers : mapping of str to float
        The engine's parameters by name.
    engine_law : GeneralisedHuntCrossley, optional
        The resulting force law in the engine, if it has this form; :meth:`predict_force` may add
        to it.
    exact : bool
        Whether that is the requested law, to the engine's accuracy. Default: False.
    largest_step : float, optional
        Stability limit of the time step, s.
    findings : tuple of Finding
        Warnings (:func:`make_warnings`) and refusals (:func:`make_refusals`).
    most_samples : int
        Most states for a replay.
    """

    most_samples: ClassVar[int] = MOST_SAMPLES
    form: str
    request: ExportRequest = field(repr=False)
    numbers: Mapping[str, float]
    engine_law: GeneralisedHuntCrossley | None = None
    exact: bool = False
    largest_step: float | None = None
    findings: tuple[Finding, ...] = ()

    def describe_friction(self) -> str:
        """Return the friction of the contact in words, for the first line of the statement."""
        friction = self.request.friction
        return f"friction {rounded(friction, 3)}" if friction else "frictionless"

    @property
    def paste(self) -> str:
        """What to do with the files, in one sentence."""
        return "paste the first of these files into your model, as the scene does"

    @property
    def snippet(self) -> str:
        """What to paste, if it is so short that the screen has room for it; else empty."""
        return ""

    @abstractmethod
    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return text by file name: the fragment to paste, and a minimal scene.

        Parameters
        ----------
        notes : sequence of str
            Lines for the comment in each file: origin, error, warnings.
        """

    def predict_force(self, motion: ProbeMotion) -> Floats:
        """Return the engine's predicted force along a motion, N, at least 0."""
        assert self.engine_law is not None  # else a subclass overrides this
        return np.maximum(motion.force_by(self.engine_law), 0.0)

    def predict_restitution(self, drop: Drop) -> float:
        """Return the engine's predicted restitution in an impact."""
        assert self.engine_law is not None
        return restitution_by(self.engine_law, drop)

    def replay(self, motion: ProbeMotion) -> Replayed | None:
        """Return the real engine's force along a motion; None if palpate cannot run it."""
        return None

    def drop_restitution(self, drop: Drop) -> float | None:
        """Return the real engine's restitution at the time step; None if it is not simulated."""
        return None


class Engine(ABC):
    """A simulation engine to which laws can be exported; ``ENGINES`` has its place.

    Attributes
    ----------
    name : str
        Name for ``--to``.
    title : str
        Display name.
    forms : mapping of str to str
        Names and descriptions of the forms of contact; "auto" chooses among them.
    distribution : str, optional
        Name of its Python package; None if palpate cannot run the engine.
    extra : str
        The extra of palpate that installs it.
    takes : frozenset of str
        Which of the options model, geom, tip_radius, friction and name it uses.
    continuous : bool
        Whether it accepts a time step of 0 (continuous time).
    exact_form : str
        The form that has every law, to which "auto" falls back. Default: "", none.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    forms: ClassVar[Mapping[str, str]]
    distribution: ClassVar[str | None] = None
    extra: ClassVar[str] = ""
    takes: ClassVar[frozenset[str]] = frozenset()
    continuous: ClassVar[bool] = False
    exact_form: ClassVar[str] = ""

    @abstractmethod
    def fit(self, request: ExportRequest) -> Fragment:
        """Return the law in this engine's parameters.

        Raises
        ------
        InvalidParameterError
            An option that the engine needs is missing.
        """

    def version(self) -> str | None:
        """Return the version of the installed engine; None if there is none."""
        if self.distribution is None:
            return None
        try:
            return version(self.distribution)
        except PackageNotFoundError:
            return None


#: The engines by name, each at its place; importing one does not import the simulator.
ENGINES: Mapping[str, str] = MappingProxyType(
    {
        "mujoco": "palpate.exports.mujoco:ENGINE",
        "mjx": "palpate.exports.mujoco:MJX",
        "mujoco-warp": "palpate.exports.mujoco:WARP",
        "drake": "palpate.exports.drake.engine:ENGINE",
        "opensim": "palpate.exports.opensim:ENGINE",
        "newton": "palpate.exports.usd:NEWTON",
        "isaaclab": "palpate.exports.usd:ISAAC_LAB",
        "physx": "palpate.exports.usd:PHYSX",
    }
)
#: gz-physics issues 82 and 636, gz-sim issue 1961.
_DART = (
    "Gazebo with DART ignores the <kp> and <kd> of a surface, so it cannot have the law; export to "
    "mujoco or drake instead"
)
_BULLET = (
    "PyBullet has only K x + B v, and adds K times its time step to B: with K and B of palpate "
    "identify FILE --method kelvin-voigt set contactStiffness = K and contactDamping = B - K dt on "
    "one of the two bodies"
)
_ODE = (
    "Gazebo Classic has only K x + B v: set <kp> and <kd> to the K and B of palpate identify FILE "
    "--method kelvin-voigt"
)
_GENESIS = (
    "Genesis takes solref as a time constant only and has a friction pyramid, both of which change "
    "the force; export to mjx or mujoco-warp instead"
)
#: Other names that people type: an engine's own name, or why there is no export and what to use.
OTHER_NAMES: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("mujoco-mjx", "brax"), "mjx"),
        **dict.fromkeys(("mjwarp", "warp", "mujoco-playground"), "mujoco-warp"),
        **dict.fromkeys(("usd", "newton-physics"), "newton"),
        **dict.fromkeys(("isaac", "isaac-lab"), "isaaclab"),
        **dict.fromkeys(("isaacsim", "isaac-sim", "omniverse", "isaacgym", "sapien"), "physx"),
        **dict.fromkeys(("simbody",), "opensim"),
        **dict.fromkeys(("gazebo", "gz", "gz-sim", "dart"), _DART),
        **dict.fromkeys(("gazebo-classic", "ode"), _ODE),
        **dict.fromkeys(("pybullet", "bullet"), _BULLET),
        "genesis": _GENESIS,
    }
)


def engines() -> tuple[str, ...]:
    """Return the names of the engines."""
    return tuple(ENGINES)


def engine_called(name: str) -> Engine:
    """Return the engine of a name, in any case and with hyphens or underscores.

    Raises
    ------
    InvalidParameterError
        There is no such engine.
    ExportRefusedError
        The engine cannot have the law; the message says what to use.
    """
    typed = str(name).strip().lower().replace("_", "-").replace(" ", "-")
    own = OTHER_NAMES.get(typed, typed)
    if typed in OTHER_NAMES and own not in ENGINES:
        raise ExportRefusedError(own)
    check_choice("to", own, ENGINES)
    engine: Engine = resolve_name(ENGINES[own])
    return engine
