"""The options about numbers that follow from a law: an impact, and a tip."""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclopts import Parameter

from palpate.cli.groups import DERIVED
from palpate.cli.values import Frequency, Shape, Speed

if TYPE_CHECKING:
    from palpate.quantities.wanted import Wanted
    from palpate.tips import Tip

_FORMS = "sphere:radius=5mm, punch:diameter=4mm or cone:angle=30deg (between axis and side)"
_ANGLE = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*(deg|°|rad)\s*$")


@Parameter(name="*", group=DERIVED)
@dataclass(frozen=True)
class Deriving:
    """Which impact and which tip the numbers that follow from the law are for."""

    impact_speed: Speed | None = None
    "Speed of the rebound's impact, such as 0.5m/s; the fastest approach unless given."
    tip: Shape | None = None
    "Gives the elastic modulus: sphere:radius=5mm, punch:radius=2mm, cone:angle=30deg (half)."
    poisson: float | None = None
    "Poisson's ratio of the material, for --tip; 0.5, incompressible as soft tissue, unless given."

    frequency: Frequency | None = None
    "Prints K', B' and tan delta of a small oscillation, such as 2Hz, within the motion's band."

    @property
    def options(self) -> dict[str, str | float]:
        """What was asked for, by option."""
        given = {
            "impact-speed": self.impact_speed,
            "tip": self.tip,
            "poisson": self.poisson,
            "frequency": self.frequency,
        }
        return {name: value for name, value in given.items() if value is not None}

    @property
    def wanted(self) -> "Wanted":
        """What is asked for, SI."""
        from palpate.cli.quantities import quantity
        from palpate.errors import InvalidParameterError
        from palpate.quantities.wanted import Wanted
        from palpate.validation import number_in

        speed, ratio = None, None
        if self.impact_speed is not None:
            given = quantity("--impact-speed", self.impact_speed, "velocity")
            speed = number_in("--impact-speed", given, 0.0, 1e6, open_low=True)
        if self.poisson is not None:
            if self.tip is None:
                raise InvalidParameterError(f"--poisson needs --tip, such as {_FORMS}")
            ratio = number_in("--poisson", self.poisson, -1.0, 0.5, open_low=True)
        tip = None if self.tip is None else tip_of(self.tip)
        return Wanted(speed, tip, ratio, self._omega)

    @property
    def _omega(self) -> float | None:
        from palpate.cli.quantities import FREQUENCIES, quantity
        from palpate.validation import number_in

        if self.frequency is None:
            return None
        given = quantity("--frequency", self.frequency, FREQUENCIES)
        return number_in("--frequency", given, 0.0, 1e12, open_low=True)


def tip_of(text: str) -> "Tip":
    """Return the tip of a text such as ``sphere:radius=5mm``.

    Raises
    ------
    InvalidParameterError
        It is not of one of the forms, or a size is out of its range.
    """
    from palpate.cli.quantities import quantity
    from palpate.errors import InvalidParameterError
    from palpate.tips import Cone, FlatPunch, Sphere

    kind, _, size = text.partition(":")
    name, _, value = (part.strip() for part in size.partition("="))
    option, round_ = f"--tip {kind}:{name}", {"sphere": Sphere, "punch": FlatPunch}
    if kind in round_ and name in ("radius", "diameter"):
        length = quantity(option, value, "penetration")
        return round_[kind](length if name == "radius" else 0.5 * length)
    if kind == "cone" and name in ("angle", "opening"):
        angle = _radians(option, value)
        return Cone(angle if name == "angle" else 0.5 * angle)
    raise InvalidParameterError(f"--tip must be such as {_FORMS}, not {text!r}")


def _radians(option: str, text: str) -> float:
    """An angle with its unit: without one 1.2 might be either."""
    from math import radians

    from palpate.errors import InvalidParameterError

    found = _ANGLE.match(text)
    if found is None:
        raise InvalidParameterError(f"{option} must be such as 30deg or 0.52rad, not {text!r}")
    return float(found[1]) if found[2] == "rad" else radians(float(found[1]))
