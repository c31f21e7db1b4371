"""Which law it is, as the loop sees it: the law in force after each sample, and when it changed."""

import math
from base64 import b64encode
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from palpate.estimate import Estimate
from palpate.estimators import ContactEstimator, ViscoelasticContact
from palpate.estimators.law_verdicts import Candidate, LawVerdict
from palpate.force_laws import GeneralisedHuntCrossley

# Turns of the verdict that are remembered: more than that in a few seconds is one that flickers.
_REMEMBERED = 6
# Of the samples, that are independent: AR(1) noise of 0.9 leaves a nineteenth, of 0.875 as many.
_FEW = 1.0 / 15.0
_DAMPING = GeneralisedHuntCrossley.names().index("damping")


class Turn(NamedTuple):
    """Another law is in force, from a time on [s], by so many samples; None: none is."""

    time: float
    law: Candidate | None
    samples: float


@dataclass(slots=True)
class LawsInForce:
    """The law in force, since when, and which were before it.

    Where the evidence is given up, as when the material changes, there is none until the next
    verdict, and the count of changes begins anew.
    """

    now: Candidate | None = None
    changes: int = 0
    #: What was in force from then on, and of how many samples.
    turns: deque[Turn] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    def see(self, time: float, estimator: ContactEstimator) -> None:
        """Look at an estimator after a sample; at one that offers a single law there is nothing."""
        if not isinstance(estimator, ViscoelasticContact):
            return
        now = estimator.candidate
        if now is self.now:
            return
        self.changes = 0 if now is None or self.now is None else self.changes + 1
        self.now = now
        self.turns.append(Turn(time, now, estimator.verdict().samples))

    def page(self, estimator: ContactEstimator) -> dict[str, Any] | None:
        """Return what is to be known of the verdict, as JSON takes it; None where there is none.

        That is what costs little in the loop; what follows from it, such as the dynamic stiffness,
        is worked out where it is shown: :mod:`palpate.live.law_numbers`.
        """
        if not isinstance(estimator, ViscoelasticContact):
            return None
        verdict, estimate, offered = estimator.verdict(), estimator.estimate(), estimator.offered
        learned = len(self.turns) > 0  # where an estimator starts is nothing that it knows
        return {
            **verdict.as_dict(),
            "known": bool(verdict.standings),
            "offered": [str(law) for law in offered],
            "own": list(verdict.candidate.own),
            "fixed": list(estimate.fixed),
            "parameters": estimate.parameters.tolist() if learned else None,
            # Of 64 numbers: as digits they would take JSON ten times as long.
            "covariance": b64encode(estimate.covariance.tobytes()).decode() if learned else None,
            "flags": [
                *estimate.flags,
                *verdict.flags,
                *self._unsettled(verdict.samples),
                *_open(verdict, estimate, offered),
            ],
            "since": self.turns[-1].time if self.turns else math.nan,
            "changes": self.changes,
            "turns": [[each.time, each.law and str(each.law)] for each in self.turns],
        }

    def _unsettled(self, samples: float) -> list[str]:
        """Say of a verdict that it flickers: twice another while the samples doubled."""
        late = [turn for turn in self.turns if turn.law and 2.0 * turn.samples > samples]
        # The first law after a change of the material is no turn.
        count = min(len(late), self.changes)
        if count < 2:
            return []
        return [f"the verdict is not settled: it changed {count} times while the samples doubled"]


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


def _open(verdict: LawVerdict, estimate: Estimate, offered: Sequence[Candidate]) -> list[str]:
    """Say what the samples so far leave open of the verdict itself."""
    stand = {each.candidate for each in verdict.standings}
    if not stand:
        return []
    flags = []
    if any(law.memory != "none" and law not in stand for law in offered):
        flags.append("no law with memory competes yet: five numbers fit any hundred samples")
    if verdict.effective_samples < _FEW * verdict.samples:
        flags.append(
            "what the best law leaves is correlated: so is the sensor's noise, or none of the laws "
            "on offer holds, and their error bars do not say so; --law any offers all"
        )
    damping, error = estimate.parameters[_DAMPING], estimate.standard_errors[_DAMPING]
    if verdict.candidate.damping != "none" and abs(damping) < 1e-6 * error:
        flags.append("B is 0: laws that differ by their damper alone are the same here")
    return flags
