"""What an estimator knew as it went along, with its error bars."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.estimate import Estimate
from palpate.force_laws import ForceLaw
from palpate.identification import Identified
from palpate.validation import Floats

# So many times a replay is stopped to look at the covariance, which a trace does not hold.
_STOPS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The law, its stiffness and damping at one depth, and their errors, at some of the samples.

    Attributes
    ----------
    samples : numpy.ndarray of int, shape (k,)
        After which they were known.
    parameters, errors : numpy.ndarray, shape (k, p)
        Of the law, SI, and their standard errors.
    stiffness, stiffness_error : numpy.ndarray, shape (k,)
        ∂F/∂x, N/m, and its standard error; NaN before the first contact.
    damping, damping_error : numpy.ndarray, shape (k,)
        ∂F/∂v, N·s/m.
    """

    samples: NDArray[np.intp]
    parameters: Floats
    errors: Floats
    stiffness: Floats
    stiffness_error: Floats
    damping: Floats
    damping_error: Floats


def course_of(result: Identified, depth: float) -> Course:
    """Replay a contact, and stop at times to look at what is known.

    Parameters
    ----------
    result : Identification
        Its contact is replayed by its estimator, as it was when it had learned nothing.
    depth : float
        Where, m, > 0.
    """
    contact, estimator = result.contact, result.estimator.replace()
    steps = contact.time_steps
    taken = np.flatnonzero(result.trace.taken)
    stops = np.unique(taken[np.linspace(0, taken.size - 1, _STOPS).astype(np.intp)])
    samples, rows, laws = [], [], []
    for part in contact.segments():
        estimator.leave_contact()
        edges = [*stops[(stops >= part.start) & (stops < part.stop)] + 1, part.stop]
        start = part.start
        for edge in edges:
            piece = slice(start, int(edge))
            channels = contact.penetration, contact.velocity, contact.force, steps
            estimator.replay(*(channel[piece] for channel in channels), at=())
            if edge - 1 in stops:
                now = estimator.estimate()
                samples.append(edge - 1)
                rows.append(_known(now, depth))
                laws.append([now.parameters, now.standard_errors])
            start = int(edge)
    parameters, errors = np.moveaxis(np.array(laws), 1, 0)
    return Course(np.array(samples, dtype=np.intp), parameters, errors, *np.array(rows).T)


def _known(estimate: Estimate, depth: float) -> list[float]:
    """Stiffness, its error, damping, its error; NaN for what overflows."""
    with np.errstate(all="ignore"):
        try:
            law = estimate.law
            values = law.stiffness_at(depth), law.damping_at(depth)
        except ValueError:  # of parameters that are not finite there is no law
            return [np.nan] * 4
        slopes = _slopes(law, depth)
        errors = np.sqrt(np.einsum("ij,jk,ik->i", slopes, estimate.covariance, slopes))
    return [values[0], float(errors[0]), values[1], float(errors[1])]


def _slopes(law: ForceLaw, depth: float) -> Floats:
    """∂S/∂θ and ∂C/∂θ at a depth and at rest, shape (2, p).

    By S = ∂F/∂x and C = ∂F/∂v they are the slopes of ∂F/∂θ over x and v. A step of 1e-5 of the
    depth leaves 1e-10 of its curvature, and 1e-11 of rounding.
    """
    step, slow = 1e-5 * depth, 1e-3
    by_depth = law.parameter_gradient(depth + step * np.array([1.0, -1.0]), np.zeros(2))
    by_speed = law.parameter_gradient(np.full(2, depth), slow * np.array([1.0, -1.0]))
    rows = (by_depth[0] - by_depth[1]) / (2.0 * step), (by_speed[0] - by_speed[1]) / (2.0 * slow)
    return np.array(rows)
