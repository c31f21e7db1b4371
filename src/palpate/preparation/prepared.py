"""Results of the preparation of a contact: its places, and the recording behind them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from palpate.contact import Contact
from palpate.errors import RecordingError
from palpate.preparation.settings import Preparation
from palpate.preparation.surface import Surface
from palpate.recordings import Recording
from palpate.validation import Floats

if TYPE_CHECKING:
    from palpate.preparation.normal import Normal
    from palpate.wrench.payload import Payload


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """One place on the material, and when the probe was there.

    Attributes
    ----------
    start, stop : float
        Time interval, s.
    position : numpy.ndarray, shape (3,)
        Median position of the probe, m, in the frame of the recording.
    normal : Normal or None
        Contact normal; None if the position is along one axis.
    surface : Surface
        Surface along that normal.
    """

    start: float
    stop: float
    position: Floats
    normal: "Normal | None"
    surface: Surface

    def as_dict(self) -> dict[str, Any]:
        """Return the place as JSON types."""
        return {
            "position": self.position.tolist(),
            "normal": None if self.normal is None else self.normal.vector.tolist(),
            "surface": self.surface.position,
            "surface_deviation": self.surface.deviation,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """How a contact was made from a recording.

    Attributes
    ----------
    recording : Recording
        The channels as they were recorded.
    settings : Preparation
        The requested settings.
    zero : numpy.ndarray, optional
        The subtracted mean force offset, N: one number, or three in the axes of the sensor.
    drift : float
        Change of the force offset over the recording, N.
    normal : Normal, optional
        Contact normal of the whole recording, if the probe moves in space.
    surface : Surface, optional
        The surface found, in the penetration of the recording or along the normal.
    payload : Payload, optional
        Tool, mount, bias and clock of a sensor that turns with the tool.
    places : tuple of Place
        For a travelling probe, the place of each segment of the contact.
    way : callable, optional
        The function that makes the contact from the recording and the settings.
    """

    recording: Recording
    settings: Preparation
    zero: Floats | None = None
    drift: float = 0.0
    normal: "Normal | None" = None
    surface: Surface | None = None
    payload: "Payload | None" = None
    places: tuple[Place, ...] = ()
    way: Callable[[Recording, Preparation], Contact] | None = field(default=None, repr=False)

    def again(self) -> Contact:
        """Make the contact again, bit for bit the same.

        Raises
        ------
        RecordingError
            The contact was made from arrays, not from a recording.
        """
        if self.way is None:
            raise RecordingError("this contact was made from arrays and has no recording")
        return self.way(self.recording, self.settings)
