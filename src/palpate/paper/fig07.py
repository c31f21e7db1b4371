"""Fig. 7: how the past is forgotten, and how large the first covariance is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.estimators import SingleStageRLS, VariableProjection
from palpate.figures.style import LIGHT as THEME
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import BALL, THREE_SINES, Bench, Command, IdealProbe, Trajectory
from palpate.paper.causes import varying
from palpate.paper.experiment import Curves, Experiment, Outcome, Say, Table, by_symbol
from palpate.paper.panels import DASHES, UNITS, Axes, Figure, draw_course, draw_lines, traced
from palpate.paper.quantities import Numbers, named
from palpate.paper.sessions import START, identified, pressed
from palpate.paper.starts import starts_of, times_to
from palpate.settings import ConstantForgetting, FadingForgetting, Forgetting
from palpate.validation import Floats

PROFILES: dict[str, Forgetting] = {
    "λ = 1": ConstantForgetting(1.0),
    **{f"α = {rate:g}": FadingForgetting(0.99, rate) for rate in (0.1, 1.0, 5.0, 6.0, 7.0, 8.0)},
    "α = 20": FadingForgetting(0.99, 20.0),
    **{f"λ = {factor:g}": ConstantForgetting(factor) for factor in (0.99, 0.95, 0.9)},
}
COVARIANCES = {f"P₀ = {size:g}": size for size in (1.0, 10.0, 20.0, 1e2, 1e3, 1e4, 1e6)}
HELD = ("α = 5", "α = 0.1", "λ = 0.99", "λ = 0.9")
HOLD_FROM, HELD_SECONDS = 8.0, 60.0
LAW: HuntCrossley = BALL.law  # type: ignore[assignment]  # the ball is one

# What is drawn, over which limits: later on all are within a few percent.
PROFILES_DRAWN = {
    name: name for name in ("λ = 1", "α = 0.1", "α = 5", "λ = 0.99", "variable projection")
}
COVARIANCES_DRAWN = {name: name for name in COVARIANCES if name not in ("P₀ = 20", "P₀ = 1000")}
CLOSE = {"K": (1800.0, 2200.0), "B": (1600.0, 2400.0), "n": (0.96, 1.04)}
WIDE = {"K": (1000.0, 3000.0), "B": (-1000.0, 5000.0), "n": (0.8, 1.2)}


@dataclass(frozen=True, slots=True)
class Held:
    """A trajectory that stops where its speed is next zero, and stays there.

    Parameters
    ----------
    trajectory : Trajectory
        What is followed until then.
    after : float
        s.
    """

    trajectory: Trajectory
    after: float

    @property
    def pause(self) -> float:
        """Time at rest before anything moves, s."""
        return self.trajectory.pause

    @property
    def stop(self) -> float:
        """When the probe stops, s."""
        time = self.after + 1e-4 * np.arange(20_000, dtype=np.float64)
        turns = np.flatnonzero(np.diff(np.sign(self.trajectory.at(time).velocity)))
        return float(time[turns[0]])

    def at(self, time: Floats) -> Command:
        """Return the command at times [s], shape (k,)."""
        stop = self.stop
        command = self.trajectory.at(np.minimum(time, stop))
        moving = time < stop
        return Command(
            command.penetration,
            np.where(moving, command.velocity, 0.0),
            command.lateral_position,
            np.where(moving, command.lateral_velocity, 0.0),
        )


@dataclass(frozen=True)
class ForgettingFactors(Experiment):
    """The single stage on the ball under several forgetting factors and initial covariances."""

    name: str = "fig07"
    title: str = "Rubber ball, single stage: forgetting factor and initial covariance"
    caption = (
        "Left: K, B and n over time for several forgetting factors. Right: the same for several "
        "initial covariances. Below: a probe held at one depth, and convergence and overshoot of "
        "every seed over the initial covariance."
    )
    size: tuple[float, float] = (10.5, 10.0)

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Identify one recording again and again, and a probe that is held."""
        contact = pressed("ball", "three-sines", seed)
        methods = {
            **{name: SingleStageRLS(forgetting=each) for name, each in PROFILES.items()},
            "variable projection": VariableProjection(),
            **{name: SingleStageRLS(initial_covariance=s) for name, s in COVARIANCES.items()},
            **{
                f"start {name}": SingleStageRLS(initial=law)
                for name, law in starts_of(contact, SingleStageRLS).items()
            },
        }
        numbers, curves = _held(seed)
        numbers |= varying(seed)
        numbers["λ after 1 s"] = 1.0 - 0.01 * math.exp(-5.0)
        for name, estimator in methods.items():
            result = identified(contact, estimator)
            numbers |= _summary(name, result)
            curves |= traced(name, result)
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw a column for forgetting, one for P₀; below, the held probe and every seed."""
        curves = outcomes[0].curves
        grid = figure.subplots(4, 2, height_ratios=(1.0, 1.0, 1.0, 0.9))
        for (left, right), (symbol, unit) in zip(grid, UNITS.items(), strict=False):
            limits: dict[str, Any] = {"unit": unit, "xlim": (0.0, 10.0), "ylim": CLOSE[symbol]}
            draw_course(left, curves, symbol, PROFILES_DRAWN, **limits)
            limits |= {"xscale": "log", "xlim": (1e-2, 10.0), "ylim": WIDE[symbol]}
            draw_course(right, curves, symbol, COVARIANCES_DRAWN, **limits)
        for axes, title in zip(
            grid[0], ("Forgetting factor, P₀ = 1e3", "Initial covariance, α = 5"), strict=True
        ):
            axes.set_title(title, pad=46)
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
        for axes in grid[2]:
            axes.set(xlabel="time since contact [s]")
        lines = {name: curves[f"held/{name}"] for name in HELD}
        draw_lines(grid[3, 0], curves["held/time"], lines, linewidth=1.0)
        grid[3, 0].set(yscale="log", xlabel="time since the probe stopped [s]")
        grid[3, 0].set(ylabel="worst parameter's error [%]", title="Probe held at one depth")
        grid[3, 0].legend(loc="upper right", ncols=2)
        _draw_seeds(grid[3, 1], outcomes)

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Return times and fluctuations by forgetting factor, and by initial covariance."""
        columns = {f"{symbol} [s]": f"time {{}} {symbol}" for symbol in UNITS} | {
            "late scatter of B [%]": "scatter {} B",
            "overshoot of B": "overshoot {} B",
            "RMSE%": "rmse {}",
        }
        note = (
            "Seconds of contact until each parameter is within 5 % of the truth for good; scatter: "
            "standard deviation over the second half; overshoot: largest excursion beyond start "
            "and truth, in units of the truth."
        )
        shown = {
            "Forgetting factor": (*PROFILES, "variable projection"),
            "Initial covariance, α = 5": tuple(COVARIANCES),
        }
        return tuple(
            Table.of(say, title, ("",), columns, [(name,) for name in names], note)
            for title, names in shown.items()
        )


def _summary(name: str, result: Identification) -> dict[str, float]:
    known = result.trace.parameters[result.trace.taken]
    truth = LAW.parameters
    start = result.estimator.settings.get("initial", LAW).parameters
    low, high = np.minimum(start, truth), np.maximum(start, truth)
    beyond = np.maximum(known.max(axis=0) - high, low - known.min(axis=0)).clip(min=0.0)
    late = known[len(known) // 2 :] / truth - 1.0
    return {
        **by_symbol(f"time {name}", times_to(result, truth), "s"),
        **by_symbol(f"scatter {name}", 100.0 * late.std(axis=0), "%"),
        **by_symbol(f"largest error {name}", 100.0 * np.abs(late).max(axis=0), "%"),
        **by_symbol(f"overshoot {name}", beyond / truth, "of the truth"),
        f"rmse {name} [%]": result.prediction_rmse_percent,
    }


def _held(seed: int) -> tuple[dict[str, float], dict[str, Floats]]:
    """Largest relative error of a parameter while the probe is held, and how many were guarded."""
    trajectory = Held(THREE_SINES, HOLD_FROM)
    measurement = Bench(BALL, trajectory, IdealProbe()).run(seed, seconds=HOLD_FROM + HELD_SECONDS)
    contact = measurement.contact.window(START)
    late = contact.time > trajectory.stop
    keep = np.flatnonzero(late)[::60]
    curves = {"held/time": contact.time[keep] - trajectory.stop}
    numbers: dict[str, float] = {}
    for name in HELD:
        result = identified(contact, SingleStageRLS(forgetting=PROFILES[name]))
        error = 100.0 * np.abs(result.trace.parameters / LAW.parameters - 1.0)
        numbers |= by_symbol(f"held error {name}", error[late].max(axis=0), "%")
        numbers |= by_symbol(f"held error at the end, {name}", error[-1], "%")
        numbers[f"held guarded {name} [samples]"] = int(result.estimate.guarded)
        curves[f"held/{name}"] = error[keep].max(axis=1)
    return numbers, curves


def _draw_seeds(axes: Axes, outcomes: Sequence[Outcome]) -> None:
    """Convergence and overshoot over P₀."""
    for i, outcome in enumerate(outcomes):
        shown = {"time to 5 % [s]": "time", "overshoot of K or B / truth": "overshoot"}
        for style, (label, what) in enumerate(shown.items()):
            symbols = "K|B|n" if what == "time" else "K|B"
            every = [named(f"{what} {name} {symbols}", outcome.numbers) for name in COVARIANCES]
            values = [max(each.values()) for each in every]
            axes.plot(
                list(COVARIANCES.values()), values, marker="os"[style], linestyle=DASHES[style],
                color=THEME.lines[style], label=label if i == 0 else None, alpha=0.8,
                linewidth=1.0, markersize=4,
            )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="P₀", title="Every seed")
    axes.legend(loc="upper left")


EXPERIMENTS = (ForgettingFactors(),)
