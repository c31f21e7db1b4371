"""Error bars, as wide as a correlated residual and an uncertain surface ask for."""

import numpy as np
from numpy.typing import NDArray

from palpate._core import Status, correlated_variances
from palpate.contact import Contact
from palpate.estimators import ContactEstimator
from palpate.force_laws import ForceLaw
from palpate.replaying import with_surface_off
from palpate.trace import Trace
from palpate.validation import Floats


def joint_covariance(contact: Contact, trace: Trace, estimator: ContactEstimator) -> Floats:
    """Joint covariance of a law's parameters: see :attr:`Identification.covariance`.

    Parameters
    ----------
    contact : Contact
        What was identified.
    trace : Trace
        Of it.
    estimator : ContactEstimator
        As it stood at the end.
    """
    estimate, widths = estimator.estimate(), _widths(contact, trace, estimator)
    own: Floats = estimate.covariance * np.outer(widths, widths)
    deviation = contact.surface_deviation
    if deviation is None or estimate.surface_standard_error > 0.0:
        return own
    off = with_surface_off(contact, estimator.replace(), deviation)
    moved = off.parameters - estimate.parameters
    whole: Floats = own + np.outer(moved, moved)
    return whole if np.isfinite(whole).all() else own


def _widths(contact: Contact, trace: Trace, estimator: ContactEstimator) -> Floats:
    """How much wider a correlated residual makes the method's own standard errors."""
    estimate = estimator.estimate()
    law = estimate.law
    if estimator.minimises is None:
        return np.ones(len(law.parameters))
    taken = np.flatnonzero(trace.taken)
    restarts = np.flatnonzero(trace.status == Status.RESTARTED)
    if restarts.size:
        taken = taken[taken >= restarts[-1]]
    return widening(
        law,
        contact.penetration[taken],
        contact.velocity[taken],
        contact.force[taken],
        logarithmic=estimator.minimises == "logarithm",
        fixed=estimate.fixed,
    )


def widening(
    law: ForceLaw,
    penetration: Floats,
    velocity: Floats,
    force: Floats,
    *,
    logarithmic: bool,
    fixed: tuple[str, ...] = (),
) -> Floats:
    """Factors ≥ 1 on the standard errors of a law's parameters, shape (p,).

    C = (Σ w JJᵀ)⁻¹ [Σ w² d D] (Σ w JJᵀ)⁻¹ over (Σ w JJᵀ)⁻¹ Σ w r²/(N − p), with the residual of
    force r, its slopes J, and w = 1, or 1/F̂² for a least squares of ln F. D and d are information
    and noise by how quick they are (``docs/variable-projection.md``), with t₀.₉₇₅(ν)/1.96 in C.

    Parameters
    ----------
    law : force law
        What the method ended with, of two or three parameters.
    penetration, velocity, force : numpy.ndarray, shape (k,)
        The samples that it took, SI.
    logarithmic : bool
        Whether it minimises the residual of ln F rather than of F.
    fixed : tuple of str
        The law's parameters that were not identified; the factors of these are 1.
    """
    own = np.array([name not in fixed for name in law.names()])
    factors = np.ones(len(own))
    if len(force):
        slopes = law.parameter_gradient(penetration, velocity)[None, :, own]
        model = law.force(penetration, velocity)[None]
        every = np.ones(model.shape, dtype=np.bool_)
        [factors[own]] = widenings(slopes, model, force[None], every, logarithmic=logarithmic)
    return factors


def widenings(
    slopes: Floats, model: Floats, force: Floats, used: NDArray[np.bool_], *, logarithmic: bool
) -> Floats:
    """As :func:`widening`, of many contacts of one length at once; shape (k, p).

    Parameters
    ----------
    slopes : numpy.ndarray, shape (k, m, p)
        Of the force by the parameters that were identified.
    model, force : numpy.ndarray, shape (k, m)
        By the law, and as measured, N.
    used : numpy.ndarray of bool, shape (k, m)
        The samples that the method took. What the others hold has to be finite, no more.
    logarithmic : bool
        As there.
    """
    if logarithmic:
        used = used & (model > 0.0) & (force > 0.0)
    counts, size = used.sum(axis=1), slopes.shape[2]
    residual = np.where(used, force - model, 0.0)
    with np.errstate(all="ignore"):  # rows that come to nothing are left out below
        weight = np.where(used, 1.0 / model**2, 0.0) if logarithmic else used.astype(np.float64)
        weighted = weight[:, :, None] * slopes
        information = np.swapaxes(slopes, 1, 2) @ weighted
        units = np.sqrt(np.diagonal(information, axis1=1, axis2=2))  # of the parameters
        freedom = counts - size
        noise = np.sqrt((residual**2).sum(axis=1) / counts)
        sound = (freedom >= 1) & (np.isfinite(units) & (units > 0.0)).all(axis=1)
        sound &= (noise > 0.0) & (noise < np.inf)
        information /= units[:, :, None] * units[:, None, :]
        information[~sound] = np.eye(size)
        inverse = np.linalg.pinv(information, hermitian=True)
        variance = (weight * residual**2).sum(axis=1) / freedom
        white = np.diagonal(inverse, axis1=1, axis2=2) * variance[:, None]
        # Neither squares nor sums leave the range of a double in units of their own.
        unit = weight.max(axis=1)
        scores = weighted / (unit[:, None] * units)[:, None, :]
        influence = inverse * unit[:, None, None]
        found = np.ones_like(white)
        correlated_variances(scores, residual / noise[:, None], used, influence, found)
        factors = np.sqrt(np.maximum(found * noise[:, None] ** 2 / white, 1.0))
    sound &= (white > 0.0).all(axis=1)
    return np.where(sound[:, None] & np.isfinite(factors), factors, 1.0)
