"""Outliers that were left out: said always, and not to be trusted blindly where they are many."""

import numpy as np

from palpate.diagnosis.finding import Finding
from palpate.diagnosis.fit import Fit
from palpate.digits import rounded

MANY = 0.02  # of the samples in contact


def left_out(fit: Fit) -> Finding | None:
    """Samples that the rejection of outliers left out; more than 2 % call for care."""
    count = int(np.count_nonzero(fit.rejected))
    if count == 0:
        return None
    contact = int(np.count_nonzero(fit.inside)) + count
    return Finding(
        "outliers",
        count_of_outliers(count, contact),
        "look at the figure: if they are no outliers, --no-reject-outliers takes them",
        severity="with-care" if count > MANY * contact else "note",
    )


def count_of_outliers(count: int, samples: int) -> str:
    """Say how many samples were left out, and of how many."""
    words = "1 sample was left out as an outlier"
    if count != 1:
        words = f"{count} samples were left out as outliers"
    return f"{words} ({rounded(100.0 * count / samples, 2)} %)"
