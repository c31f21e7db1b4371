"""What a reader should know before trusting the numbers of an identification."""

import math
from typing import TYPE_CHECKING

import numpy as np

from palpate._core import Status
from palpate.refusals import not_finite

if TYPE_CHECKING:
    from palpate.identification import Identification


def flags_of(result: "Identification") -> list[str]:
    """Return the flags of the estimate, and those of the contact as a whole."""
    flags = list(result.estimate.flags)
    law, estimate, status = result.law, result.estimate, result.trace.status
    if estimate.samples < 10 * len(law.symbols):
        flags.append(f"only {estimate.samples} samples in contact")
    if law.as_dict().get("damping", 0.0) < 0.0:
        flags.append("negative damping: this law gives energy back, which no passive material does")
    if result.estimator.needs_condition_10 and result.violated_fraction > 0.0:
        flags.append(f"condition 10 violated in {result.violated_fraction:.1%} of the contact")
    if math.isnan(result.prediction_rmse_percent):
        flags.append("less than 0.2 s of contact: no prediction error")
    if estimate.guarded:
        flags.append(f"covariance guard acted on {estimate.guarded} samples")
    for refusal in (Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE):
        count = int(np.count_nonzero(status == refusal))
        if count:
            words = refusal.name.lower().replace("_", " ")
            if refusal == Status.NOT_FINITE:
                words += f": {not_finite(result.contact)}"
            flags.append(f"{count} samples refused: {words}")
    return flags
