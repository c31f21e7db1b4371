"""Figs. 5, 11 and 14: three repetitions on one material, from the first set of starts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.estimators import (
    ContactEstimator,
    DoubleStageRLS,
    SingleStageRLS,
    VariableProjection,
)
from palpate.figures.style import DARK, LIGHT, Theme, style
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import MATERIALS, Homogeneous
from palpate.paper.experiment import Experiment, Finding, Outcome, Table
from palpate.paper.identifying import identify
from palpate.paper.panels import LABELS, draw_course, draw_finals
from palpate.paper.repetitions.claims import CLAIMS, TITLES
from palpate.paper.report.verdicts import readable
from palpate.paper.sessions import GATE, SI, pressed, session, thinned

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPETITIONS = 3
#: Footnote 3 of the paper: estimates agree where they are within 5 %.
AGREEMENT = 5.0
PARAMETERS = ("stiffness", "damping", "exponent")
FIGURES = {"fig05": "ball", "fig11": "sponge", "fig14": "pvc"}
# Made when they are wanted: what a module holds may outlive the compiled module at the end.
METHODS: Mapping[str, Callable[[], ContactEstimator]] = {
    "single-stage": partial(SingleStageRLS, gate=GATE, scale=SI),
    "variable-projection": partial(VariableProjection, gate=GATE),
    "double-stage": partial(DoubleStageRLS, gate=GATE, scale=SI),
}


@dataclass(frozen=True)
class Repetitions(Experiment):
    """Three repetitions of one session, with other noise each, and how they agree.

    Parameters
    ----------
    name : str
        "fig05", "fig11" or "fig14".
    """

    name: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "title", TITLES[self.name])
        object.__setattr__(self, "claims", CLAIMS[self.name])
        words = LABELS[self.material]
        object.__setattr__(
            self,
            "caption",
            f"Stiffness, damping and exponent of the {words}. Above, over time in three "
            "repetitions by the single stage, and in the first by variable projection; the "
            "dotted line is the truth. Below, the final values of every repetition and seed, "
            "with two standard errors of each method's own.",
        )

    @property
    def material(self) -> str:
        """What is pressed."""
        return FIGURES[self.name]

    def run(self, seed: int) -> Outcome:
        """Press three times; PVC is held against the ball and the sponge."""
        finals = {material: _finals(material, seed) for material in self._needed()}
        first = pressed(self.material, "three-sines", REPETITIONS * seed)
        drawn = thinned(first.time)
        curves = {"time": first.time[drawn].tolist()}
        for repetition in range(REPETITIONS):
            contact = pressed(self.material, "three-sines", REPETITIONS * seed + repetition)
            for method in ("single-stage", "variable-projection"):
                if repetition == 0 or method == "single-stage":
                    result = identify(contact, METHODS[method]())
                    curves.update(_courses(result, f"{method} {repetition}"))
        numbers: dict[str, Any] = {
            "final": finals[self.material],
            "spread": {name: _spreads(final) for name, final in finals.items()},
            "motion": {name: _motion(name, REPETITIONS * seed) for name in self._needed()},
        }
        return Outcome(seed, numbers, curves, self._findings(numbers))

    def _needed(self) -> tuple[str, ...]:
        return ("ball", "sponge", "pvc") if self.name == "fig14" else (self.material,)

    def _findings(self, numbers: dict[str, Any]) -> dict[str, Finding]:
        found = _common_findings(numbers, self.material)
        if self.name == "fig14":
            found |= _phantom_findings(numbers)
        return {claim.key: found[claim.key] for claim in self.claims}

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw the first seed's courses, and every seed's final values."""
        theme = DARK if dark else LIGHT
        truth = _truth(self.material)
        with style(theme) as new_figure:
            figure = new_figure(figsize=(10.5, 6.2), layout="constrained")
            axes = figure.subplots(2, 3, height_ratios=(1.5, 1.0))
            for i, name in enumerate(PARAMETERS):
                lines = _lines(outcomes[0], name, theme)
                draw_course(
                    axes[0, i], outcomes[0].curves["time"], lines, theme, truth.parameters[i]
                )
                label = f"{truth.symbols[i]} [{truth.units[i]}]" if truth.units[i] else "n"
                axes[0, i].set(title=name, ylabel=label, xlabel="time [s]")
                draw_finals(axes[1, i], _dots(outcomes, i), theme, truth.parameters[i])
                axes[1, i].set(xlabel=label)
            axes[1, 0].set_title("final values, all seeds")
            figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center",
                          ncols=5)  # fmt: skip
        return figure

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Final values and how far the repetitions lie apart, by method."""
        truth = _truth(self.material)
        rows = [("truth, ours", *(readable(value) for value in truth.parameters), "")]
        for method in METHODS:
            every = np.array([o.numbers["final"][method]["values"] for o in outcomes])
            spread = np.median([max(o.numbers["spread"][self.material][method]) for o in outcomes])
            values = every.reshape(-1, len(PARAMETERS))
            rows.append((method, *(_span(column) for column in values.T), f"{spread:.2g} %"))
        header = ("method", "K, N/mⁿ", "B, N·s/mⁿ⁺¹", "n", "spread of three repetitions")
        note = (
            "Median of all repetitions and seeds, range in brackets. Spread: largest minus least "
            "of three, relative to their mean, of the parameter with the most; median over seeds."
        )
        title = f"{LABELS[self.material].capitalize()}: final values from set I".strip()
        return (Table(title, header, tuple(rows), note),)


def _truth(material: str) -> HuntCrossley:
    known = MATERIALS[material]
    assert isinstance(known, Homogeneous)
    assert isinstance(known.law, HuntCrossley)
    return known.law


def _finals(material: str, seed: int) -> dict[str, dict[str, list[list[float]]]]:
    """Final values and standard errors: method → repetition → parameter."""
    found: dict[str, dict[str, list[list[float]]]] = {}
    for method, estimator in METHODS.items():
        results = [
            identify(pressed(material, "three-sines", REPETITIONS * seed + i), estimator())
            for i in range(REPETITIONS)
        ]
        found[method] = {
            "values": [result.law.parameters.tolist() for result in results],
            "errors": [result.estimate.standard_errors.tolist() for result in results],
        }
    return found


def _spreads(final: dict[str, dict[str, list[list[float]]]]) -> dict[str, list[float]]:
    """Largest minus least of the repetitions, relative to their mean, %, by parameter."""
    found = {}
    for method, both in final.items():
        values = np.array(both["values"])
        found[method] = (100.0 * np.ptp(values, axis=0) / np.abs(values.mean(axis=0))).tolist()
    return found


def _motion(material: str, seed: int) -> float:
    """Standard deviation of the penetration that the rig reached, mm: the excitation's level."""
    truth = session(material, "three-sines", seed).truth.window(3.0)
    return 1e3 * float(np.std(truth.penetration))


def _courses(result: Identification, name: str) -> dict[str, list[float]]:
    drawn = thinned(result.contact.time)
    known = np.where(result.trace.taken[:, None], result.trace.parameters, np.nan)[drawn]
    return {f"{name} {PARAMETERS[i]}": known[:, i].tolist() for i in range(len(PARAMETERS))}


def _lines(outcome: Outcome, name: str, theme: Theme) -> list[tuple[str, list[float], str, str]]:
    repetitions = [
        (
            f"single stage, {i + 1}",
            outcome.curves[f"single-stage {i} {name}"],
            theme.lines[i],
            "-",
        )
        for i in range(REPETITIONS)
    ]
    projection = outcome.curves[f"variable-projection 0 {name}"]
    return [*repetitions, ("variable projection, 1", projection, theme.ink, "--")]


def _dots(outcomes: Sequence[Outcome], index: int) -> dict[str, tuple[list[float], list[float]]]:
    shown = {"single stage": "single-stage", "variable projection": "variable-projection"}
    return {
        label: (
            [row[index] for o in outcomes for row in o.numbers["final"][method]["values"]],
            [row[index] for o in outcomes for row in o.numbers["final"][method]["errors"]],
        )
        for label, method in shown.items()
    }


def _common_findings(numbers: dict[str, Any], material: str) -> dict[str, Finding]:
    values = np.mean(numbers["final"]["single-stage"]["values"], axis=0)
    stiffness, damping, exponent = (float(value) for value in values)
    spread = max(numbers["spread"][material]["single-stage"])
    projected = max(numbers["spread"][material]["variable-projection"])
    return {
        "agree": Finding(
            spread <= AGREEMENT, spread, f"Variable projection spreads {projected:.2g} %."
        ),
        "stiffness": Finding(None, stiffness, f"B = {readable(damping)} N·s/mⁿ⁺¹."),
        "ratio": Finding(None, damping / stiffness),
        "exponent": Finding(None, exponent),
        "restitution": Finding(
            None,
            1e3 * 10e-3 * damping / stiffness,
            "A Hunt–Crossley law lets an unloaded surface come back at K/B.",
        ),
        "elastic": Finding(None, damping / stiffness),
    }


def _phantom_findings(numbers: dict[str, Any]) -> dict[str, Finding]:
    spread, motion = numbers["spread"], numbers["motion"]
    worst = {name: max(spread[name]["single-stage"]) for name in spread}
    double = max(spread["pvc"]["double-stage"])
    ends = np.mean(numbers["final"]["double-stage"]["values"], axis=0)
    reached = motion["pvc"] / motion["ball"]
    compared = f"Ball {worst['ball']:.2g} %, sponge {worst['sponge']:.2g} %."
    differ = Finding(worst["pvc"] > max(worst["ball"], worst["sponge"]), worst["pvc"], compared)
    return {
        "differ": differ,
        "consistent": Finding(
            worst["pvc"] < double,
            double / worst["pvc"],
            f"Single stage {worst['pvc']:.2g} %, double stage {double:.2g} %, which ends at "
            f"n = {ends[2]:.3f}.",
        ),
        "harder": Finding(reached < 0.98, reached),
    }


def _span(values: Any) -> str:
    middle, low, high = (readable(float(f(values))) for f in (np.median, np.min, np.max))
    return f"{middle} ({low} to {high})"
