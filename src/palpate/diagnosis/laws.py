"""What laws that are compared made of the samples that were identified."""

from dataclasses import dataclass

from palpate.digits import rounded
from palpate.estimators import LawVerdict, ViscoelasticContact
from palpate.estimators.law_verdicts import EVERYDAY
from palpate.force_laws import GeneralisedHuntCrossley

REMEDY = "--law auto"
FASTER = "move as fast as the task will"
# Of the everyday bank: its longest relaxation time, in sample times.
_LONGEST = 2048.0


@dataclass(frozen=True, slots=True, eq=False)
class Laws:
    """Which of them was chosen, and by what evidence.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        That was chosen.
    verdict : LawVerdict
        The evidence.
    own : bool
        Whether it is the identification's own law.
    longest : float
        The longest relaxation time that was looked for, s.
    """

    law: GeneralisedHuntCrossley
    verdict: LawVerdict
    own: bool = False
    longest: float = 0.0

    @property
    def asked_for_memory(self) -> bool:
        """Whether laws with memory were among them."""
        return any(each.candidate.memory != "none" for each in self.verdict.standings)

    @property
    def open_memory(self) -> bool:
        """Whether these samples do not say how much relaxes, though they say that it does."""
        return any("relaxation stiffness not identifiable" in f for f in self.verdict.flags)

    @property
    def of_all(self) -> bool:
        """Whether they were more than the everyday ones."""
        return len(self.verdict.standings) > EVERYDAY

    @classmethod
    def of(cls, estimator: ViscoelasticContact, *, own: bool = False) -> "Laws":
        """Of an estimator that has learned the samples."""
        longest = _LONGEST * estimator.evidence().step
        return cls(estimator.estimate().law, estimator.verdict(), own, longest)


def remedy_of_memory(laws: Laws | None, time: float) -> str:
    """What to do of a memory that the residual shows, in agreement with the verdict on laws.

    Parameters
    ----------
    laws : Laws, optional
        That were compared.
    time : float
        For how long the residual remembers, s.
    """
    if laws is None or not laws.asked_for_memory:
        return f"{REMEDY} tells whether a law with memory is better; or {FASTER}"
    if laws.verdict.candidate.memory != "none":
        if not laws.own:
            return f"{REMEDY} identifies the memory; or {FASTER}"
        return FASTER if laws.of_all else f"--law any has more kinds of memory; or {FASTER}"
    if time > laws.longest and not laws.of_all:
        longest = rounded(laws.longest, 2)
        return f"longer than the {longest} s of {REMEDY}: as likely the drift of a sensor; {FASTER}"
    better = "by the verdict on laws" if laws.own else f"by {REMEDY}: {laws.verdict.candidate} is"
    return f"no law with memory is better, {better}; {FASTER}"
