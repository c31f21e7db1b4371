"""Identify a whole contact, with one estimator or with all of them side by side."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.contact import Contact
from palpate.errors import InvalidParameterError, RecordingError
from palpate.estimate import Estimate
from palpate.estimators import (
    ESTIMATORS,
    ContactEstimator,
    VariableProjection,
    estimator_named,
)
from palpate.metrics import prediction_rmse_percent, rmse_percent, violated_fraction
from palpate.preparation.preparing import Recorded, prepare
from palpate.preparation.suggestions import choose_gate, suggest_scale
from palpate.settings import ContactGate, Scale
from palpate.trace import Trace
from palpate.validation import Floats, shown

# Samples above the surface that a search for it needs: the force in the free to a quarter of σ.
FEWEST_ABOVE = 20


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """What a whole contact gave.

    Attributes
    ----------
    contact : Contact
        What was identified.
    estimator : ContactEstimator
        As it stood after the last sample; it can go on.
    trace : Trace
        Every sample, on the contact's clock.
    flags : tuple of str
        What a reader should know before trusting the numbers.
    """

    contact: Contact
    estimator: ContactEstimator
    trace: Trace
    flags: tuple[str, ...] = ()

    @property
    def method(self) -> str:
        """Name of the method."""
        return self.estimator.method

    @property
    def estimate(self) -> Estimate:
        """What the estimator knew at the end."""
        return self.estimator.estimate()

    @property
    def law(self) -> Any:
        """The contact model, SI."""
        return self.estimate.law

    @property
    def gate(self) -> ContactGate:
        """The gate that chose the samples."""
        return self.estimator.settings["gate"] or ContactGate()

    @property
    def scale(self) -> Scale:
        """The units of the arithmetic."""
        return self.estimator.settings["scale"] or Scale()

    @property
    def prediction_rmse_percent(self) -> float:
        """RMSE% of the a-priori force after 0.2 s of contact."""
        return prediction_rmse_percent(self.trace, self.contact.force, self.contact.time_steps)

    @property
    def fit_rmse_percent(self) -> float:
        """RMSE% of the final law, and offset where one is estimated, over every sample taken."""
        taken = self.trace.taken
        return rmse_percent(self.contact.force[taken], self.fitted_force[taken])

    @property
    def fitted_force(self) -> Floats:
        """Force by the final law, and offset where one is estimated, at every sample, N."""
        estimate, contact = self.estimate, self.contact
        depth = contact.penetration - estimate.surface
        fitted: Floats = self.law.force(depth, contact.velocity) + estimate.offset
        return fitted

    @property
    def violated_fraction(self) -> float:
        """Fraction of contact without condition 10; NaN for laws that it does not concern."""
        return violated_fraction(self.trace) if self.law.has_condition_10 else math.nan

    @property
    def changes(self) -> Floats:
        """Times at which a change of the material was detected, s."""
        times: Floats = self.contact.time[self.trace.status == Status.RESTARTED]
        return times

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers and words; what is not defined is None."""
        law = self.law
        errors = self.estimate.standard_errors.tolist()
        estimate, beside = self.estimate, {}
        if estimate.offset_standard_error > 0.0:
            beside["offset"] = estimate.offset
            beside["offset_standard_error"] = estimate.offset_standard_error
        if estimate.surface_standard_error > 0.0:
            beside["surface"] = estimate.surface
            beside["surface_standard_error"] = estimate.surface_standard_error
        return {
            "method": self.method,
            "law": {"kind": law.kind, **law.as_dict()},
            "standard_errors": dict(zip(law.as_dict(), errors, strict=True)),
            **beside,
            "prediction_rmse_percent": _defined(self.prediction_rmse_percent),
            "fit_rmse_percent": _defined(self.fit_rmse_percent),
            "violated_fraction": _defined(self.violated_fraction),
            "changes": self.changes.tolist(),
            "contact_samples": int(np.count_nonzero(self.trace.taken)),
            "flags": list(self.flags),
        }


def identify(
    source: Contact | Recorded, estimator: ContactEstimator | str | None = None
) -> Identification:
    """Identify the contact model of a whole contact.

    The samples go one by one through the estimator's own recursion, a segment at a time.

    Parameters
    ----------
    source : Contact, Recording, path or frame
        What is not yet a contact is prepared by :func:`prepare`, with its default columns.
    estimator : ContactEstimator or str, optional
        Method and settings; it is left as it is. Or the name of a method, such as
        ``"single-stage"``. :class:`VariableProjection` unless given. A ``gate`` or ``scale`` it
        leaves open (None) is chosen from the data: see :mod:`palpate.preparation.suggestions`.

    Raises
    ------
    RecordingError
        The recording cannot be prepared; the probe never touches: no sample passes the gate; or a
        search for the surface has no free approach: fewer than 20 samples lie above the surface
        that it found.
    InvalidParameterError
        The source is none of these, or there is no such estimator.
    """
    contact = source if isinstance(source, Contact) else prepare(source)
    given = _estimator(estimator)
    chosen: dict[str, Any] = {}
    if given.settings["gate"] is None:
        chosen["gate"] = choose_gate(contact)
    if given.settings["scale"] is None:
        chosen["scale"] = suggest_scale(contact)
    fresh = given.replace(**chosen)
    trace = _replay_segments(contact, fresh)
    if not trace.taken.any():
        raise RecordingError(_nothing_taken(contact, fresh))
    if fresh.settings.get("surface") == "estimate":
        _check_approach(contact, trace, fresh.estimate().surface)
    bare = Identification(contact, fresh, trace)
    return Identification(contact, fresh, trace, tuple(_flags(bare)))


def compare(
    source: Contact | Recorded, *, gate: ContactGate | None = None
) -> dict[str, Identification]:
    """Identify a contact with every method, on the same samples.

    Parameters
    ----------
    source : Contact, Recording, path or frame
        As for :func:`identify`.
    gate : ContactGate, optional
        Which samples are contact; chosen from the data unless given.

    Returns
    -------
    dict
        An :class:`Identification` for each name in ``ESTIMATORS``.
    """
    contact = source if isinstance(source, Contact) else prepare(source)
    return {name: identify(contact, kind(**{"gate": gate})) for name, kind in ESTIMATORS.items()}


def _estimator(given: ContactEstimator | str | None) -> ContactEstimator:
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


def _replay_segments(contact: Contact, estimator: ContactEstimator) -> Trace:
    steps = contact.time_steps
    traces = []
    for part in contact.segments():
        estimator.leave_contact()
        traces.append(
            estimator.replay(
                contact.penetration[part], contact.velocity[part], contact.force[part], steps[part]
            )
        )
    if len(traces) == 1:
        return traces[0]
    return Trace.joined(traces, len(estimator.law_type.symbols))


def _nothing_taken(contact: Contact, estimator: ContactEstimator) -> str:
    gate = estimator.settings["gate"]
    where = f"{contact.source}: " if contact.source else ""
    if not len(contact):
        return f"{where}there are no samples"
    inside = (contact.penetration > gate.minimum_penetration) & (contact.force > gate.make_force)
    if inside.any() and not np.isfinite(contact.velocity[inside]).any():
        return (
            f"{where}no sample of the contact has a velocity: {_not_finite(contact)}; without that "
            "channel it is worked out from the penetration"
        )
    return (
        f"{where}the probe never touches: no sample has penetration above "
        f"{gate.minimum_penetration:.3g} m and force above {gate.make_force:.3g} N "
        f"(the largest are {_largest(contact.penetration)} m and {_largest(contact.force)} N); "
        "check the units and signs, or lower the gate"
    )


def _not_finite(contact: Contact) -> str:
    """Which channels are not finite, where they come from, and how often, in words."""
    penetration, force = ~np.isfinite(contact.penetration), ~np.isfinite(contact.force)
    velocity = ~np.isfinite(contact.velocity) & ~penetration  # beyond what follows from the depth
    words = []
    for name, wrong in {"penetration": penetration, "velocity": velocity, "force": force}.items():
        if wrong.any():
            origin = f" ({contact.provenance[name]})" if name in contact.provenance else ""
            words.append(f"{name}{origin} is NaN or infinite in {wrong.sum()}")
    return f"{', '.join(words)} of {len(contact)} samples"


def _largest(values: Floats) -> str:
    known = values[~np.isnan(values)]
    return f"{known.max():.3g}" if known.size else "no"


def _check_approach(contact: Contact, trace: Trace, surface: float) -> None:
    """A surface is where the force begins: without samples before it, it is a guess from below."""
    above = int(np.count_nonzero(contact.penetration[trace.taken] < surface))
    if above < FEWEST_ABOVE:
        where = f"{contact.source}: " if contact.source else ""
        raise RecordingError(
            f"{where}the search for the surface needs the free approach: {above} of "
            f"{len(contact)} samples lie above the best surface, {surface:.3g} m, and at least "
            f"{FEWEST_ABOVE} have to; record from before the touch, or give the penetration from "
            "a known surface and leave surface out"
        )


def _flags(result: Identification) -> list[str]:
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
                words += f": {_not_finite(result.contact)}"
            flags.append(f"{count} samples refused: {words}")
    return flags


def _defined(value: float) -> float | None:
    return value if math.isfinite(value) else None
