"""Base classes of engines, and their registry."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType
from typing import ClassVar

import numpy as np

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

    @property
    def paste(self) -> str:
        """What to do with the files, in one sentence."""
        return "paste the first of these files into your model, as the scene does"

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
    """A simulation engine to which laws can be exported; each module has one as ``ENGINE``.

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
        Which of the options model, geom, tip_radius and name it uses.
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


#: Modules whose ``ENGINE`` is the engine; importing one does not import the simulator.
MODULES: Mapping[str, str] = MappingProxyType(
    {
        "mujoco": "palpate.exports.mujoco",
        "drake": "palpate.exports.drake.engine",
        "opensim": "palpate.exports.opensim",
        "usd": "palpate.exports.usd",
    }
)
#: gz-physics issues 82 and 636, gz-sim issue 1961.
_DART = (
    "Gazebo with DART ignores the <kp> and <kd> of a surface, so it cannot have the law; export to "
    "mujoco or drake instead"
)


def engines() -> tuple[str, ...]:
    """Return the names of the engines."""
    return tuple(MODULES)


def engine_called(name: str) -> Engine:
    """Return the engine of a name.

    Raises
    ------
    InvalidParameterError
        There is no such engine.
    ExportRefusedError
        The engine ignores the parameters of a contact law.
    """
    if name in ("gazebo", "gz", "dart"):
        raise ExportRefusedError(_DART)
    check_choice("to", name, MODULES)
    engine: Engine = import_module(MODULES[name]).ENGINE
    return engine
