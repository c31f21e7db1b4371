"""What the figures share: curves thinned out, lines that differ without colour, labels."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import palpate
from palpate.figures.style import LIGHT
from palpate.figures.style import style as style
from palpate.force_laws import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:  # matplotlib takes half a second, and is loaded where something is drawn
    Axes = Figure = Any

THEME = LIGHT
#: What a person calls the lab's materials.
LABELS = {"ball": "ball", "sponge": "sponge", "pvc": "PVC phantom"}
LABELS |= {"relaxing-sponge": "relaxing sponge"}
#: Of Hunt–Crossley's parameters, by their symbols.
UNITS = {"K": "N/mⁿ", "B": "N·s/mⁿ⁺¹", "n": ""}
#: Told apart without colour.
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (7, 2, 1.5, 2)), (0, (3, 1)))
# More points than this on a line of a figure look the same.
POINTS = 400


def thinned(time: Floats) -> NDArray[np.intp]:
    """Which samples to draw over the clock: one in 5 in the first half second, then one in 20."""
    return np.flatnonzero(np.arange(time.size) % np.where(time < time[0] + 0.5, 5, 20) == 0)


def course_of(result: palpate.Identification) -> Floats:
    """Parameters sample by sample, NaN where none was taken; shape (k, p)."""
    return np.where(result.trace.taken[:, None], result.trace.parameters, np.nan)


def traced(
    prefix: str, result: palpate.Identification, clock: str = "elapsed"
) -> dict[str, Floats]:
    """Return parameters and force error of a result over the time since contact, to be drawn."""
    trace, contact = result.trace, result.contact
    elapsed = np.cumsum(contact.time_steps[trace.taken])
    # Enough samples for a logarithmic axis of time, and for a linear one.
    early = np.geomspace(1, elapsed.size, POINTS).round().astype(np.intp) - 1
    keep = np.union1d(early, np.arange(0, elapsed.size, max(elapsed.size // POINTS, 1)))
    columns = zip(result.law.symbols, trace.parameters[trace.taken][keep].T, strict=True)
    error = (contact.force - trace.predicted_force)[trace.taken][keep]
    curves = {f"{prefix}/{symbol}": column for symbol, column in columns}
    return {clock: elapsed[keep], **curves, f"{prefix}/error": error}


def lines(
    axes: Axes, x: ArrayLike, curves: Mapping[Any, ArrayLike], *, first: int = 0, **options: Any
) -> None:
    """Draw lines that differ in colour and dashes, the first of them in the ``first`` style."""
    for i, (label, y) in enumerate(curves.items(), first):
        looks = {"color": THEME.lines[i % len(THEME.lines)], "linestyle": DASHES[i % len(DASHES)]}
        axes.plot(x, y, label=label, **{"linewidth": 1.4, **looks, **options})


def course(
    axes: Axes,
    curves: Mapping[str, list[float]],
    symbol: str,
    shown: Mapping[str, str],
    *,
    clock: str = "elapsed",
    unit: str = "",
    **settings: Any,
) -> None:
    """One parameter over time, a line for each result; ``shown`` gives its curves by label."""
    of_symbol = {label: curves[f"{prefix}/{symbol}"] for label, prefix in shown.items()}
    lines(axes, curves[clock], of_symbol)
    axes.set(ylabel=f"{symbol} [{unit}]" if unit else symbol, **settings)


def truth(axes: Axes, value: float, label: str | None = "truth") -> None:
    """Dot a line where the truth, or another fixed value, is."""
    axes.axhline(value, color=THEME.ink, linewidth=0.9, linestyle=":", label=label)


def legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of one of the axes below the whole figure."""
    shown = axes.get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower center", ncols=columns)
