"""An experiment of the paper: its claims, measurement, tables and figure."""

import tomllib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes as Axes
from matplotlib.figure import Figure as Figure
from numpy.typing import ArrayLike, NDArray

import palpate
from palpate.output.figures.style import choose_look, figure_style
from paper.judging import (
    JUDGES,
    Judge,
    Numbers,
    SeedAnswer,
    format_values,
    number,
    quantities,
    unit_of,
)

LOOK = choose_look(dark=False, width=None)
THEME = LOOK.theme
#: Display names of the lab's materials.
LABELS = {"ball": "ball", "sponge": "sponge", "pvc": "PVC phantom"}
LABELS |= {"relaxing-sponge": "relaxing sponge"}
#: Units of the Hunt–Crossley parameters, by their symbols.
UNITS = {"K": "N/mⁿ", "B": "N·s/mⁿ⁺¹", "n": ""}
#: Line styles, to distinguish lines without colour.
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (7, 2, 1.5, 2)), (0, (3, 1)))
# Points per line of a figure; more would look the same.
POINTS = 400

Floats = NDArray[np.float64]
Curves = dict[str, Floats]
#: The numbers (by name) and curves that an experiment measures.
Measured = tuple[dict[str, float], Curves]
#: Symbols of the laws' parameters.
SYMBOLS = ("K", "B", "n", "K₁", "K₂")
# A pixel is a thousandth of a figure's width; more digits would only make the file larger.
DIGITS_DRAWN = 5


@dataclass(frozen=True, slots=True)
class Claim:
    """A sentence of the paper, from ``claims.toml``.

    ``number`` is the paper's value; ``measured`` describes ours if the paper's words do not, and
    ``unit`` is its unit. ``reading`` states how the words are interpreted in numbers, and
    ``depends`` on which unspecified conditions the result depends.
    """

    key: str
    where: str
    words: str
    number: str = ""
    measured: str = ""
    unit: str = ""
    reading: str = ""
    depends: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of one seed, as plain numbers that can be saved, judged and drawn later.

    The names of ``numbers`` end with the unit in brackets; NaN means that an event never happened.
    ``curves`` are the lines of the figure, thinned out; NaN marks gaps.
    """

    seed: int
    numbers: Numbers
    curves: Mapping[str, list[float]]


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of text under a heading."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True, slots=True)
class Seeds:
    """The numbers of several seeds, formatted for tables."""

    every: Sequence[Numbers]

    def __call__(self, *names: str) -> str:
        """Return the median of one or more numbers over the seeds, with the range in brackets."""
        return format_values(
            [each.of(numbers) for numbers in self.every for each in quantities(*names)]
        )

    def every_number(self) -> Table:
        """Return the table of all measured numbers, the parameters of a law in one row."""
        rows: dict[str, list[str]] = {}
        for key in self.every[0]:
            name = key.partition(" [")[0]
            head, _, last = name.rpartition(" ")
            value = format_values([number(key).of(numbers) for numbers in self.every], unit_of(key))
            if last in SYMBOLS:
                name, value = head, f"{last} {value}"
            rows.setdefault(name, []).append(value)
        cells = tuple((name, "; ".join(values)) for name, values in rows.items())
        return Table("Every number", ("number", "median over the seeds (range)"), cells)


@dataclass(frozen=True)
class Experiment(ABC):
    """A figure of the paper, with the tables that belong to it.

    ``name`` is for example "fig03"; ``size`` is the figure's width and height, in. Experiments of
    the same ``group`` share recordings, so one process measures a seed of all of them in turn.
    """

    name: str
    size: tuple[float, float]
    title: str
    group: str = field(default="pressed once", kw_only=True)

    @property
    def caption(self) -> str:
        """Caption of the figure; default: the docstring of the class."""
        return " ".join((self.__doc__ or "").split())

    @abstractmethod
    def measure(self, seed: int) -> Measured:
        """Return numbers by name, and curves; the same seed gives the same result."""

    @abstractmethod
    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome, and where possible the range of the other seeds.

        Use the colours for a light background, which are exchanged for a dark one.
        """

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        """Return the tables that belong to the figure; default: none."""
        return ()

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Claims of the paper about this experiment."""
        return all_claims()[self.name]

    @property
    def judges(self) -> Mapping[str, Judge]:
        """Judge of each claim, by its key."""
        return JUDGES[self.name]

    def run(self, seed: int) -> Outcome:
        """Measure one seed."""
        numbers, curves = self.measure(seed)
        plain = {name: float(value) for name, value in numbers.items()}
        return Outcome(seed, plain, {name: _rounded(curve) for name, curve in curves.items()})

    def findings(self, outcome: Outcome) -> dict[str, SeedAnswer]:
        """Judge every claim by an outcome; those on recordings of others stay open."""
        judges = {claim.key: self.judges[claim.key] for claim in self.claims}
        return {
            key: judge(outcome.numbers) if judge.recorded is None else SeedAnswer(None)
            for key, judge in judges.items()
        }

    def figure(self, outcomes: Sequence[Outcome]) -> Figure:
        """Return the figure of some outcomes."""
        with figure_style(LOOK) as new_figure:
            figure = new_figure(figsize=self.size, layout="constrained")
            self.draw(figure, outcomes)
            figure.suptitle(self.title, fontsize=11)
            for axes in figure.axes:
                # Minor ticks are half of the file's size and nobody reads them.
                axes.minorticks_off()
        return figure


@cache
def claims_file() -> Mapping[str, Any]:
    """Return the content of ``claims.toml``."""
    text = Path(__file__).with_name("claims.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def all_claims() -> Mapping[str, tuple[Claim, ...]]:
    """Return all claims, by experiment."""
    others = ("abstract", "notes", "not-held")
    of_figures = {name: each for name, each in claims_file().items() if name not in others}
    return {
        name: tuple(_claim(key, **written) for key, written in claims.items())
        for name, claims in of_figures.items()
    }


def _claim(key: str, ours: str = "", **written: str) -> Claim:
    """Insert the notes that a claim names; ``ours`` is for example "largest bias left [mN]"."""
    known = {name: words.format(**claims_file()["notes"]) for name, words in written.items()}
    measured, _, unit = ours.rpartition(" [") if ours.endswith("]") else (ours, "", "")
    return Claim(key, **known, measured=measured, unit=unit.removesuffix("]"))


def by_symbol(
    what: str,
    values: Iterable[float],
    unit: str | None = None,
    law: palpate.ForceLaw | type[palpate.ForceLaw] = palpate.HuntCrossley,
) -> dict[str, float]:
    """Name a value for each parameter: "time α = 5 K [s]"; default unit: the parameter's."""
    units = law.units if unit is None else (unit,) * len(law.symbols)
    return {
        f"{what} {symbol}{f' [{end}]' if end else ''}": float(value)
        for symbol, end, value in zip(law.symbols, units, values, strict=False)
    }


def _rounded(values: ArrayLike) -> list[float]:
    flat = np.asarray(values, dtype=np.float64).tolist()
    return [float(f"{value:.{DIGITS_DRAWN}g}") for value in flat]


# Common parts of the figures: thinned curves, lines that differ without colour, labels.


def thinned(time: Floats) -> NDArray[np.intp]:
    """Return the samples to draw over time: one in 5 in the first half second, then one in 20."""
    return np.flatnonzero(np.arange(time.size) % np.where(time < time[0] + 0.5, 5, 20) == 0)


def course_of(result: palpate.Identification) -> Floats:
    """Return the parameters after each sample, NaN for unused samples; shape (k, p)."""
    return np.where(result.trace.taken[:, None], result.trace.parameters, np.nan)


def courses(prefix: str, result: palpate.Identification, keep: Any) -> dict[str, Floats]:
    """Return each parameter over some samples, as curves to draw."""
    every = zip(result.law.symbols, course_of(result)[keep].T, strict=True)
    return {f"{prefix}/{symbol}": column for symbol, column in every}


def traced(
    prefix: str, result: palpate.Identification, clock: str = "elapsed"
) -> dict[str, Floats]:
    """Return parameters and force error over the time since contact, as curves to draw."""
    trace, contact = result.trace, result.contact
    elapsed = np.cumsum(contact.time_steps[trace.taken])
    # Enough samples for both a logarithmic and a linear time axis.
    early = np.geomspace(1, elapsed.size, POINTS).round().astype(np.intp) - 1
    keep = np.union1d(early, np.arange(0, elapsed.size, max(elapsed.size // POINTS, 1)))
    columns = zip(result.law.symbols, trace.parameters[trace.taken][keep].T, strict=True)
    error = (contact.force - trace.predicted_force)[trace.taken][keep]
    curves = {f"{prefix}/{symbol}": column for symbol, column in columns}
    return {clock: elapsed[keep], **curves, f"{prefix}/error": error}


def lines(
    axes: Axes, x: ArrayLike, curves: Mapping[Any, ArrayLike], *, first: int = 0, **options: Any
) -> None:
    """Draw lines that differ in colour and dashes, the first of them in the ``first`` style."""
    for i, (label, y) in enumerate(curves.items(), first):
        looks = {"color": THEME.lines[i % len(THEME.lines)], "linestyle": DASHES[i % len(DASHES)]}
        axes.plot(x, y, label=label, **{"linewidth": 1.4, **looks, **options})


def course(
    axes: Axes,
    curves: Mapping[str, list[float]],
    symbol: str,
    shown: Mapping[str, str],
    *,
    clock: str = "elapsed",
    unit: str = "",
    **settings: Any,
) -> None:
    """Draw one parameter over time, one line per result; ``shown`` has its curves by label."""
    of_symbol = {label: curves[f"{prefix}/{symbol}"] for label, prefix in shown.items()}
    lines(axes, curves[clock], of_symbol)
    axes.set(ylabel=f"{symbol} [{unit}]" if unit else symbol, **settings)


def truth(axes: Axes, value: float, label: str | None = "truth") -> None:
    """Draw a dotted line at the truth or another fixed value."""
    axes.axhline(value, color=THEME.ink, linewidth=0.9, linestyle=":", label=label)


def legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of one of the axes below the whole figure."""
    shown = axes.get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower center", ncols=columns)
