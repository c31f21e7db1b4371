"""What the figures of the experiments share: fewer samples, rounded numbers, lines, limits."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.estimators import VariableProjection
from palpate.figures.style import DARK, LIGHT, Theme
from palpate.identification import Identification
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Told apart without colour.
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (7, 2, 1.5, 2)), (0, (3, 1)))
# More points than this on a line of a figure look the same.
POINTS = 400
#: Standard error over value, up to which variable projection is drawn.
CONFIDENT = 1.0 / 3.0
#: What a legend calls it.
PROJECTION = "variable projection, once its error bar is below a third"


def theme_of(dark: bool) -> Theme:
    """Return the colours for a background."""
    return DARK if dark else LIGHT


def early_and_late(elapsed: Floats) -> NDArray[np.intp]:
    """Which samples to draw: enough for a logarithmic axis of time, and for a linear one."""
    early = np.geomspace(1, elapsed.size, POINTS).round().astype(np.intp) - 1
    return np.union1d(early, np.arange(0, elapsed.size, max(elapsed.size // POINTS, 1)))


def plain(values: ArrayLike) -> list[float]:
    """Numbers to five digits, as a list."""
    return [float(f"{value:.5g}") for value in np.asarray(values, dtype=np.float64).tolist()]


def traced(prefix: str, result: Identification, clock: str = "elapsed") -> dict[str, list[float]]:
    """Return parameters and force error of a result over the time since contact, to be drawn.

    Variable projection says from the first sample on how little it knows: it is drawn where its
    own standard error is below ``CONFIDENT`` of the value.
    """
    trace, contact = result.trace, result.contact
    taken = trace.taken
    elapsed = np.cumsum(contact.time_steps[taken])
    keep = early_and_late(elapsed)
    known, errors = trace.parameters[taken][keep], trace.standard_errors[taken][keep]
    if isinstance(result.estimator, VariableProjection):
        known = np.where(errors < CONFIDENT * np.abs(known), known, np.nan)
    curves = {clock: plain(elapsed[keep])}
    for i, symbol in enumerate(result.law.symbols):
        curves[f"{prefix}/{symbol}"] = plain(known[:, i])
    curves[f"{prefix}/error"] = plain((contact.force - trace.predicted_force)[taken][keep])
    return curves


def median_and_range(values: Iterable[float], digits: str = ".3g", never: str = "never") -> str:
    """Say several seeds' numbers in words: the median, and from the least to the greatest."""
    every = np.array(list(values), dtype=np.float64)
    missing = int(np.isnan(every).sum())
    if missing == every.size:
        return never
    middle = np.median(np.where(np.isnan(every), np.inf, every))
    known = every[~np.isnan(every)]
    low, high = format(known.min(), digits), format(known.max(), digits)
    words = format(middle, digits) if np.isfinite(middle) else never
    if missing:
        return f"{words} ({low} to {never}, {missing} of {every.size})"
    return words if low == high else f"{words} ({low} to {high})"


def draw_lines(
    axes: "Axes",
    x: "Floats | Sequence[float]",
    lines: Iterable[tuple[str, "Floats | Sequence[float]"]],
    theme: Theme,
    *,
    width: float = 1.4,
    first: int = 0,
) -> None:
    """Draw lines that differ in colour and dashes."""
    for i, (label, y) in enumerate(lines, first):
        axes.plot(
            x,
            y,
            color=theme.lines[i % len(theme.lines)],
            linestyle=DASHES[i % len(DASHES)],
            linewidth=width,
            label=label,
        )


def limits_about(values: Iterable[ArrayLike], share: float = 0.25, floor: float = 0.0) -> Any:
    """Return axis limits that hold all values, with some room."""
    known = np.concatenate([np.ravel(np.asarray(v, dtype=np.float64)) for v in values])
    known = known[np.isfinite(known)]
    low, high = float(known.min()), float(known.max())
    room = max(share * (high - low), floor, 1e-9 * max(abs(low), abs(high)), 1e-300)
    return low - room, high + room
