"""Comparison of the methods on the same data: forgetting, accuracy, and causes.

Each cause that the paper names is tested by changing it alone.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import palpate
from palpate import lab
from paper import experiment, rig
from paper.choices import chosen
from paper.experiment import (
    UNITS,
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
from paper.judging import named, number

SINGLE, DOUBLE, LINEAR = palpate.SingleStageRLS, palpate.DoubleStageRLS, palpate.KelvinVoigtRLS
PROJECTION = palpate.VariableProjection

# Fig. 7: forgetting, and the initial covariance.

PROFILES: dict[str, palpate.ConstantForgetting | palpate.FadingForgetting] = {
    "λ = 1": palpate.ConstantForgetting(1.0),
    **{f"α = {a:g}": palpate.FadingForgetting(0.99, a) for a in (0.1, 1.0, 5, 6, 7, 8, 20)},
    **{f"λ = {factor:g}": palpate.ConstantForgetting(factor) for factor in (0.99, 0.95, 0.9)},
}
COVARIANCES = {f"P₀ = {size:g}": size for size in (1.0, 10.0, 20.0, 1e2, 1e3, 1e4, 1e6)}
HELD = ("α = 5", "α = 0.1", "λ = 0.99", "λ = 0.9")
HOLD_FROM, HELD_SECONDS = 8.0, 60.0
# Lines of the figure and axis limits; later all results are within a few percent.
PROFILES_DRAWN = ("λ = 1", "α = 0.1", "α = 5", "λ = 0.99", "variable projection")
COVARIANCES_DRAWN = tuple(name for name in COVARIANCES if name not in ("P₀ = 20", "P₀ = 1000"))
CLOSE = {"K": (1800.0, 2200.0), "B": (1600.0, 2400.0), "n": (0.96, 1.04)}
WIDE = {"K": (1000.0, 3000.0), "B": (-1000.0, 5000.0), "n": (0.8, 1.2)}
#: The ball alternates every two seconds with one whose stiffness and damping are 20 % higher.
CHANGES = (4.0, 6.0, 8.0, 10.0)
STIFFER = palpate.HuntCrossley(K=1.2 * rig.BALL_LAW.K, B=1.2 * rig.BALL_LAW.B, n=rig.BALL_LAW.n)


@dataclass(frozen=True, slots=True)
class Held:
    """A trajectory that stops at a time, s, of zero speed, and stays there."""

    trajectory: lab.Trajectory
    stop: float

    @property
    def pause(self) -> float:
        """Time at rest before anything moves, s."""
        return self.trajectory.pause

    def at(self, time: Floats) -> lab.Command:
        """Return the command at times [s], shape (k,)."""
        command = self.trajectory.at(np.minimum(time, self.stop))
        speeds = command.velocity, command.lateral_velocity
        along, across = (np.where(time < self.stop, each, 0.0) for each in speeds)
        return lab.Command(command.penetration, along, command.lateral_position, across)


class _Forgetting(Experiment):
    """Left: K, B and n over time for several forgetting factors. Right: the same for several
    initial covariances. Below: a probe held at one depth. Times are until a parameter stays within
    5 % of the truth; scatter is the standard deviation over the second half, overshoot the largest
    excursion beyond initial value and truth.
    """

    def measure(self, seed: int) -> Measured:
        contact = rig.simulated_contact("ball", "three-sines", seed)
        starts = rig.starts_of(contact, SINGLE)
        settings: dict[str, dict[str, Any]] = {
            **{name: {"forgetting": each} for name, each in PROFILES.items()},
            **{name: {"initial_covariance": size} for name, size in COVARIANCES.items()},
            **{f"start {name}": {"initial": law} for name, law in starts.items()},
        }
        results = {name: rig.identified(contact, SINGLE, **each) for name, each in settings.items()}
        results["variable projection"] = rig.identified(contact, PROJECTION)
        numbers, curves = _held(seed)
        numbers |= _varying(seed)
        numbers["λ after 1 s"] = 1.0 - 0.01 * math.exp(-5.0)
        truth = rig.BALL_LAW.parameters
        for name, result in results.items():
            known = rig.taken(result)
            start = result.estimator.settings.get("initial", rig.BALL_LAW).parameters
            low, high = np.minimum(start, truth), np.maximum(start, truth)
            beyond = np.maximum(known.max(axis=0) - high, low - known.min(axis=0)).clip(min=0.0)
            late = known[len(known) // 2 :] / truth - 1.0
            worst = 100.0 * np.abs(late).max(axis=0)
            numbers |= by_symbol(f"time {name}", rig.times_to(result, truth), "s")
            numbers |= by_symbol(f"scatter {name}", 100.0 * late.std(axis=0), "%")
            numbers |= by_symbol(f"largest error {name}", worst, "%")
            numbers |= by_symbol(f"overshoot {name}", beyond / truth, "of the truth")
            numbers[f"rmse {name} [%]"] = result.prediction_rmse_percent
            curves |= experiment.traced(name, result)
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        curves = outcomes[0].curves
        grid = figure.subplots(4, 2, height_ratios=(1.0, 1.0, 1.0, 0.9))
        for (left, right), (symbol, unit) in zip(grid, UNITS.items(), strict=False):
            shown = {name: name for name in PROFILES_DRAWN}
            limits: dict[str, Any] = {"unit": unit, "xlim": (0.0, 10.0), "ylim": CLOSE[symbol]}
            experiment.course(left, curves, symbol, shown, **limits)
            shown = {name: name for name in COVARIANCES_DRAWN}
            limits |= {"xscale": "log", "xlim": (1e-2, 10.0), "ylim": WIDE[symbol]}
            experiment.course(right, curves, symbol, shown, **limits)
        titles = ("Forgetting factor, P₀ = 1e3", "Initial covariance, α = 5")
        for axes, lowest, title in zip(grid[0], grid[2], titles, strict=True):
            axes.set_title(title, pad=46)
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
            lowest.set(xlabel="time since contact [s]")
        left, right = grid[3]
        left.remove()
        right.remove()
        held = figure.add_subplot(left.get_gridspec()[3, :])
        lines = {name: curves[f"held/{name}"] for name in HELD}
        experiment.lines(held, curves["held/time"], lines, linewidth=1.0)
        held.set(yscale="log", xlabel="time since the probe stopped [s]")
        held.set(ylabel="worst parameter's error [%]", title="Probe held at one depth")
        held.legend(loc="upper right", ncols=len(HELD), title="held with")


def _held(seed: int) -> Measured:
    """Return errors while the probe is held, and the number of samples limited by the guard."""
    clock = HOLD_FROM + 1e-4 * np.arange(20_000, dtype=np.float64)
    turns = np.flatnonzero(np.diff(np.sign(lab.THREE_SINES.at(clock).velocity)))
    trajectory = Held(lab.THREE_SINES, float(clock[turns[0]]))
    contact = rig.ideal_contact(lab.BALL, trajectory, seed, HOLD_FROM + HELD_SECONDS)
    late = contact.time > trajectory.stop
    keep = np.flatnonzero(late)[::60]
    curves = {"held/time": contact.time[keep] - trajectory.stop}
    numbers: dict[str, float] = {}
    for name in HELD:
        result = rig.identified(contact, SINGLE, forgetting=PROFILES[name])
        error = rig.off(result.trace.parameters, rig.BALL_LAW.parameters)
        numbers |= by_symbol(f"held error {name}", error[late].max(axis=0), "%")
        numbers |= by_symbol(f"held error at the end, {name}", error[-1], "%")
        numbers[f"held guarded {name} [samples]"] = int(result.estimate.guarded)
        curves[f"held/{name}"] = error[keep].max(axis=1)
    return numbers, curves


def _varying(seed: int) -> dict[str, float]:
    """Return errors by forgetting factor for a ball that changes every two seconds."""
    other = lab.Homogeneous(STIFFER)
    varying = lab.TimeVaryingMaterial((lab.BALL, other, lab.BALL, other, lab.BALL), CHANGES)
    contact = rig.ideal_contact(varying, lab.THREE_SINES, seed)
    stiffer = np.searchsorted(CHANGES, contact.time, side="right") % 2 == 1
    truth = np.where(stiffer, STIFFER.K, rig.BALL_LAW.K)
    numbers: dict[str, float] = {}
    for factor in (1.0, 0.99):
        forgetting = palpate.ConstantForgetting(factor)
        result = rig.identified(contact, SINGLE, forgetting=forgetting)
        after = result.trace.taken & (contact.time > CHANGES[0])
        error = (result.trace.parameters[:, 0] / truth - 1.0)[after]
        numbers[f"varying rmse λ = {factor:g} [%]"] = result.prediction_rmse_percent
        numbers[f"varying error of K λ = {factor:g} [%]"] = 100.0 * np.sqrt(np.mean(error**2))
    return numbers


# Figs. 8, 13 and 16 with Tables I to VI: all methods from all initial values.

#: End of "the first few milliseconds", s.
FIRST_FEW = 20e-3
# Axis limits of a stiffness, relative to the final value.
BELOW, ABOVE = 1e-3, 1e3
# Errors below this are drawn on a linear scale, N.
FINE = 0.25
RMSE = (
    "RMSE%: one-step prediction error of force after 0.2 s of contact, 100 √(Σe²/ΣF²). Median over "
    "the seeds, range in brackets."
)
#: Units near the contact's depth, speed and force, so that all regressors are near 1.
OWN = palpate.Scale(10e-3, 20e-3, 20.0)
#: Factors of downsampling from the rig's 1 kHz.
STEPS = (1, 2, 4, 10, 20)
#: Largest |v| as a fraction of K/B: the paper's tenth, and a larger one.
SHARES = (0.1, 0.5)


@dataclass(frozen=True)
class _Comparison(Experiment):
    """One column per method: parameters and force error over the time since contact, from all
    initial values of the tables. Times are until the results of all initial values stay within 5 %
    of each other; spread is their final range; settled is when each stays within 5 % of its final
    value.
    """

    material: str
    kinds: tuple[rig.Method, ...]
    numerals: str  # of the paper's tables of initial values and errors
    beside: str = ""  # a second material for which the claims are judged too

    @property
    def _methods(self) -> tuple[rig.Method, ...]:
        return (*self.kinds, PROJECTION)

    def measure(self, seed: int) -> Measured:
        numbers, curves = self._measured(self.material, seed)
        if self.beside:
            prefix = self.beside.replace("-", " ")
            second = self._measured(self.beside, seed)[0]
            numbers |= {f"{prefix} {name}": value for name, value in second.items()}
        if self.material == "ball":
            numbers |= _logarithm(rig.simulated_contact("ball", "three-sines", seed)) | _threshold()
            numbers |= _sampled(rig.session("ball", "three-sines", seed).contact)
        return numbers, curves

    def _measured(self, material: str, seed: int) -> Measured:
        contact = rig.simulated_contact(material, "three-sines", seed)
        numbers: dict[str, float] = {}
        curves: Curves = {}
        errors: dict[tuple[float, rig.Method], list[float]] = {}
        for kind in self.kinds:
            starts, law = rig.starts_of(contact, kind), kind.law_type
            results = rig.from_starts(contact, kind, starts)
            for name, start in starts.items():
                numbers |= by_symbol(f"start {kind.method} {name}", start.parameters, law=law)
            times = {"": list(results.values())}
            same: dict[Any, list[palpate.Identification]] = {}  # a draw has one P₀ for all sizes
            for size in rig.SAME_COVARIANCES:
                first = chosen().covariance_of(kind, size)
                if first not in same:
                    others = rig.from_starts(contact, kind, starts, initial_covariance=first)
                    same[first] = list(others.values())
                times[f"P₀ = {size:g} "] = same[first]
                errors[size, kind] = [each.prediction_rmse_percent for each in same[first]]
            for which, every in times.items():
                what, apart = f"{which}{kind.method}", 100.0 * rig.spread(every)[-1]
                numbers |= by_symbol(f"time {what}", rig.convergence_times(every), "s", law)
                numbers |= by_symbol(f"spread {what}", apart, "%", law)
            numbers |= _by_start(kind, results, material, curves)
        for size in rig.SAME_COVARIANCES:
            pairs = zip(errors[size, DOUBLE], errors[size, SINGLE], strict=True)
            least = min(double / single for double, single in pairs)
            numbers[f"least double over single P₀ = {size:g} [×]"] = least
        projected = {rig.NO_START: rig.identified(contact, PROJECTION)}
        return numbers | _by_start(PROJECTION, projected, material, curves), curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        grid = figure.subplots(4, len(self._methods), sharex=True, squeeze=False)
        for column, kind in zip(grid.T, self._methods, strict=True):
            _draw_method(column, kind, outcomes[0])

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        def lawful(what: str, kind: rig.Method) -> str:
            return ", ".join(f"{s} = {say(f'{what} {s}')}" for s in kind.law_type.symbols)

        rows = []
        for kind in self._methods:
            for start in rig.names_of_starts(kind):
                what = f"{kind.method} {start}"
                first = lawful(f"start {what}", kind) if kind in self.kinds else ""
                last = lawful(f"final {what}", kind)
                rows.append((kind.method, start, first, say(f"rmse {what}"), last))
        header = ("method", "set", "initial values, SI", "RMSE%", "final values, SI")
        title = f"{self.numerals}: initial values and RMSE%, {self.material}"
        return (Table(title, header, tuple(rows), RMSE),)


def _by_start(
    kind: rig.Method, results: rig.Results, material: str, curves: Curves
) -> dict[str, float]:
    """Return the result from each set of initial values; add its curves to ``curves``."""
    law, known, numbers = kind.law_type, lab.MATERIALS[material], {}
    for start, result in results.items():
        what, final = f"{kind.method} {start}", result.law.parameters
        few = round(FIRST_FEW / result.contact.sample_time)
        numbers[f"rmse {what} [%]"] = result.prediction_rmse_percent
        numbers |= by_symbol(f"final {what}", final, law=law)
        first = rig.taken(result)[:few].min(axis=0) / final
        numbers |= by_symbol(f"first over final {what}", first, "", law)
        if isinstance(known, lab.Homogeneous) and law is type(known.law):
            error = rig.off(final, known.law.parameters)
            numbers |= by_symbol(f"off the truth {what}", error, "%", law)
        curves |= experiment.traced(f"{kind.method}/{start}", result)
    # With a large P₀ the results agree long before they are right.
    settled = np.max([rig.times_to(each, each.law.parameters) for each in results.values()], axis=0)
    return numbers | by_symbol(f"settled {kind.method}", settled, "s", law)


def _draw_method(column: Any, kind: rig.Method, outcome: Outcome) -> None:
    curves, law = outcome.curves, kind.law_type
    shown = {name: f"{kind.method}/{name}" for name in rig.names_of_starts(kind)}
    # The same axes for all Hunt–Crossley methods, for comparison.
    about = "single-stage I" if law is palpate.HuntCrossley else f"{kind.method} low"
    finals = list(named(f"final {about}", outcome.numbers).values())
    # Parameters by row: stiffness, damping, and those that only some laws have.
    order = {"KB": (0, 1), "KBn": (0, 1, 2), "K₁K₂B": (0, 2, 1)}["".join(law.symbols)]
    for axes, i in zip(column, order, strict=False):
        symbol, final = law.symbols[i], finals[i]
        experiment.course(axes, curves, symbol, shown, unit=law.units[i])
        if symbol in ("n", "B", "K₁"):
            ends = {"n": (0.0, 3.0), "B": (-0.5 * final, 2.5 * final), "K₁": (-1500.0, 1500.0)}
            axes.set_ylim(ends[symbol])
        else:
            axes.set(yscale="log", ylim=(BELOW * final, ABOVE * final))
    if len(order) == 2:
        column[2].set_axis_off()
    error = column[3]
    lines = {name: curves[f"{prefix}/error"] for name, prefix in shown.items()}
    experiment.lines(error, curves["elapsed"], lines, linewidth=0.8)
    error.set_yscale("symlog", linthresh=FINE)
    error.set(xscale="log", xlabel="time since contact [s]")
    error.set(ylabel="force error [N]", ylim=(-30.0, 30.0), yticks=(-10, -1, 0, 1, 10))
    name = kind.method.replace("kelvin-voigt", "Kelvin–Voigt").replace("-", " ")
    column[0].set_title(f"HC, {name}" if law is palpate.HuntCrossley else name)
    column[0].legend(loc="upper right", ncols=3, handlelength=1.6, columnspacing=0.9)


def _logarithm(contact: palpate.Contact) -> dict[str, float]:
    """Return convergence times of one model with and without the logarithm, for known n, equal P₀.

    The single stage then is ln F − n ln x = ln K + (B/K) v, and stage 1 of the double stage
    F = K xⁿ + B xⁿ v, with the same samples, initial values and parameters. For comparison also the
    complete models, with P₀ in units in which it is equivalent for both.
    """
    starts, linear = rig.starts_of(contact, SINGLE), rig.starts_of(contact, LINEAR)
    # Set II differs from set I only in n.
    two, alone = {name: starts[name] for name in ("I", "III")}, {"exponent": rig.BALL_LAW.n}
    models = [
        ("with ln", SINGLE, two, alone, rig.SI),
        ("without ln", DOUBLE, two, alone, rig.SI),
        ("with ln, own units", SINGLE, two, alone, OWN),
        ("without ln, own units", DOUBLE, two, alone, OWN),
        # `_Comparison` has the complete models in SI.
        ("single-stage, own units", SINGLE, starts, {}, OWN),
        ("kelvin-voigt, own units", LINEAR, linear, {}, OWN),
    ]
    numbers: dict[str, float] = {}
    for size in rig.SAME_COVARIANCES:
        for words, kind, each, settings, scale in models:
            same = chosen().covariance_of(kind, size) if scale is rig.SI else size
            given: dict[str, Any] = {"initial_covariance": same, "scale": scale, **settings}
            times = rig.convergence_times(rig.from_starts(contact, kind, each, **given).values())
            numbers |= by_symbol(f"time {words}, P₀ = {size:g}", times[:2], "s")
    known = contact.window(rig.START + 1.0)
    power, one = known.penetration**rig.BALL_LAW.n, np.ones_like(known.velocity)
    for words, regressors in {"with ln": one, "without ln": power}.items():
        columns = np.stack((regressors, regressors * known.velocity))
        numbers[f"condition number {words}"] = condition_number(columns)
    return numbers


def condition_number(columns: Floats) -> float:
    """Return the condition number of regressors, one per row, each normalised to unit length."""
    return float(np.linalg.cond(columns / np.linalg.norm(columns, axis=1, keepdims=True)))


def _threshold() -> dict[str, float]:
    """Return the bias by ln(1 + δ) ≈ δ at the limit of condition 10, for data without noise."""
    time = np.arange(rig.START + 0.5, rig.START + 10.0, 1e-3)
    motion = lab.THREE_SINES.at(time)
    x, v = motion.penetration, motion.velocity
    numbers = {"0.1 − ln 1.1": 0.1 - math.log1p(0.1), "−0.1 − ln 0.9": -0.1 - math.log1p(-0.1)}
    for share in SHARES:
        damping = share * rig.BALL_LAW.K / np.abs(v).max()
        law = palpate.HuntCrossley(K=rig.BALL_LAW.K, B=damping, n=rig.BALL_LAW.n)
        force = law.force(x, v)
        contact = palpate.Contact(time, penetration=x, velocity=v, force=force, source="exact")
        bias = rig.off(rig.identified(contact, SINGLE).law.parameters, law.parameters)
        numbers |= by_symbol(f"bias at {share:g} K/B", bias, "%")
    return numbers


def _sampled(whole: palpate.Contact) -> dict[str, float]:
    """Return errors for the same contact, with its pause, sampled at lower rates than 1 kHz."""
    numbers: dict[str, float] = {}
    for step in STEPS:
        channels = {name: getattr(whole, name)[::step] for name in ("time", "penetration", "force")}
        result = rig.identified(palpate.prepare(**channels).window(rig.START), SINGLE)
        error = rig.off(result.law.parameters, rig.BALL_LAW.parameters)
        numbers |= by_symbol(f"error at {1000 // step} Hz", error, "%")
    return numbers


# Fig. 9: how near to the truth the double stage has to start.

MATERIALS = {"ball": lab.BALL, "sponge": lab.SPONGE}
#: Relative errors of the initial values, of all three parameters in either direction.
OFF = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
WAYS = {
    "all more": (1, 1, 1),
    "all less": (-1, -1, -1),
    "n less": (1, 1, -1),
    "n more": (-1, -1, 1),
}
KEEPING_N = {"K and B more": (1, 1, 0), "K and B less": (-1, -1, 0)}
DRAWN = (0.02, 0.1, 0.3)
#: Variants with a smaller P₀, and in units in which penetrations are near 1.
OTHERWISE: dict[str, dict[str, Any]] = {
    "0.1, P₀ = 1e4": {"initial_covariance": (1e4, 1e4, 1e3)},
    "0.1, P₀ = 10": {"initial_covariance": (10.0, 10.0, 10.0)},
    "0.1, in cm": {"scale": palpate.Scale(10e-3, 10e-3, 1.0)},
}
LIMITS = {"K": (0.0, 6000.0), "B": (0.0, 6000.0), "n": (0.6, 1.4)}
#: "≪ 1" in (5), read as in condition 10; the quantity is in N, since x^n is in mⁿ.
MUCH_LESS = 0.1


class _NearTruth(Experiment):
    """K, B and n of the double stage from initial values 2, 10 and 30 % off the truth; the results
    remain different. The numbers are for the worst of four sets of initial values that are off in
    both directions, or of two with the true n.
    """

    def measure(self, seed: int) -> Measured:
        numbers: dict[str, float] = {}
        curves: Curves = {}
        for name, material in MATERIALS.items():
            contact, law = rig.simulated_contact(name, "three-sines", seed), material.law.parameters
            ends = {f"{away:g}": _from(contact, law, away) for away in OFF}
            for words, settings in OTHERWISE.items():
                ends[words] = _from(contact, law, 0.1, **settings)
            ends["0.5, n right"] = _from(contact, law, 0.5, KEEPING_N)
            ends["0.5, single stage"] = _from(contact, law, 0.5, kind=SINGLE)
            for case, results in ends.items():
                final = np.array([result.law.parameters for result in results.values()])
                spread = 100.0 * np.ptp(final, axis=0) / final.mean(axis=0)
                times = rig.convergence_times(results.values())
                numbers |= by_symbol(f"error {name} {case}", rig.off(final, law).max(axis=0), "%")
                numbers |= by_symbol(f"apart {name} {case}", spread, "%")
                numbers |= by_symbol(f"time {name} {case}", times, "s")
            # The largest error of initial values up to which results are within 5 % of each other.
            apart = [number(f"apart {name} {each:g}").of(numbers) for each in OFF]
            agreed = np.logical_and.accumulate(np.array(apart) <= 100.0 * rig.AGREED)
            numbers[f"reach {name} [%]"] = 100.0 * np.max(agreed * OFF)
            near = (each for away in OFF for each in ends[f"{away:g}"].values())
            known = _conditions(contact, law, near)
            numbers |= {f"{name} {words}": value for words, value in known.items()}
            if name == "ball":
                for away in DRAWN:
                    for way, result in ends[f"{away:g}"].items():
                        curves |= experiment.traced(f"{away:g}/{way}", result)
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        grid = figure.subplots(len(UNITS), len(DRAWN))
        for column, away in zip(grid.T, DRAWN, strict=True):
            shown = {way: f"{away:g}/{way}" for way in WAYS}
            truths = zip(UNITS.items(), rig.BALL_LAW.parameters, strict=True)
            for axes, ((symbol, unit), truth) in zip(column, truths, strict=True):
                limits: dict[str, Any] = {"xscale": "log", "ylim": LIMITS[symbol]}
                experiment.course(axes, outcomes[0].curves, symbol, shown, unit=unit, **limits)
                experiment.truth(axes, truth)
            column[0].set_title(f"initial values {100 * away:g} % off")
            column[-1].set(xlabel="time since contact [s]")
        experiment.legend_below(figure, grid[0, 0], 5)


def _from(
    contact: palpate.Contact,
    law: Floats,
    away: float,
    ways: Mapping[str, tuple[int, int, int]] = WAYS,
    kind: rig.Method = DOUBLE,
    **settings: Any,
) -> dict[str, palpate.Identification]:
    """Identify from initial values with a relative error, in several directions."""
    starts = {way: law * (1.0 + away * np.array(signs)) for way, signs in ways.items()}
    laws = {way: palpate.HuntCrossley.from_parameters(start) for way, start in starts.items()}
    return rig.from_starts(contact, kind, laws, **settings)


def _conditions(
    contact: palpate.Contact, truth: Floats, near: Iterable[palpate.Identification]
) -> dict[str, float]:
    """Return whether conditions (5) and (6) hold where the double stage fails, and where not.

    Then enforce them: stage 2 with the true K and B, stage 1 with the true n.
    """
    starts = rig.starts_of(contact, DOUBLE)
    stiffness, damping, exponent = truth.tolist()
    right = {
        name: palpate.HuntCrossley(K=stiffness, B=damping, n=law.parameters[2])
        for name, law in starts.items()
    }
    # A P₀ this small fixes K and B.
    held = {"initial_covariance": (1e-12, 1e-12, 1e3)}
    ends = {
        "starts I to III": rig.from_starts(contact, DOUBLE, starts),
        "K and B given": rig.from_starts(contact, DOUBLE, right, **held),
        "n given": rig.from_starts(contact, DOUBLE, starts, exponent=exponent),
    }
    ending_right = [each for each in near if _worst(each, truth) <= 100.0 * rig.AGREED]
    seen = {"starts I to III": ends["starts I to III"].values(), "near, ending right": ending_right}
    numbers: dict[str, float] = {}
    for words, results in seen.items():
        met = np.array([_broken(each, truth) for each in results] or [(math.nan, math.nan)])
        numbers[f"(5) broken, {words} [%]"], numbers[f"(6) one-sided, {words}"] = met.min(axis=0)
    for words, by_start in ends.items():
        numbers[f"ends apart, {words} [%]"] = 100.0 * rig.spread(by_start.values())[-1].max()
        numbers[f"off the truth, {words} [%]"] = max(_worst(r, truth) for r in by_start.values())
    # The result of stage 1 with the true n, and with n too large by 0.2.
    numbers["0.01^0.2"] = 0.01**0.2
    for words, more in {"n right": 0.0, "n 0.2 too large": 0.2}.items():
        result = rig.identified(contact, DOUBLE, exponent=exponent + more)
        numbers[f"stage 1 rmse, {words} [%]"] = result.prediction_rmse_percent
        numbers[f"stage 1 K, {words} [× the truth]"] = result.law.parameters[0] / stiffness
    return numbers


def _worst(result: palpate.Identification, truth: Floats) -> float:
    return float(rig.off(result.law.parameters, truth).max())


def _broken(result: palpate.Identification, truth: Floats) -> tuple[float, float]:
    """Return violations of (5), %, and |mean|/mean|…| of the product in (6), 0 if it holds."""
    inside, contact = result.trace.taken, result.contact
    x, v = contact.penetration[inside], contact.velocity[inside]
    stiffness, damping, exponent = (truth - rig.taken(result)).T
    rate = (stiffness + damping * v) * x ** truth[2]
    product = exponent * rate
    one_sided = abs(product.mean()) / np.abs(product).mean()
    return 100.0 * float(np.mean(np.abs(rate) > MUCH_LESS)), float(one_sided)


THREE, RELAXING = (SINGLE, DOUBLE, LINEAR), "relaxing-sponge"
FOUR = (*THREE, palpate.ExtendedKelvinVoigtRLS)
FORGETTING = "Rubber ball, single stage: forgetting factor and initial covariance"
NEAR = "Rubber ball, double stage: initial values near the final values"
ONE_RECORDING = "{}: three sets of initial values, {} methods, one recording (Tables {} and {})"
BALL = ONE_RECORDING.format("Rubber ball", "four", "I", "II")
SPONGE = ONE_RECORDING.format("Sponge", "four", "III", "IV")
PHANTOM = ONE_RECORDING.format("PVC phantom", "five", "V", "VI")
EXPERIMENTS = (
    _Forgetting("fig07", (10.5, 10.0), FORGETTING),
    _Comparison("fig08", (11.4, 9.0), BALL, "ball", THREE, "Tables I and II"),
    _Comparison("fig13", (11.4, 9.0), SPONGE, "sponge", THREE, "Tables III and IV", RELAXING),
    _Comparison("fig16", (14.0, 9.0), PHANTOM, "pvc", FOUR, "Tables V and VI"),
    _NearTruth("fig09", (10.5, 6.6), NEAR),
)
