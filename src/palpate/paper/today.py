"""What the authors would see today: their methods on the relaxing sponge, and what is said of them.

Every method learns from the first half of a recording, and predicts the second.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import palpate
from palpate import lab
from palpate.paper import drawing
from palpate.paper.drawing import THEME, Figure
from palpate.paper.experiment import Curves, Experiment, Measured, Outcome, Say, Table
from palpate.paper.judging import Numbers
from palpate.paper.rig import GATE, SI, START, Method, pressed

#: What is learned from ends here, s.
HALF = 7.0
#: Of a thousand samples a second one in so many is drawn.
EVERY = 20
_PAPER: Mapping[str, Any] = {"gate": GATE, "scale": SI, "outlier_rejection": False}
# By what a person calls it: the paper's as the paper sets them, and ours with default settings.
METHODS: Mapping[str, tuple[Method, Mapping[str, Any]]] = {
    "single stage": (palpate.SingleStageRLS, _PAPER),
    "double stage": (palpate.DoubleStageRLS, _PAPER),
    "Kelvin–Voigt": (palpate.KelvinVoigtRLS, _PAPER),
    "variable projection": (palpate.VariableProjection, {}),
    "memory: --law auto": (palpate.ViscoelasticContact, {}),
    "memory: --law any": (palpate.ViscoelasticContact, {"memory": "any"}),
}
#: What a diagnosis says of a number, from the best to the worst, and what it advises.
MARKS = ("trust", "with-care", "do-not-trust")
WORDS = tuple(mark.replace("-", " ") for mark in MARKS)
ADVICE = ("nothing", "--law auto", "--law any", "something else")
QUANTITIES = {"K′": "N/m", "B′": "N·s/m"}


class _Today(Experiment):
    """The relaxing sponge by every method that there is, with the verdict of the diagnosis."""

    caption = (
        "Force error over time of each method's law, learned from the first five seconds; the "
        "other five, shaded, it had not seen. Below, RMSE% over those, and stiffness and damping "
        "that a small oscillation of the motion's own frequency feels, with their error bars at "
        "two standard errors, for every seed; the truth dotted."
    )

    def measure(self, seed: int) -> Measured:
        # The recording that Fig. 13 uses.
        contact = pressed("relaxing-sponge", "three-sines", seed)
        learned = contact.window(START, HALF)
        unseen = contact.time >= HALF
        numbers: dict[str, float] = {}
        curves: Curves = {"time": contact.time[::EVERY]}
        for name, (kind, settings) in METHODS.items():
            result = palpate.identify(learned, kind(**settings), trace="full")
            error = contact.force - result.predicted_force(contact)
            numbers |= _said(name, result)
            shares = (np.dot(each[unseen], each[unseen]) for each in (error, contact.force))
            numbers[f"rmse unseen {name} [%]"] = 100.0 * np.sqrt(next(shares) / next(shares))
            curves[f"{name}/error"] = error[::EVERY]
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        curves = outcomes[0].curves
        grid = figure.add_gridspec(2, 3, height_ratios=(1.2, 1.0))
        axes = figure.add_subplot(grid[0, :])
        lines = {name: curves[f"{name}/error"] for name in METHODS}
        drawing.lines(axes, curves["time"], lines, linewidth=1.0)
        axes.axvspan(HALF, curves["time"][-1], color=THEME.grid, alpha=0.5, linewidth=0)
        axes.set(
            xlabel="time [s]", ylabel="force error [N]", xlim=(START + 0.5, curves["time"][-1])
        )
        axes.set_ylim(-1.5, 1.5)
        axes.legend(loc="upper center", ncols=3)
        names = list(METHODS)
        rows = np.arange(len(names))[::-1]
        for j, (symbol, unit) in enumerate({"RMSE": "%", **QUANTITIES}.items()):
            panel = figure.add_subplot(grid[1, j])
            for k, outcome in enumerate(outcomes):
                place = rows + 0.12 * (k - 0.5 * (len(outcomes) - 1))
                _draw_numbers(panel, place, outcome.numbers, symbol)
            panel.set(xlabel=f"{symbol} [{unit}]", yticks=rows)
            panel.set_yticklabels(names if j == 0 else [])

    def tables(self, say: Say) -> tuple[Table, ...]:
        marks = {f"trust {symbol}?": f"mark of {symbol} {{}}" for symbol in QUANTITIES}
        marks |= {"and all?": "mark of all {}"}
        rows = tuple(
            (
                name,
                say(f"rmse unseen {name}"),
                *(_word(say(number.format(name)), WORDS) for number in marks.values()),
                _word(say(f"advice {name}"), ADVICE),
            )
            for name in METHODS
        )
        verdicts = ("method", "RMSE% of the unseen half", *marks, "advised")
        columns = {
            "value, SI": "{} {}",
            "± 2 standard errors": "{} bar {}",
            "truth": "{} truth {}",
            "off [× that]": "{} off {}",
        }
        felt = {(name, symbol): (symbol, name) for name in METHODS for symbol in QUANTITIES}
        first = ("method", "stiffness, damping")
        return (
            Table("What is said of each method's law", verdicts, rows, SAID),
            Table.of(say, "What a small oscillation feels", first, columns, felt, FELT),
        )


SAID = (
    "Learned from 2 to 7 s, RMSE% from 7 to 12 s; noise alone would leave 2 %. The paper's "
    "methods as it sets them, the others with default settings; advised is the law that the "
    "diagnosis names first. Without memory the best fit of the first half is no guide to the "
    "second, which has relaxed further. --law auto offers one kind of memory, a flat spectrum, "
    "which this sponge does not have: the verdict sends on to --law any."
)
FELT = (
    "K′ and B′ at the motion's own frequency and median depth; standard errors repeatable and "
    "systematic together. The truth: F = 300 x + 300 x v and a branch of 150 N/m that relaxes "
    "with 1 s. Off by more than 1 is a bar that is too small: so is the damping's by --law auto "
    "in some seeds, where its verdict does not say so. Median over the seeds, range in brackets."
)


def _said(name: str, result: palpate.Identification) -> dict[str, float]:
    """What it comes to, with bars, and what is said of it."""
    felt, diagnosis = result.dynamic_stiffness(), result.diagnosis
    truth = _truth(felt.depth, felt.frequency)
    numbers = {}
    for (symbol, unit), known, true in zip(
        QUANTITIES.items(), (felt.stiffness, felt.damping), truth, strict=True
    ):
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
    laws = [law for each in serious for law in ADVICE if str(each.remedy).startswith(law)]
    numbers[f"advice {name}"] = ADVICE.index(laws[0]) if laws else len(ADVICE) - 1 if serious else 0
    return numbers


def _truth(depth: float, frequency: float) -> tuple[float, float]:
    """K′ and B′ of the sponge: its spring and damper, and a Maxwell branch E iωτ/(1 + iωτ)."""
    law, branch = lab.RELAXING_SPONGE.law, lab.RELAXING_SPONGE.branch_stiffness
    turned = 1j * frequency * lab.RELAXING_SPONGE.relaxation_time
    memory = branch * turned / (1.0 + turned)
    stiffness = law.stiffness_at(depth) + memory.real
    return stiffness, law.damping_at(depth) + memory.imag / frequency


def _word(said: str, words: Sequence[str]) -> str:
    """What a number stands for; where the seeds differ, from which to which."""
    # "2.00" of all seeds alike, "1.00 (0 to 2.00)" else.
    _, *ends = said.replace("(", "").replace(")", "").replace(" to ", " ").split()
    return " to ".join(dict.fromkeys(words[round(float(each))] for each in ends or [said]))


def _draw_numbers(axes: Any, place: Any, numbers: Numbers, symbol: str) -> None:
    for y, name, i in zip(place, METHODS, range(len(METHODS)), strict=True):
        colour = THEME.lines[i % len(THEME.lines)]
        if symbol == "RMSE":
            axes.plot(numbers[f"rmse unseen {name} [%]"], y, "o", color=colour, markersize=4)
            continue
        unit = QUANTITIES[symbol]
        value, bar, truth = (
            numbers[f"{symbol}{what} {name} [{unit}]"] for what in ("", " bar", " truth")
        )
        axes.errorbar(value, y, xerr=bar, fmt="o", color=colour, markersize=3, linewidth=1.0)
        axes.axvline(truth, color=THEME.ink, linewidth=0.5, linestyle=":")


TITLE = "What the authors would see today: a sponge that relaxes"
EXPERIMENTS = (_Today("today", TITLE, size=(11.0, 7.5)),)
