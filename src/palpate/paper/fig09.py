"""Fig. 9: from how near the truth the double stage has to start."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import DoubleStageRLS, SingleStageRLS, VariableProjection
from palpate.figures.style import LIGHT as THEME
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import BALL, SPONGE
from palpate.paper.causes import conditions, wrong_exponent
from palpate.paper.experiment import Curves, Experiment, Outcome, Say, Table, by_symbol
from palpate.paper.panels import DASHES, UNITS, Axes, Figure, draw_course, draw_truth, traced
from palpate.paper.quantities import Numbers, named
from palpate.paper.sessions import identified, pressed
from palpate.paper.starts import AGREED, convergence_times
from palpate.settings import Scale
from palpate.validation import Floats

MATERIALS = {"ball": BALL, "sponge": SPONGE}
#: How far from the final values the starts lie: all three parameters off by that, either way.
OFF = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
WAYS = {
    "all more": (1, 1, 1),
    "all less": (-1, -1, -1),
    "n less": (1, 1, -1),
    "n more": (-1, -1, 1),
}
KEEPING_N = {"K and B more": (1, 1, 0), "K and B less": (-1, -1, 0)}
DRAWN = (0.02, 0.1, 0.3)
#: What it would be with a smaller P₀, and in units in which penetrations are near 1.
OTHERWISE: dict[str, dict[str, Any]] = {
    "0.1, P₀ = 1e4": {"initial_covariance": (1e4, 1e4, 1e3)},
    "0.1, P₀ = 10": {"initial_covariance": (10.0, 10.0, 10.0)},
    "0.1, in cm": {"scale": Scale(10e-3, 10e-3, 1.0)},
}
CASES = (*(f"{off:g}" for off in OFF), *OTHERWISE, "0.5, n right", "0.5, single stage")
LIMITS = {"K": (0.0, 6000.0), "B": (0.0, 6000.0), "n": (0.6, 1.4)}


@dataclass(frozen=True)
class NearTruth(Experiment):
    """The double stage on ball and sponge, from starts ever farther from where it should end."""

    name: str = "fig09"
    title: str = "Rubber ball, double stage: starts in the vicinity of the final values"
    caption = (
        "K, B and n of the double stage from starts 2, 10 and 30 % off the truth, which stay "
        "apart. Below: how far apart they end over how far off they start, for ball and sponge."
    )
    size: tuple[float, float] = (10.5, 8.5)

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Identify one recording of each material from every start."""
        numbers: dict[str, float] = {}
        curves: Curves = {}
        for name, material in MATERIALS.items():
            contact, law = pressed(name, "three-sines", seed), material.law.parameters
            ends = {f"{off:g}": _from(contact, law, off) for off in OFF}
            for words, settings in OTHERWISE.items():
                ends[words] = _from(contact, law, 0.1, **settings)
            ends["0.5, n right"] = _from(contact, law, 0.5, KEEPING_N)
            ends["0.5, single stage"] = _from(contact, law, 0.5, kind=SingleStageRLS)
            for case, results in ends.items():
                numbers |= _summary(f"{name} {case}", results, law)
            numbers[f"reach {name} [%]"] = _reach(name, numbers)
            near = (each for off in OFF for each in ends[f"{off:g}"].values())
            known = conditions(contact, law, near) | wrong_exponent(contact, law)
            numbers |= {f"{name} {words}": value for words, value in known.items()}
            if name == "ball":
                for off in DRAWN:
                    for way, result in ends[f"{off:g}"].items():
                        curves |= traced(f"{off:g}/{way}", result)
                curves |= traced("projection", identified(contact, VariableProjection()))
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome's parameters, and below where every seed ends."""
        curves = outcomes[0].curves
        grid = figure.add_gridspec(4, len(DRAWN), height_ratios=(1.0, 1.0, 1.0, 1.1))
        for column, off in enumerate(DRAWN):
            shown = {way: f"{off:g}/{way}" for way in WAYS} | {"variable projection": "projection"}
            for row, (symbol, unit) in enumerate(UNITS.items()):
                axes = figure.add_subplot(grid[row, column])
                limits: dict[str, Any] = {"xscale": "log", "ylim": LIMITS[symbol]}
                draw_course(axes, curves, symbol, shown, unit=unit, **limits)
                if row == 0:
                    axes.set_title(f"starts {100 * off:g} % off")
            axes.set(xlabel="time since contact [s]")
        labels = axes.get_legend_handles_labels()
        figure.legend(*labels, loc="outside lower center", ncols=5)
        _draw_ends(figure.add_subplot(grid[3, :]), outcomes)

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Return where the starts end."""
        columns = {f"{symbol} off [%]": f"error {{}} {{}} {symbol}" for symbol in UNITS} | {
            "ends apart [%]": "apart {} {}",
            "convergence [s]": "time {} {}",
        }
        rows = [(name, case) for name in MATERIALS for case in CASES]
        note = (
            "Each line is four starts, K and B and n off both ways, or two with n as it is; what "
            "is shown is the worst of them at the end."
        )
        title, first = "Double stage: starts near the truth", ("material", "starts off by")
        return (Table.of(say, title, first, columns, rows, note),)


def _from(
    contact: Contact,
    law: Floats,
    off: float,
    ways: Mapping[str, tuple[int, int, int]] = WAYS,
    kind: type[DoubleStageRLS] | type[SingleStageRLS] = DoubleStageRLS,
    **settings: Any,
) -> dict[str, Identification]:
    """Identify from starts that are off the truth by a share, in several ways."""
    starts = {way: law * (1.0 + off * np.array(signs)) for way, signs in ways.items()}
    return {
        way: identified(contact, kind(initial=HuntCrossley(*start.tolist())), **settings)
        for way, start in starts.items()
    }


def _summary(what: str, results: Mapping[str, Identification], law: Floats) -> dict[str, float]:
    final = np.array([result.law.parameters for result in results.values()])
    apart = 100.0 * np.ptp(final, axis=0) / final.mean(axis=0)
    return {
        **by_symbol(f"error {what}", 100.0 * np.abs(final / law - 1.0).max(axis=0), "%"),
        **by_symbol(f"apart {what}", apart, "%"),
        **by_symbol(f"time {what}", convergence_times(list(results.values())), "s"),
    }


def _reach(material: str, numbers: Numbers) -> float:
    """How far off, in percent, all starts up to there end within 5 % of each other."""
    reach = 0.0
    for off in OFF:
        if max(named(f"apart {material} {off:g}", numbers).values()) > 100.0 * AGREED:
            break
        reach = 100.0 * off
    return reach


def _draw_ends(axes: Axes, outcomes: Sequence[Outcome]) -> None:
    """How far apart every seed ends, over how far off the starts are."""
    for i, material in enumerate(MATERIALS):
        for j, outcome in enumerate(outcomes):
            ends = [
                max(named(f"apart {material} {off:g}", outcome.numbers).values()) for off in OFF
            ]
            looks = {"color": THEME.lines[i], "linestyle": DASHES[i], "marker": "os"[i]}
            label = material if j == 0 else None
            axes.plot([100.0 * off for off in OFF], ends, markersize=4, label=label, **looks)
    draw_truth(axes, 100.0 * AGREED, None)
    axes.text(60.0, 5.3, "5 %", color=THEME.ink, ha="right")
    axes.set(xscale="log", yscale="log", xlim=(0.9, 62.0), ylim=(1.0, 300.0))
    ticks = [1, 2, 5, 10, 20, 50]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set(xlabel="starts off by [%]", ylabel="apart at the end [%]")
    axes.set_title("Every seed: how far apart the starts end")
    axes.legend(loc="upper left")


EXPERIMENTS = (NearTruth(),)
