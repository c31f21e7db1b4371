"""What a person sees of the loop at a glance."""

from enum import IntEnum


class State(IntEnum):
    """One at a time, the gravest that holds."""

    FREE = 0
    """The probe touches nothing."""
    CONTACT = 1
    """It touches, and the estimate is refreshed."""
    HELD = 2
    """On request: nothing is learned until it is resumed."""
    CHANGED = 3
    """The material has changed within the last second; the estimate was reinitialised."""
    INVALID = 4
    """Samples come that cannot be taken: NaN, repeated, or with a jump in time."""
    LOST = 5
    """No sample has come for a while; the estimate is held."""
    TARING = 6
    """The force without contact is measured: touch nothing."""
