"""An estimator for a whole contact: its settings, defaults from the data, and the replay."""

import logging
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis import Data, Laws
from palpate.errors import InvalidParameterError
from palpate.estimators import (
    ESTIMATORS,
    ContactEstimator,
    VariableProjection,
    ViscoelasticContact,
    estimator_named,
)
from palpate.estimators.estimate import Estimate, Trace, Traced, thinned
from palpate.estimators.law_verdicts import CANDIDATES, STRONG
from palpate.estimators.least_squares import long_run_covariance
from palpate.force_laws import ForceLaw, force_over_breaks
from palpate.preparation.gates import (
    choose_gate,
    dead_band_of,
    suggest_scale,
    suggest_surface_deviation,
)
from palpate.settings import ContactGate, OutlierRejection
from palpate.stages import timed
from palpate.validation import Floats, shown

_LOGGER = logging.getLogger(__name__)


def defaults_from_data(contact: Contact, given: ContactEstimator) -> dict[str, Any]:
    """What an estimator leaves open and the data can choose."""
    settings = given.settings
    ways: dict[str, Callable[[Contact], object]] = {
        "scale": suggest_scale,
        "outlier_rejection": lambda _: OutlierRejection(),
        "sample_time": attrgetter("sample_time"),
    }
    ways["gate"] = _gate_above_dead_band if given.chooses_samples else choose_gate
    # A search for the surface has the free approach.
    if given.knows_offset and settings.get("surface") is None:
        ways["offset_deviation"] = attrgetter("tare_deviation")
        ways["surface_deviation"] = _surface_deviation
    return {
        name: choose(contact)
        for name, choose in ways.items()
        if name in settings and settings[name] is None
    }


def _gate_above_dead_band(contact: Contact) -> ContactGate | None:
    """The gate of a method that chooses its samples: only above a dead band."""
    band = dead_band_of(contact)
    return ContactGate(0.0, band, band) if band else None


def _surface_deviation(contact: Contact) -> float | None:
    """How well the surface is known: as it was found, and as the position is resolved."""
    resolved = suggest_surface_deviation(contact)
    if contact.surface_deviation is None:
        return resolved
    return math.hypot(contact.surface_deviation, resolved or 0.0)


def estimator_of(given: ContactEstimator | str | None) -> ContactEstimator:
    """The requested estimator: itself, by its name, or the default."""
    if given is None:
        return VariableProjection()
    if isinstance(given, str):
        return estimator_named(given)()
    if not isinstance(given, ContactEstimator):
        raise InvalidParameterError(
            f"estimator must be a ContactEstimator or one of {', '.join(ESTIMATORS)}, "
            f"not {shown(given)}"
        )
    return given


@timed("replay")
def replayed(contact: Contact, estimator: ContactEstimator, trace: Traced) -> Trace:
    """Replay a contact, a segment at a time; the estimator has then learned all of it.

    The trace has the contact's clock, thinned as requested.
    """
    if _LOGGER.isEnabledFor(logging.DEBUG):
        words = (f"{name}={value!r}" for name, value in estimator.settings.items())
        _LOGGER.debug("settings: %s", ", ".join(words))
    steps, segments = contact.time_steps, list(contact.segments())
    after = thinned(trace, contact.time, segments)
    traces = []
    for part in segments:
        estimator.leave_contact()
        channels = contact.penetration[part], contact.velocity[part], contact.force[part]
        at = None
        if after is not None:
            first, last = np.searchsorted(after, (part.start, part.stop))
            at = after[first:last] - part.start
        traces.append(estimator.replay(*channels, steps[part], at=at))
    finish_pending = getattr(estimator, "finish_pending", None)
    if finish_pending is not None:  # its answer would be of most of the samples only
        finish_pending()
    one = len(traces) == 1
    whole = traces[0] if one else Trace.joined(traces, len(estimator.law_type.symbols))
    return replace(whole, time=contact.time if after is None else contact.time[after])


# Error bars, as wide as a correlated residual and an uncertain surface ask for.


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
    off, deeper = estimator.replace(), contact.penetration - deviation
    replayed(replace(contact, penetration=deeper), off, trace=False)
    moved = off.estimate().parameters - estimate.parameters
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
        contact.force[taken] - estimate.offset,
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
        What the method ended with.
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
        scores = (weighted / units) @ inverse
        found = np.diag(long_run_covariance(scores, residual / noise, fitted=len(units)))
        wide = np.sqrt(np.maximum(found * noise**2 / white, 1.0))
    if (white > 0.0).all():
        factors[own] = np.where(np.isfinite(wide), wide, 1.0)
    return factors


# For how long a material relaxes: the place of the relaxation times, by a whole contact.

# In sample times: where the last relaxation time's part of a spectrum ends.
_LONGEST = 4096.0
# From one place to the next: the common bank's times are as far apart.
_FURTHER = 4.0
# Of the cost of a number. Memory that explains nothing costs a whole one more; of a material that
# relaxes more slowly than the first place can tell, the first finds some.
_SOME = 0.75
_MOST = 3  # places beyond the first: up to 260 000 sample times


@timed("relaxation times")
def placed(
    contact: Contact, bank: ContactEstimator, trace: Traced = False
) -> tuple[ContactEstimator, Trace]:
    """Return a bank that has learned a contact, with the place of its relaxation times.

    They go from the sample time that it is given: the contact's own, unless a bank that begins
    later and ends later fits better by more than one number of the law would have to: 2 ln N_eff.
    None is tried where memory explains nothing by the first, nor one that lasts four times as long
    as the contact.

    Parameters
    ----------
    contact : Contact
        All of it.
    bank : ContactEstimator
        One that chooses among laws.
        With the settings that were chosen; it is left as it is.
    trace : int, float, "full" or False
        Which estimates are written down.
    """
    own, duration = contact.sample_time, float(contact.time_steps.sum())
    best = bank.replace(sample_time=own)
    written = replayed(contact, best, trace)
    # By the samples that count with the first: of what fits better others do.
    effective = max(best.evidence().effective_samples, math.e)
    forgets, remembers = _costs(best, effective)
    penalty = 2.0 * math.log(effective)
    least, some = min(forgets, remembers), remembers < forgets + _SOME * penalty
    for place in range(1, 1 + _MOST):
        step = own * _FURTHER**place
        if not some or _LONGEST * step >= _FURTHER * duration:
            break
        trial = bank.replace(sample_time=step)
        traced = replayed(contact, trial, trace)
        cost = min(_costs(trial, effective)) + penalty
        if cost < least:
            best, written, least = trial, traced, cost
    return best, written


def _costs(bank: ContactEstimator, effective: float) -> tuple[float, float]:
    """What the best law without memory leaves, and the best with, with what their numbers cost."""
    costs = [math.inf, math.inf]
    for index, _, mean_square in bank.evidence().rows:
        law = CANDIDATES[int(index)]
        cost = effective * math.log(max(mean_square, sys.float_info.min))
        cost += 2.0 * math.log(effective) * law.parameters
        costs[law.memory != "none"] = min(cost, costs[law.memory != "none"])
    return costs[0], costs[1]


# The common laws on the samples that another method identified, to see whether one is better; and
# what speaks against the law that a method has chosen.

FEWEST_HELD_OUT = 60  # samples in contact


def laws_beside(data: Data, estimator: ContactEstimator, chosen: Sequence[str]) -> Laws | None:
    """Which law it is; None where the identified one is none of those that are compared.

    Methods of one contact that were given the same share the answer.

    Parameters
    ----------
    data : Data
        The contact.
    estimator : ContactEstimator
        As it stood at the end. What it was given of which samples are contact, and of the
        exponent, holds for the other laws too.
    chosen : sequence of str
        Its settings that were chosen from the data, for its own method.
    """
    if estimator.chooses_law:
        key = repr(["own", estimator.settings])
        if key not in data.laws:
            own = replace(Laws.of(estimator, own=True), one_time=_one_time(data, estimator))
            data.laws[key] = _held_out(data, estimator, own)
        return data.laws[key]
    estimate = estimator.estimate()
    if estimate.law.candidate is None:
        return None
    names = {"gate", "outlier_rejection", "exponent"}.difference(chosen)
    given = {name: value for name, value in estimator.settings.items() if name in names}
    key = repr([sorted(given.items()), estimate.surface])
    if key not in data.laws:
        data.laws[key] = _compared(data, given, estimate.surface)
    return data.laws[key]


@timed("laws")
def _one_time(data: Data, estimator: ContactEstimator) -> Laws | None:
    """The law with one relaxation time that is strongly preferred over the common laws, if any."""
    if estimator.settings["memory"] != "auto":
        return None
    bank = estimator.replace(memory="single")
    replayed(data.contact, bank, trace=False)
    effective = max(estimator.evidence().effective_samples, math.e)
    score = min(_costs(estimator, effective)) - min(_costs(bank, effective))
    return Laws.of(bank) if score >= STRONG else None


@timed("laws")
def _held_out(data: Data, estimator: ContactEstimator, own: Laws) -> Laws:
    """With the law by the first two thirds of the contact, and how it predicts the last."""
    contact, bank = data.contact, estimator.replace()
    inside = np.flatnonzero(data.known & (contact.penetration > 0.0))
    early, late = np.split(inside, [inside.size - inside.size // 3])
    if late.size < FEWEST_HELD_OUT:
        return own
    replayed(contact.taken(slice(late[0])), bank, trace=False)
    estimate = bank.estimate()
    left = contact.force - predicted_force(estimate, contact)
    with np.errstate(all="ignore"):
        own_error, error, size = (
            float(np.sqrt(np.mean(values**2)))
            for values in (left[early], left[late], contact.force[late] - estimate.offset)
        )
        return replace(own, before=Laws.of(bank), missed=error / size, surprise=error / own_error)


def predicted_force(estimate: Estimate, contact: Contact) -> Floats:
    """Force by an estimate's law, and offset, at every sample of a contact, N."""
    depth = contact.penetration - estimate.surface
    starts = [part.start for part in contact.segments()]
    force = force_over_breaks(estimate.law, depth, contact.velocity, contact.time_steps, starts)
    return force + estimate.offset


@timed("laws")
def _compared(data: Data, given: dict[str, Any], surface: float) -> Laws:
    contact, kept = data.contact, given.get("exponent")
    low, high = ViscoelasticContact.exponents
    bank = ViscoelasticContact(
        gate=given.get("gate"),
        outlier_rejection=given.get("outlier_rejection"),
        exponent=kept if kept is not None and low <= kept <= high else None,
    )
    below = replace(contact, penetration=contact.penetration - surface) if surface else contact
    bank = bank.replace(**defaults_from_data(below, bank))
    key = repr([bank.settings, surface])  # what one method was given another may have chosen
    if key not in data.laws:
        data.laws[key] = Laws.of(placed(below, bank)[0])
    return data.laws[key]
