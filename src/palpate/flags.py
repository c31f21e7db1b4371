"""What a reader should know before trusting the numbers of an identification."""

from contextlib import suppress

import numpy as np

from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis.left_out import count_of_outliers
from palpate.digits import rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.estimators import ContactEstimator, ViscoelasticContact
from palpate.metrics import has_prediction_error, violated_fraction
from palpate.refusals import not_finite
from palpate.trace import Trace


def flags_of(contact: Contact, trace: Trace, estimator: ContactEstimator) -> list[str]:
    """Return the flags of the last estimate, and those of the contact as a whole."""
    estimate, violated = estimator.estimate(), violated_fraction(trace)
    law, flags = estimate.law, list(estimate.flags)
    if estimate.samples < 10 * len(law.symbols):
        flags.append(f"only {estimate.samples} samples in contact")
    if law.as_dict().get("damping", 0.0) < 0.0:
        flags.append("negative damping: this law gives energy back, which no passive material does")
    if isinstance(estimator, ViscoelasticContact):
        flags += _memory_flags(estimator)
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


def _memory_flags(estimator: ViscoelasticContact) -> list[str]:
    """Say of what a law with memory has a stiffness, and what is open of it."""
    if not estimator.estimate().law.remembers:
        return []
    verdict, felt = estimator.verdict(), ""
    with suppress(InvalidParameterError):  # of a probe that never moved there is no frequency
        told = estimator.dynamic_stiffness()
        felt = (
            f"; an oscillation of {rounded(told.frequency, 3)} rad/s about "
            f"{rounded(1e3 * told.depth, 3)} mm feels "
            f"{with_error(told.stiffness, told.stiffness_error, unit='N/m')} and "
            f"{with_error(told.damping, told.damping_error, unit='N·s/m')}"
        )
    words = (
        f"the material remembers ({verdict.candidate}): force and stiffness are those once it has "
        f"relaxed{felt}"
    )
    return [words, *verdict.flags]
