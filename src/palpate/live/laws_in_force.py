"""Which law it is, as the loop sees it: the law in force after each sample, and when it changed."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from palpate.estimators import ContactEstimator, ViscoelasticContact
from palpate.estimators.law_verdicts import Candidate, LawVerdict

# Turns of the verdict that are remembered: more than that in a few seconds is one that flickers.
_REMEMBERED = 6


@dataclass(slots=True)
class LawsInForce:
    """The law in force, since when, and which were before it.

    Where the evidence is given up, as when the material changes, there is none until the next
    verdict, and the count of changes begins anew.
    """

    now: Candidate | None = None
    changes: int = 0
    #: Times, and what was in force from then on.
    turns: deque[tuple[float, Candidate | None]] = field(
        default_factory=lambda: deque(maxlen=_REMEMBERED)
    )

    def see(self, time: float, estimator: ContactEstimator) -> None:
        """Look at an estimator after a sample; at one that offers a single law there is nothing."""
        if not isinstance(estimator, ViscoelasticContact):
            return
        now = estimator.candidate
        if now is self.now:
            return
        self.changes = 0 if now is None or self.now is None else self.changes + 1
        self.now = now
        self.turns.append((time, now))

    def page(self, estimator: ContactEstimator) -> dict[str, Any] | None:
        """Return what is to be known of the verdict, as JSON takes it; None where there is none.

        That is what costs little in the loop; what follows from it, such as the dynamic stiffness,
        is worked out where it is shown: :mod:`palpate.live.law_numbers`.
        """
        if not isinstance(estimator, ViscoelasticContact):
            return None
        verdict, estimate = estimator.verdict(), estimator.estimate()
        learned = estimate.samples > 0
        return {
            **verdict.as_dict(),
            "known": bool(verdict.standings),
            "offered": [str(law) for law in estimator.offered],
            "own": [name for name in verdict.candidate.own if name not in estimate.fixed],
            "parameters": estimate.parameters.tolist() if learned else None,
            "covariance": estimate.covariance.tolist() if learned else None,
            "flags": [*estimate.flags, *verdict.flags, *_waiting(verdict, estimator.offered)],
            "since": self.turns[-1][0] if self.turns else math.nan,
            "changes": self.changes,
            "turns": [[time, None if law is None else str(law)] for time, law in self.turns],
        }


def shown_parameters(estimator: ContactEstimator) -> list[int]:
    """Return places of the law's parameters that some law on offer has as its own."""
    names = estimator.law_type.names()
    if not isinstance(estimator, ViscoelasticContact):
        return list(range(len(names)))
    own = {name for law in estimator.offered for name in law.own}
    return [place for place, name in enumerate(names) if name in own]


def may_remember(estimator: ContactEstimator) -> bool:
    """Whether a law on offer has memory, so that K is the stiffness once it has relaxed."""
    if not isinstance(estimator, ViscoelasticContact):
        return False
    return any(law.memory != "none" for law in estimator.offered)


def _waiting(verdict: LawVerdict, offered: Sequence[Candidate]) -> list[str]:
    """Say of laws with memory that they do not compete yet."""
    stand = {each.candidate for each in verdict.standings}
    if not stand or all(law.memory == "none" or law in stand for law in offered):
        return []
    return ["no law with memory competes yet: five numbers fit any hundred samples"]
