"""MJX and MuJoCo-Warp: MuJoCo's contacts on accelerators, with the same XML.

MJX ignores the adhesion of a pair, so its contacts only push; MuJoCo-Warp has it. Neither calls
Python at every step. Both replay all states at once, in the minimal scene.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, ClassVar

import numpy as np

from palpate.exports.engine import Replayed
from palpate.exports.motion import ProbeMotion
from palpate.exports.mujoco.engine import InRows, MuJoCo
from palpate.exports.mujoco.fitting import MOST_STEPS
from palpate.exports.mujoco.robot import engine_here
from palpate.exports.replay_errors import Drop
from palpate.validation import Floats

_HOW = "by inverse dynamics of scene.xml, all states at once"


@contextmanager
def written_for(engine: str) -> Iterator[None]:
    """Raise ImportError where another version of an engine lacks what a replay calls."""
    try:
        yield
    except (AttributeError, TypeError) as error:
        raise ImportError(f"palpate is written for {engine}: {error}") from error


@contextmanager
def quick_warp() -> Iterator[None]:
    """Let Warp compile without optimisation, in 26 s instead of 70 s, and print nothing of it."""
    import warp

    config = warp.config
    before = config.log_level, config.optimization_level
    config.log_level = warp.LOG_ERROR
    config.optimization_level = 0
    try:
        yield
    finally:
        config.log_level, config.optimization_level = before


def _slide(motion: ProbeMotion) -> tuple[Floats, Floats, Floats]:
    """Return position, velocity and acceleration of the scene's slide, which points up."""
    return -motion.penetration, -motion.velocity, -motion.acceleration


class InMjx(InRows):
    """A law as contacts that MJX simulates."""

    def _model(self, speed: float) -> tuple[Any, Any]:
        """Return the scene of MJX, and its state with a body that arrives at a speed [m/s]."""
        from mujoco import mjx

        mujoco = engine_here()
        model = mujoco.MjModel.from_xml_string(self.scene(speed))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        return mjx.put_model(model), mjx.put_data(model, data)

    @written_for("MJX 3.17")
    def replay(self, motion: ProbeMotion) -> Replayed | None:
        """Return the force by inverse dynamics in MJX."""
        import jax
        from mujoco import mjx

        model, data = self._model(0.0)

        def force(position: Any, velocity: Any, acceleration: Any) -> Any:
            state = data.replace(
                qpos=position[None],
                qvel=velocity[None],
                qacc=acceleration[None],
            )
            return mjx.inverse(model, state).qfrc_constraint[0]

        forces: Any = jax.jit(jax.vmap(force))
        found = forces(*map(jax.numpy.asarray, _slide(motion)))
        return Replayed(np.asarray(found, dtype=np.float64), _HOW)

    def drop_restitution(self, drop: Drop) -> float | None:
        """Return the restitution in MJX, for a body of mass 1/Â; 0 if it stays."""
        import jax
        from mujoco import mjx

        model, data = self._model(drop.speed)
        limit = MOST_STEPS * self.request.time_step
        inside = lambda state: (state.qpos[0] < 0.0) & (state.time < limit)  # noqa: E731
        step: Any = jax.jit(lambda state: mjx.step(model, state))
        end = jax.lax.while_loop(inside, step, step(data))
        return max(float(end.qvel[0]), 0.0) / drop.speed


class InWarp(InRows):
    """A law as contacts that MuJoCo-Warp simulates."""

    @written_for("MuJoCo-Warp 4.0")
    @quick_warp()
    def replay(self, motion: ProbeMotion) -> Replayed | None:
        """Return the force by inverse dynamics in MuJoCo-Warp."""
        import mujoco_warp

        mujoco = engine_here()
        model = mujoco.MjModel.from_xml_string(self.scene(0.0))
        data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=len(motion))
        for array, values in zip((data.qpos, data.qvel, data.qacc), _slide(motion), strict=True):
            array.assign(values.astype(np.float32)[:, None])
        mujoco_warp.inverse(mujoco_warp.put_model(model), data)
        # A pair that may pull has its adhesion among the passive forces.
        found = data.qfrc_constraint.numpy() + data.qfrc_passive.numpy()
        return Replayed(found[:, 0].astype(np.float64), _HOW)

    def drop_restitution(self, drop: Drop) -> float | None:
        """Return None: MuJoCo-Warp steps as MuJoCo does, which the prediction follows."""
        return None


def _without_callback() -> Mapping[str, str]:
    return {form: text for form, text in MuJoCo.forms.items() if form != "callback"}


class Mjx(MuJoCo):
    """A law as contacts that only push."""

    name: ClassVar[str] = "mjx"
    title: ClassVar[str] = "MJX"
    forms: ClassVar[Mapping[str, str]] = {
        form: text for form, text in _without_callback().items() if form != "pair"
    }
    distribution: ClassVar[str | None] = "mujoco-mjx"
    extra: ClassVar[str] = "engines"
    rows_class: ClassVar[type[InRows]] = InMjx

    def pulls(self) -> bool:
        """Return False: MJX ignores the adhesion of a pair."""
        return False


class MuJoCoWarp(MuJoCo):
    """A law as contacts that may pull."""

    name: ClassVar[str] = "mujoco-warp"
    title: ClassVar[str] = "MuJoCo-Warp"
    forms: ClassVar[Mapping[str, str]] = _without_callback()
    distribution: ClassVar[str | None] = "mujoco-warp"
    extra: ClassVar[str] = "engines"
    rows_class: ClassVar[type[InRows]] = InWarp


MJX = Mjx()
WARP = MuJoCoWarp()
