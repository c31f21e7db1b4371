"""The figure of safe gains: which contacts a gain bears, and the force after first touch."""

import math
from typing import TYPE_CHECKING

import numpy as np

from palpate.control_loops.answer import SAFETY, Gains
from palpate.control_loops.laws import LawDraws
from palpate.control_loops.response import find_onset
from palpate.control_loops.touching import simulate_touches
from palpate.errors import InvalidParameterError
from palpate.output import figures
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STIFFNESSES = 60
_DRAWS = 12  # of the band of forces
_SHOWN = 1.5  # s
CAPTION = (
    "Left: factor on the gain at which the loop swings, for contacts of other stiffness; shaded: "
    "at least 6 dB below it. Right: simulated force, with bands of laws as likely as the "
    "identified one."
)


def draw_gains(gains: Gains, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw which contacts the gains bear, and the force after first touch.

    Parameters
    ----------
    gains : Gains
        The answer of :func:`palpate.gains`.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width of the figure, m, in [0.06, 0.4]. Default: a page of 11 inches.

    Returns
    -------
    matplotlib.figure.Figure
        Two panels.

    Raises
    ------
    InvalidParameterError
        No gain is recommended, or the width is out of its range.
    MissingExtraError
        matplotlib is not installed.
    """
    if gains.recommended is None:
        raise InvalidParameterError(f"there is nothing to draw: {gains.describe()[0]}")
    look = figures.choose_look(dark=dark, width=width)
    draws = gains.knowledge.laws[0].draws(_DRAWS, gains.knowledge.lowest_frequency)
    with figures.drawing(look, 7.6 if look.narrow else 5.2) as figure:
        rows, columns = (2, 1) if look.narrow else (1, 2)
        onsets, touches = figure.subplots(rows, columns)
        _draw_onsets(onsets, gains, draws, look)
        _draw_forces(touches, gains, draws, look)
        figures.set_titles(figure, look, gains.describe()[:1], CAPTION)
    return figure


def _draw_onsets(axes: "Axes", gains: Gains, draws: LawDraws, look: figures.Look) -> None:
    """Onset over the stiffness of the contact, with all, half and none of its damping."""
    loop = gains.loop
    depth = draws.depth(loop.wanted_force)
    frequency = min(float(np.nan_to_num(gains.frequency)), gains.knowledge.damping_limit)
    here, damping = draws.stiffness_and_damping(depth, np.full_like(depth, frequency))
    stiffness = np.geomspace(0.03 * here[0], 30.0 * here[0], _STIFFNESSES)
    styles = zip((1.0, 0.5, 1e-3), ("-", "--", ":"), ("", "half ", "no "), strict=True)
    lowest = np.full(_STIFFNESSES, np.inf)
    for row, (share, dashes, name) in enumerate(styles):
        onset = find_onset(loop, stiffness, np.full(_STIFFNESSES, share * damping[0])).gain
        label = f"{name}damping" if name else "identified damping"
        axes.plot(stiffness, onset, dashes, color=look.colour(row), label=label)
        lowest = np.minimum(lowest, onset)
    bottom, top = _limits(lowest, gains.recommended_factor)
    safe = np.clip(lowest / SAFETY, bottom, top)
    axes.fill_between(stiffness, bottom, safe, color=look.theme.grid, lw=0.0)
    marker = look.points(6.0)
    ink = look.theme.ink
    place = float(here[0])
    axes.plot(place, 1.0, "o", color=ink, mfc="none", markersize=marker, label="this gain")
    best = gains.recommended_factor
    axes.plot(place, best, "D", color=ink, markersize=marker, label="recommended")
    axes.set(xscale="log", yscale="log", ylim=(bottom, top))
    axes.set(xlabel="contact stiffness [N/m]", ylabel="factor on the gain")
    figures.head(axes, "Onset of swinging")


def _limits(onset: Floats, factor: float) -> tuple[float, float]:
    known = np.append(onset[np.isfinite(onset)], (1.0, factor))
    low = max(float(known.min()), 1e-3 * factor)
    high = min(float(known.max()), 1e3 * factor)
    return 0.3 * min(low, 1.0, factor), 3.0 * max(high, 1.0, factor)


def _draw_forces(axes: "Axes", gains: Gains, draws: LawDraws, look: figures.Look) -> None:
    """Force after first touch at the given gain, at the recommended one, and beyond the margin."""
    loop = gains.loop
    assert gains.recommended is not None
    best = loop if gains.recommended_factor == 1.0 else gains.recommended
    shown = [("this gain", loop, 1.0, "--"), ("recommended", best, 1.0, "-")]
    value = math.inf if gains.gain_margin is None else gains.gain_margin.value
    if math.isfinite(value) and value > 0.0:
        shown.append(("1.1 × the margin", loop, 1.1 * value, ":"))
    highest = 0.0
    for row, (name, each, factor, dashes) in enumerate(shown):
        factors = np.full(_DRAWS, factor)
        force = simulate_touches(each, draws, factors, _SHOWN, with_forces=True).forces
        force = force[:, np.isfinite(force).all(axis=0)]
        time = np.arange(force.shape[1]) / each.sample_rate
        few = slice(None, None, max(force.shape[1] // 400, 1))
        colour = look.colour(row)
        axes.plot(time[few], force[0, few], dashes, color=colour, label=name)
        if row < 2:
            low, high = force.min(axis=0)[few], force.max(axis=0)[few]
            axes.fill_between(time[few], low, high, color=colour, alpha=0.2, lw=0.0)
            highest = max(highest, float(force.max(initial=0.0)))
    axes.axhline(loop.wanted_force, color=look.theme.ink, ls=":", lw=look.points(0.7))
    axes.set_ylim(0.0, 1.3 * max(highest, loop.wanted_force))
    axes.set(xlabel="time since first touch [s]", ylabel="contact force [N]")
    figures.head(axes, "Force after first touch")
