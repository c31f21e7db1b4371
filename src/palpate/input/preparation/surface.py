"""The surface of the material: where the force begins, or an assumption without free air."""

import math

import numpy as np

from palpate.digits import rounded
from palpate.findings import Check, Finding
from palpate.input.preparation.options import SurfaceRule
from palpate.input.preparation.resolution import deviation_of_mean, noise_of
from palpate.method.contact import add_step
from palpate.method.estimators.least_squares import fit_surface_position, robust_covariance
from palpate.method.rows import count_true, finite_rows, median, rms, true_runs
from palpate.validation import Floats, Mask, frozen

NOISES_OF_CONTACT = 6.0  # σ
# Limits of the light branch, which shows the surface, over the peak force. Drag and drift stay
# below 3 %.
LIGHTEST = 0.03
HEAVIEST = 0.4
FEWEST_LIGHT = 8  # samples of the light branch
# Samples in free air for a search of the surface: 20, in a short recording a tenth, at least 8.
MOST_NEEDED = 20
SHARE_NEEDED = 0.1
LEAST_NEEDED = 8
MOST_FITTED = 4000  # samples
# Standard deviations of the baseline rule; a fit that ends beyond does not fit the light branch.
FARTHEST = 4.0
# A flat punch has 1, a sphere 1.5, a cone 2. An exponent far from these compensates for a wrong
# surface; the light branch alone is then more accurate.
LEAST_EXPONENT = 0.7
MOST_EXPONENT = 2.6
GROWTHS = (1.0, 1.5, 2.0)  # exponents of the force: flat punch or foam, sphere, cone


@frozen
class Surface:
    """The surface of the material.

    Attributes
    ----------
    position : float
        m, in the coordinate that increases into the material.
    deviation : float or None
        Its standard deviation, m; None if it is assumed.
    text : str
        How it was found.
    """

    position: float
    deviation: float | None
    text: str

    @property
    def assumed(self) -> bool:
        """Whether the position is an assumption."""
        return self.deviation is None

    def report(self, made: dict[str, str], findings: list[Finding]) -> None:
        """Record that the penetration is relative to it, and report an assumption."""
        step = f"relative to {rounded(self.position, 6)} m, {self.text}"
        if self.deviation:
            step += f" (± {rounded(self.deviation, 2)} m)"
        add_step(made, "penetration", step)
        findings += self.assumption()

    def assumption(self) -> list[Finding]:
        """The finding on an assumed surface; none if it was found."""
        if not self.assumed:
            return []
        return [report_assumed_surface("the recording has no free air")]


def report_assumed_surface(
    reason: str,
    remedy: str = "record from before the touch, or pass the surface, such as --surface 0.7mm",
) -> Finding:
    """Report that the surface is assumed where the shallowest sample is."""
    problem = (
        f"{reason}, so the surface position is assumed (the shallowest sample): K, B and n depend "
        "on it, stiffness and damping at working depth do not"
    )
    return Check.SURFACE.finding(problem, remedy, severity="with-care")


def find_surface(depth: Floats, velocity: Floats, force: Floats, rule: SurfaceRule) -> Surface:
    """Find the surface of the material.

    *threshold*: the depth at which the force exceeds max(6 σ, 3 % of its peak) on the way in. It is
    too deep by the penetration at which the material gives this force. *baseline*: the depth at
    which a line through the light branch, F^(1/n) over depth, reaches zero for n = 1.5; the results
    for n = 1 and 2 give its uncertainty. *fit*: joint least squares of a Hunt–Crossley law, an
    offset and the surface, started at the baseline's surface. Without free air the surface is
    assumed at the shallowest depth.

    Parameters
    ----------
    depth : numpy.ndarray, shape (k,)
        m, increasing into the material, from an arbitrary origin.
    velocity : numpy.ndarray, shape (k,)
        m/s, positive while penetrating.
    force : numpy.ndarray, shape (k,)
        N, compression positive, tared.
    rule : str
        ``"threshold"``, ``"baseline"``, ``"fit"``, or ``"estimate"``, which is as ``"fit"`` here.
    """
    finite = finite_rows(depth, force, velocity)
    x = depth[finite]
    v = velocity[finite]
    f = force[finite]
    peak = float(np.percentile(f, 99.0)) if f.size else 0.0
    least = max(NOISES_OF_CONTACT * noise_of(f), LIGHTEST * peak)
    fewest = min(MOST_NEEDED, max(SHARE_NEEDED * x.size, LEAST_NEEDED))
    surface = None
    if count_true(f < least) >= fewest and least < HEAVIEST * peak:
        if rule == "threshold":
            surface = _find_crossing(x, f, least)
        else:
            going_in = (v > 0.0) & find_presses(f, least, peak)
            surface = _find_departure(x[going_in], f[going_in], least, peak)
            if surface is not None and rule != "baseline":
                surface = _fit_surface(x, v, f, surface) or surface
    if surface is not None:
        return surface
    shallowest = float(x.min()) if x.size else 0.0
    return Surface(shallowest, None, "the shallowest sample: there is no free air")


def _find_crossing(x: Floats, f: Floats, least: float) -> Surface | None:
    """The median depth at which the force exceeds a threshold on the way in."""
    over = f >= least
    entered = np.flatnonzero(over[1:] & ~over[:-1] & (x[1:] >= x[:-1]))
    if not entered.size:
        return None
    fraction = (least - f[entered]) / np.maximum(f[entered + 1] - f[entered], 1e-300)
    depths = x[entered] + np.clip(fraction, 0.0, 1.0) * (x[entered + 1] - x[entered])
    position = median(depths)
    # The penetration at this force, from F ∝ x^1.5 through the deepest sample.
    deepest = float(np.percentile(x, 99.0))
    peak = float(np.percentile(f, 99.0))
    share = (least / peak) ** (1.0 / 1.5) if peak > least else 0.0
    excess = max(deepest - position, 0.0) * share / max(1.0 - share, 1e-3)
    scatter = float(np.std(depths)) / math.sqrt(depths.size)
    return Surface(position, math.hypot(scatter, excess), f"where the force exceeds {least:.2g} N")


def find_presses(f: Floats, least: float, peak: float) -> Mask:
    """Find the runs of a force above a least one that reach 40 % of its peak."""
    pressed = f > least
    mask = np.zeros(f.size, dtype=bool)
    for run in true_runs(pressed):
        mask[run] = f[run].max() >= HEAVIEST * peak
    return mask


def _find_departure(x: Floats, f: Floats, least: float, peak: float) -> Surface | None:
    """The depth at which F^(1/n) over depth reaches zero."""
    light = (f > least) & (f < HEAVIEST * peak)
    if count_true(light) < FEWEST_LIGHT:
        return None
    (shallow, _), (position, error), (deep, _) = (
        _intercept(x[light], f[light] ** (1.0 / n)) for n in GROWTHS
    )
    if not np.isfinite([shallow, position, error, deep]).all():
        return None
    # The standard deviation of a uniform distribution between the two others.
    model = abs(shallow - deep) / math.sqrt(12.0)
    text = "where the force departs from that in free air"
    return Surface(position, math.hypot(error, model), text)


def _intercept(x: Floats, root: Floats) -> tuple[float, float]:
    """The depth at which a line through the root of the force is zero, and its error.

    Samples far from a line of median slope (Theil 1950, Sen 1968) are excluded first.
    """
    order = np.argsort(x)
    low = order[: x.size // 2]
    high = order[-(x.size // 2) :]
    slope = median((root[high] - root[low]) / np.maximum(x[high] - x[low], 1e-300))
    offsets = root - slope * x
    distance = np.abs(offsets - np.median(offsets))
    close = distance <= FARTHEST * 1.4826 * np.median(distance)
    x = x[close]
    root = root[close]
    centre = float(x.mean())
    mean = float(root.mean())
    dx = x - centre
    dr = root - mean
    # Regress the root on depth: the noise of the position is small.
    energy = float(dx @ dx)
    slope = float(dx @ dr) / max(energy, 1e-300)
    if slope <= 0.0:
        return math.nan, math.nan
    residual = dr - slope * dx
    every = np.ones(residual.size, dtype=bool)
    of_mean = deviation_of_mean(residual, every) if residual.size > 1 else math.inf
    lever = (mean / slope) ** 2 / max(energy / x.size, 1e-300)
    return centre - mean / slope, of_mean / slope * math.sqrt(1.0 + lever)


def _fit_surface(x: Floats, v: Floats, f: Floats, start: Surface) -> Surface | None:
    """Least squares of law, offset and surface; None if it ends far from its start."""
    depth = float(np.percentile(x, 99.0)) - start.position
    speed = rms(v)
    size = float(np.percentile(f, 99.0))
    if not (depth > 0.0 and speed > 0.0 and size > 0.0 and start.deviation):
        return None
    close = x > start.position - depth  # more free air is not needed
    stride = count_true(close) // MOST_FITTED + 1
    samples = np.array([(x[close] - start.position) / depth, v[close] / speed, f[close]])
    starts = np.array([(size, 0.0, n, 0.0, 0.0) for n in GROWTHS])
    fit = fit_surface_position(samples[:, ::stride], starts)
    shift = float(fit.parameters[4]) * depth
    error = math.sqrt(robust_covariance(fit.jacobian, fit.residual)[-1, -1]) * depth
    at_start = abs(shift) <= FARTHEST * start.deviation and 0.0 < error < depth
    if not at_start or not LEAST_EXPONENT <= fit.parameters[2] <= MOST_EXPONENT:
        return None
    return Surface(start.position + shift, error, "by joint least squares of law and surface")
