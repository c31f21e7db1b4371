"""Figures of merit, as the paper takes them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.trace import Trace
from palpate.validation import Floats, signals

# The paper's Tables II, IV and VI leave out the first 0.2 s of contact.
START_UP = 0.2  # s


def rmse_percent(measured: "ArrayLike", predicted: "ArrayLike") -> float:
    """100 √(Σ (F − F̂)² / Σ F²), the paper's RMSE%; NaN without samples or without force."""
    force, estimate = signals(measured=measured, predicted=predicted)
    energy = float(np.dot(force, force))
    error = force - estimate
    return 100.0 * float(np.sqrt(np.dot(error, error) / energy)) if energy > 0.0 else float("nan")


def prediction_rmse_percent(trace: Trace, force: Floats, time_steps: Floats) -> float:
    """RMSE% of the a-priori force over the samples taken after the first 0.2 s of contact.

    NaN where there was less contact than that.
    """
    late = _late(trace, time_steps)
    return rmse_percent(force[late], trace.predicted_force[late])


def has_prediction_error(trace: Trace, force: Floats, time_steps: Floats) -> bool:
    """Whether there is enough contact, and force, for :func:`prediction_rmse_percent`."""
    late = force[_late(trace, time_steps)]
    return float(np.dot(late, late)) > 0.0


def _late(trace: Trace, time_steps: Floats) -> NDArray[np.bool_]:
    """The samples taken after the first 0.2 s of contact."""
    taken = trace.taken
    elapsed = np.cumsum(np.where(taken, time_steps, 0.0))
    late: NDArray[np.bool_] = taken & (elapsed > START_UP)
    return late


def violated_fraction(trace: Trace) -> float:
    """Share of the samples taken at which condition 10 did not hold; NaN without samples."""
    margin = trace.validity_margin[trace.taken]
    return float(np.mean(~(margin > 0.0))) if margin.size else float("nan")
