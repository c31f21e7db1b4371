"""What the final law leaves of the force, over time, depth and speed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from palpate.diagnosis import Data
from palpate.figures.look import Look, look_of
from palpate.figures.scales import Scale, largest, scale_of
from palpate.figures.sheet import head, set_titles
from palpate.figures.style import style
from palpate.figures.thinning import BAND_DEVIATIONS, Scatter, clock, in_order, over
from palpate.figures.words import name_of
from palpate.identification import Identified
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Against = Literal["time", "depth", "velocity"]
AGAINST: tuple[Against, ...] = ("time", "depth", "velocity")
# Of several residuals those so many times as large as the first one's leave their panel.
_MOST_REACH = 5.0
CAPTION = (
    "Residual: measured − final law. Line: its median; band: from its 10th to its 90th "
    "percentile; dotted: the same band of the sensors' noise alone, at working depth."
)


def draw_residuals(
    identification: Identified, *, dark: bool = False, width: float | None = None
) -> "Figure":
    """Draw what the final law leaves of the force, over time, depth and velocity.

    Where it stays between the dotted lines, noise is all that is left; a wave or a slope is
    structure that the law does not have.

    Parameters
    ----------
    identification : Identification
        As :func:`palpate.identify` returns it.
    dark : bool
        For a dark background.
    width : float, optional
        Of the figure as it is printed, m, in [0.06, 0.4]; a page unless given.

    Raises
    ------
    InvalidParameterError
        The width is out of its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = look_of(dark=dark, width=width)
    sheet, seen = look.sheet, [_scatter(identification, each) for each in AGAINST]
    noise = _noise_band(identification)
    unit = scale_of(max(_reach(each, noise) for _, each in seen), "N")
    with style(look.theme, sheet) as new_figure:
        figure = new_figure(figsize=sheet.size(8.6 if sheet.narrow else 3.6), layout="constrained")
        shape = (3, 1) if sheet.narrow else (1, 3)
        panels = figure.subplots(*shape, squeeze=False).reshape(-1)
        for axes, against, (label, scatter) in zip(panels, AGAINST, seen, strict=True):
            _draw(axes, scatter, noise, unit, look, look.theme.lines[0])
            axes.set(xlabel=label, ylabel=unit.label("residual"))
            head(axes, f"Over {against}")
        low = min(axes.get_ylim()[0] for axes in panels)
        for axes in panels:
            axes.set_ylim(low, -low)
        laws = "laws of each part leave" if identification.stretches else "final law leaves"
        fit = f"the {laws} {identification.fit_rmse_percent:.2g} % of the force"
        name = name_of(identification)
        set_titles(figure, sheet, [f"{name}: {fit}" if name else fit], CAPTION)
    return figure


def draw_residual(axes: "Axes", result: Identified, look: Look) -> None:
    """One panel of the residual over time, with the band of noise alone."""
    draw_residual_rows([axes], [result], [look.theme.lines[0]], look)
    law = "law of each part" if result.stretches else "final law"
    head(axes, f"Residual, measured − {law}: {result.fit_rmse_percent:.2g} % rms")


def draw_residual_rows(
    rows: "Sequence[Axes]",
    results: Sequence[Identified],
    colours: Sequence[str],
    look: Look,
) -> None:
    """The residual of each of several identifications over time, to one scale.

    That is at most so large that the first of them, the best, is still to be seen.
    """
    noise = _noise_band(results[0])
    seen = [_scatter(result, "time") for result in results]
    reaches = [_reach(scatter, noise) for _, scatter in seen]
    reach = min(max(reaches), _MOST_REACH * reaches[0])
    unit = scale_of(reach, "N")
    for axes, (label, scatter), colour in zip(rows, seen, colours, strict=True):
        _draw(axes, scatter, noise, unit, look, colour)
        axes.set_ylim(-1.15 * unit.factor * reach, 1.15 * unit.factor * reach)
        axes.locator_params(axis="y", nbins=4)
        axes.set(xlabel=label, ylabel=unit.label("residual"))


def _noise_band(result: Identified) -> float:
    """Half of the band that noise alone would have, N.

    Of a sample's force √(σ² + S²σ_x² + C²σ_v²), at working depth.
    """
    data, there = result.data or Data(result.contact), result.diagnosis.working_depth
    by_position = there.stiffness.value * data.penetration_noise
    by_velocity = there.damping.value * data.velocity_noise
    parts = np.array([data.force_noise, by_position, by_velocity])
    return BAND_DEVIATIONS * float(np.linalg.norm(parts[np.isfinite(parts)]))


def _reach(seen: Scatter, noise: float) -> float:
    return max(largest(seen.low), largest(seen.high), noise, 1e-300)


def _draw(axes: "Axes", seen: Scatter, noise: float, unit: Scale, look: Look, colour: str) -> None:
    k = unit.factor
    axes.fill_between(seen.place, k * seen.low, k * seen.high, color=colour, alpha=0.3, lw=0)
    few = np.isfinite(seen.middle).sum() < 4  # of one point there is no line
    axes.plot(seen.place, k * seen.middle, "o-" if few else "-", color=colour, markersize=3.0)
    for level in (-noise, noise) if noise > 0.0 else ():
        axes.axhline(k * level, color=look.theme.ink, linestyle=":", linewidth=look.points(0.9))
    axes.axhline(0.0, color=look.theme.ink, linewidth=look.points(0.6))
    reach = 1.15 * k * _reach(seen, noise)
    axes.set_ylim(-reach, reach)


def _scatter(result: Identified, against: Against) -> tuple[str, Scatter]:
    """What the abscissa is called, and where the residual lies over it."""
    contact, taken = result.contact, result.trace.taken
    with np.errstate(all="ignore"):  # absurd samples overflow
        residual = contact.force - result.fitted_force
    if against == "time":
        time, label = clock(contact)
        return label, in_order(time, residual, contact, taken)
    name, unit, values = {
        "depth": ("penetration", "m", contact.penetration),
        "velocity": ("velocity, inwards > 0", "m/s", contact.velocity),
    }[against]
    scale = scale_of(largest(values[taken]), unit)
    return scale.label(name), over(_scaled(values, scale), residual, taken)


def _scaled(values: Floats, scale: Scale) -> Floats:
    with np.errstate(over="ignore"):
        return scale.factor * values
