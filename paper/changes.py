"""Fig. 19 and section VII: a probe that moves between a soft and a hard zone in contact."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import palpate
from palpate import lab
from paper import experiment
from paper.experiment import (
    THEME,
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
from paper.rig import (
    AGREED,
    GATE,
    START,
    Method,
    ideal_contact,
    identified,
    off,
    simulated_contact,
)

SECONDS = 27.0
#: A change takes half a second about its middle.
SHIFTING = 0.25
#: Time that the probe stays in a zone, and times at which it changes zones, s.
STAY = lab.PALPATION.dwell
CHANGES = tuple(START + k * STAY for k in (1, 2, 3, 4))
#: The error has recovered if its mean over WINDOW samples is below FLOOR, N, twice the force noise.
WINDOW, FLOOR = 5, 0.1
#: One of so many samples is drawn.
EVERY = 50
#: Samples drawn before and after a change.
BEFORE, AFTER = 5, 30
#: The paper's γ, N⁻², in the interpretation that works.
SENSITIVITY = 2.5
#: Values of β, and of the hard zone's relative stiffness, for the study of one against the other.
GAINS = (0.005, 0.05, 0.5, 5.0)
CONTRASTS = {"1.3 times": 0.3, "twice": 1.0, "ten times": 9.0}
#: Time in a zone, s, in that study, which needs many runs: one zone before and two after.
SHORT = 2.0
SINGLE, PERTURBED = palpate.SingleStageRLS, palpate.SelfPerturbation(0.05, SENSITIVITY)
METHODS: dict[str, tuple[Method, dict[str, Any]]] = {
    "regular": (SINGLE, {}),
    "self-perturbing": (SINGLE, {"perturbation": PERTURBED}),
    "constants exchanged": (SINGLE, {"perturbation": palpate.SelfPerturbation(2.5, 0.05)}),
    "γ = 0.1": (SINGLE, {"perturbation": palpate.SelfPerturbation(0.05, 0.1)}),
    # At the first change λ is 1 to within 1e-13 anyway, so only the reset differs.
    "no reset": (SINGLE, {"perturbation": PERTURBED, "forgetting": palpate.ConstantForgetting()}),
    "λ = 0.99": (SINGLE, {"forgetting": palpate.ConstantForgetting(0.99)}),
    "variable projection": (
        palpate.VariableProjection,
        {"change_detector": palpate.ChangeDetector()},
    ),
}
SHOWN = {
    "regular": "regular",
    "self-perturbing": "self-perturbing",
    "variable projection": "variable projection with change detection",
}


def stiffer(by: float) -> lab.Homogeneous:
    """Return a phantom whose stiffness and damping are larger by a fraction."""
    stiffness, damping, exponent = lab.PVC.law.parameters.tolist()
    law = palpate.HuntCrossley(K=(1.0 + by) * stiffness, B=(1.0 + by) * damping, n=exponent)
    return lab.Homogeneous(law)


def palpation(depth: float, share: float) -> lab.Palpation:
    """Return the palpation about a depth, m, with a share of the amplitudes of the three sines."""
    sines = lab.THREE_SINES.motion
    motion = replace(sines, depth=depth, amplitudes=tuple(share * a for a in sines.amplitudes))
    return replace(lab.PALPATION, probing=lab.Probing(motion))


#: Mean depth over the bar, m: the paper's lies 7 mm below the surface.
DEPTH = 4e-3
BAR = ", over a bar"


@dataclass(frozen=True)
class Case:
    """A phantom with two zones, the motion, and where stiffness is compared (None: by K)."""

    material: str
    motion: lab.Palpation
    hard: lab.Material
    title: str
    at: float | None = None


#: By the ending of the numbers' names.
CASES = {
    "": Case("soft-and-hard", lab.PALPATION, lab.INCLUSION, "three times as stiff"),
    BAR: Case(
        "soft-and-bar", palpation(DEPTH, 0.3), lab.OVER_BAR, "a bar 7 mm below the surface", DEPTH
    ),
}
#: Second zones and motions that give about the same errors, for an ideal probe: depth, m, share of
#: the sines' amplitudes, and zone.
ALIKE: dict[str, tuple[float, float, lab.Material]] = {
    "the bar, 4 mm": (DEPTH, 0.3, lab.OVER_BAR),
    "felt more, 3.5 mm": (3.5e-3, 0.3, replace(lab.OVER_BAR, influence=0.48)),
    "felt less, 5.5 mm": (5.5e-3, 0.3, replace(lab.OVER_BAR, influence=1.37)),
    "no bar but 7 % stiffer, 10 mm": (10e-3, 1.0, stiffer(0.07)),
}

ALIKE_NOTE = (
    "The paper gives errors but neither the depth of the probe nor its force in either zone, and "
    "its Fig. 19(c) is lost. A bar that is felt more, pressed less deeply, and even a zone "
    "without a bar give the errors of its text alike, so the figure determines neither how much "
    "the bar stiffens its zone nor that it does so with depth; the peak force of the second zone "
    "would. That the parameters are constant after 10 s speaks for a small difference and a deep "
    "probe."
)


def palpated(
    zone: lab.Material, seed: int, seconds: float, motion: lab.Palpation = lab.PALPATION
) -> palpate.Contact:
    """Return an ideal probe's contact with a phantom that has another zone."""
    return ideal_contact(lab.SpaceVaryingMaterial((lab.PVC, zone), (0.0,)), motion, seed, seconds)


def stiffness_of(material: lab.Material, at: float | None) -> float:
    """Return the stiffness ∂F/∂x at a depth, m, of a material pressed slowly; None: its K."""
    if at is None:
        return float(material.describe()["K"])
    depth, zero = at + np.array([-1e-6, 1e-6]), np.zeros(2)
    return float(np.diff(material.force(zero, zero, depth, zero))[0] / 2e-6)


def stiffness_by(parameters: Floats, at: float | None) -> Floats:
    """Return the same by estimates of K, B and n, shape (k, 3)."""
    stiffness, _, exponent = parameters.T
    return np.asarray(stiffness if at is None else exponent * stiffness * at ** (exponent - 1.0))


class _Intermittent(Experiment):
    """K, B, n, force error and penetration over time while the probe changes between two zones
    every five seconds: left for a zone three times as stiff as the first, right for a rigid bar 7
    mm below the surface, as in the paper. Bottom: force error around a change, mean of the four
    changes. The regular single stage does not follow the change, the self-perturbing one does. Mean
    errors exclude half a second around each change. The error has recovered when its mean over 5 ms
    first falls below 0.1 N; K has when it stays within 5 % of the truth until the next change.
    Above the bar no K is true, so the stiffness at 4 mm stands for it. Self-perturbation has
    β = 0.05, γ = 2.5 N⁻².
    """

    def measure(self, seed: int) -> Measured:
        contacts = {
            which: simulated_contact(case.material, case.motion, seed, SECONDS)
            for which, case in CASES.items()
        }
        # β = 0.05, γ = 2.5 N⁻²: NINT rounds, so an error perturbs from γ e² = 0.5.
        numbers: dict[str, float] = {"error that perturbs [N]": np.sqrt(0.5 / SENSITIVITY)}
        curves: Curves = {}
        for which, contact in contacts.items():
            curves[f"time{which}"] = contact.time[::EVERY]
            curves[f"penetration{which}"] = 1e3 * contact.penetration[::EVERY]
            for name, (kind, settings) in METHODS.items():
                result = identified(contact, kind, **settings)
                trace = result.trace
                error = np.abs(contact.force - trace.predicted_force)
                error = np.where(trace.taken, error, np.nan)
                numbers |= _summary(f"{name}{which}", result, error, CASES[which])
                if kind is SINGLE:
                    numbers |= _corrected(f"{name}{which}", result)
                if name in SHOWN:
                    curves |= _curves(f"{name}{which}", result, np.nan_to_num(error))
        return numbers | _alike(seed) | _times_by_gain(seed) | _thresholds(seed), curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        grid = figure.subplots(6, 2, height_ratios=(1.0, 1.0, 1.0, 1.2, 0.7, 1.2))
        for column, (which, case) in zip(grid.T, CASES.items(), strict=True):
            _draw_zones(column, outcomes[0].curves, which, case.hard)
            column[0].set_title(f"second zone: {case.title}", loc="left", fontsize=10)
        experiment.legend_below(figure, grid[0, 0], 3)

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        rows = []
        for words in ALIKE:
            after = (say(f"mean error after change regular, {words} {k}") for k in (1, 2, 3, 4))
            perturbed = say(f"largest mean error after a change self-perturbing, {words}")
            constancy = say(f"range of K, {words}")
            rows.append((words, say(f"peak force, {words}"), *after, constancy, perturbed))
        header = ("second zone, mean depth", "peak force", "zone 2", "zone 1", "zone 2", "zone 1")
        title = "Second zones that suit Fig. 19: mean error of the regular single stage by visit"
        return (
            Table(title, (*header, "K after 10 s", "self-perturbing"), tuple(rows), ALIKE_NOTE),
        )


def _draw_zones(
    column: Any, curves: Mapping[str, list[float]], which: str, hard: lab.Material
) -> None:
    """Draw a phantom's parameters, force error, penetration, and the error around a change."""
    laws = [each.law.parameters for each in (lab.PVC, hard) if isinstance(each, lab.Homogeneous)]
    truths = zip(*laws, strict=True)
    shown = {label: f"{name}{which}" for name, label in SHOWN.items()}
    clock = f"time{which}"
    for axes, (symbol, unit), known in zip(column, UNITS.items(), truths, strict=False):
        looks: dict[str, Any] = {"ylim": (0.0, 1.5 * max(known))}
        if which and symbol != "n":  # they grow with n, by a power of the depth in metres
            looks = {"yscale": "log", "ylim": (0.3 * min(known), 300.0 * max(known))}
        experiment.course(axes, curves, symbol, shown, clock=clock, unit=unit, **looks)
        for value in known:
            experiment.truth(axes, value, None)
    errors = {name: curves[f"{name}{which}/error"] for name in SHOWN}
    size = len(next(iter(errors.values())))
    experiment.lines(column[3], curves[clock][:size], errors, linewidth=0.9)
    column[3].set(ylabel="|force error| [N]\nlargest of 50 ms")
    penetration = curves[f"penetration{which}"]
    column[4].plot(curves[clock], penetration, color=THEME.measured, linewidth=0.9)
    column[4].set(ylabel="penetration [mm]", xlabel="time [s]")
    for axes in column[:5]:
        axes.set_xlim(START, SECONDS)
        for a, b in zip(CHANGES[::2], CHANGES[1::2], strict=True):
            axes.axvspan(a, b, color=THEME.grid, alpha=0.5, linewidth=0)
    moments = {name: curves[f"{name}{which}/change"] for name in SHOWN}
    experiment.lines(column[5], np.arange(-BEFORE, AFTER), moments, marker=".")
    column[5].set(xlabel="time since a change [ms]", ylabel="|force error| [N]\nmean of four")
    for axes in (column[3], column[5]):
        axes.set(yscale="log", ylim=(0.01, 60.0))


def _summary(
    name: str, result: palpate.Identification, error: Floats, case: Case
) -> dict[str, float]:
    """Return force errors and parameters in each zone, and recovery times of the error."""
    time, trace = result.contact.time, result.trace
    first = error[trace.taken][:20]
    late = trace.parameters[(time > 10.0) & trace.taken]
    span = 100.0 * np.ptp(late, axis=0) / np.abs(late.mean(axis=0))
    numbers = {
        f"first error {name} [N]": np.max(first),
        f"first error lasts {name} [ms]": np.count_nonzero(first > 4.0 * FLOOR),
        **{f"alarm {name} {k} [s]": time for k, time in enumerate(result.changes, 1)},
        **by_symbol(f"range after 10 s {name}", span, "%"),
        f"time of K {name} [ms]": _time_of_stiffness(result, case.hard, case.at),
    }
    for k, (start, end) in enumerate(itertools.pairwise((START, *CHANGES, SECONDS))):
        zone = np.flatnonzero((time > start + SHIFTING) & (time < end - SHIFTING))
        when = f"after change {name} {k}" if k else f"before {name}"
        last, touched = trace.parameters[zone[-1:]], (lab.PVC, case.hard)[k % 2]
        numbers[f"mean error {when} [N]"] = np.nanmean(error[zone])
        numbers |= by_symbol(f"end of visit {k} {name}", last[0], "")
        ends = off(stiffness_by(last, case.at), stiffness_of(touched, case.at))
        numbers[f"K off at a zone's end {name} {k} [%]"] = ends[0]
    backs, firsts = [], []
    for k, change in enumerate(CHANGES, 1):
        start = int(np.searchsorted(time, change))
        since = np.nan_to_num(error[start : start + 4000])
        # Start at the first sample within 20 ms that shows the change.
        since = since[int(np.argmax(since[:20] > FLOOR)) :]
        mean = np.convolve(since, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
        back = np.flatnonzero(mean < FLOOR)
        backs.append(1e3 * result.contact.sample_time * back[0] if back.size else np.nan)
        firsts.append(since[:2])
        numbers[f"back {name} {k} [ms]"] = backs[-1]
    numbers[f"mean back {name} [ms]"] = np.mean(backs)
    numbers[f"first 2 ms {name} [N]"] = np.mean(firsts)
    return numbers


def _curves(name: str, result: palpate.Identification, error: Floats) -> Curves:
    # The largest of each 50 samples, so that thinning keeps every peak.
    blocks = error[: len(error) // EVERY * EVERY].reshape(-1, EVERY)
    starts = (int(np.searchsorted(result.contact.time, change)) for change in CHANGES)
    changes = [error[start - BEFORE : start + AFTER] for start in starts]
    return {
        **experiment.courses(name, result, np.s_[::EVERY]),
        f"{name}/error": blocks.max(axis=1),
        f"{name}/change": np.mean(changes, axis=0),
    }


def correction(result: palpate.Identification) -> tuple[Floats, Floats]:
    """Return times, and the percentage of its own error that each sample corrects: φᵀΔθ/e = φᵀL.

    For the single stage by eqs. 12 and 13: φᵀL = φᵀPφ/(λ + φᵀPφ), so it measures P along the
    regressor.
    """
    taken, contact = result.trace.taken, result.contact
    stiffness, damping, exponent = result.trace.parameters[taken].T
    known = np.stack([np.log(stiffness), damping / stiffness, exponent])
    depth, speed = contact.penetration[taken][1:], contact.velocity[taken][1:]
    regressor = np.stack([np.ones_like(depth), speed, np.log(depth)])
    error = np.log(contact.force[taken][1:]) - np.sum(regressor * known[:, :-1], axis=0)
    corrected = 100.0 * np.sum(regressor * np.diff(known), axis=0) / error
    return contact.time[taken][1:], corrected


def _corrected(name: str, result: palpate.Identification) -> dict[str, float]:
    """Return the largest correction at first, just before the first change, and after each."""
    time, share = correction(result)

    def most(start: float, seconds: float) -> float:
        return float(share[(time >= start) & (time < start + seconds)].max())

    numbers = {
        f"corrected at first {name} [%]": share[:5].max(),
        f"corrected before a change {name} [%]": most(CHANGES[0] - 0.5, 0.5),
    }
    for k, change in enumerate(CHANGES, 1):
        numbers[f"corrected after a change {name} {k} [%]"] = most(change, SHIFTING)
    return numbers


def _time_of_stiffness(
    result: palpate.Identification,
    hard: lab.Material,
    at: float | None,
    changes: tuple[float, ...] = CHANGES,
) -> float:
    """Return the time, ms, until K, or the stiffness at a depth, stays within 5 % until the next
    change; mean of the changes.
    """
    time, times = result.contact.time, []
    for k, (start, end) in enumerate(itertools.pairwise((*changes, np.inf)), 1):
        there = stiffness_by(result.trace.parameters[(time >= start) & (time < end)], at)
        outside = np.abs(there / stiffness_of((lab.PVC, hard)[k % 2], at) - 1.0) > AGREED
        last = np.flatnonzero(outside)
        times.append(np.nan if outside[-1] else 1.0 + (last[-1] if last.size else -1.0))
    return 1e3 * result.contact.sample_time * float(np.mean(times))


def _alike(seed: int) -> dict[str, float]:
    """Return errors, and the range of K after 10 s, in second zones that suit the paper."""
    numbers: dict[str, float] = {}
    for words, (depth, share, zone) in ALIKE.items():
        contact = palpated(zone, seed, SECONDS, palpation(depth, share))
        numbers[f"peak force, {words} [N]"] = contact.force.max()
        for name in ("regular", "self-perturbing"):
            kind, settings = METHODS[name]
            result = identified(contact, kind, **settings)
            trace, time = result.trace, contact.time
            error = np.abs(contact.force - trace.predicted_force)
            errors = [
                float(np.mean(error[trace.taken & (time > a + SHIFTING) & (time < b - SHIFTING)]))
                for a, b in itertools.pairwise((*CHANGES, SECONDS))
            ]
            if name == "regular":
                late = trace.parameters[trace.taken & (time > 10.0), 0]
                numbers[f"range of K, {words} [%]"] = 100.0 * np.ptp(late) / late.mean()
                numbers |= {
                    f"mean error after change regular, {words} {k} [N]": each
                    for k, each in enumerate(errors, 1)
                }
            else:
                most = f"largest mean error after a change {name}, {words} [N]"
                numbers[most] = max(errors)
    return numbers


def _times_by_gain(seed: int) -> dict[str, float]:
    """Return the recovery time of K for each β and difference of the zones."""
    numbers: dict[str, float] = {}
    first, second, end = (START + k * SHORT for k in (1, 2, 3))
    for words, by in CONTRASTS.items():
        hard = stiffer(by)
        contact = palpated(hard, seed, end, replace(lab.PALPATION, dwell=SHORT))
        for gain in GAINS:
            perturbation = palpate.SelfPerturbation(gain, SENSITIVITY)
            result = identified(contact, SINGLE, perturbation=perturbation)
            time = _time_of_stiffness(result, hard, None, (first, second))
            numbers[f"K back with β = {gain:g}, {words} [ms]"] = time
    return numbers


def _thresholds(seed: int) -> dict[str, float]:
    """Tap a phantom, and detect contact by any positive force or by our force threshold."""
    run = lab.Bench(lab.PVC, lab.TAPPING, lab.IdealProbe()).run(seed, seconds=12.0)
    contact, inside = run.contact.window(START), run.truth.window(START).penetration > 0.0
    numbers: dict[str, float] = {}
    for least in (0.0, GATE.make_force):
        what, touching = f"force above {least:g} N", contact.force > least
        result = identified(contact, SINGLE, gate=palpate.ContactGate(make_force=least))
        error = off(result.law.parameters, lab.PVC.law.parameters)
        numbers[f"free, but {what} [%]"] = 100.0 * float(np.mean(touching[~inside]))
        numbers[f"contact misjudged by {what} [%]"] = 100.0 * float(np.mean(touching != inside))
        numbers |= by_symbol(f"error by {what}", error, "%")
    return numbers


TITLE = "PVC phantom with a hard zone: regular and self-perturbing single stage"
EXPERIMENTS = (_Intermittent("fig19", (11.5, 11.0), TITLE),)
