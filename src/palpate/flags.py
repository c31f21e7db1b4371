"""What a reader should know before trusting the numbers of an identification."""

import numpy as np

from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis.left_out import count_of_outliers
from palpate.estimators import ContactEstimator
from palpate.force_laws import HuntCrossley
from palpate.metrics import has_prediction_error, violated_fraction
from palpate.refusals import not_finite
from palpate.trace import Trace

NEGATIVE_STIFFNESS = (
    "negative stiffness: by this law the force falls as the probe goes deeper; check the signs"
)
NEGATIVE_DAMPING = "negative damping: this law gives energy back, which no passive material does"


def flags_of(contact: Contact, trace: Trace, estimator: ContactEstimator) -> list[str]:
    """Return the flags of the last estimate, and those of the contact as a whole."""
    estimate, violated = estimator.estimate(), violated_fraction(trace)
    law, flags = estimate.law, list(estimate.flags)
    if estimate.samples < 10 * len(law.symbols):
        flags.append(f"only {estimate.samples} samples in contact")
    if isinstance(law, HuntCrossley) and law.stiffness < 0.0:
        flags.append(NEGATIVE_STIFFNESS)
    if law.as_dict().get("damping", 0.0) < 0.0:
        flags.append(NEGATIVE_DAMPING)
    if estimator.needs_condition_10 and violated > 0.0:
        flags.append(f"condition 10 violated in {violated:.1%} of the contact")
    if not has_prediction_error(trace, contact.force, contact.time_steps):
        flags.append("less than 0.2 s of contact: no prediction error")
    if estimate.guarded:
        flags.append(f"covariance guard acted on {estimate.guarded} samples")
    left_out = int(np.count_nonzero(trace.rejected))
    if left_out:
        contact_samples = left_out + int(np.count_nonzero(trace.taken))
        flags.append(count_of_outliers(left_out, contact_samples))
    for refusal in (Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE):
        count = int(np.count_nonzero(trace.status == refusal))
        if count:
            words = refusal.name.lower().replace("_", " ")
            if refusal == Status.NOT_FINITE:
                words += f": {not_finite(contact)}"
            flags.append(f"{count} samples refused: {words}")
    return flags
