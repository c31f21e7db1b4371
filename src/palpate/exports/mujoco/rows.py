"""What one row of MuJoCo's solver does, in plain numbers.

For every row that is not clipped the solver gives R f = a_ref − a, R = (1 − d)/d · Â, with
a_ref = D/d_w v + S/d_w² d x of a contact whose solref is in the direct format, (−S, −D) (MuJoCo,
*Computation*, constraint model, and *Modeling*, solver parameters). In terms of the penetration x,

    f = d²/(d_w² (1 − d) Â) · S x + d/(d_w (1 − d) Â) · D v + d/((1 − d) Â) · ẍ,   d = d(x).

Gravity and every other force are in ẍ already. The last term is a mass that the contact adds.
"""

from dataclasses import dataclass

import numpy as np

from palpate.validation import Floats

#: What the engine clamps an impedance to (mjMINIMP, mjMAXIMP).
LEAST, MOST = 1e-4, 0.9999


def impedance(
    depth: Floats | float,
    low: Floats | float,
    high: Floats | float,
    width: Floats | float,
    midpoint: Floats | float,
    power: Floats | float,
) -> Floats:
    """Return d(x): from ``low`` at the surface to ``high`` at the width, along MuJoCo's sigmoid.

    y = z^p/m^(p − 1) up to the midpoint m, 1 − (1 − z)^p/(1 − m)^(p − 1) from there, z = x/width;
    d = low + y (high − low). All go together as in NumPy.
    """
    z = np.clip(np.asarray(depth, dtype=np.float64) / width, 0.0, 1.0)
    m, p = np.asarray(midpoint, dtype=np.float64), np.asarray(power, dtype=np.float64)
    rising = z**p * m ** (1.0 - p)
    falling = 1.0 - (1.0 - z) ** p * (1.0 - m) ** (1.0 - p)
    y = np.where(z <= m, rising, falling)
    found: Floats = low + y * (high - low)
    return found


@dataclass(frozen=True, slots=True)
class Row:
    """One contact of one pair: numbers as MuJoCo's XML has them.

    Parameters
    ----------
    spring, damper : float
        S, 1/s², and D, 1/s, ≥ 0, of solref = (−S, −D).
    solimp : tuple of float
        (d₀, d_w, width, midpoint, power).
    inset : float
        By how much deeper than the surface the contact begins, m, ≥ 0: −margin.
    adhesion : float
        How strongly the row may pull, N.
    """

    spring: float
    damper: float
    solimp: tuple[float, float, float, float, float]
    inset: float = 0.0
    adhesion: float = 0.0

    def reach(self, penetration: Floats) -> Floats:
        """Impedance at each penetration [m], and 0 where there is no contact."""
        inside = np.asarray(penetration) - self.inset
        return np.where(inside > 0.0, impedance(inside, *self.solimp), 0.0)

    def added_mass(self, penetration: Floats, mobility: float) -> Floats:
        """d/((1 − d) Â), kg."""
        d = self.reach(penetration)
        return np.asarray(d / ((1.0 - d) * mobility))

    def springs_and_dampers(self, penetration: Floats, mobility: float) -> tuple[Floats, Floats]:
        """The force at rest [N], and ∂f/∂v [N·s/m]."""
        d, high = self.reach(penetration), self.solimp[1]
        inside = np.maximum(np.asarray(penetration) - self.inset, 0.0)
        mass = d / ((1.0 - d) * mobility * high)
        return mass * d / high * self.spring * inside, mass * self.damper

    def force(
        self, penetration: Floats, velocity: Floats, acceleration: Floats, mobility: float
    ) -> Floats:
        """What the row pushes with, N, at least −adhesion."""
        spring, damper = self.springs_and_dampers(penetration, mobility)
        mass = self.added_mass(penetration, mobility)
        whole = spring + damper * velocity + mass * acceleration
        return np.where(mass > 0.0, np.maximum(whole, -self.adhesion), 0.0)


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows of one fragment, each as often as MuJoCo makes a contact of it.

    Parameters
    ----------
    rows : tuple of Row
        One a pair.
    mobility : float
        Â, 1/kg: the sum of both bodies' translational body_invweight0.
    contacts : int
        That the two geoms have with each other, each of which pushes.
    """

    rows: tuple[Row, ...]
    mobility: float
    contacts: int = 1

    def force(self, penetration: Floats, velocity: Floats, acceleration: Floats) -> Floats:
        """What MuJoCo pushes with along a motion, N: added mass, clamps, clipping and all."""
        each = [row.force(penetration, velocity, acceleration, self.mobility) for row in self.rows]
        return np.asarray(self.contacts * np.sum(each, axis=0))

    def added_mass(self, penetration: Floats) -> Floats:
        """Σ d/((1 − d) Â), kg."""
        each = [row.added_mass(penetration, self.mobility) for row in self.rows]
        return np.asarray(self.contacts * np.sum(each, axis=0))
