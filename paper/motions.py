"""Motions: near the surface, where a linear model pulls; required excitation; and a modern view.

The last is not an experiment of the paper: it applies all methods to a relaxing sponge.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import palpate
from palpate import lab
from paper import experiment, rig
from paper.choices import chosen
from paper.experiment import (
    THEME,
    Axes,
    Curves,
    Experiment,
    Figure,
    Floats,
    Measured,
    Outcome,
    Seeds,
    Table,
    by_symbol,
)
from paper.judging import named
from paper.methods import condition_number

# Fig. 10: near the surface.

#: Time at which the approach is over, s.
SINES = 2.5
MODELS: dict[str, rig.Method] = {
    "Kelvin–Voigt": palpate.KelvinVoigtRLS,
    "single stage": palpate.SingleStageRLS,
    "variable projection": palpate.VariableProjection,
}
LINEAR = next(iter(MODELS))


#: The three sines at their usual speed pull by less than the sensor's step of 1/8 N, at any x₀ that
#: keeps the probe in the ball; the paper gives no speed.
FASTER = 3.0
NEAR_MOTION = replace(
    lab.NEAR_SURFACE.motion,
    frequencies=tuple(FASTER * each for each in lab.NEAR_SURFACE.motion.frequencies),
)
NEAR = lab.Probing(NEAR_MOTION)
NEAR_SECONDS = 12.0


class _Hysteresis(Experiment):
    """Top, as in the paper: the position, and force over position, measured and by Kelvin–Voigt.
    Bottom: near the surface, where Kelvin–Voigt pulls; and the forces without the linear spring,
    which vanish at the surface for Hunt–Crossley, but not for Kelvin–Voigt. The sines are three
    times as fast as elsewhere. The numbers are for the final law along the measured motion inside
    the material.
    """

    def measure(self, seed: int) -> Measured:
        contact = rig.simulated_contact("ball", NEAR, seed, NEAR_SECONDS)
        truth = rig.session("ball", NEAR, seed, NEAR_SECONDS).truth.window(rig.START)
        usual = rig.simulated_contact("ball", "near-surface", seed, NEAR_SECONDS)
        inside = _inside(contact)
        damped = replace(rig.BALL_LAW, B=3.0 * rig.BALL_LAW.B)
        numbers = {
            "least force measured [N]": contact.force[inside].min(),
            "least force felt [N]": truth.force[inside].min(),
            "peak speed [mm/s]": 1e3 * np.abs(truth.velocity[inside]).max(),
            "least force, the three sines at their usual speed [N]": _least(usual),
            "least force 10 mm deep [N]": _least(
                rig.simulated_contact("ball", "three-sines", seed)
            ),
            "least force, ideal probe, as it is [N]": _ideal(rig.BALL_LAW, 1.0, seed),
            "least force, ideal probe, half the speed [N]": _ideal(rig.BALL_LAW, 0.5, seed),
            "least force, ideal probe, three times the damping [N]": _ideal(damped, 1.0, seed),
        }
        keep = np.flatnonzero(contact.time > SINES)[::4]
        curves = {
            "time": contact.time[keep],
            "penetration": contact.penetration[keep],
            "force": np.where(inside, contact.force, np.nan)[keep],
        }
        for name, kind in MODELS.items():
            result = rig.identified(contact, kind)
            force = result.law.force(contact.penetration, contact.velocity)
            pulls = inside & (force < 0.0)
            # With adhesion the robot would have to do work while it withdraws.
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
        (position, loop), (near, viscous) = figure.subplots(2, 2)
        time = np.array(first.curves["time"])
        depth = 1e3 * np.array(first.curves["penetration"])
        position.plot(time, depth, color=THEME.measured, linewidth=1.0)
        experiment.truth(position, 0.0, None)
        position.set(xlabel="time [s]", ylabel="penetration [mm]", title="Position profile")
        position.set_xlim(SINES, SINES + 4.0)
        _draw_loop(loop, first, (LINEAR,))
        loop.set(ylabel="force [N]", title="Force–position loop")
        _draw_loop(viscous, first, tuple(MODELS), first.numbers[f"stiffness {LINEAR} [N/m]"])
        viscous.set(ylabel="force − K̂ x [N]", ylim=(-2.0, 2.0))
        viscous.set_title("Without the spring K̂ x")
        _draw_loop(near, first, tuple(MODELS))
        near.set(ylabel="force [N]", xlim=(-0.03, 0.8), ylim=(-0.6, 1.8))
        near.set_title(f"Near the surface: {LINEAR} pulls")
        experiment.legend_below(figure, near, 4)


def _inside(contact: palpate.Contact) -> Any:
    return (contact.penetration > 0.0) & (contact.time > SINES)


def _least(contact: palpate.Contact) -> float:
    """Return the smallest force of an identified Kelvin–Voigt law along a motion, N."""
    law = rig.identified(contact, palpate.KelvinVoigtRLS).law
    return float(law.force(contact.penetration, contact.velocity)[_inside(contact)].min())


def _ideal(law: palpate.HuntCrossley, speed: float, seed: int) -> float:
    """Return the same for an ideal probe, at a fraction of the near-surface motion's speed."""
    slower = replace(
        NEAR_MOTION, frequencies=tuple(speed * each for each in NEAR_MOTION.frequencies)
    )
    seconds = rig.START + 10.0 / speed
    return _least(rig.ideal_contact(lab.Homogeneous(law), lab.Probing(slower), seed, seconds))


def _draw_loop(axes: Axes, outcome: Outcome, models: Sequence[str], stiffness: float = 0.0) -> None:
    """Draw force minus that of a spring over penetration."""
    depth = np.array(outcome.curves["penetration"])
    spring = stiffness * depth
    measured = np.array(outcome.curves["force"]) - spring
    axes.plot(1e3 * depth, measured, color=THEME.measured, linewidth=1.6, label="measured")
    predicted = {name: np.array(outcome.curves[f"predicted/{name}"]) - spring for name in models}
    experiment.lines(axes, 1e3 * depth, predicted, linewidth=0.9)
    experiment.truth(axes, 0.0, None)
    axes.set(xlabel="penetration [mm]")


# Figs. 17 and 18: the required excitation.

SECONDS = 22.0
#: Duration of the ideal probe's motion, s.
LONG = 452.0
MOTIONS = {"two sines": "two-sines", "one sine": "one-sine"}
COVARIANCES = (1.0, 10.0, 1e2, 1e3, 1e4, 1e6)
LONG_COVARIANCES = (0.1, 1.0, 10.0)
LONG_MOTION = "one sine, 450 s"
PROJECTION = "none: variable projection"


@dataclass(frozen=True)
class _Richness(Experiment):
    """Parameters and force error over the time since contact, for two sines and for one, from all
    initial values. Dotted: the values from three sines.
    """

    kind: rig.Method

    def measure(self, seed: int) -> Measured:
        three = rig.simulated_contact("ball", "three-sines", seed)
        # Use the initial values of the three sines.
        starts = rig.starts_of(three, self.kind)
        reference = rig.from_starts(three, self.kind, starts)
        numbers = self._summary("three sines", reference)
        curves: Curves = {}
        for name, trajectory in MOTIONS.items():
            contact = rig.simulated_contact("ball", trajectory, seed, SECONDS)
            results = rig.from_starts(contact, self.kind, starts)
            numbers |= self._summary(name, results)
            numbers |= _by_covariance(name, contact, self.kind, starts, COVARIANCES)
            numbers |= _conditioning(name, contact)
            numbers[f"largest difference from three sines, {name} [%]"] = max(
                rig.off(result.law.parameters, reference[start].law.parameters).max()
                for start, result in results.items()
            )
            if self.kind is palpate.KelvinVoigtRLS and name == "one sine":
                # Convergence times of the other model on the same data, with the same P₀.
                other, what = palpate.SingleStageRLS, f"of single-stage {name}"
                others = rig.starts_of(three, other)
                numbers |= _by_covariance(what, contact, other, others, rig.SAME_COVARIANCES)
            projected = rig.identified(contact, palpate.VariableProjection)
            for start, result in {**results, "projection": projected}.items():
                curves |= experiment.traced(f"{name}/{start}", result, f"{name}/elapsed")
            times = rig.times_to(projected, rig.BALL_LAW.parameters)
            numbers |= by_symbol(f"time of variable projection {name}", times, "s")
            numbers |= _end(f"{name} variable projection", projected)
        if self.kind is palpate.SingleStageRLS:
            contact = rig.ideal_contact(lab.BALL, lab.ONE_SINE, seed, LONG)
            long = _by_covariance(LONG_MOTION, contact, self.kind, starts, LONG_COVARIANCES)
            numbers |= long
        return numbers, curves

    def _summary(self, motion: str, results: rig.Results) -> dict[str, float]:
        times = rig.convergence_times(results.values())
        numbers = by_symbol(f"time {motion}", times, "s", self.kind.law_type)
        for start, result in results.items():
            numbers |= _end(f"{motion} {start}", result)
        return numbers

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        grid = figure.subplots(len(self.kind.law_type.symbols) + 1, len(MOTIONS))
        for column, motion in zip(grid.T, MOTIONS, strict=True):
            self._draw_motion(column, motion, outcomes[0])
        experiment.legend_below(figure, grid[-1, 0], 4)

    def _draw_motion(self, column: Any, motion: str, outcome: Outcome) -> None:
        """Draw parameters and force error for all initial values; dotted: values of three sines."""
        curves, law, clock = outcome.curves, self.kind.law_type, f"{motion}/elapsed"
        names = rig.names_of_starts(self.kind)
        starts = {start: f"{motion}/{start}" for start in names}
        every = {**starts, PROJECTION: f"{motion}/projection"}
        # K and B of Hunt–Crossley are not comparable with those of Kelvin–Voigt.
        shown = every if law is palpate.HuntCrossley else starts
        finals = named(f"final three sines {names[0]}", outcome.numbers).values()
        for axes, symbol, unit, final in zip(column, law.symbols, law.units, finals, strict=False):
            looks = {"xscale": "log", "ylim": (-0.5 * final, 3.0 * final)}
            experiment.course(axes, curves, symbol, shown, clock=clock, unit=unit, **looks)
            experiment.truth(axes, final, None)
        column[0].set_title(f"{motion} (dotted: three)")
        lines = {label: curves[f"{prefix}/error"] for label, prefix in every.items()}
        experiment.lines(column[-1], curves[clock], lines, linewidth=0.8)
        column[-1].set(xscale="log", ylim=(-1.0, 1.0), ylabel="force error [N]")
        column[-1].set(xlabel="time since contact [s]")


def _by_covariance(
    what: str,
    contact: palpate.Contact,
    kind: rig.Method,
    starts: rig.Starts,
    sizes: Sequence[float],
) -> dict[str, float]:
    numbers: dict[str, float] = {}
    times: dict[Any, Floats] = {}  # by P₀: a draw has one for all sizes
    for size in sizes:
        covariance = chosen().covariance_of(kind, size)
        if covariance not in times:
            results = rig.from_starts(contact, kind, starts, initial_covariance=covariance)
            times[covariance] = rig.convergence_times(results.values())
        numbers |= by_symbol(f"time P₀ = {size:g} {what}", times[covariance], "s", kind.law_type)
    return numbers


def _end(what: str, result: palpate.Identification) -> dict[str, float]:
    finals = by_symbol(f"final {what}", result.law.parameters, "", result.law)
    return {**finals, f"rmse {what} [%]": result.prediction_rmse_percent}


def _conditioning(motion: str, contact: palpate.Contact) -> dict[str, float]:
    """Return condition numbers of normalised regressors, of the logarithm and of linear systems."""
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


# All methods on the relaxing sponge, with their verdicts today. Each method is identified from the
# first half of a recording and predicts the second.

#: End of the samples used for identification, s.
HALF = 7.0
#: One of so many samples is drawn.
EVERY = 20
_PAPER: Mapping[str, Any] = {"gate": rig.GATE, "scale": rig.SI, "outlier_rejection": False}
# By display name: the paper's methods with the paper's settings, and ours with default settings.
METHODS: Mapping[str, tuple[rig.Method, Mapping[str, Any]]] = {
    "single stage": (palpate.SingleStageRLS, _PAPER),
    "double stage": (palpate.DoubleStageRLS, _PAPER),
    "Kelvin–Voigt": (palpate.KelvinVoigtRLS, _PAPER),
    "variable projection": (palpate.VariableProjection, {}),
    "relaxation: --law auto": (palpate.ViscoelasticContact, {}),
}
#: The marks of a verdict, from the best to the worst.
MARKS = ("trust", "with-care", "do-not-trust")
#: Possible advice of a diagnosis.
ADVICE = ("nothing", "--law auto", "something else")
QUANTITIES = {"K′": "N/m", "B′": "N·s/m"}
TODAY_NOTE = (
    "Identified from 2 to 7 s; RMSE% from 7 to 12 s, of which noise alone contributes 2 %. Laws "
    "without relaxation do not predict the second half, in which the sponge has relaxed further."
)


class _Today(Experiment):
    """Force error over time of each method's law, identified from the first five seconds; the
    shaded five seconds were not used. K′ and B′ are the dynamic stiffness and damping at the
    motion's frequency, with bars of two standard errors. The true law is F = 300 x + 300 x v plus a
    Maxwell branch of 150 N/m with a relaxation time of 1 s.
    """

    def measure(self, seed: int) -> Measured:
        # The recording that Fig. 13 uses.
        contact = rig.simulated_contact("relaxing-sponge", "three-sines", seed)
        learned = contact.window(rig.START, HALF)
        unseen = contact.time >= HALF
        numbers: dict[str, float] = {}
        curves: Curves = {"time": contact.time[::EVERY]}
        for name, (kind, settings) in METHODS.items():
            result = palpate.identify(learned, kind(**settings), trace="full")
            error = contact.force - result.predicted_force(contact)
            numbers |= _verdicts(name, result)
            shares = (np.dot(each[unseen], each[unseen]) for each in (error, contact.force))
            numbers[f"rmse unseen {name} [%]"] = 100.0 * np.sqrt(next(shares) / next(shares))
            curves[f"{name}/error"] = error[::EVERY]
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        curves = outcomes[0].curves
        axes = figure.subplots()
        lines = {name: curves[f"{name}/error"] for name in METHODS}
        experiment.lines(axes, curves["time"], lines, linewidth=1.0)
        axes.axvspan(HALF, curves["time"][-1], color=THEME.grid, alpha=0.5, linewidth=0)
        axes.set(xlim=(rig.START + 0.5, curves["time"][-1]), ylim=(-1.5, 1.5))
        axes.set(xlabel="time [s]", ylabel="force error [N]")
        axes.legend(loc="upper center", ncols=3)

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        def word(number: str, words: Sequence[str]) -> str:
            """Return the word for a number; the range of words if the seeds differ."""
            values = sorted({round(each[number]) for each in say.every})
            return " to ".join(words[each] for each in dict.fromkeys((values[0], values[-1])))

        rows = []
        for name in METHODS:
            marks = (word(f"mark of {of} {name}", MARKS) for of in (*QUANTITIES, "all"))
            advice = word(f"advice {name}", ADVICE)
            rows.append((name, say(f"rmse unseen {name}"), *marks, advice))
        trust = ("verdict on K′", "verdict on B′", "overall")
        verdicts = ("method", "RMSE% of the unused half", *trust, "advice")
        title = "Verdicts on each method's law"
        return (Table(title, verdicts, tuple(rows), TODAY_NOTE),)


def _verdicts(name: str, result: palpate.Identification) -> dict[str, float]:
    """Return dynamic stiffness and damping with bars, verdicts and advice."""
    felt, diagnosis = result.dynamic_stiffness(), result.diagnosis
    # The truth is a spring and damper, and a Maxwell branch E iωτ/(1 + iωτ).
    sponge, omega = lab.RELAXING_SPONGE, felt.frequency
    turned = 1j * omega * sponge.relaxation_time
    memory = sponge.branch_stiffness * turned / (1.0 + turned)
    stiffness = sponge.law.stiffness_at(felt.depth) + memory.real
    damping = sponge.law.damping_at(felt.depth) + memory.imag / omega
    numbers = {}
    pairs = ((felt.stiffness, stiffness), (felt.damping, damping))
    for (symbol, unit), (known, true) in zip(QUANTITIES.items(), pairs, strict=True):
        bar = 2.0 * float(np.hypot(known.standard_error, known.systematic))
        numbers[f"{symbol} {name} [{unit}]"] = known.value
        numbers[f"{symbol} bar {name} [{unit}]"] = bar
        numbers[f"{symbol} truth {name} [{unit}]"] = true
        numbers[f"{symbol} off {name} [× bar]"] = abs(known.value - true) / bar
    verdict = diagnosis.verdict
    marks = (verdict.stiffness, verdict.damping, verdict.overall)
    for of, mark in zip((*QUANTITIES, "all"), marks, strict=True):
        numbers[f"mark of {of} {name}"] = MARKS.index(mark)
    serious = [each for each in diagnosis.findings if each.severity != "note" and each.remedy]
    laws = [law for each in serious for law in ADVICE if law in str(each.remedy)]
    numbers[f"advice {name}"] = ADVICE.index(laws[0]) if laws else len(ADVICE) - 1 if serious else 0
    return numbers


SURFACE = "Rubber ball near the surface: force over penetration"
SINGLE = "Rubber ball, Hunt–Crossley by the single stage: two sines and one"
EXPERIMENTS = (
    _Hysteresis("fig10", (10.5, 7.4), SURFACE),
    _Richness("fig17", (9.5, 9.2), SINGLE, palpate.SingleStageRLS),
    _Richness(
        "fig18", (11.5, 7.0), "Rubber ball, Kelvin–Voigt: two sines and one", palpate.KelvinVoigtRLS
    ),
    _Today("today", (11.0, 4.6), "All methods today: a sponge that relaxes"),
)
