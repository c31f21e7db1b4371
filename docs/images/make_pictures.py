"""Write the pictures of the docs that show a result: the README's, one a panel, and the gallery.

python docs/images/make_pictures.py
"""

import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt

import palpate
from palpate import InvalidParameterError, figures, lab
from palpate.fleet.figures import draw_map
from palpate.fleet.maps import map_of

IMAGES = Path(__file__).parent
EXAMPLES = IMAGES.parents[1] / "examples"
THUMBNAIL = 60e-3  # m
PAPER = "#16181c"  # of the dark figures
LIGHT: dict[str, str] = {}
DARK = ["dark_background", {"figure.facecolor": PAPER, "axes.facecolor": PAPER}]


def write(figure: "matplotlib.figure.Figure", name: str) -> None:
    """Write a figure, with the folder that it stands in."""
    path = IMAGES / f"{name}.svg"
    path.parent.mkdir(exist_ok=True)
    figures.save(figure, path)


def draw_late_force() -> "matplotlib.figure.Figure":
    """Draw a stroke at each of two frequencies of a spring, as recorded and without the delay."""
    touch = runpy.run_path(str(EXAMPLES / "gallery" / "late_force.py"))
    delay = touch["delay"].value
    figure, axes = plt.subplots(1, 2, figsize=(6.9, 2.9), sharey=True, layout="constrained")
    for panel, seconds in zip(axes, (0.0, delay), strict=True):
        contact = palpate.prepare(
            time=touch["time"], penetration=touch["depth"], force=touch["late"], delay=seconds
        )
        for label, colour, start, stop in (
            ("4 Hz", "#0072b2", 6.0, 6.25),
            ("1 Hz", "#e69f00", 3.0, 4.0),
        ):
            stroke = contact.window(start, stop)
            panel.plot(1e3 * stroke.penetration, stroke.force, color=colour, label=label)
        panel.set_xlabel("penetration [mm]")
    axes[0].set(ylabel="force [N]", title="as recorded")
    axes[1].set(title=f"{1e3 * delay:.1f} ms taken out")
    axes[0].legend(frameon=False)
    return figure


def main() -> None:
    """Write all of them."""
    matplotlib.use("agg")
    ball = palpate.identify(EXAMPLES / "recordings" / "ball.csv")
    for dark, ending in ((False, ""), (True, "-dark")):
        write(figures.draw(ball, dark=dark), f"ball{ending}")
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
    for name, picture in runpy.run_path(str(IMAGES / "explain.py"))["pictures"]():
        write(picture, name)
    survey = runpy.run_path(str(EXAMPLES / "gallery" / "hard_spot.py"))["table"]
    for style, ending in ((LIGHT, ""), (DARK, "-dark")):
        places = map_of(survey, ("x", "y"), depth=5e-3)
        write(draw_map(places, dark=style is DARK, width=180e-3), f"map{ending}")
        with plt.style.context(style):
            for name in ("usable", "payload"):
                figure = runpy.run_path(str(EXAMPLES / "gallery" / f"{name}.py"))["figure"]
                write(figure, f"{name}{ending}")
            write(draw_late_force(), f"late-force{ending}")


if __name__ == "__main__":
    main()
