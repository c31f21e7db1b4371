"""A picture of the rig in contact with the material: rendered by MuJoCo, or a drawing."""

import io
import os
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import InvalidParameterError, PalpateError, require_mujoco
from palpate.lab.bench import Bench
from palpate.lab.rig import Geometry, Simulation, TwinPantograph
from palpate.lab.trajectories import Command
from palpate.output import figures
from palpate.validation import Values
from palpate.writing import write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class NoRendererError(PalpateError, RuntimeError):
    """MuJoCo cannot render on this machine: it finds no graphics library."""


def photograph(bench: Bench, at: float = 3.0, size: tuple[int, int] = (1200, 760)) -> Values:
    """Return an image of a bench's rig at a time [s] of its trajectory.

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
        MuJoCo finds no graphics library.
    """
    robot = bench.probe if isinstance(bench.probe, TwinPantograph) else TwinPantograph()
    step = bench.sensors.sample_time
    time = step * np.arange(max(round(at / step), 1), dtype=np.float64)
    command = bench.trajectory.at(time)
    run = robot.start(command, step, np.random.default_rng(0))
    run.simulate(time, command, bench.material.touch())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the error reports a missing screen
            return _render_frame(run, *size)
    except Exception as error:  # each graphics library raises other errors
        raise NoRendererError(f"MuJoCo cannot render on this machine: {error}") from None


def _render_frame(run: Simulation, width: int, height: int) -> Values:
    mujoco = require_mujoco()
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        from mujoco.egl import GLContext  # needs no screen
    else:
        from mujoco.gl_context import GLContext
    context = GLContext(width, height)
    try:
        context.make_current()
        camera = mujoco.MjvCamera()
        camera.lookat[:] = (0.02, -0.085, -0.02)
        camera.distance = 0.46
        camera.azimuth = 58.0
        camera.elevation = -40.0
        scene = mujoco.MjvScene(run.model, maxgeom=200)
        options = mujoco.MjvOption()
        every_part = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(run.model, run.data, options, None, camera, every_part, scene)
        target = mujoco.MjrContext(run.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, target)
        view = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_render(view, scene, target)
        mujoco.mjr_readPixels(pixels, None, view, target)
        target.free()
    finally:
        context.free()
    return pixels[::-1]


def save_rig(bench: Bench, path: str | Path, *, dark: bool = False) -> str:
    """Write a picture of the rig; return "rendered" or "drawn".

    MuJoCo renders a .png if it can; otherwise, and for other formats, the picture is a drawing.

    Parameters
    ----------
    bench : Bench
        Its probe must be a :class:`palpate.lab.TwinPantograph`.
    path : str or Path
        .png, .svg or .pdf.
    dark : bool
        Draw for a dark background; no effect on a rendered picture. Default: False.
    """
    path = Path(path)
    if not isinstance(bench.probe, TwinPantograph):
        raise InvalidParameterError(f"an {bench.probe.name} has no rig: use TwinPantograph()")
    if path.suffix.lower() == ".png":
        with suppress(NoRendererError), figures.figure_style(figures.choose_look()):
            from matplotlib.image import imsave

            file = io.BytesIO()
            imsave(file, photograph(bench), format="png")
            write_bytes(path, file.getvalue())
            return "rendered"
    figures.save(draw_rig(bench, dark=dark), path)
    return "drawn"


def draw_rig(bench: Bench, *, dark: bool = False) -> "Figure":
    """Draw the rig from above, at its commanded position 3 s into the trajectory."""
    look = figures.choose_look(dark=dark)
    command = bench.trajectory.at(np.array([3.0]))
    with figures.figure_style(look) as new_figure:
        figure = new_figure(figsize=(7.6, 5.8), layout="constrained")
        axes = figure.add_subplot()
        _draw_linkage(axes, command, look)
        axes.axhspan(0.0, 40.0, color=look.colour(1), alpha=0.25, linewidth=0.0)
        axes.text(-165.0, 34.0, bench.material.name, va="top")
        axes.set(xlabel="along the surface [mm]", ylabel="into the material [mm]")
        axes.set(aspect="equal", xlim=(-175.0, 175.0), ylim=(-215.0, 40.0))
        depth = 1e3 * float(command.penetration[0])
        axes.set_title(f"Planar twin pantograph, {depth:.1f} mm in the {bench.material.name}")
    return figure


def _draw_linkage(axes: "Axes", command: Command, look: figures.Look) -> None:
    geometry = Geometry()
    theme = look.theme
    x = command.lateral_position
    y = command.penetration
    angles = geometry.motor_angles(x, y)
    elbows = 1e3 * geometry.elbows(angles)[0]
    wrists = 1e3 * geometry.wrists(x, y)[0]
    motors = 1e3 * geometry.motors
    for i in range(4):
        links = np.array([motors[i], elbows[i], wrists[i // 2]])
        axes.plot(*links.T, color=theme.lines[0], linewidth=5.0, solid_capstyle="round")
    axes.plot(*wrists.T, color=theme.ink, linewidth=7.0, solid_capstyle="round")
    middle = wrists.mean(axis=0)
    tip = 1e3 * np.array([x[0], y[0]])
    axes.plot(*np.array([middle, tip]).T, color=theme.lines[1], linewidth=4.0)
    axes.plot(*motors.T, "o", color=theme.ink, markersize=17.0)
    axes.plot(*np.vstack([elbows, wrists]).T, "o", color=theme.background, markersize=4.0)
    for text, at in (("two motors, two encoders", motors[:2].mean(axis=0)), ("handle", middle)):
        axes.text(at[0], at[1] - 12.0, text, ha="center", va="top")
    axes.text(6.0, -20.0, "force sensor and poker", va="center")
