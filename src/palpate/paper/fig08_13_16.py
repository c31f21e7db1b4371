"""The methods side by side on the same data: Figs. 8, 13 and 16 with Tables I to VI."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.estimators import (
    ContactEstimator,
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    RecursiveLeastSquaresEstimator,
    SingleStageRLS,
    VariableProjection,
)
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import MATERIALS, Homogeneous
from palpate.paper.causes import SAME_COVARIANCES, logarithm, sampled, threshold
from palpate.paper.experiment import (
    Curves,
    Experiment,
    Outcome,
    Say,
    Table,
    by_parameter,
    by_symbol,
)
from palpate.paper.panels import Axes, Figure, draw_course, draw_lines, traced
from palpate.paper.quantities import Numbers, named
from palpate.paper.sessions import identified, pressed, session
from palpate.paper.starts import (
    convergence_times,
    from_starts,
    names_of_starts,
    spread,
    starts_of,
    times_to,
)

Recursive = type[RecursiveLeastSquaresEstimator]

#: When "the first few milliseconds" end, s.
FIRST_FEW = 20e-3
NO_START = "no start"
TITLES = {
    "single-stage": "HC, single stage",
    "double-stage": "HC, double stage",
    "kelvin-voigt": "Kelvin–Voigt",
    "extended-kelvin-voigt": "extended Kelvin–Voigt",
    "variable-projection": "HC, variable projection",
}
# Share of the final value from which, and up to which, a stiffness is drawn.
BELOW, ABOVE = 1e-3, 1e3
# Errors below this are drawn on a linear scale, N.
FINE = 0.25
OVER = "Median over the seeds, range in brackets."


@dataclass(frozen=True)
class Comparison(Experiment):
    """Every method, from every start of the paper's rule, on one recording of one material.

    Parameters
    ----------
    material : str
        Of the laboratory.
    kinds : tuple of type
        The paper's methods for it.
    numerals : tuple of str
        Of the paper's tables of starts and of errors.
    beside : str, optional
        A second material, on which the claims are looked at too.
    """

    material: str
    kinds: tuple[Recursive, ...]
    numerals: tuple[str, str]
    beside: str = ""
    caption = (
        "A column for each method: its parameters and its force error over the time since "
        "contact, from every start of the tables."
    )

    @property
    def methods(self) -> tuple[type[ContactEstimator], ...]:
        """The paper's, and ours."""
        return (*self.kinds, VariableProjection)

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Press once and identify by every method from every start."""
        numbers, curves = self._measured(self.material, seed)
        if self.beside:
            prefix = self.beside.replace("-", " ")
            second = self._measured(self.beside, seed)[0]
            numbers |= {f"{prefix} {name}": value for name, value in second.items()}
        if self.material == "ball":
            numbers |= logarithm(pressed("ball", "three-sines", seed)) | threshold()
            numbers |= sampled(session("ball", "three-sines", seed).contact)
        return numbers, curves

    def _measured(self, material: str, seed: int) -> tuple[dict[str, float], Curves]:
        contact = pressed(material, "three-sines", seed)
        numbers: dict[str, float] = {}
        curves: Curves = {}
        errors: dict[tuple[float, Recursive], list[float]] = {}
        for kind in self.kinds:
            starts = starts_of(contact, kind)
            results = from_starts(contact, kind, starts)
            symbols = kind.law_type.symbols
            for name, law in starts.items():
                numbers |= by_parameter(f"start {kind.method} {name}", law, law.parameters)
            numbers |= _summary(kind, results, material)
            times = {"": list(results.values())}
            for size in SAME_COVARIANCES:
                others = from_starts(contact, kind, starts, initial_covariance=size)
                times[f"P₀ = {size:g} "] = list(others.values())
                errors[size, kind] = [each.prediction_rmse_percent for each in others.values()]
            for which, every in times.items():
                what, apart = f"{which}{kind.method}", 100.0 * spread(every)[-1]
                numbers |= by_symbol(f"time {what}", convergence_times(every), "s", symbols)
                numbers |= by_symbol(f"spread {what}", apart, "%", symbols)
            curves |= _curves(kind.method, results)
        for size in SAME_COVARIANCES:
            pairs = zip(errors[size, DoubleStageRLS], errors[size, SingleStageRLS], strict=True)
            least = min(double / single for double, single in pairs)
            numbers[f"least double over single P₀ = {size:g} [×]"] = least
        projected = {NO_START: identified(contact, VariableProjection())}
        numbers |= _summary(VariableProjection, projected, material)
        return numbers, curves | _curves(VariableProjection.method, projected)

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome, a column for each method; the titles give the RMSE% of all."""
        grid = figure.subplots(4, len(self.methods), sharex=True, squeeze=False)
        for column, kind in zip(grid.T, self.methods, strict=True):
            _draw_method(column, kind, outcomes)
        for axes in grid[3]:
            axes.set(xlabel="time since contact [s]")

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Return starts, RMSE% and convergence times."""
        starts, errors = self.numerals
        title = f"Table {starts}: initial values, {self.material}"
        rows = tuple(
            (kind.method, start, _said(say, kind, f"start {kind.method} {start}"))
            for kind in self.kinds
            for start in _names(kind)
        )
        tables = [
            Table(title, ("method", "start", "initial values, SI"), rows, OVER),
            self._errors(say, f"Table {errors}: RMSE%, {self.material}"),
            self._times(say, f"Convergence, {self.material}"),
        ]
        if self.beside:
            prefix = self.beside.replace("-", " ") + " "
            tables.append(self._errors(say, f"RMSE%, {self.beside}", prefix))
            tables.append(self._times(say, f"Convergence, {self.beside}", prefix))
        return tuple(tables)

    def _errors(self, say: Say, title: str, prefix: str = "") -> Table:
        rows = tuple(
            (
                kind.method,
                start,
                say(f"{prefix}rmse {kind.method} {start}"),
                _said(say, kind, f"{prefix}final {kind.method} {start}"),
            )
            for kind in self.methods
            for start in _names(kind)
        )
        note = f"A-priori force error after 0.2 s of contact, 100 √(Σe²/ΣF²). {OVER}"
        return Table(title, ("method", "start", "RMSE%", "final values, SI"), rows, note)

    def _times(self, say: Say, title: str, prefix: str = "") -> Table:
        columns = {
            "time [s]": f"{prefix}time {{}} {{}}",
            "starts apart at the end [%]": f"{prefix}spread {{}} {{}}",
            "own end [s]": f"{prefix}settled {{}} {{}}",
        }
        for size in SAME_COVARIANCES:
            columns[f"P₀ = {size:g}: time [s]"] = f"{prefix}time P₀ = {size:g} {{}} {{}}"
        rows = [(kind.method, symbol) for kind in self.kinds for symbol in kind.law_type.symbols]
        note = (
            "Seconds of contact until the estimates from all starts agree within 5 % and stay so; "
            "own end: until each is within 5 % of its own final value. "
            "First with each method's default P₀ (1e3 single stage, 1e8 Kelvin–Voigt and double "
            "stage, 1e10 extended Kelvin–Voigt, in SI), then with the same P₀ for all, by which "
            "the claims are judged. " + OVER
        )
        return Table.of(say, title, ("method", "parameter"), columns, rows, note)


def _names(kind: type[ContactEstimator]) -> tuple[str, ...]:
    """Of a method's starts."""
    recursive = issubclass(kind, RecursiveLeastSquaresEstimator)
    return names_of_starts(kind) if recursive else (NO_START,)


def _said(say: Say, kind: type[ContactEstimator], what: str) -> str:
    return ", ".join(f"{symbol} = {say(f'{what} {symbol}')}" for symbol in kind.law_type.symbols)


def _summary(
    kind: type[ContactEstimator], results: Mapping[str, Identification], material: str
) -> dict[str, float]:
    symbols, numbers = kind.law_type.symbols, {}
    few = round(FIRST_FEW / next(iter(results.values())).contact.sample_time)
    known = MATERIALS[material]
    for start, result in results.items():
        what, final = f"{kind.method} {start}", result.law.parameters
        numbers[f"rmse {what} [%]"] = result.prediction_rmse_percent
        numbers |= by_parameter(f"final {what}", result.law, final)
        least = result.trace.parameters[result.trace.taken][:few].min(axis=0)
        numbers |= by_symbol(f"first over final {what}", least / final, "", symbols)
        if isinstance(known, Homogeneous) and kind.law_type is type(known.law):
            error = 100.0 * np.abs(final / known.law.parameters - 1.0)
            numbers |= by_symbol(f"off the truth {what}", error, "%", symbols)
    # Starts that a large P₀ has forgotten agree long before they are right.
    settled = np.max([times_to(each, each.law.parameters) for each in results.values()], axis=0)
    return numbers | by_symbol(f"settled {kind.method}", settled, "s", symbols)


def _curves(method: str, results: Mapping[str, Identification]) -> Curves:
    traces = [traced(f"{method}/{name}", result) for name, result in results.items()]
    return {name: curve for each in traces for name, curve in each.items()}


def _draw_method(column: Any, kind: type[ContactEstimator], outcomes: Sequence[Outcome]) -> None:
    curves, time = outcomes[0].curves, outcomes[0].curves["elapsed"]
    law, shown = kind.law_type, {name: f"{kind.method}/{name}" for name in _names(kind)}
    # For every Hunt–Crossley method the same axes, so that they compare.
    about = SingleStageRLS if law is HuntCrossley else kind
    finals = named(f"final {about.method} {_names(about)[0]}", outcomes[0].numbers)
    for axes, i in zip(column, _rows(kind), strict=False):
        if i is None:
            axes.set_axis_off()
            continue
        symbol = law.symbols[i]
        draw_course(axes, curves, symbol, shown, unit=law.units[i])
        _set_scale(axes, list(finals.values())[i], symbol)
    error = column[3]
    lines = {name: curves[f"{prefix}/error"] for name, prefix in shown.items()}
    draw_lines(error, time, lines, linewidth=0.8)
    error.set_yscale("symlog", linthresh=FINE)
    error.set(xscale="log", ylabel="force error [N]", ylim=(-30.0, 30.0))
    error.set_yticks([-10.0, -1.0, 0.0, 1.0, 10.0], ["−10", "−1", "0", "1", "10"])
    rmse = [v for o in outcomes for v in named(f"rmse {kind.method}", o.numbers).values()]
    low, high = f"{min(rmse):.2g}", f"{max(rmse):.2g}"
    span = low if low == high else f"{low}–{high}"
    column[0].set_title(f"{TITLES[kind.method]}\nRMSE {span} %")
    column[0].legend(loc="upper right", ncols=3, handlelength=1.6, columnspacing=0.9)


def _rows(kind: type[ContactEstimator]) -> tuple[int | None, ...]:
    """Which parameter is in which row."""
    if kind.law_type is HuntCrossley:
        return (0, 1, 2)
    return (0, 1, None) if len(kind.law_type.symbols) == 2 else (0, 2, 1)


def _set_scale(axes: Axes, final: float, symbol: str) -> None:
    if symbol == "n":
        axes.set_ylim(0.0, 3.0)
    elif symbol == "B":
        axes.set_ylim(-0.5 * final, 2.5 * final)
    elif symbol == "K₁":
        axes.set_ylim(-1500.0, 1500.0)
    else:
        axes.set(yscale="log", ylim=(BELOW * final, ABOVE * final))


EXPERIMENTS = (
    Comparison(
        "fig08",
        "Rubber ball: three starts, four methods, one recording (Tables I and II)",
        "ball",
        (SingleStageRLS, DoubleStageRLS, KelvinVoigtRLS),
        ("I", "II"),
        size=(11.4, 9.0),
    ),
    Comparison(
        "fig13",
        "Sponge: three starts, four methods, one recording (Tables III and IV)",
        "sponge",
        (SingleStageRLS, DoubleStageRLS, KelvinVoigtRLS),
        ("III", "IV"),
        beside="relaxing-sponge",
        size=(11.4, 9.0),
    ),
    Comparison(
        "fig16",
        "PVC phantom: three starts, five methods, one recording (Tables V and VI)",
        "pvc",
        (SingleStageRLS, DoubleStageRLS, KelvinVoigtRLS, ExtendedKelvinVoigtRLS),
        ("V", "VI"),
        size=(14.0, 9.0),
    ),
)
