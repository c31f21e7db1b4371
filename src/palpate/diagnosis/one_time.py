"""One relaxation time, which the common laws do not offer, where it describes the force better."""

import math
import sys

import numpy as np

from palpate.diagnosis.finding import MORE_LAWS, Laws
from palpate.diagnosis.fit import Fit, MisfitHypothesis
from palpate.digits import rounded
from palpate.estimators.law_verdicts import STRONG
from palpate.validation import Floats

# Of K′ or B′. In the noise of a robot's encoder and amplifier one more number finds something: on
# clean runs it is preferred in one of six, and moves B′ by 1 %.
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


def _felt(laws: Laws, depth: float, omega: float) -> Floats:
    """K′ and B′ of a small oscillation, shape (2,)."""
    whole = laws.law.dynamic_stiffness(depth, omega)
    return np.array([whole.real, whole.imag / omega])
