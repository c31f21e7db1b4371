"""Motions: what a linear model does near the surface, and how rich a motion has to be."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import palpate
from palpate import lab
from palpate.paper import drawing, rig
from palpate.paper.drawing import THEME, Axes, Figure
from palpate.paper.experiment import Curves, Experiment, Measured, Outcome, Seeds, Table, by_symbol
from palpate.paper.judging import named
from palpate.paper.methods import condition_number

#: From here on the approach is over, s.
SINES = 2.5
#: What is drawn of the loop, and of the motion, s.
DRAWN, MOTION = (2.5, 12.0), (4.0, 8.0)
MODELS: dict[str, rig.Method] = {
    "Kelvin–Voigt": palpate.KelvinVoigtRLS,
    "single stage": palpate.SingleStageRLS,
    "variable projection": palpate.VariableProjection,
}
LINEAR = next(iter(MODELS))


class _Hysteresis(Experiment):
    """The motion; force over penetration; the same without its linear spring, which tapers to the
    surface as Hunt–Crossley does and Kelvin–Voigt does not; and the last millimetre, where
    Kelvin–Voigt pulls.
    """

    def measure(self, seed: int) -> Measured:
        contact = rig.pressed("ball", "near-surface", seed)
        truth = rig.session("ball", "near-surface", seed).truth.window(rig.START)
        inside = _inside(contact)
        damped = replace(rig.BALL_LAW, damping=3.0 * rig.BALL_LAW.damping)
        numbers = {
            "least force measured [N]": contact.force[inside].min(),
            "least force felt [N]": truth.force[inside].min(),
            "least force 10 mm deep [N]": _least(rig.pressed("ball", "three-sines", seed)),
            "least force, ideal probe, as it is [N]": _ideal(rig.BALL_LAW, 1.0, seed),
            "least force, ideal probe, half the speed [N]": _ideal(rig.BALL_LAW, 0.5, seed),
            "least force, ideal probe, three times the damping [N]": _ideal(damped, 1.0, seed),
        }
        keep = np.flatnonzero((contact.time > DRAWN[0]) & (contact.time < DRAWN[1]))[::3]
        curves = {
            "time": contact.time[keep],
            "penetration": contact.penetration[keep],
            "force": np.where(inside, contact.force, np.nan)[keep],
        }
        for name, kind in MODELS.items():
            result = rig.identified(contact, kind)
            force = result.law.force(contact.penetration, contact.velocity)
            pulls = inside & (force < 0.0)
            # Force and velocity both outward: the robot would have to pull the material along.
            power = np.where(pulls & (contact.velocity < 0.0), force * contact.velocity, 0.0)
            numbers |= {
                f"least force {name} [N]": force[inside].min(),
                f"time pulling {name} [%]": 100.0 * pulls.sum() / inside.sum(),
                f"energy given {name} [mJ]": 1e3 * np.dot(power, contact.time_steps),
                f"rmse {name} [%]": result.prediction_rmse_percent,
                f"stiffness {name} [N/m]": result.law.parameters[0],
            }
            curves[f"predicted/{name}"] = np.where(inside, force, np.nan)[keep]
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        first = outcomes[0]
        (motion, loop), (viscous, near) = figure.subplots(2, 2)
        depth = 1e3 * np.array(first.curves["penetration"])
        motion.plot(first.curves["time"], depth, color=THEME.measured)
        drawing.truth(motion, 0.0)
        motion.set(xlabel="time [s]", ylabel="penetration [mm]", title="Motion", xlim=MOTION)
        _draw_loop(loop, first, (LINEAR,))
        loop.set(ylabel="force [N]", title="Force–penetration loop")
        loop.legend(loc="upper left")
        _draw_loop(viscous, first, tuple(MODELS), first.numbers[f"stiffness {LINEAR} [N/m]"])
        viscous.set(ylabel="force − K̂ x [N]", ylim=(-0.75, 0.75))
        viscous.set_title("Without the spring K̂ x: what is measured tapers to the surface")
        _draw_loop(near, first, tuple(MODELS))
        near.set(ylabel="force [N]", xlim=(-0.03, 0.8), ylim=(-0.35, 1.8))
        least = Seeds([outcome.numbers for outcome in outcomes])(f"least force {LINEAR}")
        near.set_title(f"Near the surface: {LINEAR} down to {least} N")
        near.legend(loc="upper left")

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        columns = ("least force {}", "time pulling {}", "energy given {}", "rmse {}")
        rows = [(name,) for name in MODELS]
        note = "The final law along the measured motion, samples inside the material from 2.5 s on."
        return (say.table("Near the surface", ("model",), columns, rows, note),)


def _inside(contact: palpate.Contact) -> Any:
    return (contact.penetration > 0.0) & (contact.time > SINES)


def _least(contact: palpate.Contact) -> float:
    """Least force of an identified Kelvin–Voigt law along a motion, N."""
    law = rig.identified(contact, palpate.KelvinVoigtRLS).law
    return float(law.force(contact.penetration, contact.velocity)[_inside(contact)].min())


def _ideal(law: palpate.HuntCrossley, speed: float, seed: int) -> float:
    """The same of an ideal probe, with the near-surface motion at a share of its speed."""
    motion = lab.NEAR_SURFACE.motion
    slower = replace(motion, frequencies=tuple(speed * each for each in motion.frequencies))
    seconds = rig.START + 10.0 / speed
    return _least(rig.ideally_pressed(lab.Homogeneous(law), lab.Probing(slower), seed, seconds))


def _draw_loop(axes: Axes, outcome: Outcome, models: Sequence[str], stiffness: float = 0.0) -> None:
    """Force over penetration, less a spring's."""
    depth = np.array(outcome.curves["penetration"])
    spring = stiffness * depth
    measured = np.array(outcome.curves["force"]) - spring
    axes.plot(1e3 * depth, measured, color=THEME.measured, linewidth=1.6, label="measured")
    predicted = {name: np.array(outcome.curves[f"predicted/{name}"]) - spring for name in models}
    drawing.lines(axes, 1e3 * depth, predicted, linewidth=0.9)
    drawing.truth(axes, 0.0, None)
    axes.set(xlabel="penetration [mm]")


SECONDS = 22.0
#: How long the ideal probe goes on, s.
LONG = 452.0
MOTIONS = {"two sines": "two-sines", "one sine": "one-sine"}
COVARIANCES = (1.0, 10.0, 1e2, 1e3, 1e4, 1e6)
LONG_COVARIANCES = (0.1, 1.0, 10.0)
LONG_MOTION = "one sine, 450 s"
PROJECTION = "none: variable projection"


@dataclass(frozen=True)
class _Richness(Experiment):
    """Parameters and force error over the time since contact, from every start, for two sines and
    for one; beside them the convergence times of every seed over the initial covariance.
    """

    kind: rig.Method

    @property
    def _norms(self) -> dict[str, tuple[float, ...]]:
        """Initial covariances by motion."""
        norms: dict[str, tuple[float, ...]] = dict.fromkeys(MOTIONS, COVARIANCES)
        single = self.kind is palpate.SingleStageRLS
        return norms | {LONG_MOTION: LONG_COVARIANCES} if single else norms

    def measure(self, seed: int) -> Measured:
        three = rig.pressed("ball", "three-sines", seed)
        # The starts are those of the three sines.
        starts = rig.starts_of(three, self.kind)
        reference = rig.from_starts(three, self.kind, starts)
        numbers = self._summary("three sines", reference)
        curves: Curves = {}
        for name, trajectory in MOTIONS.items():
            contact = rig.pressed("ball", trajectory, seed, SECONDS)
            results = rig.from_starts(contact, self.kind, starts)
            numbers |= self._summary(name, results)
            numbers |= _by_covariance(name, contact, self.kind, starts, COVARIANCES)
            numbers |= _conditioning(name, contact)
            numbers[f"largest difference from three sines, {name} [%]"] = max(
                rig.off(result.law.parameters, reference[start].law.parameters).max()
                for start, result in results.items()
            )
            if self.kind is palpate.KelvinVoigtRLS and name == "one sine":
                # Times of the other model on the same data, with the same P₀.
                other, what = palpate.SingleStageRLS, f"of single-stage {name}"
                others = rig.starts_of(three, other)
                numbers |= _by_covariance(what, contact, other, others, rig.SAME_COVARIANCES)
            projected = rig.identified(contact, palpate.VariableProjection)
            for start, result in {**results, "projection": projected}.items():
                curves |= drawing.traced(f"{name}/{start}", result, f"{name}/elapsed")
            times = rig.times_to(projected, rig.BALL_LAW.parameters)
            numbers |= by_symbol(f"time of variable projection {name}", times, "s")
            numbers |= _end(f"{name} variable projection", projected)
        if sizes := self._norms.get(LONG_MOTION):
            contact = rig.ideally_pressed(lab.BALL, lab.ONE_SINE, seed, LONG)
            numbers |= _by_covariance(LONG_MOTION, contact, self.kind, starts, sizes)
        return numbers, curves

    def _summary(self, motion: str, results: rig.Results) -> dict[str, float]:
        times = rig.convergence_times(results.values())
        numbers = by_symbol(f"time {motion}", times, "s", self.kind.law_type)
        for start, result in results.items():
            numbers |= _end(f"{motion} {start}", result)
        return numbers

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        symbols = self.kind.law_type.symbols
        rows = len(symbols)
        grid = figure.subplots(rows + 1, 3)
        for column, motion in zip(grid.T, MOTIONS, strict=False):
            self._draw_motion(column, motion, outcomes[0])
        for symbol, axes in zip(symbols, grid[:rows, 2], strict=True):
            for j, outcome in enumerate(outcomes):
                for i, (motion, sizes) in enumerate(self._norms.items()):
                    names = (f"time P₀ = {size:g} {motion} {symbol} [s]" for size in sizes)
                    line = {motion if j == 0 else None: [outcome.numbers[name] for name in names]}
                    drawing.lines(axes, sizes, line, first=i, linewidth=1.0)
            axes.set(xscale="log", yscale="log", ylabel=f"{symbol}: convergence [s]")
        grid[0, 2].set_title("Every seed, over P₀")
        grid[0, 2].legend(loc="upper right")
        grid[rows - 1, 2].set(xlabel="P₀")
        grid[rows, 2].set_axis_off()
        shown = grid[rows, 0].get_legend_handles_labels()
        grid[rows, 2].legend(*shown, loc="center left", title="start")

    def _draw_motion(self, column: Any, motion: str, outcome: Outcome) -> None:
        """Parameters and force error of every start; the value from three sines dotted."""
        curves, law, clock = outcome.curves, self.kind.law_type, f"{motion}/elapsed"
        names = rig.names_of_starts(self.kind)
        starts = {start: f"{motion}/{start}" for start in names}
        every = {**starts, PROJECTION: f"{motion}/projection"}
        # Its stiffness and damping are another law's than Kelvin–Voigt's.
        shown = every if law is palpate.HuntCrossley else starts
        finals = named(f"final three sines {names[0]}", outcome.numbers).values()
        for axes, symbol, unit, final in zip(column, law.symbols, law.units, finals, strict=False):
            looks = {"xscale": "log", "ylim": (-0.5 * final, 3.0 * final)}
            drawing.course(axes, curves, symbol, shown, clock=clock, unit=unit, **looks)
            drawing.truth(axes, final, None)
        column[0].set_title(f"{motion} (dotted: three)")
        lines = {label: curves[f"{prefix}/error"] for label, prefix in every.items()}
        drawing.lines(column[-1], curves[clock], lines, linewidth=0.8)
        column[-1].set(xscale="log", ylim=(-1.0, 1.0), ylabel="force error [N]")
        column[-1].set(xlabel="time since contact [s]")

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        rows = {(motion, "default"): (motion, "") for motion in ("three sines", *MOTIONS)}
        for motion, sizes in self._norms.items():
            rows |= {(motion, f"{size:g}"): (motion, f"P₀ = {size:g} ") for size in sizes}
        symbols = self.kind.law_type.symbols
        columns = [f"time {{1}}{{0}} {symbol}" for symbol in symbols]
        note = (
            f"Seconds of contact until all starts agree within 5 %, of {SECONDS - rig.START:g} s "
            "on the rig; 450 s are an ideal probe's with the same sensors."
        )
        title = f"Convergence by motion, {self.kind.method}"
        return (say.table(title, ("motion", "P₀"), columns, rows, note),)


def _by_covariance(
    what: str,
    contact: palpate.Contact,
    kind: rig.Method,
    starts: rig.Starts,
    sizes: Sequence[float],
) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for size in sizes:
        results = rig.from_starts(contact, kind, starts, initial_covariance=size)
        times = rig.convergence_times(results.values())
        numbers |= by_symbol(f"time P₀ = {size:g} {what}", times, "s", kind.law_type)
    return numbers


def _end(what: str, result: palpate.Identification) -> dict[str, float]:
    finals = by_symbol(f"final {what}", result.law.parameters, "", result.law)
    return {**finals, f"rmse {what} [%]": result.prediction_rmse_percent}


def _conditioning(motion: str, contact: palpate.Contact) -> dict[str, float]:
    """Condition numbers of columns of unit length: of the logarithm's, and of linear systems."""
    known = contact.window(rig.START + 1.0)
    x, v = known.penetration, known.velocity
    one = np.ones_like(x)
    systems = {
        "1, v, ln x": (one, v, np.log(x)),
        "1, v, x": (one, v, x),
        "x, v, a": (x, v, np.gradient(v, known.time)),
    }
    return {
        f"condition number of {name}, {motion}": condition_number(np.stack(columns))
        for name, columns in systems.items()
    }


SURFACE = "Rubber ball, near the surface: force over penetration"
SINGLE = "Rubber ball, Hunt–Crossley by the single stage: two sines and one"
EXPERIMENTS = (
    _Hysteresis("fig10", (10.5, 7.6), SURFACE),
    _Richness("fig17", (11.5, 9.2), SINGLE, palpate.SingleStageRLS),
    _Richness(
        "fig18", (11.5, 7.0), "Rubber ball, Kelvin–Voigt: two sines and one", palpate.KelvinVoigtRLS
    ),
)
