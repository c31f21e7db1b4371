"""A rigid sphere on Drake's hydroelastic slab, in closed form.

In a box whose medial plane is H below its top the pressure rises as E/H times the depth, and pushes
along the sphere's own surface, p (1 + d v cos θ)₊ n̂. So the force is

    F = (E/H) [V(x) + d v W(x)],  V = π x² (3R − x)/3,  W = ∫ depth cos θ dA,

V the volume of the cap that is below the surface. The sphere is a mesh inside of the sphere, of
which the volume is smaller. After Elandt et al., IROS 2019.
"""

import math
from dataclasses import dataclass

import numpy as np

from palpate.exports.drake.spheres import not_negative
from palpate.exports.motion import Motion
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats

#: What the mesh may take from the force at a mean depth. The formula of it is good to a seventh, so
#: that 0.07 % are left: below the 0.1 percentage points that a predicted error may be off.
MESH_LOSS = 0.005
# Drake halves the edges of an octahedron until they are shorter than the hint, at first R √2.
_COARSEST = 3
#: 131 000 triangles.
FINEST = 7


@dataclass(frozen=True, slots=True)
class Slab:
    """A slab of a modulus, and the sphere on it.

    Attributes
    ----------
    modulus, dissipation : float
        E, Pa, and d, s/m.
    thickness, radius : float
        H, m: half the height of the box; and R, m.
    halvings : int
        How often the edges of the mesh were halved.
    """

    modulus: float
    dissipation: float
    thickness: float
    radius: float
    halvings: int

    @property
    def resolution_hint(self) -> float:
        """Length of edges, m, that gives as many halvings; they come out a little shorter."""
        return 1.6 * self.radius / 2.0**self.halvings

    def force(self, penetration: Floats, velocity: Floats) -> Floats:
        """Return the force, N, which never pulls."""
        elastic, damper = shapes(penetration, self.radius, self.halvings)
        per_volume = self.modulus / self.thickness
        return np.maximum(per_volume * (elastic + self.dissipation * velocity * damper), 0.0)

    def at(self, penetration: float, velocity: float) -> float:
        """The same of one state."""
        return float(self.force(np.array([penetration]), np.array([velocity]))[0])


def slab(law: GeneralisedHuntCrossley, motion: Motion, radius: float) -> Slab:
    """Return the slab nearest to a law: least squares over the judged samples."""
    x, v = motion.penetration[motion.judged], motion.velocity[motion.judged]
    halvings = halvings_for(radius, float(np.sqrt(np.mean(x**2))))
    # The pressure rises down to the medial plane only.
    thickness = max(0.02, 2.0 * motion.deepest)
    elastic, damper = shapes(x, radius, halvings)
    wanted = motion.force_by(law)[motion.judged]
    per_volume, damping = not_negative(np.column_stack([elastic, damper * v]), wanted).tolist()
    dissipation = damping / per_volume if per_volume > 0.0 else 0.0
    return Slab(per_volume * thickness, dissipation, thickness, radius, halvings)


def halvings_for(radius: float, depth: float) -> int:
    """How fine the mesh must be for its loss at a depth to be :data:`MESH_LOSS`."""
    # loss/V by `shapes`, with V = π x² R.
    wanted = math.log(math.pi * radius / (2.0 * math.sqrt(3.0) * depth * MESH_LOSS), 4.0)
    return max(math.ceil(wanted), _COARSEST)


def shapes(penetration: Floats, radius: float, halvings: int) -> tuple[Floats, Floats]:
    """V and W of the mesh, m³; 0 out of contact.

    A flat triangle of side a is on average a²/8R below the sphere through its corners; 8·4ᴸ of them
    cover 4πR², so that a² = 2π R²/(√3 4ᴸ), and the cap, 2πR x of it, loses π² R² x/(2√3 4ᴸ).
    """
    x = np.clip(penetration, 0.0, radius)
    volume = math.pi * x**2 * (3.0 * radius - x) / 3.0
    edge = 1.0 - x / radius
    shifted = (x - radius) * (1.0 - edge**3) / 3.0 + radius * (1.0 - edge**4) / 4.0
    loss = math.pi**2 * radius**2 * x / (2.0 * math.sqrt(3.0) * 4.0**halvings)
    left = 1.0 - np.minimum(loss / np.maximum(volume, 1e-300), 1.0)
    return volume * left, 2.0 * math.pi * radius**2 * shifted * left
