"""A contact that was recorded, delivered again at its own pace or faster."""

import time
from typing import Any

from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.live.arrivals import Arrival, Counts
from palpate.live.sources.source import EndOfSourceError
from palpate.validation import number_in


class Replay:
    """A recording in place of a robot.

    Parameters
    ----------
    contact : Contact
        Its positions and forces are delivered; the velocity is the loop's matter.
    speed : float
        Times its own pace, in (0, 1e6]; or infinite, as fast as the loop goes.
    """

    def __init__(self, contact: Contact, *, speed: float = 1.0) -> None:
        self._speed = (
            speed if speed == float("inf") else number_in("speed", speed, 0.0, 1e6, open_low=True)
        )
        self._contact, self.counts = contact, Counts()
        self._rows = zip(
            contact.time.tolist(), contact.penetration.tolist(), contact.force.tolist(), strict=True
        )
        self._news = _hindsight(contact)
        self._waiting: tuple[float, float, float] | None = None
        self._began, self._first = 0.0, float(contact.time[0]) if len(contact) else 0.0

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self._contact.source or "recording"

    @property
    def sample_time(self) -> float:
        """Median step of the recording, s."""
        return self._contact.sample_time

    @property
    def pace(self) -> float:
        """How fast its clock goes."""
        return self._speed

    def open(self) -> None:
        """Begin now."""
        self._began = time.monotonic()

    def take(self, timeout: float) -> Arrival | None:
        """Wait until the next sample is due, and return it."""
        row = self._waiting or next(self._rows, None)
        if row is None:
            raise EndOfSourceError
        now = time.monotonic()
        due = self._began + (row[0] - self._first) / self._speed if self._speed < 1e300 else now
        if due > now + timeout:
            self._waiting = row
            time.sleep(timeout)
            return None
        self._waiting = None
        if due > now:
            time.sleep(due - now)
        return Arrival(row[0], row[1], row[2], due)

    def ask(self, options: dict[str, Any]) -> str:
        """A recording cannot be asked for anything."""
        raise InvalidParameterError("a recording is as it is: nothing of it can be chosen")

    def news(self) -> list[str]:
        """What was found with hindsight, once."""
        news, self._news = self._news, []
        return news

    def close(self) -> None:
        """Nothing is held."""


def _hindsight(contact: Contact) -> list[str]:
    """What no robot in a loop could know, and the preparation of a whole recording said."""
    said = [
        f"{remark.step}: {remark.sentence}" + (f" ({remark.remedy})" if remark.remedy else "")
        for remark in contact.remarks
    ]
    found = {"tare": contact.tare_deviation, "surface": contact.surface_deviation}
    names = [name for name, deviation in found.items() if deviation is not None]
    if contact.prepared is not None and contact.prepared.normal is not None:
        names.append("contact normal")
    if not names:
        return said
    words = " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
    return [
        f"{words} of the recording are those of all of it, as palpate identify finds them",
        *said,
    ]
