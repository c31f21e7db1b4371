"""Figs. 17 and 18: how rich a motion has to be, for Hunt–Crossley and for Kelvin–Voigt."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import KelvinVoigtRLS, SingleStageRLS, VariableProjection
from palpate.identification import Identification
from palpate.lab import BALL, ONE_SINE, Bench, IdealProbe
from palpate.paper.curves import median_and_range, plain, traced
from palpate.paper.experiment import Outcome, Table
from palpate.paper.judged import Curves, Judged, JudgedExperiment
from palpate.paper.richness.claims import HUNT_CROSSLEY_CLAIMS, KELVIN_VOIGT_CLAIMS
from palpate.paper.richness.figure import draw_richness
from palpate.paper.sessions import START, pressed
from palpate.paper.starts import (
    Starts,
    convergence_times,
    from_starts,
    identified,
    starts_of,
    times_to,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SECONDS = 22.0
#: How long the ideal probe goes on, s.
LONG = 452.0
MOTIONS = {"two sines": "two-sines", "one sine": "one-sine"}
COVARIANCES = (1.0, 10.0, 1e2, 1e3, 1e4, 1e6)
LONG_COVARIANCES = (0.1, 1.0, 10.0)

Kind = type[SingleStageRLS] | type[KelvinVoigtRLS]


class Richness(JudgedExperiment):
    """One method on the ball, pressed with two sines and with one, from the starts of Table I.

    Parameters
    ----------
    name, title : str
        Of the experiment.
    kind : type
        The method.
    judged : tuple
        Claims and who judges them.
    """

    caption = (
        "Parameters and force error over the time since contact, from every start, for "
        "two sines and for one; beside them the convergence times of every seed over the "
        "initial covariance."
    )

    def __init__(self, name: str, title: str, kind: Kind, judged: tuple[Judged, ...]) -> None:
        super().__init__(name, title, judged)
        self.kind = kind

    def measure(self, seed: int) -> tuple[dict[str, Any], Curves]:
        """Press with two sines and one; the starts are those of the three sines."""
        three = pressed("ball", "three-sines", seed)
        starts = starts_of(three, self.kind)
        numbers: dict[str, Any] = {
            "three sines": _summary(from_starts(three, self.kind, starts)),
        }
        curves: Curves = {}
        for name, trajectory in MOTIONS.items():
            contact = pressed("ball", trajectory, seed, SECONDS)
            results = from_starts(contact, self.kind, starts)
            numbers[name] = {
                **_summary(results),
                "by covariance": _by_covariance(contact, self.kind, starts, COVARIANCES),
                "other": self._other(contact, three),
                "conditioning": _conditioning(contact),
            }
            projected = identified(contact, VariableProjection())
            curves |= _curves(name, {**results, "projection": projected})
            numbers[name]["projection"] = _projected(projected)
        if self.kind is SingleStageRLS:
            numbers["long"] = _long(seed, starts)
        return numbers, curves

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw parameters and force error of every start, for two sines and for one."""
        return draw_richness(self.title, self.kind, outcomes, dark=dark)

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Return convergence times by motion and initial covariance."""
        symbols = self.kind.law_type.symbols
        rows = [
            _row(name, "default", [o.numbers[name]["times"] for o in outcomes])
            for name in ("three sines", *MOTIONS)
        ]
        for name in MOTIONS:
            every = [outcome.numbers[name]["by covariance"] for outcome in outcomes]
            rows += [_row(name, v, [times[v] for times in every]) for v in every[0]]
        if self.kind is SingleStageRLS:
            every = [outcome.numbers["long"] for outcome in outcomes]
            rows += [_row("one sine, 450 s", v, [times[v] for times in every]) for v in every[0]]
        header = ("motion", "P₀", *(f"{symbol} [s]" for symbol in symbols))
        note = (
            f"Seconds of contact until all starts agree within 5 %, of {SECONDS - START:g} s on "
            "the rig; 450 s are an ideal probe's with the same sensors."
        )
        return (Table(f"Convergence by motion, {self.kind.method}", header, tuple(rows), note),)

    def _other(self, contact: Contact, three: Contact) -> list[float]:
        """Convergence times of the other model on the same data."""
        other: Kind = KelvinVoigtRLS if self.kind is SingleStageRLS else SingleStageRLS
        results = from_starts(contact, other, starts_of(three, other))
        return plain(convergence_times(list(results.values())))


def _row(motion: str, variance: str, times: Sequence[Sequence[float]]) -> tuple[str, ...]:
    cells = [median_and_range((t[i] for t in times), ".2g") for i in range(len(times[0]))]
    return (motion, variance, *cells)


def _summary(results: Mapping[str, Identification]) -> dict[str, Any]:
    return {
        "times": plain(convergence_times(list(results.values()))),
        "final": {name: plain(result.law.parameters) for name, result in results.items()},
        "rmse": {name: result.prediction_rmse_percent for name, result in results.items()},
    }


def _by_covariance(
    contact: Contact, kind: Kind, starts: Starts, variances: Sequence[float]
) -> dict[str, list[float]]:
    return {
        f"{variance:g}": plain(
            convergence_times(
                list(from_starts(contact, kind, starts, initial_covariance=variance).values())
            )
        )
        for variance in variances
    }


def _projected(result: Identification) -> dict[str, Any]:
    return {
        "times": plain(times_to(result, BALL.law.parameters)),
        "final": plain(result.law.parameters),
        "rmse": result.prediction_rmse_percent,
    }


def _conditioning(contact: Contact) -> dict[str, float]:
    """Condition numbers of columns of unit length: of the logarithm's, and of linear systems."""
    known = contact.window(START + 1.0)
    x, v = known.penetration, known.velocity
    one = np.ones_like(x)
    acceleration = np.gradient(v, known.time)
    systems = {
        "1, v, ln x": (one, v, np.log(x)),
        "1, v, x": (one, v, x),
        "x, v, a": (x, v, acceleration),
    }
    return {name: _condition(np.stack(columns)) for name, columns in systems.items()}


def _condition(columns: Any) -> float:
    scaled = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    return float(f"{np.linalg.cond(scaled):.4g}")


def _long(seed: int, starts: Starts) -> dict[str, list[float]]:
    """Convergence times of one sine that goes on."""
    run = Bench(BALL, ONE_SINE, IdealProbe()).run(seed, seconds=LONG)
    contact = run.contact.window(START)
    return _by_covariance(contact, SingleStageRLS, starts, LONG_COVARIANCES)


def _curves(name: str, results: Mapping[str, Identification]) -> Curves:
    curves: Curves = {}
    for start, result in results.items():
        curves |= traced(f"{name}/{start}", result, f"{name}/elapsed")
    return curves


RICHNESS = (
    Richness(
        "fig17",
        "Rubber ball, Hunt–Crossley by the single stage: two sines and one",
        SingleStageRLS,
        HUNT_CROSSLEY_CLAIMS,
    ),
    Richness(
        "fig18",
        "Rubber ball, Kelvin–Voigt: two sines and one",
        KelvinVoigtRLS,
        KELVIN_VOIGT_CLAIMS,
    ),
)
