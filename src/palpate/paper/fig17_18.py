"""Figs. 17 and 18: how rich a motion has to be, for Hunt–Crossley and for Kelvin–Voigt."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import KelvinVoigtRLS, SingleStageRLS, VariableProjection
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import BALL, ONE_SINE, Bench, IdealProbe
from palpate.paper.causes import SAME_COVARIANCES, condition_number
from palpate.paper.experiment import Curves, Experiment, Outcome, Say, Table, by_symbol
from palpate.paper.panels import Axes, Figure, draw_course, draw_lines, draw_truth, traced
from palpate.paper.quantities import Numbers, named
from palpate.paper.sessions import START, identified, pressed
from palpate.paper.starts import (
    Starts,
    convergence_times,
    from_starts,
    names_of_starts,
    starts_of,
    times_to,
)

SECONDS = 22.0
#: How long the ideal probe goes on, s.
LONG = 452.0
MOTIONS = {"two sines": "two-sines", "one sine": "one-sine"}
COVARIANCES = (1.0, 10.0, 1e2, 1e3, 1e4, 1e6)
LONG_COVARIANCES = (0.1, 1.0, 10.0)
LONG_MOTION = "one sine, 450 s"
PROJECTION = "none: variable projection"

Kind = type[SingleStageRLS] | type[KelvinVoigtRLS]


@dataclass(frozen=True)
class Richness(Experiment):
    """One method on the ball, pressed with two sines and with one, from the starts of Table I.

    Parameters
    ----------
    kind : type
        The method.
    """

    kind: Kind
    caption = (
        "Parameters and force error over the time since contact, from every start, for two sines "
        "and for one; beside them the convergence times of every seed over the initial covariance."
    )

    @property
    def symbols(self) -> tuple[str, ...]:
        """Of the parameters."""
        return self.kind.law_type.symbols

    @property
    def starts(self) -> tuple[str, ...]:
        """What the starts are called."""
        return names_of_starts(self.kind)

    @property
    def norms(self) -> Mapping[str, tuple[float, ...]]:
        """Initial covariances by motion."""
        long = {LONG_MOTION: LONG_COVARIANCES} if self.kind is SingleStageRLS else {}
        return dict.fromkeys(MOTIONS, COVARIANCES) | long

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Press with two sines and one; the starts are those of the three sines."""
        three = pressed("ball", "three-sines", seed)
        starts = starts_of(three, self.kind)
        reference = from_starts(three, self.kind, starts)
        numbers = self._summary("three sines", reference)
        curves: Curves = {}
        for name, trajectory in MOTIONS.items():
            contact = pressed("ball", trajectory, seed, SECONDS)
            results = from_starts(contact, self.kind, starts)
            numbers |= self._summary(name, results)
            numbers |= self._by_covariance(name, contact, starts)
            numbers |= _conditioning(name, contact)
            numbers[f"largest difference from three sines, {name} [%]"] = max(
                100.0 * float(np.max(np.abs(result.law.parameters / other.law.parameters - 1.0)))
                for result, other in zip(results.values(), reference.values(), strict=True)
            )
            if self.kind is KelvinVoigtRLS and name == "one sine":
                numbers |= _single_stage(name, contact, starts_of(three, SingleStageRLS))
            projected = identified(contact, VariableProjection())
            for start, result in {**results, "projection": projected}.items():
                curves |= traced(f"{name}/{start}", result, f"{name}/elapsed")
            times = times_to(projected, BALL.law.parameters)
            numbers |= by_symbol(f"time of variable projection {name}", times, "s")
            numbers |= _ends(f"{name} variable projection", projected)
        if LONG_MOTION in self.norms:
            run = Bench(BALL, ONE_SINE, IdealProbe()).run(seed, seconds=LONG)
            numbers |= self._by_covariance(LONG_MOTION, run.contact.window(START), starts)
        return numbers, curves

    def _summary(self, motion: str, results: Mapping[str, Identification]) -> dict[str, float]:
        times = convergence_times(list(results.values()))
        numbers = by_symbol(f"time {motion}", times, "s", self.symbols)
        for start, result in results.items():
            numbers |= _ends(f"{motion} {start}", result)
        return numbers

    def _by_covariance(self, motion: str, contact: Contact, starts: Starts) -> dict[str, float]:
        numbers: dict[str, float] = {}
        for size in self.norms[motion]:
            results = from_starts(contact, self.kind, starts, initial_covariance=size)
            times = convergence_times(list(results.values()))
            numbers |= by_symbol(f"time P₀ = {size:g} {motion}", times, "s", self.symbols)
        return numbers

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome; beside it the convergence times of every seed over P₀."""
        rows = len(self.symbols)
        grid = figure.subplots(rows + 1, 3)
        for column, motion in zip(grid.T, MOTIONS, strict=False):
            self._draw_motion(column, motion, outcomes[0])
        for symbol, axes in zip(self.symbols, grid[:rows, 2], strict=True):
            self._draw_times(axes, symbol, outcomes)
        grid[0, 2].set_title("Every seed, over P₀")
        grid[0, 2].legend(loc="upper right")
        grid[rows - 1, 2].set(xlabel="P₀")
        grid[rows, 2].set_axis_off()
        shown = grid[rows, 0].get_legend_handles_labels()
        grid[rows, 2].legend(*shown, loc="center left", title="start")

    def _draw_motion(self, column: Any, motion: str, outcome: Outcome) -> None:
        """Parameters and force error of every start; the value from three sines dotted."""
        curves, law = outcome.curves, self.kind.law_type
        clock = f"{motion}/elapsed"
        starts = {start: f"{motion}/{start}" for start in self.starts}
        every = {**starts, PROJECTION: f"{motion}/projection"}
        # Its stiffness and damping are another law's than Kelvin–Voigt's.
        shown = every if law is HuntCrossley else starts
        finals = named(f"final three sines {self.starts[0]}", outcome.numbers).values()
        for axes, symbol, unit, final in zip(column, law.symbols, law.units, finals, strict=False):
            draw_course(axes, curves, symbol, shown, clock=clock, unit=unit, xscale="log")
            axes.set(ylim=(-0.5 * final, 3.0 * final))
            draw_truth(axes, final, None)
        column[0].set_title(f"{motion} (dotted: three)")
        lines = {label: curves[f"{prefix}/error"] for label, prefix in every.items()}
        draw_lines(column[-1], curves[clock], lines, linewidth=0.8)
        column[-1].set(xscale="log", ylim=(-1.0, 1.0), ylabel="force error [N]")
        column[-1].set(xlabel="time since contact [s]")

    def _draw_times(self, axes: Axes, symbol: str, outcomes: Sequence[Outcome]) -> None:
        for j, outcome in enumerate(outcomes):
            for i, (motion, sizes) in enumerate(self.norms.items()):
                names = (f"time P₀ = {size:g} {motion} {symbol} [s]" for size in sizes)
                line = [outcome.numbers[name] for name in names]
                label = motion if j == 0 else None
                draw_lines(axes, sizes, [(label, line)], first=i, linewidth=1.0)
        axes.set(xscale="log", yscale="log", ylabel=f"{symbol}: convergence [s]")

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Return convergence times by motion and initial covariance."""
        rows = {(motion, "default"): (motion, "") for motion in ("three sines", *MOTIONS)}
        for motion, sizes in self.norms.items():
            rows |= {(motion, f"{size:g}"): (motion, f"P₀ = {size:g} ") for size in sizes}
        columns = {f"{symbol} [s]": f"time {{1}}{{0}} {symbol}" for symbol in self.symbols}
        note = (
            f"Seconds of contact until all starts agree within 5 %, of {SECONDS - START:g} s on "
            "the rig; 450 s are an ideal probe's with the same sensors."
        )
        title = f"Convergence by motion, {self.kind.method}"
        return (Table.of(say, title, ("motion", "P₀"), columns, rows, note),)


def _single_stage(motion: str, contact: Contact, starts: Starts) -> dict[str, float]:
    """Times of the other model on the same data, with the same P₀."""
    numbers: dict[str, float] = {}
    for size in SAME_COVARIANCES:
        results = from_starts(contact, SingleStageRLS, starts, initial_covariance=size)
        times = convergence_times(list(results.values()))
        numbers |= by_symbol(f"time P₀ = {size:g} of single-stage {motion}", times, "s")
    return numbers


def _ends(what: str, result: Identification) -> dict[str, float]:
    finals = by_symbol(f"final {what}", result.law.parameters, "", result.law.symbols)
    return {**finals, f"rmse {what} [%]": result.prediction_rmse_percent}


def _conditioning(motion: str, contact: Contact) -> dict[str, float]:
    """Condition numbers of columns of unit length: of the logarithm's, and of linear systems."""
    known = contact.window(START + 1.0)
    x, v = known.penetration, known.velocity
    one = np.ones_like(x)
    acceleration = np.gradient(v, known.time)
    systems = {
        "1, v, ln x": (one, v, np.log(x)),
        "1, v, x": (one, v, x),
        "x, v, a": (x, v, acceleration),
    }
    return {
        f"condition number of {name}, {motion}": condition_number(np.stack(columns))
        for name, columns in systems.items()
    }


EXPERIMENTS = (
    Richness(
        "fig17",
        "Rubber ball, Hunt–Crossley by the single stage: two sines and one",
        SingleStageRLS,
        size=(11.5, 9.2),
    ),
    Richness(
        "fig18",
        "Rubber ball, Kelvin–Voigt: two sines and one",
        KelvinVoigtRLS,
        size=(11.5, 7.0),
    ),
)
