"""A picture of the rig as it presses the material, by MuJoCo's own renderer."""

import os
import sys
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.errors import PalpateError
from palpate.lab.bench import Bench
from palpate.lab.robot import Simulation, TwinPantograph, require_mujoco


class NoRendererError(PalpateError, RuntimeError):
    """MuJoCo cannot render here: there is no graphics library that it can use."""


def photograph(bench: Bench, at: float = 3.0, size: tuple[int, int] = (1200, 760)) -> NDArray[Any]:
    """Return the rig of a bench as it stands at a time [s] of its trajectory.

    Parameters
    ----------
    bench : Bench
        Its robot, material and trajectory.
    at : float
        s.
    size : tuple of int
        Width and height in pixels, at most 1600 × 1000.

    Returns
    -------
    numpy.ndarray of uint8, shape (height, width, 3)

    Raises
    ------
    MissingExtraError
        MuJoCo is not installed.
    NoRendererError
        There is no graphics library that it can use.
    """
    robot = bench.probe if isinstance(bench.probe, TwinPantograph) else TwinPantograph()
    step = bench.sensors.sample_time
    time = step * np.arange(max(round(at / step), 1), dtype=np.float64)
    command = bench.trajectory.at(time)
    run = robot.start(command, step, np.random.default_rng(0))
    run.simulate(time, command, bench.material.touch())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a screen that is missing, which the error says
            return _rendered(run, *size)
    except Exception as error:  # each graphics library fails in its own way
        raise NoRendererError(f"MuJoCo cannot render here: {error}") from None


def _rendered(run: Simulation, width: int, height: int) -> NDArray[Any]:
    mujoco = require_mujoco()
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        from mujoco.egl import GLContext  # needs no screen
    else:
        from mujoco.gl_context import GLContext
    context = GLContext(width, height)
    try:
        context.make_current()
        scene = mujoco.MjvScene(run.model, maxgeom=200)
        mujoco.mjv_updateScene(
            run.model,
            run.data,
            mujoco.MjvOption(),
            None,
            _camera(),
            mujoco.mjtCatBit.mjCAT_ALL,
            scene,
        )
        target = mujoco.MjrContext(run.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, target)
        view, pixels = mujoco.MjrRect(0, 0, width, height), np.empty((height, width, 3), np.uint8)
        mujoco.mjr_render(view, scene, target)
        mujoco.mjr_readPixels(pixels, None, view, target)
        target.free()
    finally:
        context.free()
    return pixels[::-1]


def _camera() -> Any:
    camera = require_mujoco().MjvCamera()
    camera.lookat[:] = (0.02, -0.085, -0.02)
    camera.distance, camera.azimuth, camera.elevation = 0.46, 58.0, -40.0
    return camera
