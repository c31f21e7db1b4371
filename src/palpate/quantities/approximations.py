"""What is quoted for the restitution of a Hunt–Crossley contact, in place of the exact relation.

Each is published as the dissipation that a wanted e needs, d = b v₀ = d(e); it is solved for e.
How near they come to the exact e was found over d from 10⁻³ to 10².
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from palpate.validation import number_in


@dataclass(frozen=True, slots=True)
class Approximation:
    """A relation of dissipation and restitution that is not exact.

    Attributes
    ----------
    name : str
        Of those who published it.
    formula : str
        d = b v₀ by e, as published but for the factor K/v₀.
    source : str
        Where.
    range : str
        How near it comes to the exact e, and where it ends.
    solved : callable
        e by d ≥ 0; NaN where it has none in [0, 1].
    """

    name: str
    formula: str
    source: str
    range: str
    solved: Callable[[float], float]

    def restitution(self, dissipation: float, speed: float) -> float:
        """Return what it says of e, at a dissipation b [s/m] and a speed v₀ ≥ 0 [m/s].

        NaN where it says nothing: for a negative dissipation, and where its e would be below 0.
        """
        d = number_in("dissipation", dissipation, -1e300, 1e300)
        d *= number_in("speed", speed, 0.0, 1e300)
        e = self.solved(min(d, 1e150)) if d >= 0.0 else math.nan
        return e if e >= 0.0 else math.nan


def _lankarani_nikravesh(d: float) -> float:
    return math.sqrt(1.0 - 4.0 * d / 3.0) if d <= 0.75 else math.nan


def _gonthier(d: float) -> float:
    return 2.0 / (d + math.hypot(d, 2.0))  # (√(d² + 4) − d)/2, without cancellation


def _carvalho_martins(d: float) -> float:
    # The lesser root of e² − 2 p e + q = 0, as q over the larger one.
    p, q = 6.0 + 3.0 * d, 11.0 - 2.0 * d / 3.0
    return q / (p + math.sqrt(p * p - q))


#: In the order of their years.
APPROXIMATIONS = (
    Approximation(
        "Hunt–Crossley",
        "d = 3 (1 − e)/2",
        "Hunt & Crossley, J. Applied Mechanics 42 (1975) 440–445",
        "within 0.01 for e > 0.905; none for d > 3/2",
        lambda d: 1.0 - 2.0 * d / 3.0,
    ),
    Approximation(
        "Lankarani–Nikravesh",
        "d = 3 (1 − e²)/4",
        "Lankarani & Nikravesh, J. Mechanical Design 112 (1990) 369–376",
        "within 0.01 for e > 0.924; none for d > 3/4",
        _lankarani_nikravesh,
    ),
    Approximation(
        "Gonthier",
        "d = (1 − e²)/e",
        "Gonthier, McPhee, Lange & Piedbœuf, Multibody System Dynamics 11 (2004) 209–233, "
        "beside the exact relation",
        "within 0.033 for every e, and exact towards e = 0",
        _gonthier,
    ),
    Approximation(
        "Flores",
        "d = 8 (1 − e)/(5 e)",
        "Flores, Machado, Silva & Martins, Multibody System Dynamics 25 (2011) 357–375",
        "within 0.046 for every e, 0.01 for e > 0.818",
        lambda d: 8.0 / (8.0 + 5.0 * d),
    ),
    Approximation(
        "Carvalho–Martins",
        "d = 3 (1 − e)(11 − e)/(2 + 18 e)",
        "Carvalho & Martins, Mechanism and Machine Theory 139 (2019) 174–194",
        "within 0.01 for e > 0.225; none for d > 33/2",
        _carvalho_martins,
    ),
)
