"""How a contact is made of a recording: every choice of it, as a value."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args

from palpate.errors import InvalidParameterError
from palpate.preparation.corrections import Corrections
from palpate.preparation.episodes import RADIUS
from palpate.preparation.normals import normal_given
from palpate.preparation.roles import Columns
from palpate.preparation.surfaces import SurfaceRule
from palpate.preparation.wrenches import ForceFrame
from palpate.validation import instance, number_in, pair_in, shown

LARGEST_RATE = 1e9  # samples a second


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Preparation:
    """How a contact is made of a recording; :func:`palpate.prepare` says what each means.

    Raises
    ------
    InvalidParameterError
        One is outside its range.
    """

    columns: Columns = dataclasses.field(default_factory=Columns)
    velocity_window: float | None = None
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    flip: Sequence[str] = ()
    tare: tuple[float, float] | Literal["find"] | None = None
    delay: float = 0.0
    surface: float | SurfaceRule | None = None
    normal: str | Sequence[float] | None = None
    force_frame: ForceFrame | None = None
    tool_weight: float | None = None
    rate: float | None = None
    spot: float = RADIUS
    window: tuple[float | None, float | None] | None = None
    strict: bool = False

    def __post_init__(self) -> None:
        instance("columns", self.columns, Columns)
        units = {"penetration" if k == "position" else k: unit for k, unit in self.units.items()}
        object.__setattr__(self, "units", units)
        self.corrections()
        if isinstance(self.surface, str) and self.surface not in get_args(SurfaceRule):
            raise InvalidParameterError(
                f"surface must be a number of metres, threshold, baseline, fit or estimate, not "
                f"{shown(self.surface)}"
            )
        if self.normal is not None:
            normal_given(self.normal)
        if self.force_frame not in (None, *get_args(ForceFrame)):
            raise InvalidParameterError(
                f"force_frame must be tool or base, not {shown(self.force_frame)}"
            )
        if self.tool_weight is not None:
            number_in("tool_weight", self.tool_weight, 0.0, 1e6)
        if self.rate is not None:
            number_in("rate", self.rate, 0.0, LARGEST_RATE, open_low=True)
        number_in("spot", self.spot, 0.0, 1e6, open_low=True)
        if self.window is not None:
            low, high = self.window
            pair_in(
                "window",
                (-1e12 if low is None else low, 1e12 if high is None else high),
                -1e12,
                1e12,
            )

    def corrections(self) -> Corrections:
        """What is done to channels that are penetration and compression already."""
        tare = self.tare
        if isinstance(tare, str):
            if tare != "find":
                raise InvalidParameterError(
                    f"tare must be find, or two times (start, stop) in s, not {shown(tare)}"
                )
            tare = None
        surface = 0.0 if self.surface is None or isinstance(self.surface, str) else self.surface
        return Corrections(self.units, self.flip, tare, self.delay, surface)

    def changed(self) -> dict[str, Any]:
        """Return those that are not what they would be if nothing was asked for."""
        usual = Preparation()
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if getattr(self, field.name) != getattr(usual, field.name)
        }
