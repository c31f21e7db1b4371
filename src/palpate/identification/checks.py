"""Checks of an estimate and of its samples, and the reasons why a contact has none."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.digits import percent, rounded
from palpate.errors import NoContactError, RecordingError
from palpate.findings import Check, Finding, NextStep, Remedy
from palpate.force_laws import HuntCrossley
from palpate.identification.diagnosis import Data
from palpate.identification.diagnosis.causes import CARE
from palpate.identification.diagnosis.excitation import few_samples
from palpate.identification.diagnosis.fit import reference_scale
from palpate.identification.diagnosis.sensor import outlier_finding
from palpate.input.preparation.touch import depends_on_position
from palpate.method.contact import Contact
from palpate.method.estimators import ContactEstimator
from palpate.method.estimators.batch_fit import CurveFits
from palpate.method.estimators.estimate import (
    Estimate,
    Trace,
    flag_findings,
    prediction_rmse_percent,
    violated_fraction,
)
from palpate.method.rows import count_true, median, rms
from palpate.method.settings import ContactGate
from palpate.validation import Floats, Integers, Mask

NEGATIVE_STIFFNESS = Check.NEGATIVE_STIFFNESS.finding(
    "negative stiffness: in this law the force falls with depth",
    Remedy(NextStep.CHECK_SIGNS),
)
NEGATIVE_DAMPING = Check.NEGATIVE_DAMPING.finding(
    "negative damping: this law creates energy, which no passive material does"
)

_NOT_CONVERGED = Check.CONVERGENCE.finding(
    "the least-squares search did not converge: another fit may be better"
)


def check_estimate(
    contact: Contact,
    trace: Trace,
    estimator: ContactEstimator,
) -> Iterator[Finding]:
    """Yield findings of the last estimate and of the samples."""
    estimate = estimator.estimate()
    law = estimate.law
    yield from estimate.motion_findings
    if estimate.samples < 10 * len(law.symbols):
        yield few_samples(estimate.samples)
    pulls = (law.power_law or law.relaxes) and not law.remembers
    if pulls and law.K < 0.0:
        yield NEGATIVE_STIFFNESS
    if law.as_dict().get("B", 0.0) < 0.0 and _creates_energy(contact, trace, estimate):
        yield NEGATIVE_DAMPING
    violated = violated_fraction(trace) if estimator.needs_condition_10 else 0.0
    if violated > 0.0:
        yield Check.CONDITION_10.finding(
            f"|v| ≥ 0.1 K/B in {percent(violated)} of the contact, where the method is biased"
        )
    if math.isnan(prediction_rmse_percent(trace, contact.force, contact.time_steps)):
        yield Check.PREDICTION.finding("less than 0.2 s of contact: no prediction error")
    if estimate.guarded:
        yield Check.GUARD.finding(f"the covariance was limited on {estimate.guarded} samples")
    if left_out := count_true(trace.rejected):
        taken = count_true(trace.taken)
        yield outlier_finding(left_out, left_out + taken)
    if (verdict := estimator.verdict()) is not None:
        yield from verdict.findings
    for refusal in (Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE):
        if count := count_true(trace.status == refusal):
            text = refusal.name.lower().replace("_", " ")
            if refusal == Status.NOT_FINITE:
                text += f": {not_finite(contact)}"
            yield Check.REJECTED_SAMPLES.finding(f"{count} samples rejected: {text}")


def check_fits(
    fits: CurveFits,
    excluded: Integers,
    creating_energy: Mask,
) -> list[list[Finding]]:
    """Return for each curve the findings that :func:`check_estimate` has of one estimate.

    Parameters
    ----------
    fits : CurveFits
        Whole-curve fits.
    excluded : numpy.ndarray of int64, shape (k,)
        Number of samples of each curve that were excluded as outliers.
    creating_energy : numpy.ndarray of bool, shape (k,)
        Whether the damping is negative beyond its error, as :func:`creates_energy` returns it.
    """
    unsettled = fits.where_status("did not settle")
    findings = []
    for k, (taken, left_out) in enumerate(zip(fits.taken.tolist(), excluded.tolist(), strict=True)):
        own = list(flag_findings(int(fits.flags[k])))
        if taken < 10 * len(HuntCrossley.names()):
            own.append(few_samples(taken))
        if fits.K[k] < 0.0:
            own.append(NEGATIVE_STIFFNESS)
        if creating_energy[k]:
            own.append(NEGATIVE_DAMPING)
        if unsettled[k]:
            own.append(_NOT_CONVERGED)
        if left_out:
            own.append(outlier_finding(left_out, max(left_out + taken, 1)))
        findings.append(own)
    return findings


def _creates_energy(contact: Contact, trace: Trace, estimate: Estimate) -> bool:
    taken = trace.taken
    depth = median(contact.penetration[taken]) - estimate.surface if taken.any() else 0.0
    if not depth > 0.0:
        return False
    with np.errstate(all="ignore"):
        (force, _, damping), errors = estimate.with_errors(lambda of: of.at_rest(depth))
        speed = rms(contact.velocity[taken])
        return bool(creates_energy(damping, errors[2], force, speed))


def creates_energy(damping: Any, error: Any, force: Any, speed: Any) -> Any:
    """Whether a damping is negative, beyond two standard errors and the diagnosis's tolerance.

    Parameters
    ----------
    damping, error : float or numpy.ndarray
        Damping at a depth and its standard error, N·s/m.
    force : float or numpy.ndarray
        Force at that depth and at rest, N.
    speed : float or numpy.ndarray
        Root mean square of the velocity in contact, m/s.
    """
    size = reference_scale(damping, force, speed)
    return damping < -np.maximum(2.0 * error, CARE * size)


# Why nothing can be identified: no sample in contact, no velocity, no approach.


def why_nothing(data: Data, gate: ContactGate) -> RecordingError:
    """Return the error for no sample taken: the most severe finding of the data, if any."""
    contact = data.contact
    for finding in data.findings:
        if finding.severity == "do-not-trust":
            return RecordingError.of(contact.source, str(finding))
    air = len(contact) > 0 and not gate.makes(contact.penetration, contact.force).any()
    air = air and not depends_on_position(contact.force, contact.penetration)
    kind = NoContactError if air else RecordingError
    return kind.of(contact.source, no_contact_message(contact, gate))


def no_contact_message(contact: Contact, gate: ContactGate) -> str:
    """Describe why no sample was taken."""
    if not len(contact):
        return "there are no samples"
    inside = gate.makes(contact.penetration, contact.force)
    if inside.any() and not np.isfinite(contact.velocity[inside]).any():
        return (
            f"no sample in contact has a velocity: {not_finite(contact)}; pass "
            "--velocity none to differentiate the penetration instead"
        )
    return (
        f"no contact found: no sample has penetration above "
        f"{rounded(gate.minimum_penetration, 3)} m and force above {rounded(gate.make_force, 3)} N "
        f"(the largest are {_largest(contact.penetration)} m and {_largest(contact.force)} N); "
        "check units and signs, or pass a smaller --min-penetration or --min-force"
    )


def not_finite(contact: Contact) -> str:
    """Describe which channels are not finite, their origin, and the number of their samples."""
    penetration = ~np.isfinite(contact.penetration)
    force = ~np.isfinite(contact.force)
    velocity = ~np.isfinite(contact.velocity) & ~penetration  # for another reason
    phrases = []
    for name, wrong in {"penetration": penetration, "velocity": velocity, "force": force}.items():
        if wrong.any():
            origin = f" ({contact.provenance[name]})" if name in contact.provenance else ""
            phrases.append(f"{name}{origin} is NaN or infinite in {wrong.sum()}")
    return f"{', '.join(phrases)} of {len(contact)} samples"


def _largest(values: Floats) -> str:
    known = values[~np.isnan(values)]
    return rounded(known.max(), 3) if known.size else "no"


# Samples above the surface that a fit of the surface needs; the force in free air is then known to
# a quarter of σ.
FEWEST_ABOVE = 20


def check_approach(contact: Contact, trace: Trace, surface: float) -> None:
    """Raise if too few samples lie above an estimated surface: they show where the force begins."""
    above = count_true(contact.penetration[trace.taken] < surface)
    if above < FEWEST_ABOVE:
        raise RecordingError.of(contact.source, no_approach(above, len(contact), surface))


def no_approach(above: int, samples: int, surface: float) -> str:
    """Describe that too few samples lie above the surface that was found."""
    return (
        f"cannot estimate the surface without a free approach: {above} of {samples} samples lie "
        f"above the best surface, {rounded(surface, 3)} m, and at least {FEWEST_ABOVE} must; "
        "start the recording before the touch, or pass the position of the surface"
    )
