"""The surface position, and errors of direction and mount that no recording shows."""

import math

import numpy as np

from palpate.digits import format_quantity, percent
from palpate.findings import Check, Finding, NextStep, Remedy
from palpate.force_laws import HuntCrossley
from palpate.identification.diagnosis.causes import CARE, MisfitHypothesis, OtherLaw
from palpate.identification.diagnosis.fit import NOISE_LIKE, Fit, MovedSamples
from palpate.input.preparation.resolution import find_dead_band
from palpate.method.estimators import ESTIMATORS
from palpate.method.estimators.least_squares import fit_surface_position, robust_covariance
from palpate.validation import Floats

MOST_IN_CONTACT = 3000
MOST_FREE = 1500
STARTS = (-1.0, -0.3, -0.1, 0.0, 0.1)  # fractions of the working depth
FEWEST_MOVED = 0.005  # of the working depth; a smaller shift has less effect than noise
# Multiple of the penetration's noise including its steps: half an encoder count is not a shift.
RESOLVED = 5.0


def find_surface(fit: Fit) -> list[MisfitHypothesis]:
    """Fit (k, c, n, F₀, d) with the free approach by Levenberg–Marquardt; Hunt–Crossley only."""
    law = fit.solution.law
    surface_known = fit.estimate.surface_standard_error > 0.0
    if surface_known or not (law.power_law and fit.with_offset and fit.has_free_air):
        return []
    parameters = (*law.parameters, fit.solution.offset)
    starts = np.array([(*parameters, start) for start in STARTS])
    fitted = fit_surface_position(_thin_samples(fit), starts, exponent_fixed=bool(fit.fixed))
    k, c, n, zero, depth = fitted.parameters.tolist()
    if abs(depth) < max(FEWEST_MOVED, RESOLVED * fit.data.penetration_noise / fit.reference):
        return []
    error = math.sqrt(robust_covariance(fitted.jacobian, fitted.residual)[-1, -1])
    # Energy over the windows, refitted with this surface.
    motion = MovedSamples(np.maximum(fit.x - depth, 1e-9), fit.v, fit.windows, fit.force)
    change = OtherLaw(HuntCrossley(K=k, B=c, n=n), law, depth)
    energy = fit.solve(change.law, zero, motion).energy
    changes = change.relative(fit)
    sentence = _describe_surface(fit, change, error)
    if not math.sqrt(energy / len(fit.windows)) < NOISE_LIKE * fit.noise_floor:
        sentence += ", but the force is still not explained to the noise"
    elif max(map(abs, changes)) < CARE:
        sentence += ", stiffness and damping at working depth hardly at all"
    explained = max(fit.explained_fraction(energy), 0.0)
    parameter = abs((n - law.parameters[2]) * math.log(fit.reference)) + n * abs(depth)
    kind = ESTIMATORS.get(fit.method)
    estimates = kind is not None and "surface" in kind().settings
    remedy = Remedy(NextStep.SURFACE if estimates else NextStep.SURFACE_BY_METHOD)
    numbers = abs(depth) / max(error, 1e-300), explained, parameter
    return [MisfitHypothesis(Check.SURFACE, *numbers, sentence, remedy, change, *changes)]


def _describe_surface(fit: Fit, change: OtherLaw, error: float) -> str:
    changes = fit.units.to_si(change.law).parameters / fit.law.parameters - 1.0
    k, b, *_ = (percent(each, sign=True) for each in changes.tolist())
    way = "deeper than zero penetration" if change.deeper > 0.0 else "above zero penetration"
    return (
        f"the surface is {format_quantity(abs(change.deeper) * fit.reference, 'm')} ± "
        f"{format_quantity(error * fit.reference, 'm')} {way}: with it K changes by {k} "
        f"and B by {b}"
    )


def _thin_samples(fit: Fit) -> Floats:
    """Return samples of contact, of free approach and between them, thinned."""
    between = fit.outside & (fit.penetration >= 0.0)
    chosen = []
    if band := find_dead_band(fit.data.contact):  # the sensor suppresses smaller forces
        between &= fit.data.force >= band
    for selected, most in (
        (fit.inside, MOST_IN_CONTACT),
        (fit.free, MOST_FREE),
        (between, MOST_FREE),
    ):
        index = np.flatnonzero(selected)
        chosen.append(index[:: -(-index.size // most) or 1])
    samples = np.sort(np.concatenate(chosen))
    data = fit.data
    x = fit.penetration[samples] / fit.units.depth
    v = data.velocity[samples] / fit.units.speed
    return np.array([x, v, data.force[samples]])


OFF_AXIS = 10.0
SOFT_MOUNT = 0.05  # degrees; fraction of the stiffness


def check_unobservable(fit: Fit) -> Finding:
    """Report errors that no recording can show, and their size.

    At an angle θ to the normal both x and F are projections: S = ∂F/∂x is reduced by cosᵖ⁺¹ θ and C
    by cosᵖ⁺² θ, with p = x S/F, which is n for a power law. A mount of stiffness k in series
    reduces S to S k/(S + k). One that resonates at ω₀ raises S by (ω/ω₀)², which a motion of
    several frequencies shows as negative inertia.
    """
    law = fit.solution.law
    cosine = math.cos(math.radians(OFF_AXIS))
    stiffness = fit.stiffness(law)
    force = fit.force_at_depth(law)
    power = fit.depth * stiffness / force if force else 1.0
    lost = (1.0 - cosine ** (power + 1.0), 1.0 - cosine ** (power + 2.0))
    soft = format_quantity(abs(stiffness) * (1.0 / SOFT_MOUNT - 1.0), "N/m")
    slow = format_quantity(1.0 / (fit.period * math.sqrt(SOFT_MOUNT)), "Hz", digits=2)
    return Check.UNSEEN.finding(
        "these faults leave no trace in a recording; check them at the rig: "
        f"{OFF_AXIS:.0f}° off the surface normal makes the stiffness {percent(lost[0])} and the "
        f"damping {percent(lost[1])} too small; 1 % of scale changes them by 1 %; a mount softer "
        f"than {soft} makes the stiffness over {percent(SOFT_MOUNT)} too small, and one that "
        f"resonates below {slow} as much too large"
    )


def check_known_surface(fit: Fit) -> Finding | None:
    """The recording has no free air, and the surface is not known otherwise."""
    contact = fit.data.contact
    reported = any(finding.check == Check.SURFACE for finding in contact.findings)
    if fit.has_free_air or reported or contact.surface_deviation is not None:
        return None
    from palpate.input.preparation.surface import report_assumed_surface

    return report_assumed_surface("the recording has no free air")
