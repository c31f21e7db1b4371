"""Figures of an identification: the only module that draws.

Needs the extra ``figures`` (matplotlib).
"""

import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.errors import InvalidParameterError, MissingExtraError, RecordingError
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# More points than this on a line make a heavy file that looks the same.
MOST_POINTS = 4000


@dataclass(frozen=True, slots=True)
class _Theme:
    """Colours of Okabe & Ito, told apart by colour-blind readers too, for one background."""

    background: str
    ink: str
    grid: str
    measured: str
    lines: tuple[str, ...]


_LIGHT = _Theme(
    "#ffffff", "#1a1a1a", "#dddddd", "#8c8c8c", ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
)
_DARK = _Theme(
    "#16181c", "#e8e8e8", "#3a3d44", "#9a9a9a", ("#56b4e9", "#e69f00", "#2fc99a", "#e39ac3")
)


def draw(identification: Identification, *, dark: bool = False) -> "Figure":
    """Draw what was identified: force, loop, parameters with error bands, and condition 10.

    Parameters
    ----------
    identification : Identification
        As :func:`palpate.identify` returns it.
    dark : bool
        For a dark background.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    theme = _DARK if dark else _LIGHT
    law = identification.law
    names = list(law.as_dict())
    with _style(theme) as new_figure:
        figure = new_figure(figsize=(11.0, 8.5), layout="constrained")
        rows = figure.add_gridspec(3, 6, height_ratios=(1.25, 1.0, 0.8))
        _draw_force(figure.add_subplot(rows[0, :4]), [identification], theme)
        _draw_loop(figure.add_subplot(rows[0, 4:]), [identification], theme)
        span = 6 // len(names)
        for i, name in enumerate(names):
            axes = figure.add_subplot(rows[1, i * span : (i + 1) * span])
            _draw_parameter(axes, identification, i, name, theme)
        bottom = figure.add_subplot(rows[2, :])
        if isinstance(law, HuntCrossley):
            _draw_condition(bottom, identification, theme)
        else:
            _draw_error(bottom, [identification], theme)
        figure.suptitle(_title(identification), fontsize=11)
    return figure


def draw_comparison(results: Mapping[str, Identification], *, dark: bool = False) -> "Figure":
    """Draw several identifications of one contact: force, prediction error and loop.

    Parameters
    ----------
    results : mapping
        As :func:`palpate.compare` returns it.
    dark : bool
        For a dark background.

    Raises
    ------
    InvalidParameterError
        There is nothing to draw.
    MissingExtraError
        matplotlib is not installed.
    """
    if not results:
        raise InvalidParameterError("results must hold at least one identification, not none")
    theme = _DARK if dark else _LIGHT
    shown = list(results.values())
    with _style(theme) as new_figure:
        figure = new_figure(figsize=(11.0, 7.0), layout="constrained")
        rows = figure.add_gridspec(2, 3)
        _draw_force(figure.add_subplot(rows[0, :2]), shown, theme)
        _draw_error(figure.add_subplot(rows[1, :2]), shown, theme)
        _draw_loop(figure.add_subplot(rows[:, 2]), shown, theme)
        figure.suptitle(Path(shown[0].contact.source).name or "comparison", fontsize=11)
    return figure


def save(figure: "Figure", path: str | Path) -> None:
    """Write a figure whole or not at all; the ending of ``path`` chooses the format.

    Raises
    ------
    RecordingError
        The path cannot be written, or no format has its ending.
    """
    path = Path(path)
    if not path.suffix:
        raise RecordingError(f"{path}: a figure's name must end in .svg, .pdf or .png")
    try:
        with tempfile.NamedTemporaryFile(
            dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix, delete=False
        ) as part:
            temporary = Path(part.name)
        try:
            _write(figure, temporary)
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}; choose a folder that exists") from None
    except ValueError:
        raise RecordingError(f"{path}: cannot draw {path.suffix}; use .svg, .pdf or .png") from None


def _write(figure: "Figure", path: Path) -> None:
    import matplotlib

    # Without a date or random names, the same result gives the same file.
    undated = {"Date": None} if path.suffix == ".svg" else None
    with matplotlib.rc_context({"svg.hashsalt": "palpate"}):
        figure.savefig(path, facecolor=figure.get_facecolor(), metadata=undated)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


class _style:  # noqa: N801 - reads as a statement
    """Matplotlib's settings for one figure, put back afterwards."""

    def __init__(self, theme: _Theme) -> None:
        try:
            import matplotlib
            from matplotlib.figure import Figure
        except ImportError:
            raise MissingExtraError(
                "figures need matplotlib: pip install 'palpate[figures]'"
            ) from None
        self._new_figure = Figure
        self._context = matplotlib.rc_context(
            {
                "figure.facecolor": theme.background,
                "axes.facecolor": theme.background,
                "axes.edgecolor": theme.ink,
                "axes.labelcolor": theme.ink,
                "text.color": theme.ink,
                "xtick.color": theme.ink,
                "ytick.color": theme.ink,
                "grid.color": theme.grid,
                "axes.grid": True,
                "axes.spines.top": False,
                "axes.spines.right": False,
                "axes.axisbelow": True,
                "axes.titlesize": 10,
                "axes.formatter.useoffset": False,
                "axes.formatter.limits": (-3, 4),
                "legend.frameon": False,
                "legend.fontsize": 9,
                "lines.linewidth": 1.3,
                "font.size": 9.5,
            }
        )

    def __enter__(self) -> type["Figure"]:
        self._context.__enter__()
        return self._new_figure

    def __exit__(self, *error: Any) -> None:
        self._context.__exit__(*error)


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


def _draw_force(axes: "Axes", shown: list[Identification], theme: _Theme) -> None:
    contact = shown[0].contact
    time, label = _clock(contact)
    keep = _shown(contact)
    measured = _broken(contact.force, contact, keep)
    axes.plot(time[keep], measured, color=theme.measured, linewidth=2.4, label="measured")
    for result, colour in zip(shown, theme.lines, strict=False):
        inside = np.where(result.trace.taken, result.trace.predicted_force, np.nan)
        predicted = _broken(inside, contact, keep)
        axes.plot(time[keep], predicted, color=colour, linewidth=1.0, label=_label(result, shown))
    known = contact.force[np.isfinite(contact.force)]
    low, high = float(known.min()), float(known.max())
    span = (high - low) or abs(high)
    axes.set_ylim(low - 0.1 * span, high + 0.25 * span)
    axes.set(xlabel=label, ylabel="force [N]", title="Force, and what was predicted of it")
    axes.legend(loc="upper right", ncols=min(3, 1 + len(shown)))


def _label(result: Identification, shown: list[Identification]) -> str:
    return result.method if len(shown) > 1 else "predicted (a priori)"


def _draw_error(axes: "Axes", shown: list[Identification], theme: _Theme) -> None:
    contact = shown[0].contact
    time, label = _clock(contact)
    keep = _shown(contact)
    largest = _largest(np.abs(contact.force))
    for result, colour in zip(shown, theme.lines, strict=False):
        error = np.where(result.trace.taken, contact.force - result.trace.predicted_force, np.nan)
        rmse = result.prediction_rmse_percent
        text = f"{_label(result, shown)}: {rmse:.2g} %" if np.isfinite(rmse) else result.method
        axes.plot(
            time[keep], _broken(error, contact, keep), color=colour, linewidth=0.9, label=text
        )
    # The first error of each start is as large as the force; the scale shows what comes after.
    errors = [np.abs(r.contact.force - r.trace.predicted_force)[r.trace.taken] for r in shown]
    limit = min(1.3 * max(float(np.nanpercentile(e, 99.0)) for e in errors if e.size), largest)
    limit = max(limit, 1e-12 * largest)
    axes.set_ylim(-limit, limit)
    axes.set(
        xlabel=label, ylabel="error [N]", title="Prediction error (a priori), RMSE% after 0.2 s"
    )
    axes.legend(loc="upper right", ncols=2)


def _draw_loop(axes: "Axes", shown: list[Identification], theme: _Theme) -> None:
    contact = shown[0].contact
    keep = _shown(contact)
    prefix, factor = _length_unit(_largest(contact.penetration))
    depth = contact.penetration * factor
    axes.plot(
        depth[keep],
        _broken(contact.force, contact, keep),
        color=theme.measured,
        linewidth=2.0,
        label="measured",
    )
    for result, colour in zip(shown, theme.lines, strict=False):
        fitted = result.law.force(contact.penetration, contact.velocity)
        inside = np.where(result.trace.taken, fitted, np.nan)
        label = result.method if len(shown) > 1 else "final law"
        axes.plot(
            depth[keep], _broken(inside, contact, keep), color=colour, linewidth=0.9, label=label
        )
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


def _draw_parameter(
    axes: "Axes", result: Identification, index: int, name: str, theme: _Theme
) -> None:
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
    last = float(result.estimate.standard_errors[index])
    spread = max(float(np.ptp(settled)), 4.0 * last, 0.1 * abs(final), 1e-300)
    middle = 0.5 * float(settled.max() + settled.min())
    axes.set_ylim(middle - spread, middle + spread)
    unit = f" [{law.units[index]}]" if law.units[index] else ""
    words = name.replace("_", " ")
    axes.set(xlabel=label, ylabel=f"{law.symbols[index]}{unit}")
    axes.set_title(f"{words}: {final:.4g} ± {last:.2g} (band ±2 s.e.)", fontsize=9)


def _draw_condition(axes: "Axes", result: Identification, theme: _Theme) -> None:
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


def _title(result: Identification) -> str:
    name = Path(result.contact.source).name
    fit = f"{result.method}, final law fits to {result.fit_rmse_percent:.2g} %"
    return f"{name}: {fit}" if name else fit
