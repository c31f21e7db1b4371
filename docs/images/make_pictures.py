"""Write the pictures of the docs that show a result.

python docs/images/make_pictures.py
"""

import runpy
from pathlib import Path

import matplotlib

import palpate
from palpate import InvalidParameterError, figures, lab

IMAGES = Path(__file__).parent
EXAMPLES = IMAGES.parents[1] / "examples"
THUMBNAIL = 60e-3  # m


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
    for group in ("home", "explain", "how_to", "findings"):
        for name, picture in runpy.run_path(str(IMAGES / f"{group}.py"))["pictures"]():
            write(picture, name)
    doors = runpy.run_path(str(IMAGES / "doors.py"))
    for name in doors["DOORS"]:
        doors["draw_door"](name)


if __name__ == "__main__":
    main()
