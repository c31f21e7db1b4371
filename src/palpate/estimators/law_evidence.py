"""What a verdict on laws is worked out from, where it may be given to another process."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from palpate.estimate import Estimate
from palpate.estimators.law_flags import (
    gate_flags,
    memory_flags,
    motion_flags,
    tie_flags,
    waiting_flags,
)
from palpate.estimators.law_verdicts import CANDIDATES, Candidate, LawVerdict, Standing


class Evidence(NamedTuple):
    """What a verdict is worked out from: plain numbers, that another process may be given.

    Attributes
    ----------
    rows : sequence of (int, float, float)
        Of each law that competed its place among :data:`CANDIDATES`, its score and RSS/N, N².
    samples, effective_samples : float
        As those of :class:`LawVerdict`.
    chosen : int
        Place of the law in force.
    depth, frequency : float
        As those of :class:`LawVerdict`.
    begun : bool
        Whether the samples began in contact.
    one_way : float
        Mean velocity over its root mean square, ±1 where the motion went one way at one speed.
    offered : int
        The laws on offer, a bit each.
    step : float
        Between samples, s.
    shallowest : float, optional
        Penetration that the gate asks of a sample, m; None where it asks for a force too.
    """

    rows: Sequence[Sequence[float]]
    samples: float
    effective_samples: float
    chosen: int
    depth: float
    frequency: float
    begun: bool
    one_way: float
    offered: int
    step: float
    shallowest: float | None

    @property
    def laws(self) -> tuple[Candidate, ...]:
        """The laws on offer."""
        return tuple(law for index, law in enumerate(CANDIDATES) if self.offered >> index & 1)


def verdict_of(evidence: Evidence, estimate: Estimate) -> LawVerdict:
    """Return the verdict.

    Parameters
    ----------
    evidence : Evidence
        Of :meth:`ViscoelasticContact.evidence`.
    estimate : Estimate
        Of the same moment.
    """
    ranked = sorted(evidence.rows, key=lambda row: row[1])
    least = ranked[0][1] if ranked else 0.0
    standings = tuple(
        Standing(CANDIDATES[int(index)], score - least, math.sqrt(mean_square))
        for index, score, mean_square in ranked
    )
    flags = (
        *tie_flags(standings),
        *waiting_flags(standings, evidence.laws),
        *motion_flags(standings, evidence.one_way),
        *gate_flags(standings, estimate, evidence.depth, evidence.shallowest),
        *memory_flags(estimate, evidence.samples * evidence.step, begun=evidence.begun),
    )
    return LawVerdict(
        CANDIDATES[evidence.chosen],
        standings,
        evidence.samples,
        evidence.effective_samples,
        evidence.depth,
        evidence.frequency,
        flags,
    )
