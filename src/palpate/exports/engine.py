"""What an engine is, to an export: its ways of carrying a law, and what it makes of it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import ClassVar

import numpy as np

from palpate.exports.asked import Asked
from palpate.exports.errors import Drop, rebound_by
from palpate.exports.motion import MOST_SAMPLES, Motion
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """What an engine did along a motion.

    Attributes
    ----------
    force : numpy.ndarray, shape (k,)
        On the probe, out of the material, N, at every sample of the motion that it was asked for.
    how : str
        How the engine was moved, in words.
    """

    force: Floats
    how: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Fragment(ABC):
    """A law in an engine's own numbers: text to paste, and what the engine will do with it.

    Attributes
    ----------
    form : str
        Which of the engine's ways.
    asked : Asked
        What it was made for.
    numbers : mapping of str to float
        The engine's own parameters by their names.
    engine_law : GeneralisedHuntCrossley, optional
        The force law that the engine then has, where it is one of these; but for what
        :meth:`predicted` adds.
    exact : bool
        Whether that is the law that was asked for, to the engine's own accuracy.
    largest_step : float, optional
        The time step from which on the simulation is unstable, s.
    warnings, refusals : tuple of str
        What a user should know; and why this should not be used.
    most_samples : int
        At how many states, for an engine that is slow.
    """

    most_samples: ClassVar[int] = MOST_SAMPLES
    form: str
    asked: Asked = field(repr=False)
    numbers: Mapping[str, float]
    engine_law: GeneralisedHuntCrossley | None = None
    exact: bool = False
    largest_step: float | None = None
    warnings: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()

    @abstractmethod
    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return text by file name: what is to be pasted, and the smallest scene that runs.

        Parameters
        ----------
        notes : sequence of str
            Lines that each of them has to carry as a comment: origin, error, warnings.
        """

    def predicted(self, motion: Motion) -> Floats:
        """Force that the engine will have along a motion, N: of its law, and it cannot pull."""
        if self.engine_law is None:
            raise NotImplementedError
        return np.maximum(motion.force_by(self.engine_law), 0.0)

    def predicted_rebound(self, drop: Drop) -> float:
        """Restitution that the engine will have in a drop."""
        if self.engine_law is None:
            raise NotImplementedError
        return rebound_by(self.engine_law, drop)

    def replay(self, motion: Motion) -> Replayed | None:
        """Return what the real engine does along a motion; None of one that is not run here."""
        return None

    def rebound(self, drop: Drop) -> float | None:
        """Restitution in the real engine in a drop, at the time step; None where it is not run."""
        return None


class Engine(ABC):
    """A simulation engine that a law can be exported to; its module has one as ``ENGINE``.

    Attributes
    ----------
    name : str
        As ``--to`` knows it.
    title : str
        As a person does.
    forms : mapping of str to str
        Its ways by name, in words; "auto" chooses among them.
    distribution : str, optional
        What pip installs; None of an engine of which text is written only.
    extra : str
        Of palpate, which brings it.
    takes : frozenset of str
        Which of model, geom and tip_radius it can do something with.
    continuous : bool
        Whether it can do without time steps: a time step of 0.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    forms: ClassVar[Mapping[str, str]]
    distribution: ClassVar[str | None] = None
    extra: ClassVar[str] = ""
    takes: ClassVar[frozenset[str]] = frozenset()
    continuous: ClassVar[bool] = False

    @abstractmethod
    def fit(self, asked: Asked) -> Fragment:
        """Return the law in this engine's numbers.

        Raises
        ------
        InvalidParameterError
            Something that this engine cannot do without is not given.
        """

    def version(self) -> str | None:
        """Of the installed engine; None where it is not there, or none is run."""
        if self.distribution is None:
            return None
        try:
            return version(self.distribution)
        except PackageNotFoundError:
            return None
