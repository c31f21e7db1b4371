"""Force, stiffness and damping of many Hunt–Crossley laws, each at its own working depth."""

from dataclasses import dataclass

import numpy as np

from palpate import _core
from palpate.curves import CurveFits
from palpate.validation import Floats

Numbers = tuple[Floats, Floats]
#: At the working depth: what it is, and its unit.
AT_DEPTH = {"force": "N", "stiffness": "N/m", "damping": "N·s/m"}


def working_depths(
    penetration: Floats, force: Floats, fits: CurveFits, *, threads: int = 1
) -> Numbers:
    """Median and largest penetration of each row where contact is firm, m; NaN where it never is.

    Firm is what the gate of :func:`palpate.choose_gate` takes, at whose median
    :func:`palpate.identify` works: not what the law leaves decides, but the noise.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m; counted from the surfaces of the fits here.
    force : numpy.ndarray, shape (k, samples)
        N.
    fits : CurveFits
        Of these rows.
    threads : int
        That share the rows.
    """
    found = np.empty((len(penetration), 2))
    _core.working_depths(penetration, force, fits.surface, found, threads)
    return found[:, 0].copy(), found[:, 1].copy()


@dataclass(frozen=True, slots=True, eq=False)
class LawsAtDepth:
    """Values and standard errors, SI, one a row.

    F = K xⁿ, S = n K xⁿ⁻¹, C = B xⁿ with x = X − d: at the place X where the probe was, so that
    what is not known of the surface d moves them as little as it moves the force there.
    """

    force: Numbers
    stiffness: Numbers
    damping: Numbers

    @classmethod
    def of(cls, fits: CurveFits, depth: Floats) -> "LawsAtDepth":
        """Return them for each fit at its own depth, m; NaN where that is."""
        with np.errstate(all="ignore"):
            k, c, n = fits.stiffness, fits.damping, fits.exponent
            power, log, none = depth**n, np.log(depth), np.zeros_like(depth)
            force, damping = k * power, c * power
            stiffness = n * force / depth
            bend = (n - 1.0) * stiffness / depth
            # By K, B, n, F₀ and d.
            of_force = [power, none, log * force, none, -stiffness]
            of_stiffness = [
                n * power / depth, none, (1.0 / n + log) * stiffness, none, -bend,
            ]  # fmt: skip
            of_damping = [none, power, log * damping, none, -n * damping / depth]
            return cls(
                (force, _error(of_force, fits)),
                (stiffness, _error(of_stiffness, fits)),
                (damping, _error(of_damping, fits)),
            )


def _error(gradient: list[Floats], fits: CurveFits) -> Floats:
    """√(gᵀ C g) of each row."""
    g = np.stack(gradient, axis=1)
    variance = np.einsum("ki,kij,kj->k", g, fits.covariance, g)
    found: Floats = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    return found
