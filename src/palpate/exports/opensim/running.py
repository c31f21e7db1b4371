"""OpenSim itself: the model as it reads it, pressed and dropped."""

import math
import warnings
from types import ModuleType

import numpy as np

from palpate.exports.errors import Drop
from palpate.exports.motion import Motion
from palpate.validation import Floats
from palpate.writing import temporary_file

# A body is looked at so often on its way down, and given so many times as long to come back.
_LOOKS, _LONGEST = 100, 20
# With it the exact restitution came out to seven digits.
_ACCURACY = 1e-8


class Scene:
    """A tip on a slide above a half-space."""

    def __init__(self, text: str) -> None:
        self._opensim = _quiet_opensim()
        with temporary_file("contact.osim", [text.encode()]) as path:
            self._model = self._opensim.Model(str(path))
        self._state = self._model.initSystem()
        self._coordinate = self._model.getCoordinateSet().get("penetration")
        self._force = self._opensim.HuntCrossleyForce.safeDownCast(
            self._model.getForceSet().get("contact")
        )
        self._column = self._force.getRecordLabels().findIndex("contact.tip.force.X")

    def forces(self, motion: Motion) -> Floats:
        """Return the force at every state of a motion, N."""
        force = np.empty(len(motion))
        for k in range(len(motion)):
            self._coordinate.setValue(self._state, float(motion.penetration[k]))
            self._coordinate.setSpeedValue(self._state, float(motion.velocity[k]))
            self._model.realizeDynamics(self._state)
            force[k] = -self._force.getRecordValues(self._state).get(self._column)
        return force

    def rebound(self, drop: Drop) -> float:
        """Restitution of a body of the drop's mass; 0 of one that stays."""
        step = drop.depth / drop.speed / _LOOKS
        self._model.getBodySet().get("tip").setMass(drop.mass)
        state = self._model.initSystem()
        self._coordinate.setValue(state, 0.0)
        self._coordinate.setSpeedValue(state, drop.speed)
        manager = self._opensim.Manager(self._model)
        manager.setIntegratorAccuracy(_ACCURACY)
        manager.setIntegratorMaximumStepSize(step)
        manager.initialize(state)
        for k in range(1, _LOOKS * _LONGEST):
            state = manager.integrate(k * step)
            x, v = self._coordinate.getValue(state), self._coordinate.getSpeedValue(state)
            if x <= 0.0 and v < 0.0:
                return float(-v / drop.speed)
            if not math.isfinite(v):
                break
        return 0.0


def _quiet_opensim() -> ModuleType:
    with warnings.catch_warnings():
        # Python 3.12 says it of every extension made by an older SWIG, as it is imported.
        warnings.filterwarnings(
            "ignore", "builtin type .* has no __module__ attribute", DeprecationWarning
        )
        import opensim
    # Or it leaves a log in whichever folder this runs in.
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("Off")
    module: ModuleType = opensim
    return module
