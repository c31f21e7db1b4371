"""Error bars, as wide as a correlated residual and an uncertain surface ask for."""

import numpy as np

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
    factors, model = np.ones(len(own)), law.force(penetration, velocity)
    slopes = law.parameter_gradient(penetration, velocity)[:, own]
    if logarithmic:
        used = (model > 0.0) & (force > 0.0)
        slopes, model, force = slopes[used], model[used], force[used]
    freedom = len(force) - slopes.shape[1]
    if freedom < 1:
        return factors
    residual = force - model
    with np.errstate(all="ignore"):  # what comes to nothing widens nothing
        weight = 1.0 / model**2 if logarithmic else np.ones_like(model)
        weighted = weight[:, None] * slopes
        information = slopes.T @ weighted
        units = np.sqrt(np.diag(information))  # of the parameters
        noise = np.sqrt(np.mean(residual**2))
        if not ((np.isfinite(units) & (units > 0.0)).all() and 0.0 < noise < np.inf):
            return factors
        inverse = np.linalg.pinv(information / np.outer(units, units), hermitian=True)
        white = np.diag(inverse) * (np.sum(weight * residual**2) / freedom)
        # Neither squares nor sums leave the range of a double in units of their own.
        unit = weight.max()
        found = np.empty_like(white)
        correlated_variances(weighted / (unit * units), residual / noise, unit * inverse, found)
        wide = np.sqrt(np.maximum(found * noise**2 / white, 1.0))
    if (white > 0.0).all():
        factors[own] = np.where(np.isfinite(wide), wide, 1.0)
    return factors
