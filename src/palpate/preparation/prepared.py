"""What a contact was made of, so that it can be made again identically, and what was found."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from palpate.contact import Contact
from palpate.errors import RecordingError
from palpate.preparation.normals import Normal
from palpate.preparation.settings import Preparation
from palpate.preparation.surfaces import Surface
from palpate.recordings import Recording
from palpate.validation import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """One place of the material, and the times at which the probe was there.

    Attributes
    ----------
    start, stop : float
        s.
    position : numpy.ndarray, shape (3,)
        The median one, m, in the frame of the recording.
    normal : Normal or None
        Of the contact there; None where the position is along one axis.
    surface : Surface
        Along that normal.
    """

    start: float
    stop: float
    position: Floats
    normal: Normal | None
    surface: Surface

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers."""
        return {
            "position": self.position.tolist(),
            "normal": None if self.normal is None else self.normal.vector.tolist(),
            "surface": self.surface.position,
            "surface_deviation": self.surface.deviation,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """The way from a recording to a contact.

    Attributes
    ----------
    recording : Recording
        The channels as they were recorded.
    settings : Preparation
        What was asked for.
    zero : numpy.ndarray, optional
        What was taken off the force, N: one number; or three, in the axes of the sensor.
    drift : float
        How far that goes over the recording, N.
    normal : Normal, optional
        Of the whole, where the probe moves in space.
    surface : Surface, optional
        Where one was found; in the penetration of the recording, or along the normal.
    window : float, optional
        Length of the velocity filter, s, where the velocity was worked out.
    places : tuple of Place
        Where the probe travels: one for each segment of the contact.
    way : callable, optional
        What makes a contact of the recording by the settings.
    """

    recording: Recording
    settings: Preparation
    zero: Floats | None = None
    drift: float = 0.0
    normal: Normal | None = None
    surface: Surface | None = None
    window: float | None = None
    places: tuple[Place, ...] = ()
    way: Callable[[Recording, Preparation], Contact] | None = field(default=None, repr=False)

    def again(self) -> Contact:
        """Make the contact again: the same, to the last bit.

        Raises
        ------
        RecordingError
            It was made of arrays, not of a recording.
        """
        if self.way is None:
            raise RecordingError("a contact of arrays has no recording to be made of again")
        return self.way(self.recording, self.settings)
