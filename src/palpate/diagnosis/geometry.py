"""The surface position, and errors of direction and mount that no recording shows."""

import math
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.causes import CARE, MisfitHypothesis
from palpate.diagnosis.fit import NOISE_LIKE, Fit, MovedSamples
from palpate.digits import format_quantity
from palpate.estimators.least_squares import robust_covariance
from palpate.findings import Check, Finding
from palpate.force_laws import ForceLaw, HuntCrossley
from palpate.preparation.resolution import find_dead_band
from palpate.preparation.surfaces import fit_surface_position, report_assumed_surface
from palpate.validation import Floats

MOST_IN_CONTACT, MOST_FREE = 3000, 1500
STARTS = (-1.0, -0.3, -0.1, 0.0, 0.1)  # fractions of the working depth
FEWEST_MOVED = 0.005  # of the working depth; a smaller shift has less effect than noise
# Multiple of the penetration's noise including its steps: half an encoder count is not a shift.
RESOLVED = 5.0


def find_surface(fit: Fit) -> list[MisfitHypothesis]:
    """Fit (k, c, n, F₀, d) with the free approach by Levenberg–Marquardt; Hunt–Crossley only."""
    law = fit.solution.law
    if not law.power_law or not fit.with_offset:
        return []
    if not fit.has_free_air or fit.estimate.surface_standard_error:
        return []
    given = (*law.parameters, fit.solution.offset)
    starts = np.array([(*given, start) for start in STARTS])
    after = fit_surface_position(_thin_samples(fit), starts, exponent_fixed=bool(fit.fixed))
    depth = after.parameters[4]
    if abs(depth) < max(FEWEST_MOVED, RESOLVED * fit.data.penetration_noise / fit.reference):
        return []
    error = math.sqrt(robust_covariance(after.jacobian, after.residual)[-1, -1])
    # Energy over the windows, refitted with this surface.
    motion = MovedSamples(np.maximum(fit.x - depth, 1e-9), fit.v, fit.windows, fit.force)
    law, zero = HuntCrossley(*after.parameters[:3]), float(after.parameters[3])
    energy = fit.solve(law, zero, motion).energy
    fits = math.sqrt(energy / len(fit.windows)) < NOISE_LIKE * fit.noise_floor
    explained = max(fit.explained_fraction(energy), 0.0)
    return [_surface_cause(fit, after.parameters, error, explained, fits_to_noise=fits)]


@dataclass(frozen=True, slots=True)
class MovedSurface:
    """Replacement of the law by another below a surface that is deeper by ``depth`` references."""

    law: HuntCrossley
    before: ForceLaw
    depth: float

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness and damping at the fit's depth over their scales."""
        depth = max(fit.depth / fit.reference - self.depth, 0.05)
        stiffness = float(self.law.stiffness_at(depth)) / fit.reference
        damping = float(self.law.damping_at(depth)) / fit.speed
        return fit.relative_difference((stiffness, damping), self.before)


def _surface_cause(
    fit: Fit, parameters: Floats, error: float, explained: float, *, fits_to_noise: bool
) -> MisfitHypothesis:
    k, c, n, _, depth = parameters.tolist()
    reference, change = fit.reference, MovedSurface(HuntCrossley(k, c, n), fit.solution.law, depth)
    after = fit.units.restored(change.law).parameters / fit.law.parameters - 1.0
    way = "deeper than zero penetration" if depth > 0.0 else "above zero penetration"
    sentence = (
        f"the surface is {format_quantity(abs(depth) * reference, 'm')} ± "
        f"{format_quantity(error * reference, 'm')} {way}: with it K changes by {after[0]:+.0%} "
        f"and B by {after[1]:+.0%}"
    )
    numbers = change.relative(fit)
    if not fits_to_noise:
        sentence += ", but the force is still not explained to the noise"
    elif max(map(abs, numbers)) < CARE:
        sentence += ", stiffness and damping at working depth hardly at all"
    exponent = fit.solution.law.parameters[2]
    parameter = abs((n - exponent) * math.log(reference)) + n * abs(depth)
    method = "" if fit.finds_surface else "--method variable-projection "
    return MisfitHypothesis(
        Check.SURFACE,
        abs(depth) / max(error, 1e-300),
        explained,
        parameter,
        sentence,
        f"run again with {method}--surface estimate",
        change,
        *numbers,
        fits_to_noise,
    )


def _thin_samples(fit: Fit) -> Floats:
    """Return samples of contact, of free approach and between them, thinned."""
    between, chosen = fit.outside & (fit.penetration >= 0.0), []
    if band := find_dead_band(fit.data.contact):  # the sensor suppresses smaller forces
        between &= fit.data.force >= band
    for kept, most in ((fit.inside, MOST_IN_CONTACT), (fit.free, MOST_FREE), (between, MOST_FREE)):
        index = np.flatnonzero(kept)
        chosen.append(index[:: -(-index.size // most) or 1])
    at, data = np.sort(np.concatenate(chosen)), fit.data
    x, v = fit.penetration[at] / fit.units.depth, data.velocity[at] / fit.units.speed
    return np.array([x, v, data.force[at]])


OFF_AXIS, SOFT_MOUNT = 10.0, 0.05  # degrees; fraction of the stiffness


def check_unobservable(fit: Fit) -> Finding:
    """Report errors that no recording can show, and their size.

    At an angle θ to the normal both x and F are projections: S = ∂F/∂x is reduced by cosᵖ⁺¹ θ and C
    by cosᵖ⁺² θ, with p = x S/F, which is n for a power law. A mount of stiffness k in series
    reduces S to S k/(S + k).
    """
    law, part = fit.solution.law, math.cos(math.radians(OFF_AXIS))
    stiffness, force = fit.stiffness(law), fit.force_at_depth(law)
    power = fit.depth * stiffness / force if force else 1.0
    lost = (1.0 - part ** (power + 1.0), 1.0 - part ** (power + 2.0))
    soft = format_quantity(abs(stiffness) * (1.0 / SOFT_MOUNT - 1.0), "N/m")
    return Check.UNSEEN.finding(
        f"no recording shows these: {OFF_AXIS:.0f}° off the surface normal makes the stiffness "
        f"{lost[0]:.1%} and the damping {lost[1]:.1%} too small; 1 % of scale changes them by 1 %; "
        f"a mount softer than {soft} makes the stiffness over {SOFT_MOUNT:.0%} too small"
    )


def check_known_surface(fit: Fit) -> Finding | None:
    """The recording has no free air, and the surface is not known otherwise."""
    contact = fit.data.contact
    reported = any(finding.check == Check.SURFACE for finding in contact.findings)
    if fit.has_free_air or reported or contact.surface_deviation is not None:
        return None
    return report_assumed_surface("the recording has no free air")
