"""An experiment of the paper: what is said of it, what it measures, and how it is drawn."""

import tomllib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import palpate
from palpate.figures.style import Look, style
from palpate.force_laws import Floats, ForceLaw
from palpate.paper.judging import (
    JUDGES,
    Judge,
    Numbers,
    SeedAnswer,
    format_values,
    number,
    quantities,
    unit_of,
)
from palpate.results.colours import LIGHT

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:  # matplotlib takes half a second, and is loaded where something is drawn
    Axes = Figure = Any

THEME = LIGHT
#: What a person calls the lab's materials.
LABELS = {"ball": "ball", "sponge": "sponge", "pvc": "PVC phantom"}
LABELS |= {"relaxing-sponge": "relaxing sponge"}
#: Of Hunt–Crossley's parameters, by their symbols.
UNITS = {"K": "N/mⁿ", "B": "N·s/mⁿ⁺¹", "n": ""}
#: Told apart without colour.
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (7, 2, 1.5, 2)), (0, (3, 1)))
# More points than this on a line of a figure look the same.
POINTS = 400

Curves = dict[str, Floats]
#: Numbers by name and curves, as an experiment measures them.
Measured = tuple[dict[str, float], Curves]
#: Of the laws' parameters.
SYMBOLS = ("K", "B", "n", "K₁", "K₂")
# A pixel of a figure is a thousandth of its width; more digits make a heavy file that looks alike.
DIGITS_DRAWN = 5


@dataclass(frozen=True, slots=True)
class Claim:
    """A sentence of the paper, as ``claims.toml`` holds it.

    ``number`` is the paper's; ``measured`` says what ours is where the paper's words do not, and
    ``unit`` its unit. ``reading`` is what the words are taken to mean in numbers, and ``depends``
    what of the things that the paper leaves open decides.
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
    """What one seed gave: plain numbers, so that it can be written down, judged and drawn later.

    ``numbers`` have their unit in brackets at the end of the name, and are NaN where something
    never happened; ``curves`` are what is drawn, thinned out, NaN where there is nothing.
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
    """The numbers of some seeds, to be tabulated."""

    every: Sequence[Numbers]

    def __call__(self, *names: str) -> str:
        """Median over the seeds of one number, or of several alike, and the range in brackets."""
        return format_values(
            [each.of(numbers) for numbers in self.every for each in quantities(*names)]
        )

    def every_number(self) -> Table:
        """Return the table of all that was measured, one parameter of a law beside the other."""
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

    ``name`` is such as "fig03"; ``size`` is the figure's width and height, in. One process measures
    a seed of those of a ``group``, one after the other, for they press the same.
    """

    name: str
    size: tuple[float, float]
    title: str
    group: str = field(default="pressed once", kw_only=True)

    @property
    def caption(self) -> str:
        """What the figure shows, in words; default: the class's docstring."""
        return " ".join((self.__doc__ or "").split())

    @abstractmethod
    def measure(self, seed: int) -> Measured:
        """Return numbers by name, and what is drawn; the same seed gives the same."""

    @abstractmethod
    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome, beside what the other seeds gave where that can be shown.

        In the colours for a light background, which are exchanged for a dark one.
        """

    def tables(self, say: Seeds) -> tuple[Table, ...]:
        """Return the tables that belong to the figure; default: none."""
        return ()

    @property
    def claims(self) -> tuple[Claim, ...]:
        """What the paper says of it."""
        return all_claims()[self.name]

    @property
    def judges(self) -> Mapping[str, Judge]:
        """Who judges each claim, by its key."""
        return JUDGES[self.name]

    def run(self, seed: int) -> Outcome:
        """Measure once."""
        numbers, curves = self.measure(seed)
        plain = {name: float(value) for name, value in numbers.items()}
        return Outcome(seed, plain, {name: _rounded(curve) for name, curve in curves.items()})

    def findings(self, outcome: Outcome) -> dict[str, SeedAnswer]:
        """Hold what was measured against every claim."""
        return {claim.key: self.judges[claim.key](outcome.numbers) for claim in self.claims}

    def figure(self, outcomes: Sequence[Outcome]) -> Figure:
        """Return the figure of some outcomes."""
        with style(Look(THEME)) as new_figure:
            figure = new_figure(figsize=self.size, layout="constrained")
            self.draw(figure, outcomes)
            figure.suptitle(self.title, fontsize=11)
            for axes in figure.axes:
                # Thousands of little lines, half of a drawing, that nobody reads.
                axes.minorticks_off()
        return figure


@cache
def claims_file() -> Mapping[str, Any]:
    """Return what ``claims.toml`` holds."""
    text = resources.files("palpate.paper").joinpath("claims.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def all_claims() -> Mapping[str, tuple[Claim, ...]]:
    """Return every claim, by experiment."""
    others = ("abstract", "notes", "not-held")
    of_figures = {name: each for name, each in claims_file().items() if name not in others}
    return {
        name: tuple(_claim(key, **written) for key, written in claims.items())
        for name, claims in of_figures.items()
    }


def _claim(key: str, ours: str = "", **written: str) -> Claim:
    """Fill in the notes that a claim names; ``ours`` is such as "largest bias left [mN]"."""
    known = {name: words.format(**claims_file()["notes"]) for name, words in written.items()}
    measured, _, unit = ours.rpartition(" [") if ours.endswith("]") else (ours, "", "")
    return Claim(key, **known, measured=measured, unit=unit.removesuffix("]"))


def by_symbol(
    what: str,
    values: Iterable[float],
    unit: str | None = None,
    law: ForceLaw | type[ForceLaw] = palpate.HuntCrossley,
) -> dict[str, float]:
    """Name the values of a law's parameters: "time α = 5 K [s]"; default unit: the parameter's."""
    units = law.units if unit is None else (unit,) * len(law.symbols)
    return {
        f"{what} {symbol}{f' [{end}]' if end else ''}": float(value)
        for symbol, end, value in zip(law.symbols, units, values, strict=False)
    }


def _rounded(values: ArrayLike) -> list[float]:
    flat = np.asarray(values, dtype=np.float64).tolist()
    return [float(f"{value:.{DIGITS_DRAWN}g}") for value in flat]


# What the figures share: curves thinned out, lines that differ without colour, labels.


def thinned(time: Floats) -> NDArray[np.intp]:
    """Which samples to draw over the clock: one in 5 in the first half second, then one in 20."""
    return np.flatnonzero(np.arange(time.size) % np.where(time < time[0] + 0.5, 5, 20) == 0)


def course_of(result: palpate.Identification) -> Floats:
    """Parameters sample by sample, NaN where none was taken; shape (k, p)."""
    return np.where(result.trace.taken[:, None], result.trace.parameters, np.nan)


def courses(prefix: str, result: palpate.Identification, keep: Any) -> dict[str, Floats]:
    """Return the course of each parameter at some samples, to be drawn."""
    every = zip(result.law.symbols, course_of(result)[keep].T, strict=True)
    return {f"{prefix}/{symbol}": column for symbol, column in every}


def traced(
    prefix: str, result: palpate.Identification, clock: str = "elapsed"
) -> dict[str, Floats]:
    """Return parameters and force error of a result over the time since contact, to be drawn."""
    trace, contact = result.trace, result.contact
    elapsed = np.cumsum(contact.time_steps[trace.taken])
    # Enough samples for a logarithmic axis of time, and for a linear one.
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
    """One parameter over time, a line for each result; ``shown`` gives its curves by label."""
    of_symbol = {label: curves[f"{prefix}/{symbol}"] for label, prefix in shown.items()}
    lines(axes, curves[clock], of_symbol)
    axes.set(ylabel=f"{symbol} [{unit}]" if unit else symbol, **settings)


def truth(axes: Axes, value: float, label: str | None = "truth") -> None:
    """Dot a line where the truth, or another fixed value, is."""
    axes.axhline(value, color=THEME.ink, linewidth=0.9, linestyle=":", label=label)


def legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of one of the axes below the whole figure."""
    shown = axes.get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower center", ncols=columns)
