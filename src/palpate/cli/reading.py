"""The options that say how a file is read, and which of its samples are used."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import Parameter

if TYPE_CHECKING:
    from palpate.contact import Contact
    from palpate.settings import ContactGate


@Parameter(name="*")
@dataclass(frozen=True)
class Reading:
    """How a file is read, and which of its samples are used."""

    time: str = "time_s"
    "Column of the time, s."
    penetration: str = "penetration_m"
    "Column of the penetration, m, positive inside the material."
    force: str = "force_N"
    "Column of the force, N, compression positive."
    velocity: str = "velocity_m_s"
    "Column of the velocity, m/s; where the file has none it is worked out from the penetration."
    start: float | None = None
    "Use samples from this time on, s."
    stop: float | None = None
    "Use samples up to this time, s."
    min_penetration: float | None = None
    "Contact is deeper than this, m; chosen from the data unless given."
    min_force: float | None = None
    "Contact is firmer than this, N; chosen from the data unless given."
    velocity_window: float | None = None
    "Length of the velocity filter, s; 15 samples but at most 15 ms unless given."

    def contact(self, file: Path) -> "Contact":
        """Read the file and cut the time window."""
        from palpate.errors import MissingChannelError, RecordingError
        from palpate.preparation import Columns, prepare

        columns = Columns(self.time, self.penetration, self.force, self.velocity)
        try:
            contact = prepare(file, columns=columns, velocity_window=self.velocity_window)
        except MissingChannelError as error:
            hint = "map other names with --time, --penetration, --force, --velocity"
            raise RecordingError(f"{error} ({hint})") from None
        if self.start is None and self.stop is None:
            return contact
        return contact.window(self.start, self.stop)

    def gate(self, contact: "Contact") -> "ContactGate":
        """Return the gate asked for; what is not asked for is chosen from the data."""
        from palpate.preparation import choose_gate

        return choose_gate(
            contact, minimum_penetration=self.min_penetration, minimum_force=self.min_force
        )
