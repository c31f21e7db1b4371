"""Newton: an exported scene in USD, moved state by state."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from palpate.exports.motion import ProbeMotion
from palpate.exports.mujoco.accelerated import quick_warp
from palpate.validation import Floats
from palpate.writing import write_text

# s. The step of one state, in which the body hardly moves; Newton calculates in single precision.
_SHORT = 1e-4


class NewtonScene:
    """A tip on a plane, read by Newton from the files of an export.

    SolverMuJoCo runs on MuJoCo itself: the same conversion, without minutes of compilation.

    Parameters
    ----------
    files : mapping of str to str
        Text by file name, with ``scene.usda``.
    solver : str
        "SolverMuJoCo" or "SolverSemiImplicit".
    """

    @quick_warp()
    def __init__(self, files: Mapping[str, str], solver: str) -> None:
        with warnings.catch_warnings():
            # Newton warns of versions of MuJoCo with which it works all the same.
            warnings.simplefilter("ignore")
            import newton

            builder = newton.ModelBuilder()
            newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
            with TemporaryDirectory() as folder:
                for name, text in files.items():
                    write_text(Path(folder, name), text)
                builder.add_usd(str(Path(folder, "scene.usda")))
            self._model = builder.finalize(device="cpu")
            self._pipeline = newton.CollisionPipeline(self._model)
            settings = {"use_mujoco_cpu": True} if solver == "SolverMuJoCo" else {}
            self._solver = getattr(newton.solvers, solver)(self._model, **settings)
        self._states = [self._model.state(), self._model.state()]
        self._contacts = self._pipeline.contacts()
        self._control = self._model.control()
        self._surface = float(self._model.body_q.numpy()[0, 2])
        self._mass = float(self._model.body_mass.numpy()[0])
        self._generalised = solver == "SolverMuJoCo"

    def put(self, penetration: float, velocity: float) -> None:
        """Set the penetration [m] of the tip and its velocity into the surface [m/s]."""
        state = self._states[0]
        place = np.array([[0.0, 0.0, self._surface - penetration, 0.0, 0.0, 0.0, 1.0]], np.float32)
        speed = np.array([[0.0, 0.0, -velocity, 0.0, 0.0, 0.0]], np.float32)
        state.body_q.assign(place)
        state.body_qd.assign(speed)
        state.joint_q.assign(place[0])
        state.joint_qd.assign(speed[0])

    @quick_warp()
    def step(self, time_step: float, wrench: Sequence[float] = (0.0,) * 6) -> None:
        """Simulate a step [s] with a force [N] and torque [N·m] on the tip."""
        before, after = self._states
        before.body_f.assign(np.array([wrench], np.float32))
        if not self._generalised:  # SolverMuJoCo finds its contacts itself
            self._pipeline.collide(before, self._contacts)
        self._solver.step(before, after, self._control, self._contacts, time_step)
        self._states = [after, before]

    def velocity(self) -> Floats:
        """Return the velocity of the tip, m/s."""
        state = self._states[0]
        speed = state.joint_qd.numpy() if self._generalised else state.body_qd.numpy()[0]
        return np.asarray(speed[:3], dtype=np.float64)

    def penetration(self) -> float:
        """Return the penetration of the tip, m."""
        state = self._states[0]
        place = state.joint_q.numpy() if self._generalised else state.body_q.numpy()[0]
        return self._surface - float(place[2])

    def along(self, motion: ProbeMotion, expected: Floats) -> Floats:
        """Return the force at every state of a motion, N.

        The load is chosen so that the body has the motion's acceleration if the force is the
        expected one; the contact's mass is small, so it need not be exact.
        """
        load = expected + self._mass * motion.acceleration
        force = np.zeros(len(motion))
        for k, (x, v) in enumerate(zip(motion.penetration, motion.velocity, strict=True)):
            self.put(float(x), float(v))
            before = self.velocity()[2]
            self.step(_SHORT, (0.0, 0.0, -float(load[k]), 0.0, 0.0, 0.0))
            force[k] = load[k] + self._mass * (self.velocity()[2] - before) / _SHORT
        return force
