"""Trials: how the rig follows the motion, repetitions, and when condition 10 holds."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

import palpate
from palpate import lab
from paper import experiment
from paper.experiment import (
    LABELS,
    THEME,
    UNITS,
    Axes,
    Curves,
    Experiment,
    Figure,
    Floats,
    Measured,
    Outcome,
    by_symbol,
)
from paper.rig import GATE, START, identified, off, session, simulated_contact, truth_of

MATERIALS = ("ball", "sponge", "pvc")
REPETITIONS, THREE = 3, (10.5, 4.0)
METHODS: Mapping[str, type[palpate.ContactEstimator]] = {
    "single-stage": palpate.SingleStageRLS,
    "variable-projection": palpate.VariableProjection,
    "double-stage": palpate.DoubleStageRLS,
}
#: The condition "holds from" a time if it then holds for this long without a break, s: more than a
#: period of the slowest sine, 1.57 s. The paper claims 300 ms for PVC despite violations at 8.7 s.
UNBROKEN = 2.0
# The paper gives neither P₀ nor the smallest force of a sample.
COVARIANCES = (10.0, 1e3, 1e5)
GATES = {"ours": GATE, "every positive force": palpate.ContactGate()}
# Factors by which the sponge is pressed more slowly, for the paper's claims about speed.
SLOWER = (1.0, 2.0, 5.0, 10.0)


class _Followed(Experiment):
    """Penetration over time, commanded and reached in the ball, the sponge and the PVC phantom.
    Below: lag behind the command, with the range over the seeds.
    """

    def measure(self, seed: int) -> Measured:
        period: Floats = np.arange(0.0, 2.0 * np.pi, 1e-4)  # of the sines, s
        speed = np.abs(lab.THREE_SINES.motion.at(period)[1]).max()
        numbers: dict[str, float] = {"peak speed commanded [mm/s]": 1e3 * speed}
        curves: Curves = {}
        for name in MATERIALS:
            measured = session(name, "three-sines", seed)
            truth, contact, command = measured.truth, measured.contact, measured.command
            whole = truth.time >= lab.THREE_SINES.pause + lab.THREE_SINES.approach
            depth = truth.penetration[whole]
            lag = command.penetration[whole] - depth
            found = identified(contact.window(START), palpate.VariableProjection)
            relative = found.estimate.standard_errors / found.law.parameters
            bias = np.mean(contact.force[whole] - truth.force[whole])
            numbers |= {
                f"mean depth {name} [mm]": 1e3 * depth.mean(),
                f"least depth {name} [mm]": 1e3 * depth.min(),
                f"peak speed {name} [mm/s]": 1e3 * np.abs(truth.velocity[whole]).max(),
                f"rms lag {name} [mm]": 1e3 * float(np.sqrt(np.mean(lag**2))),
                f"peak force {name} [N]": truth.force.max(),
                f"bias left {name} [mN]": 1e3 * float(bias),
                f"largest error {name} [%]": 100.0 * relative.max(),
            }
            rendered = np.flatnonzero(truth.time >= START - 0.2)
            rendered = rendered[experiment.thinned(truth.time[rendered])]
            curves["time"] = truth.time[rendered]
            curves["command"] = 1e3 * command.penetration[rendered]
            curves[name] = 1e3 * truth.penetration[rendered]
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        first = outcomes[0].curves
        time = np.array(first["time"])
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
        upper.plot(time, first["command"], color=THEME.ink, linewidth=2.2, label="command")
        for name, colour in zip(MATERIALS, THEME.lines, strict=False):
            upper.plot(time, first[name], color=colour, linewidth=0.9, label=LABELS[name])
            lags = np.array([np.subtract(o.curves["command"], o.curves[name]) for o in outcomes])
            low, high = lags.min(axis=0), lags.max(axis=0)
            lower.fill_between(time, low, high, color=colour, alpha=0.35, linewidth=0)
            lower.plot(time, lags[0], color=colour, linewidth=0.9)
        experiment.truth(upper, 0.0, label=None)
        upper.set(ylabel="penetration [mm]", title="Into the material", ylim=(-1.5, 18.5))
        upper.legend(loc="upper right", ncols=4)
        lower.set(xlabel="time [s]", ylabel="lag [mm]", title="Command minus what was reached")
        lower.set_xlim(time[0], time[-1])


@dataclass(frozen=True)
class _Repetitions(Experiment):
    """Stiffness, damping and exponent over time in three repetitions by the single stage, and in
    the first repetition also by variable projection. Dotted: the truth.
    """

    material: str
    beside: tuple[str, ...] = ()
    group: str = field(default="pressed three times", kw_only=True)

    def measure(self, seed: int) -> Measured:
        numbers: dict[str, float] = {}
        curves: Curves = {}
        seeds = [REPETITIONS * seed + i for i in range(REPETITIONS)]
        for material in (self.material, *self.beside):
            contacts = [simulated_contact(material, "three-sines", each) for each in seeds]
            for method, kind in METHODS.items():
                results = [identified(contact, kind) for contact in contacts]
                values = np.array([result.law.parameters for result in results])
                mean = values.mean(axis=0)
                spread = 100.0 * np.ptp(values, axis=0) / np.abs(mean)
                numbers |= by_symbol(f"spread {material} {method}", spread, "%")
                if material != self.material:
                    continue
                numbers |= by_symbol(f"mean final {method}", mean)
                numbers[f"B/K {method} [s/m]"] = mean[1] / mean[0]
                rendered = experiment.thinned(contacts[0].time)
                curves["time"] = contacts[0].time[rendered]
                for k, result in enumerate(results):
                    errors = result.estimate.standard_errors
                    numbers |= by_symbol(f"final {method} {k}", result.law.parameters)
                    numbers |= by_symbol(f"standard error {method} {k}", errors)
                    # Draw all repetitions of the single stage, only the first of the others.
                    if method == "single-stage" or k == 0:
                        curves |= experiment.courses(f"{method} {k}", result, rendered)
            truth = session(material, "three-sines", seeds[0]).truth.window(3.0)
            # The amplitude that the rig reached.
            numbers[f"motion {material} [mm]"] = 1e3 * float(np.std(truth.penetration))
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        axes = figure.subplots(1, 3)
        titles, truths = ("stiffness", "damping", "exponent"), truth_of(self.material)
        curves, time = outcomes[0].curves, np.array(outcomes[0].curves["time"])
        for panel, symbol, title, truth in zip(axes, UNITS, titles, truths, strict=True):
            label = f"{symbol} [{UNITS[symbol]}]" if UNITS[symbol] else symbol
            lines = {
                f"single stage, {k + 1}": curves[f"single-stage {k}/{symbol}"]
                for k in range(REPETITIONS)
            }
            experiment.lines(panel, time, lines, linestyle="-", linewidth=1.1)
            lines["variable projection, 1"] = projected = curves[f"variable-projection 0/{symbol}"]
            looks = {"color": THEME.ink, "linewidth": 1.1}
            panel.plot(time, projected, "--", label="variable projection, 1", **looks)
            experiment.truth(panel, truth)
            # Scale the axis to three times the range after the first second.
            settled = np.abs(np.array([*lines.values()])[:, time > time[0] + 1.0] - truth)
            reach = 3.0 * float(np.nanmax(settled, initial=0.02 * abs(truth)))
            panel.set(ylim=(truth - reach, truth + reach), xlim=(time[0], time[-1]))
            panel.set(title=title, ylabel=label, xlabel="time [s]")
        experiment.legend_below(figure, axes[0], 5)


@dataclass(frozen=True)
class _Condition(Experiment):
    """Speed over time in contact, and the limit 0.1 K/B of condition 10 from the current
    estimates of the single stage and of variable projection, and from the truth if there is one.
    Left: the first second. Right: the whole contact. Band: range of the single stage's limit over
    the seeds. The condition counts as fulfilled once it holds for 2 s without a break.
    """

    materials: tuple[str, ...]  # one row of the figure each

    def measure(self, seed: int) -> Measured:
        numbers: dict[str, float] = {}
        curves: Curves = {}
        for name in self.materials:
            contact = simulated_contact(name, "three-sines", seed)
            single = identified(contact, palpate.SingleStageRLS)
            projected = identified(contact, palpate.VariableProjection)
            numbers |= _when(name, single) | _otherwise(name, contact)
            rendered = experiment.thinned(contact.time)
            speed = np.where(single.trace.taken, 1e3 * np.abs(contact.velocity), np.nan)
            curves |= {f"{name}/time": contact.time[rendered], f"{name}/speed": speed[rendered]}
            for result in (single, projected):
                stiffness, damping = np.abs(experiment.course_of(result)[rendered, :2]).T
                limit = 100.0 * stiffness / np.where(damping > 0.0, damping, np.nan)  # mm/s
                curves[f"{name}/{result.estimator.method}"] = limit
        for slower in SLOWER if "sponge" in self.materials else ():
            numbers |= _slowed(seed, slower)
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        axes = figure.subplots(len(self.materials), 2, squeeze=False, width_ratios=(1.0, 2.0))
        for (left, right), name in zip(axes, self.materials, strict=True):
            for panel in (left, right):
                _draw_limits(panel, outcomes, name)
            start = outcomes[0].numbers[f"contact at {name} [s]"]
            left.set(xlim=(start - 0.03, start + 1.0), title=LABELS[name], ylabel="speed [mm/s]")
            right.set(xlim=(start, 12.0))
        for panel in axes[-1]:
            panel.set(xlabel="time [s]")
        experiment.legend_below(figure, axes[0, 1], 4)


def _margin(result: palpate.Identification) -> Floats:
    return result.trace.validity_margin[result.trace.taken]


def _broken(margin: Floats) -> float:
    """Return the percentage of samples that violate the condition."""
    return 100.0 * float(np.mean(margin <= 0.0))


def _when(name: str, result: palpate.Identification) -> dict[str, float]:
    """Return when condition 10 holds, and speeds relative to its limit."""
    contact, taken = result.contact, result.trace.taken
    time, margin, speed = contact.time[taken], _margin(result), np.abs(contact.velocity[taken])
    least = int(np.argmin(np.where(time > time[0] + UNBROKEN, margin, np.inf)))
    near = np.abs(time - 8.7) <= 0.2
    final = 0.1 * result.law.parameters[0] / abs(result.law.parameters[1])
    after = _holds_from(time, margin)
    settled = time >= time[0] + (after if math.isfinite(after) else 0.0)
    return {
        f"contact at {name} [s]": time[0],
        f"holds from {name} [ms]": 1e3 * after,
        f"seconds until it holds {name} [s]": after,
        f"broken {name} [%]": _broken(margin),
        f"broken after that {name} [%]": _broken(margin[settled]),
        f"fastest after 5 s {name} [× the limit]": 1.0 - margin[time > time[0] + 5.0].min(),
        f"fastest after 2 s {name} [× the limit]": 1.0 - margin[least],
        f"fastest after 2 s is at {name} [s]": time[least],
        f"broken about 8.7 s {name} [samples]": np.count_nonzero(margin[near] <= 0.0),
        f"fastest about 8.7 s {name} [× the limit]": 1.0 - margin[near].min(),
        f"peak speed {name} [mm/s]": 1e3 * speed.max(),
        f"final limit {name} [mm/s]": 1e3 * final,
        f"faster than the final limit {name} [%]": 100.0 * np.mean(speed >= final),
    }


def _holds_from(time: Floats, margin: Floats) -> float:
    """Return the time since the first sample, s, from which the margin stays positive, or NaN."""
    ends = np.append(time[0], time[np.flatnonzero(margin <= 0.0)])
    free = np.append(ends[1:], time[-1]) - ends
    unbroken = np.flatnonzero(free >= UNBROKEN)
    return float(ends[unbroken[0]] - time[0]) if unbroken.size else math.nan


def _otherwise(name: str, contact: palpate.Contact) -> dict[str, float]:
    """Return the same numbers for other settings that the paper does not specify."""
    numbers = {}
    for covariance in COVARIANCES:
        for words, gate in GATES.items():
            settings = {"initial_covariance": covariance, "gate": gate}
            result = identified(contact, palpate.SingleStageRLS, **settings)
            margin, what = _margin(result), f"P₀ = {covariance:g}, {words} {name}"
            after = _holds_from(contact.time[result.trace.taken], margin)
            numbers[f"holds from {what} [ms]"] = 1e3 * after
            numbers[f"broken {what} [%]"] = _broken(margin)
    return numbers


def _slowed(seed: int, slower: float) -> dict[str, float]:
    """Return errors of the sponge's K, B and n, and violations of condition 10 after 2 s."""
    motion = lab.THREE_SINES.motion
    slowed = replace(motion, frequencies=tuple(f / slower for f in motion.frequencies))
    contact = simulated_contact("sponge", replace(lab.THREE_SINES, motion=slowed), seed)
    result, truth = identified(contact, palpate.SingleStageRLS), truth_of("sponge")
    settled = _margin(result)[round(UNBROKEN / contact.sample_time) :]
    signed = 100.0 * (result.law.parameters / truth - 1.0)
    return {
        f"broken, {slower:g} times slower [%]": _broken(settled),
        **by_symbol(f"error {slower:g} times slower", signed, "%"),
        f"worst error, {slower:g} times slower [%]": off(result.law.parameters, truth).max(),
    }


def _draw_limits(axes: Axes, outcomes: Sequence[Outcome], name: str) -> None:
    first = outcomes[0].curves
    time, speed = np.array(first[f"{name}/time"]), np.array(first[f"{name}/speed"])
    axes.plot(time, speed, color=THEME.measured, linewidth=1.0, label="|v|")
    limits = np.array([outcome.curves[f"{name}/single-stage"] for outcome in outcomes])
    low, high = np.fmin.reduce(limits), np.fmax.reduce(limits)
    axes.fill_between(time, low, high, color=THEME.lines[1], linewidth=0.0, alpha=0.3)
    experiment.lines(axes, time, {"0.1 K/B, single stage": limits[0]}, first=1, linestyle="-")
    projected = {"0.1 K/B, variable projection": first[f"{name}/variable-projection"]}
    experiment.lines(axes, time, projected, linestyle="--", linewidth=1.1)
    described = lab.MATERIALS[name].describe()
    if described["kind"] == "hunt-crossley":
        experiment.truth(axes, 100.0 * described["K"] / described["B"])
    axes.set_ylim(0.0, 2.6 * float(np.nanmax(speed)))


EXPERIMENTS = (
    _Followed("fig03", (9.5, 6.0), "The trajectory, and the motion of the rig"),
    _Repetitions("fig05", THREE, "Rubber ball, three repetitions", "ball"),
    _Repetitions("fig11", THREE, "Sponge, three repetitions", "sponge"),
    _Repetitions("fig14", THREE, "PVC phantom, three repetitions", "pvc", ("ball", "sponge")),
    _Condition("fig06", (10.5, 3.8), "Rubber ball, condition 10", ("ball",)),
    _Condition("fig12", (10.5, 6.7), "Sponge, condition 10", ("sponge", "relaxing-sponge")),
    _Condition("fig15", (10.5, 3.8), "PVC phantom, condition 10", ("pvc",)),
)
