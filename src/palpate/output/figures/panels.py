"""Panels of an identification: parameters over time, forces, residuals, and their titles."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from palpate.digits import format_hertz, percent
from palpate.findings import spoken
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.identification.diagnosis import Data, Quantity
from palpate.identification.identified import Identified
from palpate.method.estimators.estimate import Estimate
from palpate.method.estimators.viscoelastic import dynamic_response
from palpate.output.figures.field import ERRORS, VALUES, draw_field
from palpate.output.figures.style import (
    BAND_DEVIATIONS,
    LINE_STYLES,
    MOST_GAPS,
    MOST_POINTS,
    AxisScale,
    Look,
    Scatter,
    broken,
    choose_look,
    choose_scale,
    clock,
    drawing,
    few,
    head,
    largest,
    over,
    scale_as_written,
    scatter_over_time,
    set_titles,
    shown,
)
from palpate.output.results.parameters import parameter_rows
from palpate.output.results.view import NumberLine, number_lines
from palpate.validation import Floats, frozen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


JOINED = "\N{NO-BREAK SPACE}"


def file_name(result: Identified) -> str:
    """Return the recording's file name; unprintable characters become �."""
    name = Path(result.contact.source).name
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in name)


def describe_verdict(result: Identified) -> str:
    """Return both marks, each with its reason."""
    return "; ".join(
        f"{number_line.name} {spoken(number_line.mark)}"
        + f": {number_line.reason}" * bool(number_line.reason)
        for number_line in number_lines(result)
        if number_line.mark is not None
    )


def describe_fit(result: Identified) -> str:
    """Describe file, method and fit."""
    name = file_name(result)
    fitted = "fit, one law per segment" if result.segments else "fit of the final law"
    fit = f"{result.method}, {fitted}: {result.fit_rmse_percent:.2g}{JOINED}%{JOINED}rms"
    return f"{name}: {fit}" if name else fit


# The estimate over time, with its error bars.

# Number of stops of a replay to read the covariance, which a trace does not contain.
_STOPS = 200


@frozen(eq=False)
class Course:
    """The estimated law over time, with stiffness and damping at one depth and their errors.

    Attributes
    ----------
    samples : numpy.ndarray of int, shape (k,)
        Samples after which the estimate was read.
    parameters, errors : numpy.ndarray, shape (k, p)
        Parameters of the law and their standard errors, SI.
    stiffness, stiffness_error : numpy.ndarray, shape (k,)
        ∂F/∂x, N/m, and its standard error; NaN before the first contact.
    damping, damping_error : numpy.ndarray, shape (k,)
        ∂F/∂v, N·s/m.
    """

    samples: NDArray[np.intp]
    parameters: Floats
    errors: Floats
    stiffness: Floats
    stiffness_error: Floats
    damping: Floats
    damping_error: Floats


def replay_course(result: Identified, depth: float) -> Course:
    """Replay a contact and read the estimate at times.

    Parameters
    ----------
    result : Identification
        Its contact is replayed by a fresh copy of its estimator.
    depth : float
        Penetration for stiffness and damping, m, > 0.
    """
    contact = result.contact
    estimator = result.estimator.replace()
    steps = contact.time_steps
    taken = np.flatnonzero(result.trace.taken)
    stops = np.unique(taken[np.linspace(0, taken.size - 1, _STOPS).astype(np.intp)])
    samples = []
    rows = []
    laws = []
    for segment in contact.segments():
        estimator.leave_contact()
        edges = [*stops[(stops >= segment.start) & (stops < segment.stop)] + 1, segment.stop]
        start = segment.start
        for edge in edges:
            piece = slice(start, int(edge))
            channels = contact.penetration, contact.velocity, contact.force, steps
            estimator.replay(*(channel[piece] for channel in channels), at=())
            if edge - 1 in stops:
                now = result.reported(estimator.estimate())
                samples.append(edge - 1)
                rows.append(_stiffness_and_damping(now, depth, result.frequency))
                laws.append([now.parameters, now.standard_errors])
            start = int(edge)
    parameters, errors = np.moveaxis(np.array(laws), 1, 0)
    return Course(np.array(samples, dtype=np.intp), parameters, errors, *np.array(rows).T)


@dataclass(frozen=True)
class Subject:
    """A result in a panel.

    Attributes
    ----------
    result : Identification
        What is drawn.
    colour : str
        Colour of its lines.
    name : str
        Its name in the legend, where a panel shows several results; empty for one alone.
    """

    result: Identified
    colour: str
    name: str = ""

    @cached_property
    def course(self) -> Course:
        """The estimate over time, replayed once for all panels that show it."""
        return replay_course(self.result, self.result.diagnosis.working_depth.depth)


def _stiffness_and_damping(estimate: Estimate, depth: float, frequency: float) -> list[float]:
    """Return stiffness, its error, damping and its error; NaN where they overflow.

    K′ and B′ at a frequency, rad/s, of a law that relaxes.
    """

    def numbers(law: ForceLaw) -> Any:
        if isinstance(law, GeneralisedHuntCrossley) and law.remembers and frequency > 0.0:
            return dynamic_response(law, depth, frequency)
        return law.at_rest(depth)[1:]

    try:
        values, errors = estimate.with_errors(numbers)
    except ValueError:  # parameters that are not finite make no law
        return [np.nan] * 4
    return np.column_stack([values, errors]).reshape(-1).tolist()


# The residual of the final law over time, depth and speed.

Against = Literal["time", "depth", "velocity"]
AGAINST: tuple[Against, ...] = ("time", "depth", "velocity")
# Residuals larger than this multiple of the first one's are cut off at their panel.
_MOST_REACH = 5.0
CAPTION = (
    "Residual: measured − final law. Line: median; band: 10th to 90th percentile; dotted: the "
    "same band of sensor noise alone, at working depth."
)


def draw_residuals(
    identification: Identified,
    *,
    dark: bool = False,
    width: float | None = None,
) -> "Figure":
    """Draw the residual of the final law over time, depth and velocity.

    A residual between the dotted lines is noise; a wave or a slope shows an effect that the law
    does not contain.

    Parameters
    ----------
    identification : Identification
        As returned by :func:`palpate.identify`.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches.

    Raises
    ------
    InvalidParameterError
        The width is outside its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = choose_look(dark=dark, width=width)
    every = AGAINST[:2] if identification.contact.timeless else AGAINST
    seen = [_scatter(identification, each) for each in every]
    noise = _noise_band(identification)
    unit = choose_scale(max(_reach(each, noise) for _, each in seen), "N")
    with drawing(look, 8.6 if look.narrow else 3.6) as figure:
        panels = np.ravel(figure.subplots(*(len(every), 1)[:: 1 if look.narrow else -1]))
        for axes, against, (label, scatter) in zip(panels, every, seen, strict=True):
            _draw(axes, scatter, noise, unit, look, look.theme.lines[0])
            axes.set(xlabel=label, ylabel=unit.label("residual"))
            head(axes, f"Over {against}")
        low = min(axes.get_ylim()[0] for axes in panels)
        for axes in panels:
            axes.set_ylim(low, -low)
        laws = "one law per segment" if identification.segments else "final law"
        fit = f"residual of the fit, {laws}: {identification.fit_rmse_percent:.2g} % rms"
        name = file_name(identification)
        set_titles(figure, look, [f"{name}: {fit}" if name else fit], CAPTION)
    return figure


def draw_residual(axes: "Axes", subjects: Sequence[Subject], look: Look) -> None:
    """Draw the residuals over time in one panel, with the band of noise alone."""
    first = subjects[0].result
    noise = _noise_band(first)
    seen = [_scatter(subject.result, "time") for subject in subjects]
    reach = max(_reach(scatter, noise) for _, scatter in seen)
    unit = choose_scale(reach, "N")
    for subject, (label, scatter) in zip(subjects, seen, strict=True):
        _draw(axes, scatter, noise, unit, look, subject.colour, subject.name)
        axes.set(xlabel=label, ylabel=unit.label("residual"))
    _limit_residual(axes, unit.factor * reach)
    law = "law of each segment" if first.segments else "final law"
    fits = ", ".join(f"{subject.result.fit_rmse_percent:.2g} % rms" for subject in subjects)
    head(axes, f"Residual, measured − {law}: {fits}")


def draw_residual_rows(rows: "Sequence[Axes]", results: Sequence[Identified], look: Look) -> None:
    """Draw the residuals of several identifications over time, on one scale.

    The scale is limited so that the residual of the first, the best, stays visible.
    """
    noise = _noise_band(results[0])
    seen = [_scatter(result, "time") for result in results]
    reaches = [_reach(scatter, noise) for _, scatter in seen]
    reach = min(max(reaches), _MOST_REACH * reaches[0])
    unit = choose_scale(reach, "N")
    for row, (axes, (label, scatter)) in enumerate(zip(rows, seen, strict=True)):
        _draw(axes, scatter, noise, unit, look, look.colour(row))
        _limit_residual(axes, unit.factor * reach)
        axes.set(xlabel=label, ylabel=unit.label("residual"))


def _limit_residual(axes: "Axes", reach: float) -> None:
    axes.set_ylim(-1.15 * reach, 1.15 * reach)
    axes.locator_params(axis="y", nbins=4)


def _noise_band(result: Identified) -> float:
    """Return half the width of the band of noise alone, N.

    From the noise of a sample's force, √(σ² + S²σ_x² + C²σ_v²), at working depth.
    """
    data = result.data or Data(result.contact)
    working_depth = result.diagnosis.working_depth
    by_position = working_depth.stiffness.value * data.penetration_noise
    damping = working_depth.damping.value
    by_velocity = damping * data.velocity_noise if math.isfinite(damping) else 0.0
    parts = np.array([data.force_noise, by_position, by_velocity])
    return BAND_DEVIATIONS * float(np.linalg.norm(parts[np.isfinite(parts)]))


def _reach(scatter: Scatter, noise: float) -> float:
    return max(largest(scatter.low), largest(scatter.high), noise, 1e-300)


def _draw(
    axes: "Axes",
    seen: Scatter,
    noise: float,
    unit: AxisScale,
    look: Look,
    colour: str,
    name: str = "",
) -> None:
    k = unit.factor
    axes.fill_between(seen.place, k * seen.low, k * seen.high, color=colour, alpha=0.3, lw=0)
    few = np.isfinite(seen.middle).sum() < 4  # one point makes no line
    [line] = axes.plot(seen.place, k * seen.middle, "o-" if few else "-", color=colour)
    line.set(markersize=3.0, label=name or "_")
    for level in (-noise, noise) if noise > 0.0 else ():
        axes.axhline(k * level, color=look.theme.ink, linestyle=":", linewidth=look.points(0.9))
    axes.axhline(0.0, color=look.theme.ink, linewidth=look.points(0.6))
    reach = 1.15 * k * _reach(seen, noise)
    axes.set_ylim(-reach, reach)


def _scatter(result: Identified, against: Against) -> tuple[str, Scatter]:
    """Return the label of the abscissa and the residual over it."""
    contact = result.contact
    taken = result.trace.taken
    with np.errstate(all="ignore"):  # absurd samples overflow
        residual = contact.force - result.fitted_force
    if against == "time":
        time, label = clock(contact)
        return label, scatter_over_time(time, residual, contact, taken)
    name, unit, values = {
        "depth": ("penetration", "m", contact.penetration),
        "velocity": ("velocity, inwards > 0", "m/s", contact.velocity),
    }[against]
    scale = choose_scale(largest(values[taken]), unit)
    return scale.label(name), over(_apply_scale(values, scale), residual, taken)


def _apply_scale(values: Floats, scale: AxisScale) -> Floats:
    with np.errstate(over="ignore"):
        return scale.factor * values


# Panels of quantities over time, with their bands and the result at the end.

# Least span of a panel relative to the value: the ticks of a smaller one are too long to read.
_LEAST_SPAN = 1e-5
# A bar with systematic error is shown whole up to this multiple of the rest of its panel.
_MOST_MOVED = 10.0


@frozen
class Final:
    """Final value of a quantity.

    Attributes
    ----------
    value : float
        The result.
    error : float
        Statistical standard error.
    whole_error : float
        Total standard error, with the systematic part if there is one.
    """

    value: float
    error: float
    whole_error: float

    @classmethod
    def of(cls, quantity: Quantity) -> "Final":
        """Return the final value of a quantity at the working depth."""
        error = quantity.standard_error if np.isfinite(quantity.standard_error) else 0.0
        return cls(quantity.value, error, float(np.hypot(error, quantity.systematic)))


def draw_parameter(axes: "Axes", subjects: Sequence[Subject], look: Look, *, symbol: str) -> None:
    """Draw one parameter over time, with a band of ±2 standard errors, and the result."""
    lines = []
    for subject in subjects:
        result, course = subject.result, subject.course
        for row in parameter_rows(result):
            if row.symbol == symbol:
                error = float(result.standard_errors[row.index])
                final = Final(float(result.law.parameters[row.index]), error, error)
                known = course.parameters[:, row.index], course.errors[:, row.index]
                lines.append((row, _Line(subject, *known, final, subject.name)))
    row = lines[0][0]
    _draw_lines(axes, [line for _, line in lines], row.unit, symbol, look)
    words = f": {row.with_unit.replace(' ', JOINED)}" if len(lines) == 1 else ""
    head(axes, f"{symbol}{words}")


def draw_spectrum(axes: "Axes", subjects: Sequence[Subject], look: Look) -> None:
    """Draw the stiffness of each relaxation time of a law that has one, over the time."""
    law: Any = subjects[0].result.law
    times, weights = law.branches()
    stiffnesses = law.M * weights
    present = stiffnesses > 0.0
    scale = choose_scale(float(stiffnesses.max()), law.units[law.names().index("M")])
    stems = times[present], scale.factor * stiffnesses[present]
    axes.vlines(stems[0], 0.0, stems[1], color=look.theme.lines[0], linewidth=look.points(2.2))
    axes.plot(*stems, "o", color=look.theme.lines[0], markersize=look.points(4.0))
    axes.set_xscale("log")
    axes.set_xlim(times[0] / 2.0, times[-1] * 2.0)  # also the times without a stiffness
    axes.set_ylim(0.0, 1.15 * stems[1].max())
    axes.locator_params(axis="y", nbins=5)
    axes.set(xlabel="relaxation time τ [s]", ylabel=scale.label("m"))
    head(axes, f"Relaxation: {law.describe_relaxation().replace(' ', JOINED)}")


# Units and axis labels.
_AT_DEPTH = {"stiffness": ("N/m", "dF/dx"), "damping": ("N·s/m", "dF/dv")}


def draw_at_depth(
    axes: "Axes",
    subjects: Sequence[Subject],
    look: Look,
    *,
    quantity: Literal["stiffness", "damping"],
) -> None:
    """Draw stiffness or damping at working depth over time, and the diagnosed results."""
    unit, symbol = _AT_DEPTH[quantity]
    lines = [_line_at_depth(subject, quantity) for subject in subjects]
    scale = _draw_lines(axes, lines, unit, symbol, look)
    result = subjects[0].result
    depth = result.diagnosis.working_depth.depth
    length = choose_scale(depth, "m")
    name = quantity.capitalize()
    at = f"{name} at {length.factor * depth:.3g} {length.unit}"
    if result.frequency > 0.0 and (quantity == "damping" or result.law.remembers):
        at += f", {format_hertz(result.frequency)}"
    if result.segments and len(subjects) == 1:
        parts = [getattr(part.diagnosis.working_depth, quantity) for part in result.segments]
        _draw_segments(axes, result, [Final.of(each) for each in parts], scale, look)
        kind = "place" if result.segments[0].place is not None else "segment"
        head(axes, f"{name} of each {kind}" if kind == "place" else f"{at}, of each segment")
        return
    value = next(each.value for each in number_lines(result) if each.name == quantity)
    words = f": {value.replace(' ', JOINED)}" if len(subjects) == 1 else ""
    head(axes, f"{at}{words}")


# Up to this width, m, a legend has symbols for stiffness and damping.
_SHORT_NAMES = 0.075
_SYMBOLS = {"stiffness": "K′", "damping": "B′"}


def _known_numbers(result: Identified) -> list[NumberLine]:
    """Return the numbers of an answer that are given and are not zero."""
    at_depth = result.diagnosis.working_depth
    known = []
    for number in number_lines(result):
        value = getattr(at_depth, number.name).value
        if number.mark is not None and math.isfinite(value) and value:
            known.append(number)
    return known


def has_numbers(result: Identified) -> bool:
    """Return whether stiffness or damping can be drawn over its result."""
    return bool(_known_numbers(result))


def draw_numbers(axes: "Axes", subjects: Sequence[Subject], look: Look) -> None:
    """Draw stiffness and damping over time, each over its result, with the marks."""
    lines = []
    for subject in subjects:
        for place, number in enumerate(_known_numbers(subject.result)):
            mark = spoken(number.mark or "")
            name = number.name if look.width > _SHORT_NAMES else _SYMBOLS[number.name]
            words = f"{subject.name} {name} {number.value}: {mark}"
            colour = subject.colour if len(subjects) > 1 else look.colour(place)
            line = _line_at_depth(subject, number.name)
            lines.append(line.over_result(100.0, colour, words.strip()))
    _draw_lines(axes, lines, "%", "estimate / result", look)
    head(axes, "Stiffness and damping, over their results")


@frozen(eq=False)
class _Line:
    """A quantity over time: its estimates, their errors, and the result at the end."""

    subject: Subject
    values: Floats
    errors: Floats
    final: Final
    name: str = ""
    colour: str = ""

    def over_result(self, whole: float, colour: str, name: str) -> "_Line":
        """Return the line with the result as ``whole``."""
        factor = whole / self.final.value
        error, whole_error = abs(factor) * self.final.error, abs(factor) * self.final.whole_error
        return replace(
            self,
            values=factor * self.values,
            errors=abs(factor) * self.errors,
            final=Final(whole, error, whole_error),
            name=name,
            colour=colour,
        )


def _line_at_depth(subject: Subject, quantity: str) -> _Line:
    course = subject.course
    final = Final.of(getattr(subject.result.diagnosis.working_depth, quantity))
    values, errors = getattr(course, quantity), getattr(course, f"{quantity}_error")
    return _Line(subject, values, errors, final, subject.name)


def _draw_lines(
    axes: "Axes", lines: Sequence[_Line], unit: str, symbol: str, look: Look
) -> AxisScale:
    """Draw a quantity of each result over time, its band of ±2 standard errors, and the result."""
    ends = [_limits(line.values, line.errors, line.final) for line in lines]
    limits = min(low for low, _ in ends), max(high for _, high in ends)
    if len(lines) > 1:
        margin = 0.05 * (limits[1] - limits[0])
        limits = limits[0] - margin, limits[1] + margin
    scale = scale_as_written(max(abs(limits[0]), abs(limits[1])), unit)
    for place, line in enumerate(lines):
        _draw_line(axes, line, place, limits, scale.factor, look)
    axes.set_ylim(scale.factor * limits[0], scale.factor * limits[1])
    axes.locator_params(axis="y", nbins=5)
    _, label = clock(lines[0].subject.result.contact)
    axes.set(xlabel=label, ylabel=scale.label(symbol))
    return scale


def _draw_line(
    axes: "Axes", line: _Line, place: int, limits: tuple[float, float], factor: float, look: Look
) -> None:
    """Draw one quantity over time, within the limits of the panel."""
    result, samples = line.subject.result, line.subject.course.samples
    time, _ = clock(result.contact)
    colour = line.colour or line.subject.colour
    # Limit values far outside the panel: coordinates of 1e200 make no line.
    far = 10.0 * (limits[1] - limits[0])
    within = (limits[0] - far, limits[1] + far)
    with np.errstate(invalid="ignore", over="ignore"):
        low, middle, high = (
            np.clip(line.values + sign * 2.0 * line.errors, *within) for sign in (-1.0, 0.0, 1.0)
        )
    seen = (middle >= limits[0]) & (middle <= limits[1])
    seen |= np.append(seen[1:], False) | np.insert(seen[:-1], 0, False)
    middle = np.where(seen, middle, np.nan)  # a start that often leaves the panel
    gaps = np.flatnonzero(np.diff(result.contact.segment[samples])) + 1
    gaps = gaps if gaps.size <= MOST_GAPS else gaps[:0]
    x, low, middle, high = (
        np.insert(each, gaps, np.nan) for each in (time[samples], low, middle, high)
    )
    axes.fill_between(x, factor * low, factor * high, color=colour, alpha=0.3, lw=0)
    dashes = LINE_STYLES[place % len(LINE_STYLES)]
    axes.plot(x, factor * middle, color=colour, linestyle=dashes, label=line.name or "_")
    level = factor * line.final.value
    axes.axhline(level, color=look.theme.ink, linewidth=look.points(0.7), linestyle=":")
    if not result.segments:
        place_at = float(time[samples].max() + 0.03 * (1 + place) * (np.ptp(time[samples]) or 1.0))
        _draw_final(axes, place_at, line.final, factor, colour, look)


def _draw_final(
    axes: "Axes", place: float, final: Final, factor: float, colour: str, look: Look
) -> None:
    """Draw the result at the right with ±2 standard errors; thin, with the systematic part."""
    for error, width, cap in ((final.error, 2.2, 0.0), (final.whole_error, 0.9, 2.5)):
        dot = look.dot(3.5, width, cap)
        axes.errorbar(place, factor * final.value, yerr=2.0 * factor * error, color=colour, **dot)


def _draw_segments(
    axes: "Axes",
    result: Identified,
    finals: list[Final],
    scale: AxisScale,
    look: Look,
) -> None:
    """Draw the result of each segment over its time, with a box of ±2 standard errors."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    clock_time, _ = clock(result.contact)
    time = result.contact.time
    colour = look.theme.lines[1]
    k = scale.factor
    corners = []
    middles = []
    ends = []
    for part, final in zip(result.segments, finals, strict=True):
        start, stop = clock_time[(time >= part.contact.time[0]) & (time <= part.contact.time[-1])][
            [0, -1]
        ]
        low, high = (k * (final.value + s * 2.0 * final.whole_error) for s in (-1.0, 1.0))
        corners += [(start, low), (stop, low), (stop, high), (start, high), (start, low)]
        middles += [(start, k * final.value), (stop, k * final.value), (np.nan, np.nan)]
        ends += [low, high]
    # One path for all boxes: one per place would make a large file.
    codes = [Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY] * len(finals)
    boxes = PathPatch(Path(corners, codes), color=colour, alpha=0.35, linewidth=0.0, zorder=2.5)
    axes.add_patch(boxes)
    axes.plot(*np.transpose(middles), color=colour, linewidth=look.points(2.0), zorder=2.6)
    # Among many places, a few outliers would flatten all others.
    low, high = np.percentile(ends, (5.0, 95.0) if len(ends) > 20 else (0.0, 100.0))
    span = (high - low) or abs(high) or 1.0
    axes.set_ylim(low - 0.15 * span, high + 0.15 * span)


def _limits(values: Floats, errors: Floats, final: Final) -> tuple[float, float]:
    """Return limits that show the result and the band after start-up.

    A large systematic error may extend beyond the panel; the title states it.
    """
    known = np.isfinite(values) & np.isfinite(errors)
    late = np.flatnonzero(known)
    late = late[late.size // 4 :]
    error = 2.5 * final.error if np.isfinite(final.error) else 0.0
    ends = [final.value - error, final.value + error]
    if late.size:
        low = values[late] - 2.0 * errors[late]
        high = values[late] + 2.0 * errors[late]
        ends += [float(np.percentile(low, 10.0)), float(np.percentile(high, 90.0))]
    size = largest(np.array(ends))
    whole = 2.5 * final.whole_error if np.isfinite(final.whole_error) else 0.0
    whole = min(whole, _MOST_MOVED * max(max(ends) - min(ends), _LEAST_SPAN * size))
    ends += [final.value - whole, final.value + whole]
    low_end = min(ends)
    high_end = max(ends)
    spread = max(high_end - low_end, _LEAST_SPAN * size, 1e-300)
    middle = 0.5 * (low_end + high_end)
    return middle - 0.6 * spread, middle + 0.6 * spread


# Panels of force: over time, and over penetration.

# Most crosses at excluded samples: more make a large file.
_MOST_CROSSES = 200


def draw_force(axes: "Axes", subjects: Sequence[Subject], look: Look) -> None:
    """Draw measured and one-step predicted force over time, and the excluded samples."""
    theme = look.theme
    ranges = [_force_range(subject.result, outliers=True) for subject in subjects]
    low, high = min(each[0] for each in ranges), max(each[1] for each in ranges)
    unit = choose_scale(max(abs(low), abs(high)), "N")
    for place, subject in enumerate(subjects):
        contact, trace = subject.result.contact, subject.result.trace
        time, label = clock(contact)
        keep = shown(contact)
        good = keep[~trace.rejected[keep]]
        measured = unit.factor * broken(contact.force, contact, good)
        [line] = axes.plot(time[good], measured, color=theme.measured)
        line.set(linewidth=look.points(2.4), label="_" if place else "measured")
        inside = np.where(trace.taken, trace.predicted_force, np.nan)
        predicted = unit.factor * broken(inside, contact, keep)
        [line] = axes.plot(time[keep], predicted, color=subject.colour)
        line.set(linewidth=look.points(1.0), label=subject.name or "one-step prediction")
        excluded = few(np.flatnonzero(trace.rejected), _MOST_CROSSES)
        if excluded.size:
            crosses = unit.factor * np.clip(contact.force[excluded], low, high)
            [line] = axes.plot(time[excluded], crosses, "x", color=theme.ink)
            line.set(markersize=look.points(4.0), label="_" if place else "excluded")
        axes.set(xlabel=label, ylabel=unit.label("force"))
    axes.set_ylim(unit.factor * low, unit.factor * high)
    head(axes, "Force")


def draw_loop(
    axes: "Axes", subjects: Sequence[Subject], look: Look, *, points: int = MOST_POINTS
) -> None:
    """Draw force over penetration, measured and by the final law, without excluded samples."""
    ranges = [_force_range(subject.result, outliers=False) for subject in subjects]
    low, high = min(each[0] for each in ranges), max(each[1] for each in ranges)
    deepest = max(_deepest(subject.result) for subject in subjects)
    depth, force = choose_scale(deepest, "m"), choose_scale(max(abs(low), abs(high)), "N")
    for place, subject in enumerate(subjects):
        result = subject.result
        contact = result.contact
        keep = shown(contact, points)
        keep = keep[~result.trace.rejected[keep]]
        with np.errstate(over="ignore"):  # of an extreme sample out of contact
            x = np.clip(depth.factor * contact.penetration[keep], -1e4, 1e4)
        measured = force.factor * broken(contact.force, contact, keep)
        words = f"{subject.name}, measured".lstrip(", ")
        dashes = LINE_STYLES[place % len(LINE_STYLES)]
        [line] = axes.plot(x, measured, color=look.theme.measured, linestyle=dashes)
        line.set(linewidth=look.points(2.2), label=words)
        inside = np.where(result.trace.taken, result.fitted_force, np.nan)
        law = "law of each segment" if result.segments else "final law"
        words = f"{subject.name}, {law}".lstrip(", ")
        [line] = axes.plot(x, force.factor * broken(inside, contact, keep), color=subject.colour)
        line.set(linewidth=look.points(0.9), label=words)
    axes.set_xlim(-0.1 * depth.factor * deepest, 1.05 * depth.factor * deepest)
    axes.set_ylim(force.factor * low, force.factor * high)
    axes.set(xlabel=depth.label("penetration"), ylabel=force.label("force"))
    head(axes, "Force over penetration")


def _deepest(result: Identified) -> float:
    return largest(np.maximum(result.contact.penetration[result.trace.taken], 0.0)) or 1.0


def _force_range(result: Identified, *, outliers: bool) -> tuple[float, float]:
    """Return the force range of a panel, N: samples in contact, most others, and any outliers.

    An outlier beyond twice the range is drawn at the edge: it would flatten the rest.
    """
    force = result.contact.force
    trace = result.trace
    known = np.isfinite(force)
    ends = [*np.percentile(force[known], (1.0, 99.0)), *_ends(force[known & trace.taken])]
    low = min(ends)
    high = max(ends)
    span = (high - low) or abs(high) or 1.0
    excluded = force[known & trace.rejected & outliers]
    excluded = np.clip(excluded, low - 2.0 * span, high + 2.0 * span)
    low = min([low, *_ends(excluded)])
    high = max([high, *_ends(excluded)])
    return low - 0.06 * (high - low or span), high + 0.06 * (high - low or span)


def _ends(values: Floats) -> tuple[float, ...]:
    return (float(values.min()), float(values.max())) if values.size else ()


def draw_condition(axes: "Axes", subjects: Sequence[Subject], look: Look) -> None:
    """Draw the speed and its limit for the single-stage method, 0.1 K/B, as estimated so far."""
    result, course = subjects[0].result, subjects[0].course
    contact = result.contact
    time, label = clock(contact)
    keep = shown(contact)[::2]  # both lines are smooth
    speed = np.where(result.trace.taken, np.abs(contact.velocity), np.nan)
    stiffness, damping = np.abs(course.parameters[:, :2].T)
    limit = np.full(len(contact), np.nan)
    limit[course.samples] = 0.1 * np.divide(
        stiffness,
        damping,
        out=np.full_like(damping, np.nan),
        where=damping > 0.0,
    )
    fastest = largest(speed)
    settled = float(np.nanmedian(limit)) if np.isfinite(limit).any() else fastest
    top = 1.15 * max(fastest, min(settled, 5.0 * fastest), 1e-300)
    unit = choose_scale(top, "m/s")
    for values, at, colour, words in (
        (speed, keep, look.theme.measured, "|v|"),
        (limit, course.samples, look.theme.lines[1], "0.1 K/B (estimated)"),
    ):
        shown_values = unit.factor * broken(np.minimum(values, 10.0 * top), contact, at)
        axes.plot(time[at], shown_values, color=colour, label=words)
    axes.set_ylim(0.0, unit.factor * top)
    axes.set(xlabel=label, ylabel=unit.label("speed"))
    head(
        axes,
        f"Speed limit |v| < 0.1 K/B: violated in {percent(result.violated_fraction)} of contact",
    )


# The map of a probe that travels.

# Shapes tell the verdicts apart; colour, which shows the value, could not.
_MARKERS = {"trust": "o", "with-care": "s", "do-not-trust": "X"}


def draw_places(
    axes: "Axes", subjects: Sequence[Subject], look: Look, *, errors: bool = False
) -> None:
    """Draw the stiffness of each place over its position, or its standard error."""
    result = subjects[0].result
    places = [part.place for part in result.segments if part.place is not None]
    positions = 1e3 * np.array([place.position for place in places])
    normals = [place.normal.vector for place in places if place.normal is not None]
    # The map is seen along the axis closest to the normals, else along the one of least spread.
    seen_along = -np.mean(np.abs(normals), axis=0) if normals else np.ptp(positions, axis=0)
    across = np.delete(np.arange(3), np.argmin(seen_along))
    # The longer side lies: a tall map would leave most of the page empty.
    across = across[np.argsort(-np.ptp(positions[:, across], axis=0), kind="stable")]
    marks = np.array([part.diagnosis.verdict.stiffness for part in result.segments])
    shapes = [(spoken(mark), _MARKERS[mark], marks == mark) for mark in np.unique(marks).tolist()]
    trusted = marks != "do-not-trust"
    values = [part.diagnosis.working_depth.stiffness for part in result.segments]
    size = np.array([each.whole_error if errors else each.value for each in values])
    unit = choose_scale(largest(size[trusted] if trusted.any() else size), "N/m")
    at, label = positions[:, across], f"[{unit.unit}]"
    colours = ERRORS if errors else VALUES
    draw_field(axes, at, unit.factor * size, trusted, label, look, colours=colours, markers=shapes)
    axes.set(xlabel=f"{'xyz'[across[0]]} [mm]", ylabel=f"{'xyz'[across[1]]} [mm]")
    axes.set_aspect("equal", adjustable="datalim")
    head(axes, "Standard error of the stiffness" if errors else "Stiffness at working depth")
