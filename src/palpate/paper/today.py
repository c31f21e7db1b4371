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
from palpate.paper.experiment import Curves, Experiment, Measured, Outcome, Seeds, Table
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
ADVICE = ("nothing", "--law auto", "--law any", "something else")
QUANTITIES = {"K′": "N/m", "B′": "N·s/m"}
SAID = (
    "Learned from 2 to 7 s, RMSE% from 7 to 12 s; noise alone would leave 2 %. Without memory the "
    "best fit of the first half is no guide to the second, which has relaxed further. --law auto "
    "offers one kind of memory, a flat relaxation spectrum, which this sponge does not have: its "
    "verdict recommends --law any."
)
FELT = (
    "K′ and B′ at the motion's own frequency and median depth; bar: two standard errors, "
    "statistical and systematic together. The truth: F = 300 x + 300 x v and a branch of 150 N/m "
    "that relaxes with 1 s. Off by more than 1 bar: the bar is too small. Median over the seeds, "
    "range in brackets."
)


class _Today(Experiment):
    """Force error over time of each method's law, learned from the first five seconds; the other
    five, shaded, it had not seen. Below, RMSE% over those, and stiffness and damping that a small
    oscillation of the motion's own frequency feels, with their error bars at two standard errors,
    for every seed; the truth dotted.
    """

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
        axes.set(xlim=(START + 0.5, curves["time"][-1]), ylim=(-1.5, 1.5))
        axes.set(xlabel="time [s]", ylabel="force error [N]")
        axes.legend(loc="upper center", ncols=3)
        rows = np.arange(len(METHODS))[::-1]
        for j, (symbol, unit) in enumerate({"RMSE": "%", **QUANTITIES}.items()):
            panel = figure.add_subplot(grid[1, j])
            for k, outcome in enumerate(outcomes):
                numbers, shift = outcome.numbers, 0.12 * (k - 0.5 * (len(outcomes) - 1))
                for y, name, colour in zip(rows + shift, METHODS, THEME.lines, strict=False):
                    if symbol == "RMSE":
                        value = numbers[f"rmse unseen {name} [%]"]
                        panel.plot(value, y, "o", color=colour, markersize=4)
                        continue
                    names = (f"{symbol}{what} {name} [{unit}]" for what in ("", " bar", " truth"))
                    value, bar, truth = (numbers[each] for each in names)
                    looks: dict[str, Any] = {"fmt": "o", "markersize": 3, "linewidth": 1.0}
                    panel.errorbar(value, y, xerr=bar, color=colour, **looks)
                    panel.axvline(truth, color=THEME.ink, linewidth=0.5, linestyle=":")
            panel.set(xlabel=f"{symbol} [{unit}]", yticks=rows)
            panel.set_yticklabels(list(METHODS) if j == 0 else [])

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        def word(number: str, words: Sequence[str]) -> str:
            """What a number stands for; where the seeds differ, from which to which."""
            values = sorted({round(each[number]) for each in say.every})
            return " to ".join(words[each] for each in dict.fromkeys((values[0], values[-1])))

        rows = []
        for name in METHODS:
            marks = (word(f"mark of {of} {name}", MARKS) for of in (*QUANTITIES, "all"))
            advice = word(f"advice {name}", ADVICE)
            rows.append((name, say(f"rmse unseen {name}"), *marks, advice))
        trust = ("trust K′?", "trust B′?", "and all?")
        verdicts = ("method", "RMSE% of the unseen half", *trust, "advised")
        columns = {"value, SI": "{} {}", "bar": "{} bar {}", "truth": "{} truth {}"}
        columns["off [× bar]"] = "{} off {}"
        felt = {(name, symbol): (symbol, name) for name in METHODS for symbol in QUANTITIES}
        first = ("method", "stiffness, damping")
        return (
            Table("What is said of each method's law", verdicts, tuple(rows), SAID),
            say.table("What a small oscillation feels", first, columns, felt, FELT),
        )


def _said(name: str, result: palpate.Identification) -> dict[str, float]:
    """What it comes to, with bars, and what is said of it."""
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
    laws = [law for each in serious for law in ADVICE if str(each.remedy).startswith(law)]
    numbers[f"advice {name}"] = ADVICE.index(laws[0]) if laws else len(ADVICE) - 1 if serious else 0
    return numbers


TITLE = "What the authors would see today: a sponge that relaxes"
EXPERIMENTS = (_Today("today", (11.0, 7.5), TITLE),)
