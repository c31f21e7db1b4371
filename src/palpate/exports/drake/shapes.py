"""Nested spheres, whose force with Drake's linear contacts approximates a power of depth.

They touch the surface one after the other. Each is a point contact of Drake,
kᵢ (x − δᵢ)₊ (1 + dᵢ v)₊, and together they are piecewise linear. Gaps δᵢ and stiffnesses kᵢ ≥ 0
are fitted by least squares.
"""

import numpy as np

from palpate.force_laws import GeneralisedHuntCrossley
from palpate.method.estimators.least_squares import least_squares, nonnegative
from palpate.validation import Floats, frozen

#: Spheres are added until the spring's error is below this, %: about six for x^1.5, eight for x².
#: The exponent identified from Drake's force is then right within one or two standard errors.
GOOD_ENOUGH = 0.25
#: Largest number of spheres; eight have an error of 0.2 % for x².
MOST_SPHERES = 8
# Most samples for a fit; more do not change its second digit.
_MOST_SAMPLES = 1000
#: Rounding error, m, of differences between positions of some centimetres.
ROUNDING = 1e-15


@frozen(eq=False)
class Spheres:
    """F = Σ kᵢ (x − δᵢ)₊ (1 + dᵢ v)₊.

    Attributes
    ----------
    gaps : numpy.ndarray, shape (m,)
        δᵢ, m: increasing from 0.
    stiffness, dissipation : numpy.ndarray, shape (m,)
        kᵢ, N/m, > 0, and dᵢ, s/m, ≥ 0.
    """

    gaps: Floats
    stiffness: Floats
    dissipation: Floats

    def force(self, penetration: Floats, velocity: Floats, step: float = 0.0) -> Floats:
        """Return the force, N, at least 0.

        In a discrete plant with a step [s] contacts are those at the beginning of the step: a
        sphere that touches the surface within a step acts only from the next.
        """
        spring = np.maximum(penetration[:, None] - self.gaps, 0.0) * self.stiffness
        damped = np.maximum(1.0 + velocity[:, None] * self.dissipation, 0.0)
        met = (penetration - step * velocity)[:, None] >= self.gaps - ROUNDING
        force: Floats = (spring * damped * met).sum(axis=1)
        return force


def one_sphere(law: GeneralisedHuntCrossley) -> Spheres:
    """Return the sphere K x (1 + B/K v) of a law with n = p = 1."""
    return Spheres(np.zeros(1), np.array([law.K]), np.array([law.B / law.K]))


def fit_spheres(law: GeneralisedHuntCrossley, penetration: Floats, velocity: Floats) -> Spheres:
    """Return the fewest spheres that fit a law well at these samples in contact.

    For p = n all have the dissipation B/K, which keeps the restitution. Else each has its own, ≥ 0,
    from a least-squares fit of the damper alone.

    Parameters
    ----------
    law : GeneralisedHuntCrossley
        K > 0 and n ≥ 1 (xⁿ convex); for a lower n the result is one sphere.
    penetration, velocity : numpy.ndarray, shape (k,)
        Penetration, m, > 0, and velocity, m/s.
    """
    x, v = _samples(penetration, velocity)
    alike = law.B == 0.0 or law.p == law.n
    b = law.B / law.K if alike else 0.0
    weight = np.maximum(1.0 + b * v, 0.0)
    wanted = law.K * x**law.n
    for count in range(1, MOST_SPHERES + 1):
        gaps, stiffness, error = _springs(x, weight, wanted, _spread(x, law.n, count))
        if error < GOOD_ENOUGH:
            break
    kept = stiffness > 0.0
    gaps = gaps[kept]
    stiffness = stiffness[kept]
    if alike:
        return Spheres(gaps, stiffness, np.full(gaps.size, b))
    damper = law.B * x**law.p * v
    damping = _not_negative(np.maximum(x[:, None] - gaps, 0.0) * v[:, None], damper)
    return Spheres(gaps, stiffness, damping / stiffness)


def _samples(penetration: Floats, velocity: Floats) -> tuple[Floats, Floats]:
    """Return some of the samples, and half as many at rest, spaced evenly from the surface down.

    Without these the first sphere, which alone acts at shallow depths, would be too stiff: x^1.5
    was identified as x^1.52.
    """
    every = -(-penetration.size // _MOST_SAMPLES)
    x = penetration[::every]
    v = velocity[::every]
    count = x.size // 2 + 1
    depths = (np.arange(count) + 0.5) / count * float(x.max())
    return np.concatenate([x, depths]), np.concatenate([v, np.zeros(count)])


def _not_negative(columns: Floats, wanted: Floats) -> Floats:
    """Solve least squares with coefficients ≥ 0."""
    size = np.maximum(np.sqrt(np.einsum("ij,ij->j", columns, columns)), 1e-300)
    scaled = columns / size
    free = np.zeros(size.size, dtype=np.bool_)
    found: Floats = nonnegative(scaled.T @ scaled, scaled.T @ wanted, free, ~free) / size
    return found


def _spread(x: Floats, exponent: float, count: int) -> Floats:
    """Return initial gaps with density (w f″²)^(1/5), the optimum for many knots.

    de Boor, *A Practical Guide to Splines* (1978), chapter XII, with w the samples' own density.
    """
    edges = np.linspace(0.0, float(x.max()), 201)
    middle = 0.5 * (edges[1:] + edges[:-1])
    samples = np.histogram(x, edges)[0]
    # A minimum for depths without samples, so that knots do not coincide.
    density = (samples * middle ** (2.0 * (exponent - 2.0))) ** 0.2
    density += 1e-3 * density.max()
    whole = np.concatenate([[0.0], np.cumsum(density)])
    gaps: Floats = np.interp(np.arange(count) / count * whole[-1], whole, edges)
    return gaps


def _springs(
    x: Floats,
    weight: Floats,
    wanted: Floats,
    gaps: Floats,
) -> tuple[Floats, Floats, float]:
    """Return gaps, stiffnesses, and the error in %, by least squares of the gaps.

    The stiffnesses follow from the gaps (variable projection, with Kaufman's gradient); the first
    gap stays 0.
    """
    target = weight * wanted
    column = weight[:, None]

    def model(others: Floats) -> tuple[Floats, Floats]:
        """Residual and gradient of the force by all gaps but the first."""
        depths = x[:, None] - np.concatenate([[0.0], others])
        ramps = np.maximum(depths, 0.0) * column
        stiffness = _not_negative(ramps, target)
        slopes = (-1.0 * (depths > 0.0) * stiffness * column)[:, 1:]
        basis = np.linalg.qr(ramps)[0]
        return target - ramps @ stiffness, slopes - basis @ (basis.T @ slopes)

    fit = least_squares(model, gaps[1:], (0.0, 0.999 * float(x.max())), enough=1e-6)
    gaps = np.concatenate([[0.0], np.sort(fit.parameters)])
    stiffness = _not_negative(np.maximum(x[:, None] - gaps, 0.0) * column, target)
    cost = float(fit.residual @ fit.residual)
    return gaps, stiffness, 100.0 * (cost / float(target @ target)) ** 0.5
