"""What a reader should know before trusting the numbers of an identification."""

import numpy as np

from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis.left_out import count_of_outliers
from palpate.estimate import ADVICE
from palpate.estimators import ContactEstimator, ViscoelasticContact
from palpate.force_laws import GeneralisedHuntCrossley, HuntCrossley
from palpate.metrics import has_prediction_error, violated_fraction
from palpate.refusals import not_finite
from palpate.trace import Trace

#: What the bits of an estimate's flags say, for each of their combinations.
ADVICE_OF = [tuple(words for bit, words in ADVICE.items() if bits & bit) for bits in range(256)]


NEGATIVE_STIFFNESS = (
    "negative stiffness: by this law the force falls as the probe goes deeper; check the signs"
)
NEGATIVE_DAMPING = "negative damping: this law gives energy back, which no passive material does"


def flags_of(contact: Contact, trace: Trace, estimator: ContactEstimator) -> list[str]:
    """Return the flags of the last estimate, and those of the contact as a whole."""
    estimate = estimator.estimate()
    law = estimate.law
    flags = list(estimate.flags)
    if estimate.samples < 10 * len(law.symbols):
        flags.append(f"only {estimate.samples} samples in contact")
    if isinstance(law, HuntCrossley) and law.stiffness < 0.0:
        flags.append(NEGATIVE_STIFFNESS)
    if law.as_dict().get("damping", 0.0) < 0.0:
        flags.append(NEGATIVE_DAMPING)
    violated = violated_fraction(trace) if estimator.needs_condition_10 else 0.0
    if violated > 0.0:
        flags.append(f"condition 10 violated in {violated:.1%} of the contact")
    if not has_prediction_error(trace, contact.force, contact.time_steps):
        flags.append("less than 0.2 s of contact: no prediction error")
    if estimate.guarded:
        flags.append(f"covariance guard acted on {estimate.guarded} samples")
    if left_out := int(np.count_nonzero(trace.rejected)):
        flags.append(count_of_outliers(left_out, left_out + int(np.count_nonzero(trace.taken))))
    if isinstance(law, GeneralisedHuntCrossley) and law.stiffness < 0.0 and not law.remembers:
        flags.append(NEGATIVE_STIFFNESS)
    if isinstance(estimator, ViscoelasticContact):
        flags += _memory_flags(estimator)
    for refusal in (Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE):
        count = int(np.count_nonzero(trace.status == refusal))
        if count:
            words = refusal.name.lower().replace("_", " ")
            if refusal == Status.NOT_FINITE:
                words += f": {not_finite(contact)}"
            flags.append(f"{count} samples refused: {words}")
    return flags


def _memory_flags(estimator: ViscoelasticContact) -> list[str]:
    """Say of what a law with memory has a stiffness, and what is open of the verdict."""
    verdict = estimator.verdict()
    if not estimator.estimate().law.remembers:
        return list(verdict.flags)
    words = (
        f"the material remembers ({verdict.candidate}): force, stiffness and damping at a depth "
        "are those once it has relaxed; K′ and B′ are what a small oscillation feels"
    )
    return [words, *verdict.flags]
