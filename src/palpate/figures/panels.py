"""The panels of a figure, each on its own axes."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.figures.style import Theme
from palpate.identification import Identification
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# More points than this on a line make a heavy file that looks the same.
MOST_POINTS = 1200


def _clock(contact: Contact) -> tuple[Floats, str]:
    """Time to draw against; segments whose clocks overlap are put one behind the other."""
    if np.all(np.diff(contact.time) > 0.0):
        return contact.time, "time [s]"
    return np.cumsum(contact.time_steps), "time, contacts joined [s]"


def _shown(contact: Contact) -> NDArray[np.intp]:
    """Which samples to draw."""
    return np.arange(0, len(contact), max(1, len(contact) // MOST_POINTS))


def _broken(values: Floats, contact: Contact, keep: NDArray[np.intp]) -> Floats:
    """The values to draw, with a gap where another contact begins."""
    drawn = np.array(values[keep], dtype=np.float64)
    drawn[1:][np.diff(contact.segment[keep]) != 0] = np.nan
    return drawn


def draw_force(axes: "Axes", shown: list[Identification], theme: Theme) -> None:
    """Force over time, measured and predicted a priori by each identification."""
    contact = shown[0].contact
    time, label = _clock(contact)
    keep = _shown(contact)
    measured = _broken(contact.force, contact, keep)
    axes.plot(time[keep], measured, color=theme.measured, linewidth=2.4, label="measured")
    left_out = np.flatnonzero(shown[0].trace.rejected)
    if left_out.size:
        some = left_out[:: -(-left_out.size // MOST_POINTS)]
        axes.plot(
            time[some],
            contact.force[some],
            color=theme.measured,
            linestyle="none",
            marker="x",
            markersize=4.0,
            label="left out",
        )
    for result, look in zip(shown, theme.looks(len(shown)), strict=True):
        inside = np.where(result.trace.taken, result.trace.predicted_force, np.nan)
        predicted = _broken(inside, contact, keep)
        axes.plot(time[keep], predicted, **look, linewidth=1.0, label=_label(result, shown))
    known = contact.force[np.isfinite(contact.force)]
    low, high = float(known.min()), float(known.max())
    span = (high - low) or abs(high)
    entries = 1 + len(shown) + bool(left_out.size)
    rows = -(-entries // 3)  # of the legend, above the data
    axes.set_ylim(low - 0.1 * span, high + max(0.25, 0.13 * rows) * span)
    axes.set(xlabel=label, ylabel="force [N]", title="Force, and what was predicted of it")
    axes.legend(loc="upper right", ncols=min(3, entries))


def _label(result: Identification, shown: list[Identification]) -> str:
    return result.method if len(shown) > 1 else "predicted (a priori)"


def draw_error(axes: "Axes", shown: list[Identification], theme: Theme) -> None:
    """A-priori force error over time."""
    contact = shown[0].contact
    time, label = _clock(contact)
    keep = _shown(contact)
    largest = _largest(np.abs(contact.force))
    for result, look in zip(shown, theme.looks(len(shown)), strict=True):
        error = np.where(result.trace.taken, contact.force - result.trace.predicted_force, np.nan)
        rmse = result.prediction_rmse_percent
        text = f"{_label(result, shown)}: {rmse:.2g} %" if np.isfinite(rmse) else result.method
        axes.plot(time[keep], _broken(error, contact, keep), **look, linewidth=0.9, label=text)
    # The first error of each start is as large as the force; the scale shows what comes after.
    errors = [np.abs(r.contact.force - r.trace.predicted_force)[r.trace.taken] for r in shown]
    limit = min(1.3 * max(float(np.nanpercentile(e, 99.0)) for e in errors if e.size), largest)
    limit = max(limit, 1e-12 * largest)
    axes.set_ylim(-limit, limit)
    axes.set(
        xlabel=label, ylabel="error [N]", title="Prediction error (a priori), RMSE% after 0.2 s"
    )
    axes.legend(loc="upper right", ncols=2)


def draw_loop(axes: "Axes", shown: list[Identification], theme: Theme) -> None:
    """Force over penetration, measured and by the final laws, without what was left out."""
    contact = shown[0].contact
    keep = _shown(contact)
    keep = keep[~shown[0].trace.rejected[keep]]
    prefix, factor = _length_unit(_largest(contact.penetration))
    depth = contact.penetration * factor
    axes.plot(
        depth[keep],
        _broken(contact.force, contact, keep),
        color=theme.measured,
        linewidth=2.0,
        label="measured",
    )
    for result, look in zip(shown, theme.looks(len(shown)), strict=True):
        inside = np.where(result.trace.taken, result.fitted_force, np.nan)
        own = "law of each stretch" if result.stretches else "final law"
        label = result.method if len(shown) > 1 else own
        axes.plot(depth[keep], _broken(inside, contact, keep), **look, linewidth=0.9, label=label)
    largest = _largest(depth)
    axes.set_xlim(-0.1 * largest, 1.05 * largest)
    axes.set(xlabel=f"penetration [{prefix}m]", ylabel="force [N]", title="Force–penetration loop")
    axes.legend(loc="upper left")


def _largest(values: Floats) -> float:
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


def _length_unit(largest: float) -> tuple[str, float]:
    for prefix, factor in (("", 1.0), ("m", 1e3), ("µ", 1e6)):
        if largest * factor >= 0.5:
            return prefix, factor
    return "n", 1e9


def draw_parameter(
    axes: "Axes", result: Identification, index: int, name: str, theme: Theme
) -> None:
    """One parameter over time, with a band of two standard errors."""
    contact, trace, law = result.contact, result.trace, result.law
    time, label = _clock(contact)
    keep = _shown(contact)
    known = trace.taken
    value = np.where(known, trace.parameters[:, index], np.nan)
    error = np.where(known, trace.standard_errors[:, index], np.nan)
    value, error = _broken(value, contact, keep), _broken(error, contact, keep)
    final = float(law.parameters[index])
    axes.fill_between(
        time[keep], value - 2.0 * error, value + 2.0 * error, color=theme.lines[0], alpha=0.25, lw=0
    )
    axes.plot(time[keep], value, color=theme.lines[0])
    axes.axhline(final, color=theme.ink, linewidth=0.7, linestyle=":")
    # The start-up leaves any scale; show the second half of the estimate, and the final value.
    settled = value[np.isfinite(value)]
    settled = settled[settled.size // 4 :]
    last = float(result.standard_errors[index])
    spread = max(float(np.ptp(settled)), 4.0 * last, 0.1 * abs(final), 1e-300)
    middle = 0.5 * float(settled.max() + settled.min())
    axes.set_ylim(middle - spread, middle + spread)
    unit = f" [{law.units[index]}]" if law.units[index] else ""
    words = name.replace("_", " ")
    axes.set(xlabel=label, ylabel=f"{law.symbols[index]}{unit}")
    axes.set_title(f"{words}: {final:.4g} ± {last:.2g} (band ±2 s.e.)", fontsize=9)


def draw_condition(axes: "Axes", result: Identification, theme: Theme) -> None:
    """The speed beside what condition 10 allows by the estimates of the moment."""
    contact, trace = result.contact, result.trace
    time, label = _clock(contact)
    keep = _shown(contact)
    speed = np.where(trace.taken, np.abs(contact.velocity), np.nan)
    stiffness, damping = trace.parameters[:, 0], np.abs(trace.parameters[:, 1])
    limit = 0.1 * np.divide(
        np.abs(stiffness), damping, out=np.full_like(damping, np.nan), where=damping > 0.0
    )
    limit = np.where(trace.taken, limit, np.nan)
    axes.plot(time[keep], _broken(speed, contact, keep), color=theme.measured, label="|v|")
    axes.plot(
        time[keep], _broken(limit, contact, keep), color=theme.lines[1], label="0.1 K/B (estimated)"
    )
    largest = _largest(speed)
    settled = float(np.nanmedian(limit)) if np.isfinite(limit).any() else largest
    axes.set_ylim(0.0, 1.3 * max(largest, min(settled, 5.0 * largest), 1e-300))
    axes.set(xlabel=label, ylabel="speed [m/s]")
    axes.set_title(
        f"Condition 10, |v| < 0.1 K/B: broken in {result.violated_fraction:.1%} of the contact"
    )
    axes.legend(loc="upper right", ncols=2)
