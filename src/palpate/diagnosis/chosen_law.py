"""What speaks against a law that was chosen: one relaxation time, or what it fails to predict."""

import math
from collections.abc import Callable

import numpy as np

from palpate.diagnosis.finding import MORE_LAWS, Laws
from palpate.diagnosis.fit import Fit, MisfitHypothesis, Moves
from palpate.diagnosis.marks import finding_of, marks_of
from palpate.digits import rounded
from palpate.findings import MARKS, Finding, Mark, worst
from palpate.validation import Floats

# Least change that is reported, of the number. In the noise of a robot's encoder and amplifier one
# more number finds something: on clean runs it is preferred in one of six, and moves B′ by 1 %.
SMALL = 0.02
# Error in the last third over that in the others: of a law that holds 0.9 to 1.1, in noise as slow
# as the motion up to 2.6, where it moves the numbers by less than the error bars.
SURPRISE = 1.5
# Of the force: of materials that soften the second half is then predicted from the first with an
# error of 25 %.
MISSED = 0.07


def one_relaxation_time(fit: Fit) -> MisfitHypothesis | None:
    """The law with one relaxation time that the samples of ``--law auto`` strongly prefer, if any.

    It changes stiffness and damping by as much as it does K′ and B′ at the motion's frequency; how
    far a material relaxes in the end is what no recording of a motion says.
    """
    laws = fit.laws
    if laws is None or laws.one_time is None:
        return None
    omega, other = laws.verdict.frequency, laws.one_time
    if not (omega > 0.0 and fit.depth > 0.0):
        return None

    def felt(laws: Laws, depth: float) -> Floats:
        whole = laws.law.dynamic_stiffness(depth, omega)
        return np.array([whole.real, whole.imag / omega])

    own = felt(laws, fit.depth)
    parts = (felt(other, fit.depth) - own) / np.abs(own)
    if not SMALL <= np.abs(parts).max() < np.inf:
        return None
    best, before = (each.verdict.model_ranking[0] for each in (other, laws))
    sentence = (
        f"{best.candidate.title}, which --law auto does not offer, is strongly preferred: K′ "
        f"{parts[0]:+.0%}, B′ {parts[1]:+.0%} at the motion's frequency"
    )
    moves = _moves(lambda depth: felt(other, depth) - felt(laws, depth))
    gain = 1.0 - (best.rms_error / before.rms_error) ** 2
    described = gain, math.nan, sentence, MORE_LAWS, moves
    return MisfitHypothesis("law", math.nan, *described, *parts.tolist())


def held_out(fit: Fit) -> tuple[MisfitHypothesis, Finding] | None:
    """The last third of the contact is not as the law of the others says, if that matters."""
    laws = fit.laws
    if laws is None or laws.before is None or not laws.surprise > SURPRISE:
        return None
    last, before = laws.law, laws.before.law
    moves = _moves(lambda depth: np.subtract(last.at_rest(depth), before.at_rest(depth))[1:])
    stiffness, damping = moves(fit)
    missed = laws.missed > MISSED
    if not (missed or SMALL <= max(abs(stiffness), abs(damping)) < np.inf):
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
    return cause, at_most_care(cause, least="with-care" if missed else "trust")


def at_most_care(cause: MisfitHypothesis, *, least: Mark = "trust") -> Finding:
    """A finding on a law that was chosen: what speaks against it need not predict better."""
    marks = (worst(least, min(mark, "with-care", key=MARKS.index)) for mark in marks_of(cause))
    return finding_of(cause, "note", *marks)


def _moves(change: Callable[[float], Floats]) -> Moves:
    """Moves by a change of stiffness and damping at a depth, SI."""

    def moves(fit: Fit) -> tuple[float, float]:
        stiffness, damping = (change(fit.depth) / fit.sizes).tolist()
        return stiffness, damping

    return moves
