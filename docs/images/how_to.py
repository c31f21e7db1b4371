"""The pictures of the pages of how-to; ``make_pictures.py`` writes them with the others."""

import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt

import palpate
from palpate.control_loops.figures import draw_gains
from palpate.fleet.figures import draw_map
from palpate.fleet.maps import map_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GALLERY = Path(__file__).parents[2] / "examples" / "gallery"
PAPER = "#16181c"  # of the dark figures
LIGHT: dict[str, str] = {}
DARK = ["dark_background", {"figure.facecolor": PAPER, "axes.facecolor": PAPER}]


def draw_late_force() -> "Figure":
    """Draw a stroke at each of two frequencies of a spring, as recorded and without the delay."""
    touch = runpy.run_path(str(GALLERY / "late_force.py"))
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


def pictures() -> Iterator[tuple[str, "Figure"]]:
    """Yield each picture with its name, light and dark."""
    survey = runpy.run_path(str(GALLERY / "hard_spot.py"))["table"]
    gains = runpy.run_path(str(GALLERY / "safe_gains.py"))["gains"]
    for style, ending in ((LIGHT, ""), (DARK, "-dark")):
        places = map_of(survey, ("x", "y"), depth=5e-3)
        yield f"map{ending}", draw_map(places, dark=style is DARK, width=180e-3)
        yield f"gains{ending}", draw_gains(gains, dark=style is DARK, width=180e-3)
        with plt.style.context(style):
            for name in ("usable", "payload"):
                yield f"{name}{ending}", runpy.run_path(str(GALLERY / f"{name}.py"))["figure"]
            yield f"late-force{ending}", draw_late_force()
