"""``python -m benchmarks.export_pictures FOLDER``: draw measured force and that of a MuJoCo scene.

The laboratory's phantom, and others' recording of a robot on silicone, from ``PALPATE_DATA`` or
``../shared/data`` next to the checkout, which is skipped if it is absent; light and dark. Pixels
only: no copy of the data.
"""

import io
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

import palpate
from benchmarks.common.recordings import recorded
from benchmarks.common.report import run_command
from palpate import exports
from palpate.output.figures.style import Look, figure_style, save
from palpate.output.results.colours import DARK, LIGHT, Theme
from palpate.validation import Floats
from palpate.writing import write_bytes

EXAMPLES = Path(__file__).parents[1] / "examples" / "recordings"
# The width in which the docs show it: 1100 dots.
INCHES, DOTS_AN_INCH = (10.0, 2.9), 110
COLOURS = 64
MASS = 1.0  # kg, of the probe in the scene
# Duration of the left panels.
SHOWN = 3.0


class Signals(NamedTuple):
    """Time, s, penetration, mm, and forces, N: measured, by the identified law, in MuJoCo."""

    time: Floats
    penetration: Floats
    measured: Floats
    law: Floats
    engine: Floats


def main(folder: Path) -> None:
    """Draw them.

    Parameters
    ----------
    folder
        Where export-phantom.png, export-phantom-dark.png and so on are written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    recordings = {"phantom": EXAMPLES / "phantom.csv"}
    for path in recorded("G_silicone_d10mm_sphere.csv"):
        recordings["silicone"] = path
    for name, file in recordings.items():
        draw_both(name, folder, file)


def draw_both(name: str, folder: Path, file: Path) -> None:
    """Identify, export to MuJoCo, replay, and draw for a light and a dark page."""
    result = palpate.identify(file)
    made = exports.export(result, "mujoco", mass=MASS)
    motion = exports.ProbeMotion.recorded(result).firm()
    ran = made.fragment.replay(motion)
    assert ran is not None
    assert motion.force is not None
    signals = Signals(
        motion.time - motion.time[0],
        1e3 * motion.penetration,
        motion.force,
        motion.force_by(result.law),
        ran.force,
    )
    percent = made.statement.compared.percent
    title = f"MuJoCo, {made.fragment.form}: {percent:.2g} % from the law"
    for theme, ending in ((LIGHT, ""), (DARK, "-dark")):
        draw(folder / f"export-{name}{ending}.png", signals, title, theme)


def draw(path: Path, signals: Signals, title: str, theme: Theme) -> None:
    """Draw both forces over time and over penetration, and their difference."""
    import matplotlib

    with (
        figure_style(Look(theme)) as new_figure,
        matplotlib.rc_context({"savefig.dpi": DOTS_AN_INCH}),
    ):
        figure = new_figure(figsize=INCHES, layout="constrained")
        panels = figure.subplots(1, 3)
        _draw_panels(panels, signals, theme)
        lines = [*panels[0].get_lines(), *panels[2].get_lines()]
        figure.legend(handles=lines, loc="outside upper right", ncols=4)
        figure.suptitle(title, x=0.01, ha="left", fontsize=10.5)
        save(figure, path)
    with_few_colours(path)


def _draw_panels(panels: Any, signals: Signals, theme: Theme) -> None:
    over_time, loop, left = panels
    shown = signals.time < SHOWN
    time = signals.time[shown]
    for label, force, width, colour in (
        ("measured", signals.measured, 2.6, theme.measured),
        ("MuJoCo", signals.engine, 1.1, theme.lines[0]),
    ):
        look = {"color": colour, "linewidth": width}
        over_time.plot(time, force[shown], label=label, **look)
        loop.plot(signals.penetration[shown], force[shown], **look)
    # The law's is under the engine's: dashes over a line show both.
    for label, force, dashes, colour in (
        ("measured − MuJoCo", signals.engine, "-", theme.lines[0]),
        ("measured − law", signals.law, "--", theme.lines[1]),
    ):
        middle = uniform_filter1d(signals.measured - force, 25, mode="nearest")
        left.plot(time, middle[shown], dashes, color=colour, linewidth=1.1, label=label)
    noise = 2.0 * noise_of(signals.measured)
    left.axhspan(-noise, noise, color=theme.measured, alpha=0.45, linewidth=0.0)
    for panel, title, x, y in (
        (over_time, "force", "time in contact [s]", "force [N]"),
        (loop, "loop", "penetration [mm]", "force [N]"),
        (left, "residual; grey: noise ± 2 s.d.", "time in contact [s]", "residual [N]"),
    ):
        panel.set(xlabel=x, ylabel=y)
        panel.set_title(title, loc="left")


def noise_of(force: Floats) -> float:
    """Return the noise of a force smooth over four samples, N: third differences have √20."""
    return float(1.4826 * np.median(np.abs(np.diff(force, 3))) / np.sqrt(20.0))


def with_few_colours(path: Path) -> None:
    """A third of the bytes: lines of five colours need few more at their edges."""
    from PIL import Image

    smaller = io.BytesIO()
    with Image.open(path) as image:
        few = image.convert("RGB").quantize(
            COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
        )
    few.save(smaller, format="PNG", optimize=True)
    write_bytes(path, smaller.getvalue())


if __name__ == "__main__":
    run_command(main)
