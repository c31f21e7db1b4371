"""What laws that are told apart made of the samples that were identified."""

from dataclasses import dataclass

from palpate.digits import rounded
from palpate.estimators import LawVerdict, ViscoelasticContact
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
    """

    law: GeneralisedHuntCrossley
    verdict: LawVerdict
    own: bool = False

    @classmethod
    def of(cls, estimator: ViscoelasticContact, *, own: bool = False) -> "Laws":
        """Of an estimator that has learned the samples."""
        return cls(estimator.estimate().law, estimator.verdict(), own)


def remedy_of_memory(laws: Laws | None, time: float, sample_time: float) -> str:
    """What to do of a memory that the residual shows, in agreement with the verdict on laws.

    Parameters
    ----------
    laws : Laws, optional
        That were told apart.
    time : float
        For how long the residual remembers, s.
    sample_time : float
        s.
    """
    if laws is None:
        return f"{REMEDY} tells whether a law with memory is better; or {FASTER}"
    chosen = laws.verdict.candidate
    if chosen.memory != "none":
        if laws.own:
            return f"that is beside the memory of the law: --law any has more kinds; or {FASTER}"
        return f"{REMEDY} identifies the memory; or {FASTER}"
    if time > _LONGEST * sample_time:
        longest = rounded(_LONGEST * sample_time, 2)
        return f"longer than the {longest} s of {REMEDY}: as likely the drift of a sensor; {FASTER}"
    better = f"{chosen}, which has none, is better" if not laws.own else "that has none is better"
    return f"no law with memory helps, by {REMEDY}: {better}; {FASTER}"
