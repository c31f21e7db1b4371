"""An experiment whose claims are judged from its numbers."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

from palpate.paper.experiment import Claim, Experiment, Finding, Outcome

Numbers = Mapping[str, Any]
Curves = dict[str, list[float]]
Judge = Callable[[Numbers], Finding]
Judged = tuple[Claim, Judge]


class JudgedExperiment(Experiment):
    """Measures first and judges after, so that every verdict can be traced to its numbers.

    Parameters
    ----------
    name, title : str
        Of the experiment.
    judged : tuple
        Claims, and who judges them.
    """

    def __init__(self, name: str, title: str, judged: tuple[Judged, ...]) -> None:
        self.name, self.title = name, title
        self.claims = tuple(claim for claim, _ in judged)
        self._judged = judged

    @abstractmethod
    def measure(self, seed: int) -> tuple[dict[str, Any], Curves]:
        """Return numbers for tables and verdicts, and curves for the figure."""

    def run(self, seed: int) -> Outcome:
        """Measure once, and judge every claim."""
        numbers, curves = self.measure(seed)
        verdicts = {claim.key: judge(numbers) for claim, judge in self._judged}
        return Outcome(seed, numbers, curves, verdicts)


def unchecked(why: str) -> Judge:
    """Return a judge that says why a claim cannot be checked here."""
    return lambda numbers: Finding(None, None, why)
