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
    survey = runpy.run_path(str(EXAMPLES / "gallery" / "hard_spot.py"))["table"]
    for style, ending in ((LIGHT, ""), (DARK, "-dark")):
        places = map_of(survey, ("x", "y"), depth=5e-3)
        write(draw_map(places, dark=style is DARK, width=180e-3), f"map{ending}")
        with plt.style.context(style):
            usable = runpy.run_path(str(EXAMPLES / "gallery" / "usable.py"))["figure"]
        write(usable, f"usable{ending}")


if __name__ == "__main__":
    main()
