"""The estimator for a whole contact: its settings, defaults from the data, and the replay."""

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.force_laws import steps_over_breaks
from palpate.input.preparation.gate import choose_gate, suggest_scale
from palpate.input.preparation.resolution import find_dead_band, suggest_surface_deviation
from palpate.method.contact import Contact
from palpate.method.estimators import (
    ESTIMATORS,
    ContactEstimator,
    VariableProjection,
    ViscoelasticContact,
    estimator_named,
)
from palpate.method.estimators.estimate import (
    Trace,
    Traced,
    choose_trace_samples,
    samples_in_estimate,
)
from palpate.method.estimators.least_squares import long_run_covariance
from palpate.method.rows import rms
from palpate.method.settings import ContactGate, OutlierRejection
from palpate.stages import log_stage
from palpate.validation import Floats, shown

_LOGGER = logging.getLogger(__name__)


def defaults_from_data(contact: Contact, given: ContactEstimator) -> dict[str, Any]:
    """Return values, chosen from the data, for the settings that an estimator leaves open."""
    settings = given.settings
    ways: dict[str, Callable[[Contact], object]] = {
        "scale": suggest_scale,
        "outlier_rejection": lambda _: OutlierRejection(),
        "sample_time": attrgetter("sample_time"),
        "longest_time": _longest_relaxation_time,
    }
    ways["gate"] = _gate_above_dead_band if given.chooses_samples else choose_gate
    # An estimator of the surface uses the free approach instead.
    if given.knows_offset and settings.get("surface") is None:
        ways["offset_deviation"] = attrgetter("tare_deviation")
        ways["surface_deviation"] = _surface_deviation
    return {
        name: choose(contact)
        for name, choose in ways.items()
        if name in settings and settings[name] is None
    }


def _longest_relaxation_time(contact: Contact) -> float:
    """Return the longest relaxation time that a recording can distinguish from a constant, s."""
    return max(
        0.5 * float(np.ptp(contact.time)) if len(contact) else 0.0,
        4.0 * contact.sample_time,
    )


def _gate_above_dead_band(contact: Contact) -> ContactGate | None:
    """Return the gate for a method that selects its samples: above a dead band, if there is one."""
    band = find_dead_band(contact)
    return ContactGate(0.0, band, band) if band else None


def _surface_deviation(contact: Contact) -> float | None:
    """Return the standard error of the surface, from its estimation and the position's steps."""
    resolved = suggest_surface_deviation(contact)
    if contact.surface_deviation is None:
        return resolved
    return math.hypot(contact.surface_deviation, resolved or 0.0)


def resolve_estimator(
    given: ContactEstimator | str | None,
    *,
    timeless: bool = False,
) -> ContactEstimator:
    """Return an estimator as passed, from its name, or the default, which selects a law."""
    if given is None:
        return VariableProjection() if timeless else ViscoelasticContact()
    if isinstance(given, str):
        return estimator_named(given)()
    if not isinstance(given, ContactEstimator):
        raise InvalidParameterError(
            f"estimator must be a ContactEstimator or one of {', '.join(ESTIMATORS)}, "
            f"not {shown(given)}"
        )
    return given


@log_stage("replay")
def replay(contact: Contact, estimator: ContactEstimator, trace: Traced) -> Trace:
    """Replay a contact segment by segment; the estimator has then learned all samples.

    The trace has the contact's clock, thinned as requested.
    """
    if _LOGGER.isEnabledFor(logging.DEBUG):
        phrases = (f"{name}={value!r}" for name, value in estimator.settings.items())
        _LOGGER.debug("settings: %s", ", ".join(phrases))
    segments = list(contact.segments())
    # The state of a relaxing material continues from one segment to the next.
    goes_on = estimator.chooses_law
    steps = contact.time_steps
    if goes_on:
        steps = steps_over_breaks(contact.time, contact.penetration, contact.sample_time)
    trace_samples = choose_trace_samples(trace, contact.time, segments)
    traces: list[Trace] = []
    for segment in segments:
        if not (goes_on and traces):
            estimator.leave_contact()
        channels = contact.penetration[segment], contact.velocity[segment], contact.force[segment]
        at = None
        if trace_samples is not None:
            first, last = np.searchsorted(trace_samples, (segment.start, segment.stop))
            at = trace_samples[first:last] - segment.start
        traces.append(estimator.replay(*channels, steps[segment], at=at))
    finish_pending = getattr(estimator, "finish_pending", None)
    if finish_pending is not None:  # without it the estimate would miss the last samples
        finish_pending()
    one = len(traces) == 1
    whole = traces[0] if one else Trace.joined(traces, len(estimator.law_type.symbols))
    return replace(
        whole,
        time=contact.time if trace_samples is None else contact.time[trace_samples],
    )


# Error bars for a correlated residual and an uncertain surface.


def joint_covariance(contact: Contact, trace: Trace, estimator: ContactEstimator) -> Floats:
    """Joint covariance of a law's parameters: see :attr:`Identification.covariance`.

    Parameters
    ----------
    contact : Contact
        The identified contact.
    trace : Trace
        Its trace.
    estimator : ContactEstimator
        The estimator after all samples.
    """
    estimate = estimator.estimate()
    widths = _widening_factors(contact, trace, estimator)
    covariance: Floats = estimate.covariance * np.outer(widths, widths)
    deviation = contact.surface_deviation
    if deviation is None or estimate.surface_standard_error > 0.0:
        return covariance
    off = estimator.replace()
    deeper = contact.penetration - deviation
    replay(replace(contact, penetration=deeper), off, trace=False)
    moved = off.estimate().parameters - estimate.parameters
    whole: Floats = covariance + np.outer(moved, moved)
    return whole if np.isfinite(whole).all() else covariance


def _widening_factors(contact: Contact, trace: Trace, estimator: ContactEstimator) -> Floats:
    """Factors ≥ 1 on the method's standard errors, for a correlated residual, shape (p,).

    Their squares are the ratio of the variances in C = (Σ w JJᵀ)⁻¹ [Σ w² d D] (Σ w JJᵀ)⁻¹ to those
    of white noise, (Σ w JJᵀ)⁻¹ Σ w r²/(N − p). Here r is the residual of the force, J are its
    slopes, and w is 1, or 1/F̂² for a least squares of ln F. D and d are the information and the
    noise by frequency (``docs/explain/default-method.md``); C includes t₀.₉₇₅(ν)/1.96. The samples
    are those taken since the last restart. A fixed parameter has the factor 1.
    """
    estimate = estimator.estimate()
    law = estimate.law
    logarithmic = estimator.minimises == "logarithm"
    free = np.array([name not in estimate.fixed for name in law.names()])
    factors = np.ones(len(free))
    if estimator.minimises is None:
        return factors
    used = samples_in_estimate(trace)
    motion = (contact.penetration[used], contact.velocity[used])
    force = contact.force[used]
    force = force - estimate.offset
    model = law.force(*motion)
    slopes = law.parameter_gradient(*motion)[:, free]
    if logarithmic:
        inside = (model > 0.0) & (force > 0.0)
        slopes = slopes[inside]
        model = model[inside]
        force = force[inside]
    freedom = len(force) - slopes.shape[1]
    if freedom < 1:
        return factors
    residual = force - model
    with np.errstate(all="ignore"):  # a zero or non-finite term leaves the factor at 1
        weight = 1.0 / model**2 if logarithmic else np.ones_like(model)
        weighted = weight[:, None] * slopes
        information = slopes.T @ weighted
        units = np.sqrt(np.diag(information))  # they normalise the information matrix
        noise = rms(residual)
        if not ((np.isfinite(units) & (units > 0.0)).all() and 0.0 < noise < np.inf):
            return factors
        inverse = np.linalg.pinv(information / np.outer(units, units), hermitian=True)
        white = np.diag(inverse) * (np.sum(weight * residual**2) / freedom)
        scores = (weighted / units) @ inverse
        correlated = np.diag(long_run_covariance(scores, residual / noise, fitted=len(units)))
        ratios = np.sqrt(np.maximum(correlated * noise**2 / white, 1.0))
    if (white > 0.0).all():
        factors[free] = np.where(np.isfinite(ratios), ratios, 1.0)
    return factors
