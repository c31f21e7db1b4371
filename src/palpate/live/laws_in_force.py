"""Which law it is, as the loop sees it: the law in force after each sample, and when it changed."""

from base64 import b64encode
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from palpate.estimators import ContactEstimator, ViscoelasticContact
from palpate.estimators.law_verdicts import Candidate

# Turns of the verdict that are remembered: more than that in a few seconds is one that flickers.
_REMEMBERED = 6


class Turn(NamedTuple):
    """Another law is in force, from a time on [s], by so many samples; None: none is."""

    time: float
    law: str | None
    samples: float


@dataclass(slots=True)
class LawsInForce:
    """The law in force, since when, and which were before it.

    Where the evidence is given up, as when the material changes, there is none until the next
    verdict, and the count of changes starts again.

    Attributes
    ----------
    shown : list of int
        Places of the law's parameters that some law on offer has as its own.
    remembers : bool
        Whether a law on offer has memory, so that K is the stiffness once it has relaxed.
    now : Candidate, optional
        The law in force.
    changes : int
        How often it changed since the evidence began.
    turns : deque
        What was in force from then on, and of how many samples.
    """

    shown: list[int]
    remembers: bool
    now: Candidate | None = None
    changes: int = 0
    turns: deque[Turn] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    @classmethod
    def of(cls, estimator: ContactEstimator) -> "LawsInForce":
        """Return that of an estimator which has learned nothing yet."""
        names = estimator.law_type.names()
        if not isinstance(estimator, ViscoelasticContact):
            return cls(list(range(len(names))), remembers=False)
        own = {name for law in estimator.offered for name in law.own}
        shown = [place for place, name in enumerate(names) if name in own]
        return cls(shown, remembers=any(law.memory != "none" for law in estimator.offered))

    def see(self, time: float, estimator: ContactEstimator) -> None:
        """Look at an estimator after a sample; at one that offers a single law there is nothing."""
        if not isinstance(estimator, ViscoelasticContact):
            return
        now = estimator.candidate
        if now is self.now:
            return
        self.changes = 0 if now is None or self.now is None else self.changes + 1
        self.now, samples = now, estimator.evidence().samples
        self.turns.append(Turn(time, None if now is None else str(now), samples))

    def page(self, estimator: ContactEstimator) -> dict[str, Any] | None:
        """Return what a verdict is worked out from, as JSON takes it; None where there is none.

        It is worked out where it is shown, by :func:`palpate.live.verdict_on_laws.verdict_on`: the
        loop has not the time.
        """
        if not isinstance(estimator, ViscoelasticContact):
            return None
        estimate = estimator.estimate()
        learned = len(self.turns) > 0  # where an estimator starts is nothing that it knows
        return {
            "evidence": estimator.evidence(),
            "fixed": estimate.fixed,
            "parameters": estimate.parameters.tolist() if learned else None,
            # Of 64 numbers: as digits they would take JSON ten times as long.
            "covariance": b64encode(estimate.covariance.tobytes()).decode() if learned else None,
            "flags": estimate.flags,
            "changes": self.changes,
            "turns": list(self.turns),
        }
