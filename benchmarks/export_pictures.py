"""``python -m benchmarks.export_pictures FOLDER``: draw measured force and that of a MuJoCo scene.

The laboratory's phantom, and others' recording of a robot on silicone, from ``PALPATE_DATA`` or
``../shared/data`` next to the checkout, which is skipped if it is absent; light and dark. Pixels
only: no copy of the data.
"""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import palpate
from benchmarks.common.recordings import recorded
from benchmarks.common.report import run_command
from palpate import exports
from palpate.figures.style import Look, save, style
from palpate.results.colours import DARK, LIGHT, Theme
from palpate.validation import Floats
from palpate.writing import write_bytes

EXAMPLES = Path(__file__).parents[1] / "examples" / "recordings"
# The width in which the docs show it: 1100 dots.
INCHES, DOTS_AN_INCH = (10.0, 2.9), 110
COLOURS = 64
MASS = 1.0  # kg, of the probe in the scene
# Duration of the left panels.
SHOWN = 3.0


@dataclass(frozen=True)
class Replayed:
    """A recording in firm contact, and the engine's force at its samples.

    Attributes
    ----------
    time, penetration, measured, law, engine : numpy.ndarray, shape (k,)
        s, m, and N: as measured, by the identified law, and in MuJoCo.
    made : Export
        The export.
    """

    time: Floats
    penetration: Floats
    measured: Floats
    law: Floats
    engine: Floats
    made: exports.Export


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
        replayed = pressed(file)
        print(replayed.made, flush=True)
        for theme, ending in ((LIGHT, ""), (DARK, "-dark")):
            draw(folder / f"export-{name}{ending}.png", replayed, theme)


def pressed(file: Path) -> Replayed:
    """Identify, export to MuJoCo, and replay."""
    result = palpate.identify(file)
    made = exports.export(result, "mujoco", mass=MASS)
    motion = exports.ProbeMotion.recorded(result).firm()
    ran = made.fragment.replay(motion)
    assert ran is not None
    assert motion.force is not None
    law = motion.force_by(result.law)
    time = motion.time - motion.time[0]
    return Replayed(time, motion.penetration, motion.force, law, ran.force, made)


def draw(path: Path, replayed: Replayed, theme: Theme) -> None:
    """Draw both forces over time and over penetration, and their difference."""
    import matplotlib

    with style(Look(theme)) as new_figure, matplotlib.rc_context({"savefig.dpi": DOTS_AN_INCH}):
        figure = new_figure(figsize=INCHES, layout="constrained")
        panels = figure.subplots(1, 3)
        _draw_panels(panels, replayed, theme)
        lines = [*panels[0].get_lines(), *panels[2].get_lines()]
        figure.legend(handles=lines, loc="outside upper right", ncols=4)
        percent = replayed.made.statement.compared.percent
        words = f"MuJoCo, {replayed.made.fragment.form}: {percent:.2g} % from the law"
        figure.suptitle(words, x=0.01, ha="left", fontsize=10.5)
        save(figure, path)
    with_few_colours(path)


def _draw_panels(panels: Any, replayed: Replayed, theme: Theme) -> None:
    over_time, loop, left = panels
    shown = replayed.time < SHOWN
    looks: tuple[tuple[str, Floats, dict[str, Any]], ...] = (
        ("measured", replayed.measured, {"color": theme.measured, "linewidth": 2.6}),
        ("MuJoCo", replayed.engine, {"color": theme.lines[0], "linewidth": 1.1}),
    )
    for label, force, look in looks:
        over_time.plot(replayed.time[shown], force[shown], label=label, **look)
        loop.plot(1e3 * replayed.penetration[shown], force[shown], **look)
    # The law's is under the engine's: dashes over a line show both.
    residuals = (
        (replayed.measured - replayed.engine, theme.lines[0], "-", "measured − MuJoCo"),
        (replayed.measured - replayed.law, theme.lines[1], "--", "measured − law"),
    )
    for rest, colour, dashes, label in residuals:
        middle = _smoothed(rest)
        left.plot(
            replayed.time[shown], middle[shown], dashes, color=colour, linewidth=1.1, label=label
        )
    noise = 2.0 * noise_of(replayed.measured)
    left.axhspan(-noise, noise, color=theme.measured, alpha=0.45, linewidth=0.0)
    over_time.set(xlabel="time in contact [s]", ylabel="force [N]")
    loop.set(xlabel="penetration [mm]", ylabel="force [N]")
    left.set(xlabel="time in contact [s]", ylabel="residual [N]")
    over_time.set_title("force", loc="left")
    loop.set_title("loop", loc="left")
    left.set_title("residual; grey: noise ± 2 s.d.", loc="left")


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


def _smoothed(values: Floats) -> Floats:
    """A running mean of 25 samples."""
    window = np.full(25, 1.0 / 25.0)
    around = np.pad(values, 12, mode="edge")
    smooth: Floats = np.convolve(around, window, mode="valid")
    return smooth


if __name__ == "__main__":
    run_command(main)
