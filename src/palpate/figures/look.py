"""What every panel of a figure has to know: its colours and its size."""

from dataclasses import dataclass

from palpate.figures.sheet import PAGE, Sheet, sheet_of
from palpate.figures.style import DARK, LIGHT, Theme


@dataclass(frozen=True, slots=True)
class Look:
    """Colours and size of a figure.

    Parameters
    ----------
    theme : Theme
        Colours.
    sheet : Sheet
        Size.
    """

    theme: Theme
    sheet: Sheet = PAGE

    def points(self, size: float) -> float:
        """Width of a line, or size of a marker, that has so many points on a page."""
        return size * self.sheet.scale


def look_of(*, dark: bool, width: float | None) -> Look:
    """Return the look that a caller asks for; :func:`sheet_of` says what it refuses."""
    return Look(DARK if dark else LIGHT, sheet_of(width))
