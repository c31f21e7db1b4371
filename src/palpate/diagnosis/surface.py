"""Surface: where the material begins, against where the penetration says that it does."""

import math

import numpy as np
from numpy.typing import NDArray

from palpate.covariance import mean_error, robust_covariance
from palpate.diagnosis.cause import Cause
from palpate.diagnosis.data import in_words
from palpate.diagnosis.fit import Fit, Motion
from palpate.force_laws import HuntCrossley
from palpate.preparation.surface_fit import Samples, placed
from palpate.validation import Floats

FEWEST_FREE = 50  # samples above the surface; with fewer an error of the surface does not show
MOST_IN_CONTACT, MOST_FREE = 3000, 1500
STARTS = (-1.0, -0.3, -0.1, 0.0, 0.1)  # of the working depth
FEWEST_MOVED = 0.005  # of the working depth; less moves no number by more than noise does
# Times the penetration's noise, its steps included: half an encoder count is no other surface.
RESOLVED = 5.0


def free_samples(fit: Fit) -> NDArray[np.bool_]:
    """Samples above the surface, by the penetration."""
    free: NDArray[np.bool_] = (fit.penetration < 0.0) & ~fit.rejected
    return free


def has_free_air(fit: Fit) -> bool:
    """Whether 50 samples or more are out of contact, at whatever penetration is given for them.

    A probe that rests 0.5 mm above the material has none above a surface that is 0.7 mm off.
    """
    return int(np.count_nonzero(fit.outside)) >= FEWEST_FREE


def surface(fit: Fit) -> list[Cause]:
    """Levenberg–Marquardt on (k, c, n, F₀, d), the free approach included; Hunt–Crossley only."""
    law = fit.solution.law
    if not isinstance(law, HuntCrossley) or not fit.with_offset:
        return []
    if not has_free_air(fit) or fit.estimate.surface_standard_error:
        return []
    samples = _samples(fit)
    given = np.array([*law.parameters, fit.solution.offset, 0.0])
    after = min(
        (
            placed(samples, np.array([*given[:4], start]), exponent_fixed=bool(fit.fixed))
            for start in STARTS
        ),
        key=lambda placed: placed.energy,
    )
    depth = after.parameters[4]
    if abs(depth) < max(FEWEST_MOVED, RESOLVED * fit.data.penetration_noise / fit.reference):
        return []
    error = math.sqrt(robust_covariance(after.jacobian, after.residual)[-1, -1])
    return [_described(fit, after.parameters, error, max(_band_gain(fit, after.parameters), 0.0))]


def _described(fit: Fit, found: Floats, error: float, gain: float) -> Cause:
    k, c, n, _, depth = found.tolist()
    before, reference = fit.solution.law, fit.reference

    def moves(other: Fit) -> tuple[float, float]:
        at = max(other.depth / reference - depth, 0.05)
        stiffness, damping = n * k * at ** (n - 1.0) / reference, c * at**n / other.speed
        return (
            (stiffness - other.stiffness(before)) / other.sizes[0],
            (damping - other.damping(before)) / other.sizes[1],
        )

    after = fit.units.restored(HuntCrossley(k, c, n)).parameters / fit.law.parameters - 1.0
    way = "deeper than" if depth > 0.0 else "above where"
    sentence = (
        f"the surface lies {in_words(abs(depth) * reference, 'm')} ± "
        f"{in_words(error * reference, 'm')} {way} the penetration says: K {after[0]:+.0%}, "
        f"B {after[1]:+.0%}, while stiffness and damping at working depth hardly move"
    )
    return Cause(
        "surface",
        abs(depth) / max(error, 1e-300),
        gain,
        *moves(fit),
        abs((n - before.parameters[2]) * math.log(reference)) + n * abs(depth),
        sentence,
        "--surface estimate",
        moves,
    )


def _samples(fit: Fit) -> Samples:
    free = np.flatnonzero(free_samples(fit))
    inside = np.flatnonzero(fit.inside)
    between = np.flatnonzero(fit.outside & (fit.penetration >= 0.0))
    chosen = np.sort(
        np.concatenate(
            [
                _thinned(inside, MOST_IN_CONTACT),
                _thinned(free, MOST_FREE),
                _thinned(between, MOST_FREE),
            ]
        )
    )
    data = fit.data
    return Samples(
        fit.penetration[chosen] / fit.units.depth,
        data.velocity[chosen] / fit.units.speed,
        data.force[chosen],
    )


def _thinned(index: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    return index[:: -(-index.size // most) or 1]


def _band_gain(fit: Fit, found: Floats) -> float:
    """Fraction of the band's residual that a fit below this surface removes."""
    law = HuntCrossley(*found[:3])
    motion = Motion(np.maximum(fit.x - found[4], 1e-9), fit.v, fit.band, fit.force)
    moved = fit.solve(law, float(found[3]), motion)
    return 1.0 - moved.energy / max(fit.solution.energy, np.finfo(float).tiny)


def offset_against_free(fit: Fit) -> tuple[float, float] | None:
    """Significance and size [N] of the offset of the fit against the force in free air."""
    free = np.flatnonzero(free_samples(fit))
    if free.size < FEWEST_FREE or not fit.with_offset:
        return None
    x = fit.penetration[free]
    force = fit.data.force[free[x <= np.median(x)]]
    difference = fit.solution.offset - float(force.mean())
    error = math.hypot(math.sqrt(fit.covariance[-1, -1]), mean_error(force))
    return abs(difference) / max(error, 1e-300), difference
