"""The methods side by side on the same data: Figs. 8, 13 and 16 with Tables I to VI."""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import RecursiveLeastSquaresEstimator, VariableProjection
from palpate.identification import Identification
from palpate.paper.comparison.figure import draw_comparison
from palpate.paper.comparison.tables import comparison_tables
from palpate.paper.curves import plain, traced
from palpate.paper.experiment import Outcome, Table
from palpate.paper.judged import Curves, Judged, JudgedExperiment
from palpate.paper.sessions import pressed
from palpate.paper.starts import (
    Starts,
    convergence_times,
    from_starts,
    identified,
    spread,
    starts_of,
    times_to,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Initial covariances, the same for every method, that the verdicts on speed are held against.
SAME_COVARIANCES = (10.0, 1e3, 1e6)
#: When "the first few milliseconds" end, s.
FIRST_FEW = 20e-3

Results = Mapping[str, Identification]


class Comparison(JudgedExperiment):
    """Every method, from every start of the paper's rule, on one recording of one material.

    Parameters
    ----------
    name, title : str
        Of the experiment.
    material : str
        Of the laboratory.
    kinds : tuple of type
        The paper's methods for it.
    judged : tuple
        Claims and who judges them.
    beside : str, optional
        A second material, on which the claims are looked at too.
    """

    caption = (
        "A column for each method: its parameters and its force error over the time since "
        "contact, from every start of the tables."
    )

    def __init__(
        self,
        name: str,
        title: str,
        material: str,
        kinds: tuple[type[RecursiveLeastSquaresEstimator], ...],
        judged: tuple[Judged, ...],
        beside: str = "",
    ) -> None:
        super().__init__(name, title, judged)
        self.material, self.kinds, self.beside = material, kinds, beside

    def measure(self, seed: int) -> tuple[dict[str, Any], Curves]:
        """Press once and identify by every method from every start."""
        numbers, curves = self._measured(self.material, seed)
        if self.beside:
            numbers["beside"] = self._measured(self.beside, seed)[0]
        return numbers, curves

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw the parameters and errors of every start, over the time since contact."""
        return draw_comparison(self.title, self.kinds, outcomes, dark=dark)

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Return starts, RMSE% and convergence times."""
        return comparison_tables(self.material, self.kinds, outcomes, self.beside)

    def _measured(self, material: str, seed: int) -> tuple[dict[str, Any], Curves]:
        contact = pressed(material, "three-sines", seed)
        numbers: dict[str, Any] = {"truth": json.loads(contact.provenance["truth"]), "methods": {}}
        curves: Curves = {}
        for kind in self.kinds:
            starts = starts_of(contact, kind)
            results = from_starts(contact, kind, starts)
            numbers["methods"][kind.method] = {
                "starts": {name: plain(law.parameters) for name, law in starts.items()},
                "same covariance": _with_same_covariances(contact, kind, starts),
                **_summary(results),
            }
            curves |= _curves(kind.method, results)
        projected = {"no start": identified(contact, VariableProjection())}
        numbers["methods"][VariableProjection.method] = _summary(projected)
        return numbers, curves | _curves(VariableProjection.method, projected)


def _summary(results: Results) -> dict[str, Any]:
    shown = list(results.values())
    symbols = shown[0].law.symbols
    taken = shown[0].trace.taken
    few = round(FIRST_FEW / shown[0].contact.sample_time)
    summary: dict[str, Any] = {
        "symbols": list(symbols),
        "rmse": {name: result.prediction_rmse_percent for name, result in results.items()},
        "final": {name: plain(result.law.parameters) for name, result in results.items()},
        "least of the first": {
            name: plain(result.trace.parameters[taken][:few].min(axis=0))
            for name, result in results.items()
        },
        # Starts that a large P₀ has forgotten agree long before they are right.
        "settled": plain(
            np.max([times_to(result, result.law.parameters) for result in shown], axis=0)
        ),
        "largest error": {name: _largest_errors(result) for name, result in results.items()},
    }
    if len(shown) > 1:
        summary["times"] = plain(convergence_times(shown))
        summary["spread"] = plain(100.0 * spread(shown)[-1])
    return summary


def _largest_errors(result: Identification) -> list[float]:
    """Largest force error in the first 0.2 s of contact and after, N."""
    taken = result.trace.taken
    error = np.abs(result.contact.force - result.trace.predicted_force)[taken]
    late = np.cumsum(result.contact.time_steps[taken]) > 0.2
    return plain([error[~late].max(), error[late].max()])


def _with_same_covariances(
    contact: Contact, kind: type[RecursiveLeastSquaresEstimator], starts: Starts
) -> dict[str, list[float]]:
    """Convergence times where every method starts with the same covariance."""
    return {
        f"{variance:g}": plain(
            convergence_times(
                list(from_starts(contact, kind, starts, initial_covariance=variance).values())
            )
        )
        for variance in SAME_COVARIANCES
    }


def _curves(method: str, results: Results) -> Curves:
    curves: Curves = {}
    for name, result in results.items():
        curves |= traced(f"{method}/{name}", result)
    return curves
