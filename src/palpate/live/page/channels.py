"""What of each row goes to the browser."""

import math

import numpy as np
from numpy.typing import NDArray

from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.live.ring import COLUMNS, MOST_PARAMETERS
from palpate.validation import Floats

#: In their order in a frame, beside the time.
CHANNELS = (
    "penetration", "velocity", "force", "predicted_force",
    "stiffness", "stiffness_error", "damping", "damping_error",
    *(f"parameter_{k}" for k in range(MOST_PARAMETERS)),
    *(f"error_{k}" for k in range(MOST_PARAMETERS)),
    "margin", "state", "lateness",
)  # fmt: skip

_NUMBERS = slice(8, 8 + MOST_PARAMETERS)
_ERRORS = slice(8 + MOST_PARAMETERS, 8 + 2 * MOST_PARAMETERS)
_AT = {name: place for place, name in enumerate(COLUMNS)}
_PARAMETERS = slice(_AT["parameter_0"], _AT["parameter_0"] + MOST_PARAMETERS)
_COVARIANCES = slice(_AT["covariance_0"], _AT["covariance_0"] + MOST_PARAMETERS**2)
_AS_THEY_ARE = [_AT[name] for name in ("penetration", "velocity", "force", "predicted_force")]
_LAST = [_AT[name] for name in ("margin", "state", "lateness")]
_LARGEST = 3.4e38  # of a float32: what is beyond is not drawn


def column(rows: Floats, name: str) -> Floats:
    """One column of the ring's rows."""
    return rows[:, _AT[name]]


def parameters_of(rows: Floats, count: int) -> tuple[Floats, Floats]:
    """The parameters (k, p) of a law, and their covariances (k, p, p)."""
    square = rows[:, _COVARIANCES].reshape(-1, MOST_PARAMETERS, MOST_PARAMETERS)
    return rows[:, _PARAMETERS][:, :count], square[:, :count, :count]


def at_depth(law: type[ForceLaw], parameters: Floats, covariance: Floats, depth: float) -> Floats:
    """Stiffness and damping at a depth, each with its standard error, of many estimates.

    By the delta method, √(gᵀ C g), as :meth:`palpate.Estimate.stiffness_at` has it: the gradient
    by differences over a hundredth of an error, in which a law is as good as linear.

    Returns
    -------
    numpy.ndarray, shape (4, k)
        Stiffness, its error, damping, its error; SI.
    """
    count, size = parameters.shape
    if not depth > 0.0:
        return np.full((4, count), np.nan)
    with np.errstate(all="ignore"):  # of a start that knows nothing the errors may be infinite
        errors = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        steps = np.where((errors > 0.0) & np.isfinite(errors), 0.01 * errors, 1.0)
        moves = steps[:, None, :] * np.eye(size)
        # Once all of them in a row: the estimates, and each with one parameter up and down.
        every = np.concatenate(
            [
                parameters,
                (parameters[:, None, :] + moves).reshape(-1, size),
                (parameters[:, None, :] - moves).reshape(-1, size),
            ]
        )
        found = np.empty((4, count))
        for place, values in enumerate(law.many_at(every, depth)):
            up, down = values[count:].reshape(2, count, size)
            gradient = (up - down) / (2.0 * steps)
            variance = np.einsum("ki,kij,kj->k", gradient, covariance, gradient)
            found[2 * place] = values[:count]
            found[2 * place + 1] = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    return found


def channels_of(rows: Floats, law: type[ForceLaw] | None, depth: float) -> NDArray[np.float32]:
    """Rows of the ring as :data:`CHANNELS`, shape (channels, k).

    Parameters
    ----------
    rows : numpy.ndarray, shape (k, columns)
        As the loop wrote them.
    law : type, optional
        Of the estimator; unless it is known, stiffness and damping are NaN.
    depth : float
        Where stiffness and damping are worked out, m; NaN where it is not known yet.
    """
    found = np.full((len(CHANNELS), len(rows)), np.nan)
    found[0:4] = rows[:, _AS_THEY_ARE].T
    found[_NUMBERS] = rows[:, _PARAMETERS].T
    places = _COVARIANCES.start + np.arange(MOST_PARAMETERS) * (MOST_PARAMETERS + 1)
    with np.errstate(invalid="ignore"):
        found[_ERRORS] = np.sqrt(rows[:, places].T)
    if law is GeneralisedHuntCrossley:  # what one of its laws has not is no curve
        found[_NUMBERS][found[_ERRORS] == 0.0] = np.nan
    if law is not None and math.isfinite(depth):
        parameters, covariance = parameters_of(rows, len(law.symbols))
        found[4:8] = at_depth(law, parameters, covariance, depth)
    found[-3:] = rows[:, _LAST].T
    found[~(np.abs(found) < _LARGEST)] = np.nan
    return found.astype("<f4")
