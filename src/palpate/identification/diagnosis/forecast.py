"""Prediction of the last third of a recording from the law of the first two."""

import math

import numpy as np

from palpate.digits import percent, rounded
from palpate.findings import Check, Finding, NextStep, Remedy
from palpate.identification.diagnosis.fit import FEWEST_ROWS, Fit
from palpate.method.estimators.least_squares import column_sizes
from palpate.method.rows import rms

PARTS = 3  # parts of the rows; the last part is predicted
CARE = 0.25
STOP = 1.0  # fractions of the force
# Multiple of the error expected from noise, misfit and a different motion
UNEXPECTED = 3.0
FADES = 0.8  # ratio to the error of a law of all rows before
CYCLES = 6.0  # periods of the motion; a ramp with its hold is not a change of the material


def check_forecast(fit: Fit) -> Finding | None:
    """The law of the first two thirds predicts the last badly, or worse than the second third does.

    The law of some rows is one linear step from the law of all rows. Only every third row is used:
    those windows do not overlap.
    """
    rows = len(fit.windows)
    if rows < FEWEST_ROWS:
        return None
    third = rows // PARTS
    last = rows - rows // PARTS
    size = rms(fit.force[last:] - fit.solution.offset)
    error_of_all, expected = _prediction_error(fit, slice(0, last, 3))
    if not error_of_all > UNEXPECTED * fit.noise_floor:
        return None
    if error_of_all > max(CARE * size, UNEXPECTED * expected):
        return Check.FORECAST.finding(
            "identified on its first two thirds, the recording's last third is off by "
            f"{percent(error_of_all / size)} of the force",
            Remedy(NextStep.TASK_MOTION),
            mark="do-not-trust" if error_of_all > STOP * size else "trust",
        )
    recent, _ = _prediction_error(fit, slice(third, last, 3))
    cycles = fit.time[-1] - fit.time[0] > CYCLES * fit.period > 0.0
    if not (cycles and recent < FADES * error_of_all and (fit.time[:last] < fit.time[last]).all()):
        return None
    percentages = (f"{rounded(100.0 * error / size, 2)} %" for error in (recent, error_of_all))
    return Check.FORECAST.finding(
        "the force settles, or the material or a sensor changes slowly: the third before the last "
        "predicts that to {} of the force, all before it to {}".format(*percentages),
        Remedy(NextStep.LATEST_PART, rounded(float(fit.time[last]), 4)),
    )


def _prediction_error(fit: Fit, training_rows: slice) -> tuple[float, float]:
    """Return the rms error of predicting later rows from earlier ones, and its expectation, N."""
    jacobian = fit.solution.jacobian
    residual = fit.solution.residual
    predicted_rows = slice(training_rows.stop, None, training_rows.step)
    earlier = jacobian[training_rows]
    later = jacobian[predicted_rows]
    size = column_sizes(earlier)
    earlier = earlier / size
    later = later / size
    inverse = np.linalg.pinv(earlier.T @ earlier, rcond=1e-12, hermitian=True)
    change = inverse @ (earlier.T @ residual[training_rows])
    error = residual[predicted_rows] - later @ change
    earlier_residual = residual[training_rows] - earlier @ change
    leverage = float(np.mean(np.sum((later @ inverse) * later, axis=1)))
    noise = max(float(np.mean(earlier_residual**2)), fit.noise_floor**2)
    return rms(error), math.sqrt(noise * (1.0 + leverage))
