"""Where the material begins: where the force begins; and an assumption where that is not seen."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from palpate.covariance import robust_covariance
from palpate.preparation.suggestions import noise_of
from palpate.preparation.surface_fit import Samples, placed
from palpate.preparation.tare import deviation_left
from palpate.validation import Floats

SurfaceRule = Literal["threshold", "baseline", "fit", "estimate"]
NOISES = 6.0  # σ
# Of the peak force: the light branch, from which the surface is seen. Drag and drift of a sensor
# are within 3 % of it.
LEAST, MOST = 0.03, 0.4
FEWEST = 8  # samples of it
FEWEST_FREE = 20  # as many as a search for the surface asks for
MOST_FITTED = 4000  # samples
# Deviations of the baseline rule: what ends farther off is of another branch than the light one.
FARTHEST = 4.0
# A flat punch has 1, a sphere 1.5, a cone 2. Far from them the exponent stands for a surface that
# is elsewhere: the two trade off, and what the light branch alone says is nearer.
LEAST_EXPONENT, MOST_EXPONENT = 0.7, 2.6
EXPONENTS = (1.0, 1.5, 2.0)  # of the force's growth: flat punch or foam, sphere, cone


@dataclass(frozen=True, slots=True)
class Surface:
    """Where the material begins.

    Attributes
    ----------
    position : float
        m, in the coordinate that grows into the material.
    deviation : float or None
        Its standard deviation, m; None where it is an assumption.
    words : str
        How it was found.
    """

    position: float
    deviation: float | None
    words: str

    @property
    def assumed(self) -> bool:
        """Whether nothing in the recording shows it."""
        return self.deviation is None


def surface_of(depth: Floats, velocity: Floats, force: Floats, rule: SurfaceRule) -> Surface:
    """Find where the material begins.

    *threshold*: where the force passes max(6 σ, 3 % of its peak) on the way in; late by the depth
    at which the material gives that force. *baseline*: where the light branch, F^(1/n) over the
    depth, comes down to zero, for n = 1.5; what n = 1 and 2 would say is its deviation. *fit*: from
    there, by least squares of a Hunt–Crossley law, an offset and the surface together. Where the
    probe is never out of contact it is the shallowest depth, which is an assumption.

    Parameters
    ----------
    depth : numpy.ndarray, shape (k,)
        m, growing into the material, from anywhere.
    velocity : numpy.ndarray, shape (k,)
        m/s, positive while penetrating.
    force : numpy.ndarray, shape (k,)
        N, compression positive, tared.
    rule : str
        ``"threshold"``, ``"baseline"`` or ``"fit"``; ``"estimate"`` begins as the latter.
    """
    known = np.isfinite(depth) & np.isfinite(force) & np.isfinite(velocity)
    x, v, f = depth[known], velocity[known], force[known]
    peak = float(np.percentile(f, 99.0)) if f.size else 0.0
    least = max(NOISES * noise_of(f), LEAST * peak)
    free = f < least
    if np.count_nonzero(free) < FEWEST_FREE or not least < MOST * peak:
        return _assumed(x)
    going_in = v > 0.0
    if rule == "threshold":
        return _crossings(x, f, least) or _assumed(x)
    found = _departure(x[going_in], f[going_in], least, peak)
    if found is None or rule == "baseline":
        return found or _assumed(x)
    return _fitted(x, v, f, found) or found


def _assumed(x: Floats) -> Surface:
    lowest = float(x.min(initial=math.inf))
    return Surface(
        lowest if math.isfinite(lowest) else 0.0,
        None,
        "the shallowest sample: the probe is never seen out of contact",
    )


def _crossings(x: Floats, f: Floats, least: float) -> Surface | None:
    """The median depth at which the force passes a threshold, on the way in."""
    over = f >= least
    entered = np.flatnonzero(over[1:] & ~over[:-1] & (x[1:] >= x[:-1]))
    if not entered.size:
        return None
    fraction = (least - f[entered]) / np.maximum(f[entered + 1] - f[entered], 1e-300)
    at = x[entered] + np.clip(fraction, 0.0, 1.0) * (x[entered + 1] - x[entered])
    position = float(np.median(at))
    late = _late(x, f, least, position)
    scatter = float(np.std(at)) / math.sqrt(at.size)
    return Surface(position, math.hypot(scatter, late), f"where the force passes {least:.2g} N")


def _late(x: Floats, f: Floats, least: float, position: float) -> float:
    """How far below the surface a force is passed, by F ∝ x^1.5 to the deepest sample."""
    deepest, peak = float(np.percentile(x, 99.0)), float(np.percentile(f, 99.0))
    fraction = (least / peak) ** (1.0 / 1.5) if peak > least else 0.0
    return max(deepest - position, 0.0) * fraction / max(1.0 - fraction, 1e-3)


def _departure(x: Floats, f: Floats, least: float, peak: float) -> Surface | None:
    """Where F^(1/n) over the depth comes down to zero."""
    light = (f > least) & (f < MOST * peak)
    if np.count_nonzero(light) < FEWEST:
        return None
    found = [_intercept(x[light], f[light] ** (1.0 / n)) for n in EXPONENTS]
    position, error = found[1]
    others = [place for place, _ in (found[0], found[2])]
    if not all(math.isfinite(each) for each in (position, error, *others)):
        return None
    # A rectangle between the two others has the deviation of its width over √12.
    model = abs(others[0] - others[1]) / math.sqrt(12.0)
    return Surface(
        position, math.hypot(error, model), "where the force departs from that out of contact"
    )


def _intercept(x: Floats, root: Floats) -> tuple[float, float]:
    """Depth at which a straight line of the root of the force over depth is zero, and its error."""
    centre, mean = float(x.mean()), float(root.mean())
    dx, dr = x - centre, root - mean
    # Depth over root: the noise of the position is small, but the line is asked for a depth.
    slope = float(dx @ dr) / max(float(dx @ dx), 1e-300)
    if slope <= 0.0:
        return math.nan, math.nan
    left = dr - slope * dx
    zero = np.zeros(left.size, dtype=bool)
    of_mean = deviation_left(left, ~zero) if left.size > 1 else math.inf
    lever = (mean / slope) ** 2 / max(float(dx @ dx) / x.size, 1e-300)
    return centre - mean / slope, of_mean / slope * math.sqrt(1.0 + lever)


def _fitted(x: Floats, v: Floats, f: Floats, start: Surface) -> Surface | None:
    """Least squares of law, offset and surface; None where it ends far from where it began."""
    depth = float(np.percentile(x, 99.0)) - start.position
    speed, size = float(np.sqrt(np.mean(v**2))), float(np.percentile(f, 99.0))
    if not (depth > 0.0 and speed > 0.0 and size > 0.0 and start.deviation):
        return None
    near = x > start.position - depth  # farther out it is free air, of which that is enough
    kept = slice(None, None, int(np.count_nonzero(near)) // MOST_FITTED + 1)
    samples = Samples(
        ((x[near] - start.position) / depth)[kept], (v[near] / speed)[kept], f[near][kept]
    )
    found = min(
        (placed(samples, np.array([size, 0.0, n, 0.0, 0.0])) for n in EXPONENTS),
        key=lambda each: each.energy,
    )
    away = float(found.parameters[4]) * depth
    error = math.sqrt(robust_covariance(found.jacobian, found.residual)[-1, -1]) * depth
    near_start = abs(away) <= FARTHEST * start.deviation and 0.0 < error < depth
    if not near_start or not LEAST_EXPONENT <= found.parameters[2] <= MOST_EXPONENT:
        return None
    words = "by the least squares of law and surface together"
    return Surface(start.position + away, error, words)
