"""Panels of what was identified: each quantity over time, its band, and the result at the end."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis import Quantity
from palpate.figures.course import Course
from palpate.figures.look import Look
from palpate.figures.scales import Scale, largest, scale_as_written, scale_of
from palpate.figures.sheet import head
from palpate.figures.thinning import MOST_GAPS, clock
from palpate.figures.words import JOINED, kept_together
from palpate.identification import Identified
from palpate.results.parameters import Row
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A panel shows at least this part of a value: what is known better has ticks too long to read.
_LEAST_SPAN = 1e-5
# A bar of what findings would move is seen whole up to so many times what else is in its panel.
_MOST_MOVED = 10.0


@dataclass(frozen=True, slots=True)
class Final:
    """What a quantity came to.

    Attributes
    ----------
    value : float
        The result.
    error : float
        Its standard error, or the repeatable part of it.
    whole_error : float
        With what the findings would move; the same where there is no more.
    """

    value: float
    error: float
    whole_error: float

    @classmethod
    def of(cls, quantity: Quantity) -> "Final":
        """Of a quantity at the working depth."""
        error = quantity.standard_error if np.isfinite(quantity.standard_error) else 0.0
        return cls(quantity.value, error, float(np.hypot(error, quantity.systematic)))


def draw_parameter(axes: "Axes", result: Identified, course: Course, row: Row, look: Look) -> None:
    """One parameter over time, with a band of two standard errors, and the result."""
    index = row.index
    error = float(result.standard_errors[index])
    final = Final(float(result.law.parameters[index]), error, error)
    known = course.parameters[:, index], course.errors[:, index]
    _draw_line(axes, result, course.samples, known, final, row.unit, row.symbol, look)
    words = row.with_unit.replace(" ", JOINED)
    head(axes, f"{row.name.replace('_', ' ').capitalize()} {row.symbol}: {words}")


def draw_stiffness(axes: "Axes", result: Identified, course: Course, look: Look) -> None:
    """Stiffness at working depth over time, and what the diagnosis says of it."""
    known = course.stiffness, course.stiffness_error
    quantities = [p.diagnosis.working_depth.stiffness for p in (result, *result.stretches)]
    _draw_at_depth(axes, result, course, known, quantities, ("Stiffness", "N/m", "dF/dx"), look)


def draw_damping(axes: "Axes", result: Identified, course: Course, look: Look) -> None:
    """Damping at working depth over time, and what the diagnosis says of it."""
    known = course.damping, course.damping_error
    quantities = [p.diagnosis.working_depth.damping for p in (result, *result.stretches)]
    _draw_at_depth(axes, result, course, known, quantities, ("Damping", "N·s/m", "dF/dv"), look)


def _draw_at_depth(
    axes: "Axes",
    result: Identified,
    course: Course,
    known: tuple[Floats, Floats],
    quantities: list[Quantity],
    words: tuple[str, str, str],
    look: Look,
) -> None:
    name, unit, symbol = words
    depth = result.diagnosis.working_depth.depth
    length = scale_of(depth, "m")
    finals = [Final.of(each) for each in quantities]
    scale = _draw_line(axes, result, course.samples, known, finals[0], unit, symbol, look)
    name = f"Relaxed {name.lower()}" if result.law.remembers else name
    at = f"{name} at {length.factor * depth:.3g} {length.unit}"
    if result.stretches:
        _draw_stretches(axes, result, finals[1:], scale, look)
        kind = "place" if result.stretches[0].place is not None else "stretch"
        head(axes, f"{name} of each {kind}" if kind == "place" else f"{at}, of each stretch")
        return
    errors = (quantities[0].standard_error, quantities[0].systematic)
    head(axes, f"{at}: {kept_together(finals[0].value, *errors, unit=unit)}")


def _draw_line(
    axes: "Axes",
    result: Identified,
    samples: NDArray[np.intp],
    known: tuple[Floats, Floats],
    final: Final,
    unit: str,
    symbol: str,
    look: Look,
) -> Scale:
    """A quantity after some samples, its band of ±2 s.e., and the result with its error bar."""
    time, label = clock(result.contact)
    values, errors = known
    limits = _limits(values, errors, final)
    scale = scale_as_written(max(abs(limits[0]), abs(limits[1])), unit)
    k, colour, ink = scale.factor, look.theme.lines[0], look.theme.ink
    # What leaves the panel is cut: coordinates of 1e200 make no line.
    far = 10.0 * (limits[1] - limits[0])
    within = (limits[0] - far, limits[1] + far)
    with np.errstate(invalid="ignore", over="ignore"):
        lines = [
            np.clip(each, *within) for each in (values - 2 * errors, values, values + 2 * errors)
        ]
    seen = (lines[1] >= limits[0]) & (lines[1] <= limits[1])
    seen |= np.append(seen[1:], False) | np.insert(seen[:-1], 0, False)
    lines[1] = np.where(seen, lines[1], np.nan)  # a start that leaves the panel again and again
    gaps = np.flatnonzero(np.diff(result.contact.segment[samples])) + 1
    gaps = gaps if gaps.size <= MOST_GAPS else gaps[:0]
    x, low, middle, high = (np.insert(each, gaps, np.nan) for each in (time[samples], *lines))
    axes.fill_between(x, k * low, k * high, color=colour, alpha=0.3, lw=0)
    axes.plot(x, k * middle, color=colour)
    axes.axhline(k * final.value, color=ink, linewidth=look.points(0.7), linestyle=":")
    if not result.stretches:
        _draw_final(axes, time[samples], final, k, look)
    axes.set_ylim(k * limits[0], k * limits[1])
    axes.locator_params(axis="y", nbins=5)
    axes.set(xlabel=label, ylabel=scale.label(symbol))
    return scale


def _draw_final(axes: "Axes", time: Floats, final: Final, factor: float, look: Look) -> None:
    """The result at the right, as a dot, with ±2 s.e.; thin, with what the findings would move."""
    right = float(time.max() + 0.03 * (np.ptp(time) or 1.0))
    for error, width, cap in ((final.error, 2.2, 0.0), (final.whole_error, 0.9, 2.5)):
        axes.errorbar(
            [right],
            [factor * final.value],
            yerr=[2.0 * factor * error],
            fmt="o",
            color=look.theme.ink,
            markersize=look.points(3.5),
            elinewidth=look.points(width),
            capsize=look.points(cap),
        )


def _draw_stretches(
    axes: "Axes", result: Identified, finals: list[Final], scale: Scale, look: Look
) -> None:
    """The result of each stretch from its start to its end, with a box of ±2 s.e."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    clock_time, _ = clock(result.contact)
    time, colour, k = result.contact.time, look.theme.lines[1], scale.factor
    corners, middles, ends = [], [], []
    for part, final in zip(result.stretches, finals, strict=True):
        start, stop = clock_time[(time >= part.contact.time[0]) & (time <= part.contact.time[-1])][
            [0, -1]
        ]
        low, high = (k * (final.value + s * 2.0 * final.whole_error) for s in (-1.0, 1.0))
        corners += [(start, low), (stop, low), (stop, high), (start, high), (start, low)]
        middles += [(start, k * final.value), (stop, k * final.value), (np.nan, np.nan)]
        ends += [low, high]
    # One path for all: of each of a hundred places its own would make a heavy file.
    codes = [Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY] * len(finals)
    boxes = PathPatch(Path(corners, codes), color=colour, alpha=0.35, linewidth=0.0, zorder=2.5)
    axes.add_patch(boxes)
    axes.plot(*np.transpose(middles), color=colour, linewidth=look.points(2.0), zorder=2.6)
    # Of many places a few that went wrong would flatten all others.
    low, high = np.percentile(ends, (5.0, 95.0) if len(ends) > 20 else (0.0, 100.0))
    span = (high - low) or abs(high) or 1.0
    axes.set_ylim(low - 0.15 * span, high + 0.15 * span)


def _limits(values: Floats, errors: Floats, final: Final) -> tuple[float, float]:
    """What a panel shows: the result, and the band since the start-up is over.

    What the findings would move may be so much that its bar leaves the panel: the title has it.
    """
    known = np.isfinite(values) & np.isfinite(errors)
    late = np.flatnonzero(known)
    late = late[late.size // 4 :]
    error = 2.5 * final.error if np.isfinite(final.error) else 0.0
    ends = [final.value - error, final.value + error]
    if late.size:
        low, high = values[late] - 2.0 * errors[late], values[late] + 2.0 * errors[late]
        ends += [float(np.percentile(low, 10.0)), float(np.percentile(high, 90.0))]
    size = largest(np.array(ends))
    whole = 2.5 * final.whole_error if np.isfinite(final.whole_error) else 0.0
    whole = min(whole, _MOST_MOVED * max(max(ends) - min(ends), _LEAST_SPAN * size))
    ends += [final.value - whole, final.value + whole]
    low_end, high_end = min(ends), max(ends)
    spread = max(high_end - low_end, _LEAST_SPAN * size, 1e-300)
    middle = 0.5 * (low_end + high_end)
    return middle - 0.6 * spread, middle + 0.6 * spread
