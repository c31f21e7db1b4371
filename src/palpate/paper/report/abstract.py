"""What the claims come to, in ten lines."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from palpate.paper.experiment import claims_file
from palpate.paper.report.verdicts import Judgement, Verdict, verdict_of


@dataclass(frozen=True, slots=True)
class Line:
    """Several claims in one sentence.

    Attributes
    ----------
    words : str
        What the paper claims, in short.
    because : str
        Why some of it does not reproduce.
    held, checked : int
        How many of the claims reproduce in every seed, of those that can be checked.
    """

    words: str
    because: str
    held: int
    checked: int

    @property
    def verdict(self) -> Verdict:
        """Of all together."""
        return verdict_of(self.held, self.checked)


def abstract(judgements: Sequence[Judgement]) -> Iterator[Line]:
    """Sum up judgements line by line; what was not run is left out."""
    known = {f"{each.experiment}.{each.claim.key}": each.verdict for each in judgements}
    for said in claims_file()["abstract"].values():
        verdicts = [known[key] for key in said["claims"].split() if key in known]
        checked = [verdict for verdict in verdicts if verdict is not Verdict.UNCHECKED]
        if checked:
            held = checked.count(Verdict.REPRODUCED)
            yield Line(said["words"], said["because"], held, len(checked))
