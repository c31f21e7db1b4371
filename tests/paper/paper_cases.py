"""Experiments too small to take time, for what runs and reports them."""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import ClassVar

from paper.experiment import Claim, Experiment, Table
from paper.judging import judge, number

# One for all tests, whose presses then stay in memory.
SEED = 3


@dataclass(frozen=True)
class Tiny(Experiment):
    """A line & nothing else."""

    # Squares its seed; from ``slow_from`` on it takes ``seconds``. Fails where the seed is
    # ``fails_at``; draws no figure if ``undrawable``.
    name: str = "tiny"
    size: tuple[float, float] = (2.0, 1.0)
    title: str = "A tiny <experiment>"
    fails_at: int = -1
    undrawable: bool = False
    seconds: float = 0.0
    slow_from: int = 0
    claims = (
        Claim("even", "I, Fig. 1", "the seed is even", "2", "the seed", "m", "on whole numbers"),
        Claim("lost", "II", "nobody <knows> | any more"),
    )
    judges: ClassVar = {
        "even": judge("seed", number("remainder") <= 0.0, beside=["never"]),
        "lost": judge(),
    }

    def measure(self, seed):
        time.sleep(self.seconds if seed >= self.slow_from else 0.0)
        if seed == self.fails_at:
            raise ArithmeticError("no such square")
        numbers = {"seed [m]": seed, "remainder": seed % 2, "third": seed / 3.0}
        return {**numbers, "never [s]": math.nan}, {"line": [0.0, math.nan, seed + 1.0 / 3.0]}

    def draw(self, figure, outcomes):
        if self.undrawable:
            raise ArithmeticError("no such colour")
        axes = figure.add_subplot()
        for outcome in outcomes:
            axes.plot(outcome.curves["line"])

    def tables(self, say):
        rows = (("seed", say("third")),)
        return (Table("Thirds & more", ("of", "third"), rows, "as <they> came"),)


@contextmanager
def no_processes(count):
    """In place of ``running.processes``: starting some takes seconds, and one test has done it."""
    with ThreadPoolExecutor(1) as pool:
        yield pool
