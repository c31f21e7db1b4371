"""``python -m benchmarks.law_pictures FOLDER``: draw what memory explains, a recording of each set.

A picture of each of others' recordings, from ``PALPATE_DATA`` or ``../shared/data`` next to the
checkout, light and dark, and a table of them: the loop, the force while it is held, and the
residuals of Hunt–Crossley and of the selected law. Pixels only: no copy of the data.
"""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cyclopts import App

from benchmarks.law_recordings import (
    Recorded,
    folder_of_recordings,
    held_out_of,
    learned,
    predicted,
    read,
)
from palpate.errors import RecordingError
from palpate.figures.style import Look, save, style
from palpate.results.colours import DARK, LIGHT, Theme
from palpate.validation import Floats
from palpate.writing import write_bytes

app = App(name="python -m benchmarks.law_pictures", help_format="plaintext", version_flags=[])

# The width in which the docs show it: 1100 dots.
INCHES, DOTS_AN_INCH = (10.0, 2.9), 110
COLOURS = 64


@dataclass(frozen=True)
class Picture:
    """The part of a recording that is drawn.

    Attributes
    ----------
    title : str
        What was pressed.
    seconds : float
        Duration drawn, from the first contact on.
    held : tuple of float
        The interval of the middle panel, s.
    what : str
        What it shows.
    """

    title: str
    seconds: float
    held: tuple[float, float]
    what: str


# One of each set.
PICTURES = {
    "A_aurora_220118_250mN": Picture(
        "lever on skin or its stand-in", 0.3, (0.03, 0.255), "the force is held, the depth creeps"
    ),
    "B_heel_subject12": Picture("heel of a walker", 0.3, (0.0, 0.05), "one strike"),
    "C_tpu_90-50_wk0": Picture("printed TPU", 4.0, (0.0, 4.0), "the first cycles"),
    "D_dvrk_palpation_trial4_a": Picture(
        "da Vinci robot on a phantom", 3.0, (0.0, 1.5), "three cycles"
    ),
    "E_afm_brain_creep": Picture(
        "AFM on brain", 9.0, (1.2, 4.6), "the force is held, the depth creeps"
    ),
    "F_microrheo_c00": Picture(
        "AFM microrheology", 13.0, (0.0, 2.5), "pressed, held and oscillated"
    ),
    "G_silicone_d10mm_sphere": Picture("robot on silicone", 4.0, (0.0, 1.5), "the first cycles"),
}


@dataclass(frozen=True)
class Explained:
    """A recording, and two laws fitted to all of its contact.

    Attributes
    ----------
    law : str
        The selected law.
    time, penetration, force : numpy.ndarray, shape (k,)
        Of the samples of contact, s, m and N; NaN between segments.
    left : tuple of numpy.ndarray, shape (k,)
        Force minus that of Hunt–Crossley, and of the selected law, N.
    noise : float
        Standard deviation of the force sensor's noise, N.
    """

    law: str
    time: Floats
    penetration: Floats
    force: Floats
    left: tuple[Floats, Floats]
    noise: float

    @property
    def rms(self) -> tuple[float, float]:
        """Return the rms of each residual, N."""
        first, second = (float(np.sqrt(np.nanmean(each**2))) for each in self.left)
        return first, second


@app.default
def main(folder: Path) -> None:
    """Draw them.

    Parameters
    ----------
    folder
        Where laws-a.png, laws-a-dark.png and so on are written.
    """
    recordings = folder_of_recordings()
    if recordings is None:
        raise RecordingError("no recordings found: set PALPATE_DATA to their folder")
    folder.mkdir(parents=True, exist_ok=True)
    print("| | selected law | rms, Hunt–Crossley → selected law | held out |")
    print("|---|---|--:|--:|")
    for name, picture in PICTURES.items():
        record = read(recordings / f"{name}.csv")
        found = explained(record)
        for theme, ending in ((LIGHT, ""), (DARK, "-dark")):
            draw(folder / f"laws-{name[0].lower()}{ending}.png", picture, found, theme)
        ratio = held_out_of(record, "odd tenths")
        row = f"{picture.title} | {found.law} | {_from_to(found)} | {ratio:.2f}"
        print(f"| {name[0]}: {row} |", flush=True)


def explained(record: Recorded) -> Explained:
    """Fit both laws, and predict from penetration and velocity alone."""
    plain = learned(record, record.good, damping="hunt-crossley", memory="none")
    chosen = learned(record, record.good)
    time = np.cumsum(np.where(record.breaks, record.sample_time, record.steps))
    places = np.flatnonzero(record.good)
    # A line ends where samples are excluded.
    gaps = np.flatnonzero((np.diff(places) > 1) | record.breaks[places[1:]]) + 1
    left = [(record.force - predicted(record, each))[places] for each in (plain, chosen)]
    return Explained(
        str(chosen.verdict().candidate),
        np.insert(time[places] - time[places[0]], gaps, np.nan),
        np.insert(record.penetration[places], gaps, np.nan),
        np.insert(record.force[places], gaps, np.nan),
        (np.insert(left[0], gaps, np.nan), np.insert(left[1], gaps, np.nan)),
        noise_of(record.force[places]),
    )


def draw(path: Path, picture: Picture, found: Explained, theme: Theme) -> None:
    """Draw its loop, the force while it is held, and the residuals of both laws."""
    import matplotlib

    with style(Look(theme)) as new_figure, matplotlib.rc_context({"savefig.dpi": DOTS_AN_INCH}):
        figure = new_figure(figsize=INCHES, layout="constrained")
        panels = figure.subplots(1, 3)
        _draw_panels(panels, picture, found, theme)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=3)
        words = f"{found.law}: rms {_from_to(found)}"
        figure.suptitle(words, x=0.01, ha="left", fontsize=10.5)
        save(figure, path)
    with_few_colours(path)


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


def _draw_panels(panels: Any, picture: Picture, found: Explained, theme: Theme) -> None:
    shown = ~(found.time > picture.seconds)
    t, x, force = (each[shown] for each in (found.time, found.penetration, found.force))
    depth, push = _prefix(x), _prefix(force)
    rest = _prefix(np.concatenate(found.left))
    loop, course, residual = panels
    within = (t >= picture.held[0]) & (t <= picture.held[1])
    thick = {"color": theme.measured, "linewidth": 2.6}
    loop.plot(x / depth[0], force / push[0], label="measured", **thick)
    course.plot(t[within], force[within] / push[0], **thick)
    looks: tuple[dict[str, Any], ...] = (
        # Dashes over a line show both where they coincide.
        {"color": theme.lines[1], "linewidth": 1.1, "linestyle": "--", "zorder": 3.0},
        {"color": theme.lines[0], "linewidth": 1.1},
    )
    for left, look, label in zip(found.left, looks, ("Hunt–Crossley", "chosen law"), strict=True):
        model = force - left[shown]
        loop.plot(x / depth[0], model / push[0], label=label, **look)
        course.plot(t[within], model[within] / push[0], **look)
        residual.plot(t, left[shown] / rest[0], color=look["color"], linewidth=1.1)
    band = 2.0 * found.noise / rest[0]
    residual.axhspan(-band, band, color=theme.measured, alpha=0.45, linewidth=0.0)
    loop.set(xlabel=f"penetration [{depth[1]}m]", ylabel=f"force [{push[1]}N]")
    course.set(xlabel="time [s]", ylabel=f"force [{push[1]}N]")
    residual.set(xlabel="time [s]", ylabel=f"residual [{rest[1]}N]")
    loop.set_title("loop", loc="left")
    course.set_title(picture.what, loc="left")
    residual.set_title("residual; grey: ± 2 s.d. of noise", loc="left")


def noise_of(force: Floats) -> float:
    """Return the noise of a force smooth over four samples, N: third differences have √20."""
    return float(1.4826 * np.median(np.abs(np.diff(force, 3))) / np.sqrt(20.0))


def _from_to(found: Explained) -> str:
    size, unit = _prefix(np.array(found.rms))
    before, after = (f"{each / size:.3g}" for each in found.rms)
    return f"{before} → {after} {unit}N"


def _prefix(values: Floats) -> tuple[float, str]:
    """Return the unit in which the largest value is easiest to read."""
    largest = float(np.nanmax(np.abs(values)))
    units = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"))
    return next((unit for unit in units if largest >= unit[0]), units[-1])


if __name__ == "__main__":
    app()
