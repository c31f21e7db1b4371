"""Write the pictures of the docs that show a result: home, one a panel, and the gallery.

python docs/images/make_pictures.py
"""

import re
import runpy
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

import palpate
from palpate import InvalidParameterError, figures, lab

IMAGES = Path(__file__).parent
EXAMPLES = IMAGES.parents[1] / "examples"
THUMBNAIL = 60e-3  # m
LATE = 18e-3  # s, of the force on the home page
# The pages of how-to whose picture is that of their own command with --figure.
DOORS = "csv", "robot-log", "testing-machine", "afm", "robot-learning"
FENCED = re.compile(r"^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.M | re.S)
DRAWING = re.compile(r"palpate (.+) --figure \S+(.*)$", re.M)


def write(figure: "matplotlib.figure.Figure", name: str) -> None:
    """Write a figure, with the folder that it stands in."""
    path = IMAGES / f"{name}.svg"
    path.parent.mkdir(exist_ok=True)
    figures.save(figure, path)


def draw_door(name: str) -> None:
    """Run a page's first script in an empty folder, and draw what its command draws."""
    page = (IMAGES.parent / "how-to" / f"{name}.md").read_text("utf-8")
    script = next(each["text"] for each in FENCED.finditer(page) if each["language"] == "python")
    drawing = DRAWING.search(page)
    assert drawing is not None, f"{name}.md has no command with --figure"
    (IMAGES / "doors").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "examples").symlink_to(EXAMPLES)
        subprocess.run([sys.executable, "-c", script], cwd=folder, check=True)
        command = [sys.executable, "-m", "palpate", *shlex.split(drawing[1] + drawing[2])]
        for options, ending in (([], ""), (["--dark"], "-dark")):
            figure = IMAGES / "doors" / f"{name}{ending}.svg"
            subprocess.run([*command, "--figure", figure, *options], cwd=folder, check=True)


def draw_home(dark: bool) -> "matplotlib.figure.Figure":
    """Draw three answers side by side: a loop with its mark, a map, and a delay found."""
    sponge = palpate.identify(EXAMPLES / "recordings" / "sponge.csv")
    stiffness = sponge.diagnosis.working_depth.stiffness
    hard_spot = runpy.run_path(str(EXAMPLES / "gallery" / "hard_spot.py"))
    x, y = (1e3 * np.unique(hard_spot[name]) for name in "xy")
    spring = runpy.run_path(str(EXAMPLES / "gallery" / "late_force.py"))
    time, depth = spring["time"], spring["depth"]
    late = np.interp(time - LATE, time, np.maximum(3000.0 * depth, 0.0))
    late += np.random.default_rng(1).normal(0.0, 0.01, time.size)
    delay = palpate.skew(palpate.prepare(time=time, penetration=depth, force=late)).delay
    style = {"font.size": 11.0, "axes.titlesize": 12.0, "axes.spines.top": False}
    style |= {"axes.spines.right": False, "svg.hashsalt": "home", "legend.frameon": False}
    style |= {"legend.handlelength": 1.2, "axes.labelpad": 1.0}
    with plt.style.context(["dark_background" if dark else "default", style]):
        figure, (loop, place, line) = plt.subplots(
            1, 3, figsize=(7.8, 2.66), layout="constrained", gridspec_kw={"wspace": 0.1}
        )
        figures.draw(sponge, ["loop"], ax=loop, dark=dark)
        loop.set(title=f"{stiffness.value:.0f} ± {stiffness.whole_error:.0f} N/m: trust")
        values = 1e-3 * np.asarray(hard_spot["table"]["stiffness"]).reshape(len(y), len(x))
        square = slice(len(x) - len(y), None)
        image = place.pcolormesh(x[square], y, values[:, square], rasterized=True)
        figure.colorbar(image, ax=place, shrink=0.9, aspect=12, label="kN/m")
        place.set(title="stiffness of a pad", xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
        part = slice(6000, 6250)  # one stroke at 4 Hz
        grey, blue = "0.6", "#58a6ff" if dark else "#0072b2"
        line.plot(1e3 * depth[part], late[part], color=grey, linewidth=2.5, label="before")
        shifted = np.interp(time + delay.value, time, late)
        line.plot(1e3 * depth[part], shifted[part], color=blue, label="after")
        words = f"{1e3 * delay.value:.2f} ± {1e3 * delay.whole_error:.2f} ms late"
        line.set(xlabel="penetration [mm]", ylabel="force [N]", title=words)
        line.legend(loc="upper left")
        for patch in (figure.patch, loop.patch, line.patch):
            patch.set_alpha(0.0)
    return figure


def main() -> None:
    """Write all of them."""
    matplotlib.use("agg")
    ball = palpate.identify(EXAMPLES / "recordings" / "ball.csv")
    for dark, ending in ((False, ""), (True, "-dark")):
        write(figures.draw(ball, dark=dark), f"ball{ending}")
        write(draw_home(dark), f"home{ending}")
    for name in DOORS:
        draw_door(name)
    single = palpate.identify(EXAMPLES / "recordings" / "ball.csv", "single-stage")
    touch = lab.Bench(lab.TISSUE, lab.THREE_SINES, lab.IdealProbe()).run(seed=1).contact
    relaxing = palpate.identify(touch)
    for name in (*figures.PANELS, "n"):
        for result in (ball, single, relaxing):
            try:
                write(figures.draw(result, [name], width=THUMBNAIL), f"panels/{name}")
            except InvalidParameterError:  # not a panel of this result
                continue
            break
    for script in sorted((EXAMPLES / "gallery").glob("*.py")):
        write(runpy.run_path(str(script))["figure"], f"gallery/{script.stem}")


if __name__ == "__main__":
    main()
