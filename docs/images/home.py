"""The picture of the home page; ``make_pictures.py`` writes it with the others."""

import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

import palpate
from palpate import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXAMPLES = Path(__file__).parents[2] / "examples"
LATE = 18e-3  # s, the delay of the force


def draw_home(*, dark: bool) -> "Figure":
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


def pictures() -> Iterator[tuple[str, "Figure"]]:
    """Yield it light and dark, each with its name."""
    for dark, ending in ((False, ""), (True, "-dark")):
        yield f"home{ending}", draw_home(dark=dark)
