"""The options that say how a file is read, and which of its samples are used."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from palpate.contact import Contact
    from palpate.estimators import ContactEstimator
    from palpate.settings import ContactGate

#: A text that may begin with a minus sign: -3ms is no option.
Signed = Annotated[str | None, Parameter(allow_leading_hyphen=True)]


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
    "Contact is deeper than this, m; unless given chosen by the method, or from the data for it."
    min_force: float | None = None
    "Contact is firmer than this, N; unless given chosen by the method, or from the data for it."
    velocity_window: float | None = None
    "Length of the velocity filter, s; 15 samples but at most 15 ms unless given."

    unit: Annotated[tuple[str, ...], Parameter(negative="")] = ()
    "Unit of a channel, such as penetration=mm; once for each channel that is not in SI."
    flip_force: Annotated[bool, Parameter(negative="")] = False
    "Turn the sign of the force: compression is to be positive."
    flip_penetration: Annotated[bool, Parameter(negative="")] = False
    "Turn the sign of the penetration: into the material is to be positive."
    tare: Signed = None
    "Take off the mean force between these times, START:STOP, s."
    delay: Signed = None
    "How late the force is, such as 5ms; negative where it is early."
    reject_outliers: bool = True
    "Leave lost positions, spikes and the end of the sensor's range out."
    surface: Signed = None
    "Where the material begins: estimate, or a penetration such as 0.7mm."

    def contact(self, file: Path) -> "Contact":
        """Read the file and cut the time window."""
        from palpate.errors import MissingChannelError, RecordingError
        from palpate.preparation import Columns, prepare

        columns = Columns(self.time, self.penetration, self.force, self.velocity)
        try:
            contact = prepare(
                file, columns=columns, velocity_window=self.velocity_window, **self.corrections
            )
        except MissingChannelError as error:
            hint = "map other names with --time, --penetration, --force, --velocity"
            raise RecordingError(f"{error} ({hint})") from None
        if self.start is None and self.stop is None:
            return contact
        return contact.window(self.start, self.stop)

    @property
    def corrections(self) -> dict[str, Any]:
        """What is corrected, as :func:`palpate.prepare` takes it."""
        from palpate.cli.quantities import quantity, span, units_of

        given: dict[str, Any] = {"units": units_of("--unit", self.unit)}
        turned = {"force": self.flip_force, "penetration": self.flip_penetration}
        given["flip"] = [channel for channel, turn in turned.items() if turn]
        if self.tare is not None:
            given["tare"] = span("--tare", self.tare)
        if self.delay is not None:
            given["delay"] = quantity("--delay", self.delay, "time")
        if self.surface not in (None, "estimate"):
            given["surface"] = quantity("--surface", str(self.surface), "penetration")
        return given

    def settings(self, contact: "Contact", kind: "type[ContactEstimator]") -> dict[str, Any]:
        """Return what an estimator of this kind is to be made with."""
        from palpate.settings import ContactGate

        gate = self.gate(contact)
        if gate is not None and kind.chooses_samples:  # nothing beside what is asked for
            force = self.min_force or 0.0
            gate = ContactGate(self.min_penetration or 0.0, force, force)
        settings: dict[str, Any] = {"gate": gate}
        if not self.reject_outliers:
            settings["outlier_rejection"] = False
        if self.surface == "estimate":
            settings["surface"] = "estimate"
        return settings

    def gate(self, contact: "Contact") -> "ContactGate | None":
        """Return the gate asked for, the rest of it chosen from the data; None where none is."""
        from palpate.preparation import choose_gate

        if self.min_penetration is None and self.min_force is None:
            return None

        return choose_gate(
            contact, minimum_penetration=self.min_penetration, minimum_force=self.min_force
        )
