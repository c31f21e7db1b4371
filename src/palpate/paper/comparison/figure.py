"""The figure of a comparison: parameters and force error of every start, method by method."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from palpate.estimators import RecursiveLeastSquaresEstimator, VariableProjection
from palpate.estimators.contact_estimator import ContactEstimator
from palpate.figures.style import Theme, style
from palpate.force_laws import HuntCrossley
from palpate.paper.curves import draw_lines, theme_of
from palpate.paper.experiment import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES = {
    "single-stage": "HC, single stage",
    "double-stage": "HC, double stage",
    "kelvin-voigt": "Kelvin–Voigt",
    "extended-kelvin-voigt": "extended Kelvin–Voigt",
    "variable-projection": "HC, variable projection\n(error bars below ⅓)",
}
# Share of the final value from which, and up to which, a stiffness is drawn.
BELOW, ABOVE = 1e-3, 1e3
# Errors below this are drawn on a linear scale, N.
FINE = 0.25


def draw_comparison(
    title: str,
    kinds: Sequence[type[RecursiveLeastSquaresEstimator]],
    outcomes: Sequence[Outcome],
    *,
    dark: bool,
) -> "Figure":
    """Draw the first outcome, a column for each method; the titles give the RMSE% of all seeds."""
    theme = theme_of(dark)
    methods: list[type[ContactEstimator]] = [*kinds, VariableProjection]
    with style(theme) as new_figure:
        figure = new_figure(figsize=(2.6 * len(methods) + 1.0, 9.0), layout="constrained")
        grid = figure.subplots(4, len(methods), sharex=True, squeeze=False)
        for column, kind in enumerate(methods):
            _draw_method(grid[:, column], kind, outcomes, theme)
        for axes in grid[3]:
            axes.set(xlabel="time since contact [s]")
        figure.suptitle(title, fontsize=11)
    return figure


def _draw_method(
    column: Any, kind: type[ContactEstimator], outcomes: Sequence[Outcome], theme: Theme
) -> None:
    curves, numbers = outcomes[0].curves, outcomes[0].numbers["methods"][kind.method]
    starts, time = list(numbers["rmse"]), curves["elapsed"]
    symbols, units = kind.law_type.symbols, kind.law_type.units
    for axes, i in zip(column, _rows(kind), strict=False):
        if i is None:
            axes.set_axis_off()
            continue
        lines = [(start, curves[f"{kind.method}/{start}/{symbols[i]}"]) for start in starts]
        draw_lines(axes, time, lines, theme)
        _set_scale(axes, _settled(outcomes[0], kind)[i], symbols[i])
        unit = f" [{units[i]}]" if units[i] else ""
        axes.set(ylabel=f"{symbols[i]}{unit}")
    error = column[3]
    draw_lines(
        error,
        time,
        [(start, curves[f"{kind.method}/{start}/error"]) for start in starts],
        theme,
        width=0.8,
    )
    error.set_yscale("symlog", linthresh=FINE)
    error.set(xscale="log", ylabel="force error [N]", ylim=(-30.0, 30.0))
    error.set_yticks([-10.0, -1.0, 0.0, 1.0, 10.0], ["−10", "−1", "0", "1", "10"])
    column[0].set_title(f"{TITLES[kind.method]}\n{_rmse(kind.method, outcomes)}")
    column[0].legend(loc="upper right", ncols=3, handlelength=1.6, columnspacing=0.9)


def _rows(kind: type[ContactEstimator]) -> tuple[int | None, ...]:
    """Which parameter is in which row."""
    if kind.law_type is HuntCrossley:
        return (0, 1, 2)
    return (0, 1, None) if len(kind.law_type.symbols) == 2 else (0, 2, 1)


def _settled(outcome: Outcome, kind: type[ContactEstimator]) -> Sequence[float]:
    """What the axes are about: for every Hunt–Crossley method the same, so that they compare."""
    method = "single-stage" if kind.law_type is HuntCrossley else kind.method
    final: Sequence[float] = next(iter(outcome.numbers["methods"][method]["final"].values()))
    return final


def _set_scale(axes: "Axes", final: float, symbol: str) -> None:
    if symbol == "n":
        axes.set_ylim(0.0, 3.0)
    elif symbol == "B":
        axes.set_ylim(-0.5 * final, 2.5 * final)
    elif symbol == "K₁":
        axes.set_ylim(-1500.0, 1500.0)
    else:
        axes.set(yscale="log", ylim=(BELOW * final, ABOVE * final))


def _rmse(method: str, outcomes: Sequence[Outcome]) -> str:
    every = [
        value
        for outcome in outcomes
        for value in outcome.numbers["methods"][method]["rmse"].values()
    ]
    low, high = min(every), max(every)
    return f"RMSE {low:.2g} %" if f"{low:.2g}" == f"{high:.2g}" else f"RMSE {low:.2g}–{high:.2g} %"
