"""An exported fragment, for the laboratory to press: the engine's force in place of a law's."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.exports.exporting import Export
from palpate.exports.motion import Motion
from palpate.lab.materials import Touch
from palpate.validation import Floats


class InAnEngine(ABC):
    """A material of the laboratory whose force an engine works out, state by state."""

    name: str

    @abstractmethod
    def pushed(self, motion: Motion) -> Floats:
        """Force of the engine [N] at the states of a motion below the surface, shape (k,)."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return what a recording says of its truth, SI."""

    def touch(self) -> Touch:
        """Refuse: the contact of an engine has the probe's acceleration in it.

        Raises
        ------
        InvalidParameterError
            Always.
        """
        raise InvalidParameterError(
            f"{self.name} can be pressed by an ideal probe only (--probe ideal), whose motion is "
            "known beforehand: the contact of an engine has the acceleration in it"
        )

    def force(
        self, time: Floats, lateral_position: Floats, penetration: Floats, velocity: Floats
    ) -> Floats:
        """Force of the engine [N] along a whole motion, shapes (k,); 0 out of contact."""
        force = np.zeros_like(time)
        below = np.flatnonzero(penetration > 0.0)
        if below.size:
            force[below] = self.pushed(
                Motion(
                    time[below],
                    penetration[below],
                    velocity[below],
                    np.gradient(velocity, time)[below],
                    np.ones(below.size, dtype=np.bool_),
                )
            )
        return force


class Pressed(InAnEngine):
    """A material of the laboratory whose force is that of the real engine, state by state.

    The round trip: of what an engine makes of a law the laboratory records a contact, which is
    identified as any other.

    Parameters
    ----------
    made : Export
        By :func:`palpate.exports.export`; to be pressed by :class:`palpate.lab.IdealProbe`.

    Raises
    ------
    InvalidParameterError
        The engine is not run here.
    """

    def __init__(self, made: Export) -> None:
        engine = made.statement.engine
        self._made = made
        self.name = f"{made.statement.source.name or 'a law'} in {engine.title}"

    def pushed(self, motion: Motion) -> Floats:
        """Force of the replayed fragment [N], shape (k,)."""
        ran = self._made.fragment.replay(motion)
        if ran is None:
            engine = self._made.statement.engine
            raise MissingExtraError(f"{engine.title} is not run here: nothing can press it")
        return ran.force

    def describe(self) -> dict[str, Any]:
        """Return the law that was exported, SI, and the engine."""
        statement = self._made.statement
        law = statement.nearest.law.simplest()
        inside = {"engine": statement.engine.name, "form": statement.fragment.form}
        return {"kind": law.kind, **law.as_dict(), **inside}
