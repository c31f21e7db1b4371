"""Panels that show force: over time, over penetration, and what a prediction missed."""

import math
from typing import TYPE_CHECKING

import numpy as np

from palpate.figures.course import Course
from palpate.figures.look import Look
from palpate.figures.scales import largest, scale_of
from palpate.figures.sheet import head
from palpate.figures.thinning import MOST_POINTS, broken, clock, few, shown
from palpate.identification import Identified
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# More crosses than this at samples that were left out make a heavy file.
_MOST_CROSSES = 200


def draw_force(axes: "Axes", result: Identified, look: Look) -> None:
    """Force over time, measured and predicted a priori, and the samples that were left out."""
    contact, theme = result.contact, look.theme
    time, label = clock(contact)
    keep = shown(contact)
    low, high = _force_range(result, outliers=True)
    unit = scale_of(max(abs(low), abs(high)), "N")
    good = keep[~result.trace.rejected[keep]]
    measured = unit.factor * broken(contact.force, contact, good)
    axes.plot(
        time[good], measured, color=theme.measured, linewidth=look.points(2.4), label="measured"
    )
    inside = np.where(result.trace.taken, result.trace.predicted_force, np.nan)
    axes.plot(
        time[keep],
        unit.factor * broken(inside, contact, keep),
        color=theme.lines[0],
        linewidth=look.points(1.0),
        label="predicted (a priori)",
    )
    left_out = few(np.flatnonzero(result.trace.rejected), _MOST_CROSSES)
    if left_out.size:
        axes.plot(
            time[left_out],
            unit.factor * np.clip(contact.force[left_out], low, high),
            color=theme.ink,
            linestyle="none",
            marker="x",
            markersize=look.points(4.0),
            label="left out",
        )
    axes.set_ylim(unit.factor * low, unit.factor * high)
    axes.set(xlabel=label, ylabel=unit.label("force"))
    head(axes, "Force")


def draw_loop(
    axes: "Axes",
    result: Identified,
    look: Look,
    *,
    colour: str | None = None,
    points: int = MOST_POINTS,
) -> None:
    """Force over penetration, measured and by the final law, without what was left out."""
    contact, theme = result.contact, look.theme
    keep = shown(contact, points)
    keep = keep[~result.trace.rejected[keep]]
    deepest = largest(np.maximum(contact.penetration[result.trace.taken], 0.0)) or 1.0
    low, high = _force_range(result, outliers=False)
    depth, force = scale_of(deepest, "m"), scale_of(max(abs(low), abs(high)), "N")
    with np.errstate(over="ignore"):  # of an absurd sample out of contact
        x = np.clip(depth.factor * contact.penetration[keep], -1e4, 1e4)
    axes.plot(
        x,
        force.factor * broken(contact.force, contact, keep),
        color=theme.measured,
        linewidth=look.points(2.2),
        label="measured",
    )
    inside = np.where(result.trace.taken, result.fitted_force, np.nan)
    axes.plot(
        x,
        force.factor * broken(inside, contact, keep),
        color=colour or theme.lines[0],
        linewidth=look.points(0.9),
        label="law of each part" if result.stretches else "final law",
    )
    axes.set_xlim(-0.1 * depth.factor * deepest, 1.05 * depth.factor * deepest)
    axes.set_ylim(force.factor * low, force.factor * high)
    axes.set(xlabel=depth.label("penetration"), ylabel=force.label("force"))


def _force_range(result: Identified, *, outliers: bool) -> tuple[float, float]:
    """Forces that a panel shows, N: those in contact, most of those out of it, maybe outliers.

    An outlier further away than twice the range is at the panel's edge: it would flatten all else.
    """
    force, trace = result.contact.force, result.trace
    known = np.isfinite(force)
    ends = [*np.percentile(force[known], (1.0, 99.0)), *_ends(force[known & trace.taken])]
    low, high = min(ends), max(ends)
    span = (high - low) or abs(high) or 1.0
    left_out = force[known & trace.rejected & outliers]
    left_out = np.clip(left_out, low - 2.0 * span, high + 2.0 * span)
    low, high = min([low, *_ends(left_out)]), max([high, *_ends(left_out)])
    return low - 0.06 * (high - low or span), high + 0.06 * (high - low or span)


def _ends(values: Floats) -> tuple[float, ...]:
    return (float(values.min()), float(values.max())) if values.size else ()


def _error_reach(result: Identified) -> float:
    """How large a prediction error is but for the first of each start, N."""
    taken = result.trace.taken
    error = np.abs(result.contact.force - result.trace.predicted_force)[taken]
    known = error[np.isfinite(error)]
    # The first error of each start is as large as the force; the scale shows what comes after.
    reach = 1.3 * float(np.percentile(known, 99.0)) if known.size else 0.0
    force = largest(result.contact.force[taken])
    return max(min(reach, force), 1e-12 * force, 1e-300)


def draw_error(axes: "Axes", result: Identified, look: Look) -> None:
    """A-priori force error over time."""
    contact = result.contact
    time, label = clock(contact)
    keep = shown(contact)
    limit = _error_reach(result)
    unit = scale_of(limit, "N")
    with np.errstate(over="ignore", invalid="ignore"):  # of absurd samples
        missed = contact.force - result.trace.predicted_force
        error = np.where(result.trace.taken, missed, np.nan)
        values = unit.factor * np.clip(broken(error, contact, keep), -9.0 * limit, 9.0 * limit)
    axes.plot(time[keep], values, color=look.theme.lines[0], linewidth=look.points(0.8))
    axes.set_ylim(-unit.factor * limit, unit.factor * limit)
    axes.set(xlabel=label, ylabel=unit.label("error"))
    axes.axhline(0.0, color=look.theme.ink, linewidth=look.points(0.6))
    rmse = result.prediction_rmse_percent
    part = f": {rmse:.2g} % rms after 0.2 s" if math.isfinite(rmse) else ""
    head(axes, f"Prediction error (a priori){part}")


def draw_condition(axes: "Axes", result: Identified, course: Course, look: Look) -> None:
    """The speed beside what condition 10 allows by the estimates of the moment."""
    contact = result.contact
    time, label = clock(contact)
    keep = shown(contact)[::2]  # neither line is as quick as the noise
    speed = np.where(result.trace.taken, np.abs(contact.velocity), np.nan)
    stiffness, damping = np.abs(course.parameters[:, :2].T)
    limit = np.full(len(contact), np.nan)
    limit[course.samples] = 0.1 * np.divide(
        stiffness, damping, out=np.full_like(damping, np.nan), where=damping > 0.0
    )
    fastest = largest(speed)
    settled = float(np.nanmedian(limit)) if np.isfinite(limit).any() else fastest
    top = 1.15 * max(fastest, min(settled, 5.0 * fastest), 1e-300)
    unit = scale_of(top, "m/s")
    for values, at, colour, words in (
        (speed, keep, look.theme.measured, "|v|"),
        (limit, course.samples, look.theme.lines[1], "0.1 K/B (estimated)"),
    ):
        shown_values = unit.factor * broken(np.minimum(values, 10.0 * top), contact, at)
        axes.plot(time[at], shown_values, color=colour, label=words)
    axes.set_ylim(0.0, unit.factor * top)
    axes.set(xlabel=label, ylabel=unit.label("speed"))
    head(axes, f"Condition 10, |v| < 0.1 K/B: broken in {result.violated_fraction:.1%} of contact")
