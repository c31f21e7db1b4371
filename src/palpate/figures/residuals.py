"""What the final law leaves of the force, over time, depth and speed."""

from typing import TYPE_CHECKING, Literal

import numpy as np

from palpate.diagnosis import Data
from palpate.figures.scales import largest, scale_of
from palpate.figures.sheet import head, set_titles, sheet_of
from palpate.figures.style import DARK, LIGHT, Theme, style
from palpate.figures.thinning import BAND_DEVIATIONS, Scatter, clock, in_order, over
from palpate.figures.words import name_of
from palpate.identification import Identification
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Against = Literal["time", "depth", "velocity"]
CAPTION = (
    "Line: median of the residual, measured − final law; band: from its 10th to its 90th "
    "percentile; dotted: the same band of the sensors' noise alone, at working depth."
)


def draw_residuals(
    identification: Identification, *, dark: bool = False, width: float | None = None
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
    theme, sheet = DARK if dark else LIGHT, sheet_of(width)
    against: tuple[Against, ...] = ("time", "depth", "velocity")
    with style(theme, sheet) as new_figure:
        figure = new_figure(figsize=sheet.size(8.6 if sheet.narrow else 3.6), layout="constrained")
        shape = (3, 1) if sheet.narrow else (1, 3)
        panels = figure.subplots(*shape, sharey=True, squeeze=False).reshape(-1)
        for axes, each in zip(panels, against, strict=True):
            draw_residual(axes, identification, theme, each)
            head(axes, f"over {each}")
        if not sheet.narrow:
            for axes in panels[1:]:
                axes.set_ylabel("")
        fit = f"residual, {identification.fit_rmse_percent:.2g} % of the force (rms)"
        set_titles(figure, sheet, [f"{name_of(identification)}: {fit}".removeprefix(": ")], CAPTION)
    return figure


def draw_residual(
    axes: "Axes", result: Identification, theme: Theme, against: Against = "time"
) -> None:
    """One panel of the residual: its median, where most of it is, and the band of noise alone."""
    with np.errstate(all="ignore"):  # absurd samples overflow
        residual = result.contact.force - result.fitted_force
        noise = BAND_DEVIATIONS * _noise(result)
    label, seen = _scatter(result, residual, against)
    noise = noise if np.isfinite(noise) else 0.0
    reach = max(largest(seen.low), largest(seen.high), noise, 1e-300)
    unit = scale_of(reach, "N")
    k = unit.factor
    axes.fill_between(
        seen.place, k * seen.low, k * seen.high, color=theme.lines[0], alpha=0.3, lw=0
    )
    few = np.isfinite(seen.middle).sum() < 4
    axes.plot(seen.place, k * seen.middle, "o-" if few else "-", color=theme.lines[0], markersize=3)
    for level in (-noise, noise) if noise > 0.0 else ():
        axes.axhline(k * level, color=theme.ink, linestyle=":", linewidth=0.8)
    axes.axhline(0.0, color=theme.ink, linewidth=0.6)
    axes.set_ylim(-1.15 * k * reach, 1.15 * k * reach)
    axes.set(xlabel=label, ylabel=unit.label("residual"))


def _noise(result: Identification) -> float:
    """Deviation of a sample's force by noise, N: √(σ² + S²σ_x² + C²σ_v²) at working depth."""
    data, there = result.data or Data(result.contact), result.diagnosis.working_depth
    by_position = there.stiffness.value * data.penetration_noise
    by_velocity = there.damping.value * data.velocity_noise
    parts = np.array([data.force_noise, by_position, by_velocity])
    return float(np.linalg.norm(parts[np.isfinite(parts)]))


def _scatter(result: Identification, residual: Floats, against: Against) -> tuple[str, Scatter]:
    contact, taken = result.contact, result.trace.taken
    if against == "time":
        time, label = clock(contact)
        return label, in_order(time, residual, contact, taken)
    name, unit, values = {
        "depth": ("penetration", "m", contact.penetration),
        "velocity": ("velocity, inwards > 0", "m/s", contact.velocity),
    }[against]
    scale = scale_of(largest(values[taken]), unit)
    return scale.label(name), over(scale.factor * values, residual, taken)
