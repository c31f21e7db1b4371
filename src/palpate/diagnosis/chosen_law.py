"""What speaks against a law that was chosen: one relaxation time, or what it fails to predict."""

import math
import sys

import numpy as np

from palpate.diagnosis.finding import MORE_LAWS, Laws
from palpate.diagnosis.fit import Fit, MisfitHypothesis
from palpate.diagnosis.marks import finding_of, marks_of
from palpate.digits import rounded
from palpate.estimators.law_verdicts import STRONG
from palpate.findings import MARKS, Finding, Mark, worst
from palpate.validation import Floats

# Least change that is reported, of the number. In the noise of a robot's encoder and amplifier one
# more number finds something: on clean runs it is preferred in one of six, and moves B′ by 1 %.
SMALL = 0.02


def one_relaxation_time(fit: Fit) -> MisfitHypothesis | None:
    """The law with one relaxation time that the samples of ``--law auto`` strongly prefer, if any.

    It changes stiffness and damping by as much as it does K′ and B′ at the motion's frequency; how
    far a material relaxes in the end is what no recording of a motion says.
    """
    laws = fit.laws
    if laws is None or laws.one_time is None or not (laws.verdict.known and fit.depth > 0.0):
        return None
    own, other, omega = laws.verdict, laws.one_time, laws.verdict.frequency
    if not (other.verdict.known and omega > 0.0):
        return None
    # As in model selection, by the effective sample size of the common laws.
    best, before = other.verdict.model_ranking[0], own.model_ranking[0]
    size = max(own.effective_samples, 1.0)
    left = (math.log(max(each.rms_error, sys.float_info.min)) for each in (before, best))
    gained = 2.0 * (next(left) - next(left))
    more = best.candidate.parameters - before.candidate.parameters
    score = size * gained - 2.0 * more * math.log(size)
    felt = _felt(laws, fit.depth, omega)
    parts = (_felt(other, fit.depth, omega) - felt) / np.abs(felt)
    if not (score >= STRONG and SMALL <= np.abs(parts).max() < np.inf):
        return None

    def moves(fit: Fit) -> tuple[float, float]:
        apart = (_felt(other, fit.depth, omega) - _felt(laws, fit.depth, omega)) / fit.sizes
        return float(apart[0]), float(apart[1])

    sentence = (
        f"{best.candidate.title} describes the force better (ΔBIC {rounded(score, 3)}): K′ "
        f"{parts[0]:+.0%}, B′ {parts[1]:+.0%} at the motion's frequency"
    )
    described = 1.0 - math.exp(-gained), math.nan, sentence, MORE_LAWS, moves
    return MisfitHypothesis("law", math.nan, *described, *parts.tolist())


# Error in the last third over that in the others: of a law that holds 0.9 to 1.1, in noise as slow
# as the motion up to 2.6, where it moves the numbers by less than the error bars.
SURPRISE = 1.5
# Of the force: of materials that soften the second half is then predicted from the first with an
# error of 25 %.
MISSED = 0.07


def at_most_care(cause: MisfitHypothesis, *, least: Mark = "trust") -> Finding:
    """A finding on a law that was chosen: what speaks against it need not predict better."""
    marks = (worst(least, min(mark, "with-care", key=MARKS.index)) for mark in marks_of(cause))
    return finding_of(cause, "note", *marks)


def held_out(fit: Fit) -> tuple[MisfitHypothesis, Finding] | None:
    """The last third of the contact is not as the law of the others says, if that matters."""
    laws = fit.laws
    if laws is None or laws.before is None or not laws.surprise > SURPRISE:
        return None
    before = laws.before.law

    def moves(fit: Fit) -> tuple[float, float]:
        apart = np.subtract(laws.law.at_rest(fit.depth), before.at_rest(fit.depth))[1:] / fit.sizes
        return float(apart[0]), float(apart[1])

    stiffness, damping = moves(fit)
    largest = max(abs(stiffness), abs(damping))
    if not (SMALL <= largest < np.inf or laws.missed > MISSED):
        return None
    sentence = (
        f"the law of the first two thirds of the contact predicts the force of the last third with "
        f"an error of {laws.missed:.0%}, {rounded(laws.surprise, 2)} times that before: with the "
        f"last third the stiffness changes by {stiffness:+.0%} and the damping by {damping:+.0%}"
    )
    begun = float(np.quantile(fit.data.time[fit.inside], 2.0 / 3.0))
    remedy = f"identify the recent part alone: --start {rounded(begun, 3)}"
    described = math.nan, 0.0, math.nan, sentence, remedy, moves, stiffness, damping
    cause = MisfitHypothesis("held-out force", *described)
    return cause, at_most_care(cause, least="with-care" if laws.missed > MISSED else "trust")


def _felt(laws: Laws, depth: float, omega: float) -> Floats:
    """K′ and B′ of a small oscillation, shape (2,)."""
    whole = laws.law.dynamic_stiffness(depth, omega)
    return np.array([whole.real, whole.imag / omega])
