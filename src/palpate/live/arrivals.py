"""What a source delivers: one measurement and when it was there."""

from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

#: A number, or three along the axes of the recording's frame.
Value: TypeAlias = float | tuple[float, float, float]


class Arrival(NamedTuple):
    """One measurement of a robot.

    Attributes
    ----------
    time : float
        By the source's own clock, s.
    position : float or tuple of 3 float
        Penetration, or where the probe is, m.
    force : float or tuple of 3 float
        N.
    there : float
        By this machine's monotonic clock, s: when the measurement was there to be taken. What comes
        later than this is the loop's own lateness.
    """

    time: float
    position: Value
    force: Value
    there: float


@dataclass(slots=True)
class Counts:
    """What a source noticed on the way, before the loop had it.

    Attributes
    ----------
    lost : int
        Samples that were sent and never came, or for which there was no room.
    repeated, disordered : int
        Samples that came twice, or after a later one; they are left out.
    malformed : int
        Packets that hold no sample; they are left out.
    unpaired : int
        Positions without a force at their time, or forces without a position, where the two come
        apart; they are left out.
    last_fault : str
        Of the malformed and the unpaired, what was wrong with the last, in words.
    """

    lost: int = 0
    repeated: int = 0
    disordered: int = 0
    malformed: int = 0
    unpaired: int = 0
    last_fault: str = field(default="")
