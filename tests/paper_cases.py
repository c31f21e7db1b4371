"""Experiments too small to take time, for what runs and reports them."""

import math
import time
from dataclasses import dataclass

from palpate.figures.style import DARK, LIGHT, style
from palpate.paper import Claim, Experiment, Finding, Outcome, Table

# One for all tests, whose presses then stay in memory.
SEED = 3


@dataclass(frozen=True)
class Tiny(Experiment):
    """Squares its seed; from ``slow_from`` on it takes ``seconds``.

    Fails where the seed is ``fails_at``; draws no figure if ``undrawable``.
    """

    name: str = "tiny"
    fails_at: int = -1
    undrawable: bool = False
    seconds: float = 0.0
    slow_from: int = 0
    title = "A tiny <experiment>"
    caption = "A line & nothing else"
    claims = (
        Claim("even", "I, Fig. 1", "the seed is even", "2", "m", "on whole numbers", "the seed"),
        Claim("lost", "II", "nobody <knows> | any more"),
    )

    def run(self, seed: int) -> Outcome:
        time.sleep(self.seconds if seed >= self.slow_from else 0.0)
        if seed == self.fails_at:
            raise ArithmeticError("no such square")
        findings = {
            "even": Finding(seed % 2 == 0, float(seed), f"{seed} it is"),
            "lost": Finding(None),
        }
        numbers = {"square": seed**2, "nothing": math.nan, "deep": {"list": [1.0 / 3.0, math.inf]}}
        return Outcome(seed, numbers, {"line": [0.0, math.nan, seed + 1.0 / 3.0]}, findings)

    def draw(self, outcomes, *, dark=False):
        if self.undrawable:
            raise ArithmeticError("no such colour")
        with style(DARK if dark else LIGHT) as new_figure:
            figure = new_figure(figsize=(2.0, 1.0))
            axes = figure.add_subplot()
            for outcome in outcomes:
                axes.plot(outcome.curves["line"])
        return figure

    def tables(self, outcomes):
        rows = tuple((f"seed {o.seed}", str(o.numbers["square"])) for o in outcomes)
        return (Table("Squares & more", ("seed", "square"), rows, "as <they> came"),)
