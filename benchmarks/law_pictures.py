"""``python -m benchmarks.law_pictures laws.svg``: what memory explains, a recording of each set.

A row a recording made by others, from ``PALPATE_DATA`` or ``../shared/data`` beside the checkout:
the loop, force over time with its creep, and what Hunt–Crossley and the law that was chosen leave.
"""

from pathlib import Path
from typing import Any

import numpy as np
from cyclopts import App

from benchmarks.law_recordings import Recorded, folder_of_recordings, learned, predicted, read
from palpate.errors import RecordingError
from palpate.figures.style import LIGHT, save, style
from palpate.validation import Floats

app = App(name="python -m benchmarks.law_pictures", help_format="plaintext", version_flags=[])

# Of each set one, and the seconds that are drawn from the first contact on.
PICTURES = {
    "A_aurora_220118_250mN": 0.3,
    "B_heel_subject12": 0.3,
    "C_tpu_90-50_wk0": 4.0,
    "D_dvrk_palpation_trial4_a": 3.0,
    "E_afm_brain_creep": 9.0,
    "F_microrheo_c00": 13.0,
    "G_silicone_d10mm_sphere": 4.0,
}


@app.default
def main(output: Path) -> None:
    """Draw them.

    Parameters
    ----------
    output
        Ends in .svg, .pdf or .png.
    """
    folder = folder_of_recordings()
    if folder is None:
        raise RecordingError("there are no recordings: PALPATE_DATA has to name their folder")
    with style(LIGHT) as figure_of:
        figure = figure_of(figsize=(11.0, 2.4 * len(PICTURES)), layout="constrained")
        rows = figure.subplots(len(PICTURES), 3, squeeze=False)
        for axes, (name, seconds) in zip(rows, PICTURES.items(), strict=True):
            draw(axes, name, read(folder / f"{name}.csv"), seconds)
        rows[0][0].legend(loc="upper left")
        save(figure, output)


def draw(axes: Any, name: str, record: Recorded, seconds: float) -> None:
    """One recording: its loop, its force over time, and what both laws leave of it."""
    plain = learned(record, record.good, damping="hunt-crossley", memory="none")
    chosen = learned(record, record.good)
    words = str(chosen.verdict().candidate)
    time = np.cumsum(np.where(record.breaks, record.sample_time, record.steps))
    places = np.flatnonzero(record.good)
    shown = places[time[places] <= time[places[0]] + seconds]
    models = predicted(record, plain)[shown], predicted(record, chosen)[shown]
    t, x, force = time[shown] - time[shown[0]], record.penetration[shown], record.force[shown]
    depth, push = _prefix(x), _prefix(force)
    gap = np.flatnonzero(np.diff(shown) > 1) + 1  # a line does not go on over what is left out
    colours = LIGHT.lines
    measured = {"color": LIGHT.measured, "linewidth": 2.2, "label": "measured"}
    styles = (
        {"color": colours[1], "linewidth": 1.0, "label": "Hunt–Crossley"},
        {"color": colours[0], "linewidth": 1.0, "label": "chosen law"},
    )
    loop, course, left = axes
    loop.plot(_parted(x / depth[0], gap), _parted(force / push[0], gap), **measured)
    course.plot(_parted(t, gap), _parted(force / push[0], gap), **measured)
    for model, look in zip(models, styles, strict=True):
        loop.plot(_parted(x / depth[0], gap), _parted(model / push[0], gap), **look)
        course.plot(_parted(t, gap), _parted(model / push[0], gap), **look)
        left.plot(_parted(t, gap), _parted((force - model) / push[0], gap), **look)
    sizes = [float(np.sqrt(np.mean((force - model) ** 2)) / push[0]) for model in models]
    loop.set_title(f"{name[0]}: {words}", loc="left")
    loop.set_xlabel(f"penetration [{depth[1]}m]")
    loop.set_ylabel(f"force [{push[1]}N]")
    course.set_xlabel("time [s]")
    left.set_xlabel("time [s]")
    left.set_ylabel(f"residual [{push[1]}N]")
    left.set_title(f"rms {sizes[0]:.3g} → {sizes[1]:.3g} {push[1]}N", loc="left")


def _prefix(values: Floats) -> tuple[float, str]:
    """The unit that a person reads the largest value best in."""
    largest = float(np.abs(values).max())
    units = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
    return next((unit for unit in units if largest >= unit[0]), units[-1])


def _parted(values: Floats, places: Any) -> Floats:
    return np.insert(values, places, np.nan)


if __name__ == "__main__":
    app()
