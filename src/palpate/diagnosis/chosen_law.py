"""What speaks against a law that was chosen: samples that it fails to predict, no hold."""

import math
from collections.abc import Callable

import numpy as np

from palpate.diagnosis.fit import FEWEST_ROWS, Fit, MisfitHypothesis, Moves
from palpate.diagnosis.marks import finding_of, marks_of
from palpate.digits import rounded
from palpate.findings import MARKS, Finding, Mark, worst
from palpate.validation import Floats

# Least change that is reported, of the number.
SMALL = 0.02
# Error in the last third over that in the others: of a law that holds 0.9 to 1.1, in noise as slow
# as the motion up to 2.6, where it changes the result by less than the error bars.
SURPRISE = 1.5
# Of the force: of materials that soften the second half is then predicted from the first with an
# error of 25 %.
MISSED = 0.07


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


# How far a material relaxes in the end: what only a hold shows.

HOLD = 3.0  # relaxation times, after which e⁻³ = 5 % is left
STILL = 0.05  # of the rms velocity


def relaxed_stiffness(fit: Fit) -> Finding | None:
    """The stiffness after relaxation is extrapolated where no hold of three times was recorded."""
    if fit.laws is None or not (fit.laws.own and fit.laws.law.remembers):
        return None
    inside, data = np.flatnonzero(fit.inside), fit.data
    still = np.abs(data.velocity[inside]) < STILL * fit.speed
    ends = np.flatnonzero(np.diff(still, prepend=False, append=False)).reshape(-1, 2)
    time = data.time[inside]
    held = max((float(time[end - 1] - time[begin]) for begin, end in ends.tolist()), default=0.0)
    relaxation = fit.laws.law.relaxation
    assert relaxation is not None
    if held >= HOLD * relaxation.longest_time:
        return None
    return Finding(
        "relaxed stiffness",
        "the relaxed stiffness is extrapolated: no hold as long as three relaxation times was "
        "recorded; K′ and B′ at the motion's frequency do not need it",
        f"press, and hold for {rounded(HOLD * relaxation.longest_time, 2)} s",
        stiffness="with-care",
    )


# The last third of a recording, as the law of the rows before it predicts it.

PARTS = 3  # of the rows in the band: the last is predicted
CARE, STOP = 0.25, 1.0  # of the force
# Times the error that noise, misfit and another motion let expect.
UNEXPECTED = 3.0
FADES = 0.8  # of the error by all rows before
CYCLES = 6.0  # periods of the motion: a ramp and its hold are no change of the material


def ahead(fit: Fit) -> Finding | None:
    """The law of the first two thirds does not predict the last, or less well than the second does.

    By one linear step from the law of all rows, of which every third shares no window with others.
    """
    rows = len(fit.band)
    if rows < FEWEST_ROWS:
        return None
    third, last = rows // PARTS, rows - rows // PARTS
    size = math.sqrt(float(np.mean((fit.force[last:] - fit.solution.offset) ** 2)))
    whole, expected = _held_out(fit, slice(0, last, 3))
    if not whole > UNEXPECTED * fit.floor:
        return None
    if whole > max(CARE * size, UNEXPECTED * expected):
        return Finding.of_both(
            "do-not-trust" if whole > STOP * size else "with-care",
            "forecast",
            "identified on its first two thirds, the recording's last third is off by "
            f"{whole / size:.0%} of the force",
            "record the motion of the task, and repeat it",
        )
    recent, _ = _held_out(fit, slice(third, last, 3))
    cycles = fit.time[-1] - fit.time[0] > CYCLES * fit.period > 0.0
    if fit.laws is not None and fit.laws.own:
        return None  # of a selected law model selection has predicted it
    if not (cycles and recent < FADES * whole and (fit.time[:last] < fit.time[last]).all()):
        return None
    parts = (f"{rounded(100.0 * error / size, 2)} %" for error in (recent, whole))
    return Finding(
        "forecast",
        "the force settles, or the material or a sensor changes slowly: the third before the last "
        "predicts that to {} of the force, all before it to {}".format(*parts),
        "to predict what comes next, identify the latest part alone: "
        f"--start {rounded(float(fit.time[last]), 4)}",
    )


def _held_out(fit: Fit, before: slice) -> tuple[float, float]:
    """Rms error with which the law of some rows predicts those after, and the expected one, N."""
    jacobian, residual = fit.solution.jacobian, fit.solution.residual
    after = slice(before.stop, None, before.step)
    own, others = jacobian[before], jacobian[after]
    size = np.maximum(np.linalg.norm(own, axis=0), 1e-300)
    own, others = own / size, others / size
    inverse = np.linalg.pinv(own.T @ own, rcond=1e-12, hermitian=True)
    change = inverse @ (own.T @ residual[before])
    error, left = residual[after] - others @ change, residual[before] - own @ change
    leverage = float(np.mean(np.sum((others @ inverse) * others, axis=1)))
    noise = max(float(np.mean(left**2)), fit.floor**2)
    return math.sqrt(float(np.mean(error**2))), math.sqrt(noise * (1.0 + leverage))
