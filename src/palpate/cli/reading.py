"""The options that say how a file is read, and which of its samples are used."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from palpate.cli.groups import KEPT, PREPARED, READ
from palpate.cli.values import (
    FORCE,
    PENETRATION,
    TIME,
    VELOCITY,
    Axis,
    Channel,
    Channels,
    Depth,
    Direction,
    Duration,
    Span,
    SurfaceWord,
    Unit,
    Weight,
)

if TYPE_CHECKING:
    from palpate.contact import Contact
    from palpate.estimators import ContactEstimator
    from palpate.settings import ContactGate

#: One file or several.
Files = Annotated[tuple[Path, ...], Parameter(allow_leading_hyphen=True, negative="")]

_READ = Parameter(group=READ)
_PREPARED = Parameter(group=PREPARED)
_FLAG = Parameter(group=PREPARED, negative="")
#: A text that may begin with a minus sign: -3ms is no option.
_SIGNED = Parameter(group=PREPARED, allow_leading_hyphen=True)
_KEPT = Parameter(group=KEPT)


@Parameter(name="*")
@dataclasses.dataclass(frozen=True)
class Reading:
    """How a file is read, and which of its samples are used."""

    time: Annotated[Channel, _READ] = TIME
    "The time; a channel that is not named, and not there, is looked for."
    penetration: Annotated[Channel, _READ] = PENETRATION
    "The penetration, positive inside the material."
    force: Annotated[Channel, _READ] = FORCE
    "The force, compression positive; or x,y,z, or a topic such as /ft."
    velocity: Annotated[Channel, _READ] = VELOCITY
    "The velocity, or none; where there is none it is worked out from the penetration."
    position: Annotated[Channels | None, _READ] = None
    "The probe's position in place of the penetration; or x,y,z, or a topic."
    orientation: Annotated[Channels | None, _READ] = None
    "The probe's orientation, a quaternion x,y,z,w; or a topic."
    unit: Annotated[tuple[Unit, ...], Parameter(group=READ, negative="")] = ()
    "Units of channels, such as penetration=mm,force=mN; else as the file or its names say, or SI."
    rate: Annotated[float | None, _READ] = None
    "Samples a second, where the file has no time."
    curve: Annotated[int | None, _READ] = None
    "Which curve, from 0, of a file of many."
    start: Annotated[float | None, _READ] = None
    "Use samples from this time on, s."
    stop: Annotated[float | None, _READ] = None
    "Use samples up to this time, s."
    strict: Annotated[bool, Parameter(group=READ, negative="")] = False
    "Refuse bad rows and damaged files, which are else left out and said."

    min_penetration: Annotated[float | None, _PREPARED] = None
    "Contact is deeper than this, m; unless given chosen by the method, or from the data for it."
    min_force: Annotated[float | None, _PREPARED] = None
    "Contact is firmer than this, N; unless given chosen by the method, or from the data for it."
    velocity_window: Annotated[float | None, _PREPARED] = None
    "Length of the velocity filter, s; 15 samples but at most 15 ms unless given."
    flip_force: Annotated[bool, _FLAG] = False
    "Turn the sign of the force: compression is to be positive."
    flip_penetration: Annotated[bool, _FLAG] = False
    "Turn the sign of the penetration: into the material is to be positive."
    tare: Annotated[Literal["find"] | Span | None, _SIGNED] = None
    "Take off the mean force between these times, START:STOP, s; or find such times: find."
    delay: Annotated[Duration | None, _SIGNED] = None
    "How late the force is, such as 5ms; negative where it is early."
    reject_outliers: Annotated[bool, _PREPARED] = True
    "Leave lost positions, spikes and the end of the sensor's range out."
    surface: Annotated[SurfaceWord | Depth | None, _SIGNED] = None
    "Where the material begins: a penetration such as 0.7mm, threshold, baseline, fit, or estimate."
    exponent: Annotated[float | None, _PREPARED] = None
    "Exponent of the law where the shape of the tip tells it, such as 1.5 under a sphere; kept."
    normal: Annotated[Axis | Direction | None, _SIGNED] = None
    "Contact normal, out of the material: x, y, z, -x, -y, -z or three numbers; else it is found."
    force_frame: Annotated[Literal["tool", "base"] | None, _PREPARED] = None
    "Frame of the force: the tool's, which its orientation turns, or the position's."
    tool_weight: Annotated[Weight | None, _PREPARED] = None
    "Weight that the sensor carries, such as 1.2N, along -z of the position's frame."
    spot: Annotated[Literal["inf"] | Depth | None, _PREPARED] = None
    "How far a travelling probe may go within an episode, such as 5mm; or inf; 2 mm unless given."

    config: Annotated[Path | None, _KEPT] = None
    "Take options from this TOML file; those on the command line have the last word."
    save_config: Annotated[Path | None, _KEPT] = None
    "Write the options to this TOML file, with what was found as comments."

    def contact(self, files: Sequence[Path], choice: Mapping[str, str] | None = None) -> "Contact":
        """Read the files, each a contact with one object; a choice of law and method is saved."""
        from palpate.preparation.joining import joined

        contact = joined([self._contact(file) for file in files])
        if self.save_config is not None:
            from palpate.results.toml import as_toml, how_made
            from palpate.writing import write_text

            options = {**(choice or {}), **self.options}
            text = as_toml(options, how_made(contact, files))
            write_text(self.save_config, text, inputs=list(files))
        return contact

    def _contact(self, file: Path) -> "Contact":
        from palpate.cli.progress import opened
        from palpate.errors import MissingChannelError, RecordingError
        from palpate.preparation import prepare

        try:
            recording = opened(file, self._channels, strict=self.strict, curve=self.curve)
            return prepare(recording, **self.preparation)
        except MissingChannelError as error:
            hint = "name others with --time, --penetration or --position, --force, --velocity"
            raise RecordingError(f"{error} ({hint}; palpate info FILE shows them)") from None

    @property
    def _channels(self) -> list[str] | None:
        """The topics to read, where all that is needed is named by topics."""
        named = [self.force, self.position or self.penetration]
        if not all(name.startswith("/") for name in named):
            return None
        more = (self.orientation, self.velocity, self.time)
        named += [name for name in more if name and name.startswith("/")]
        # A topic as a whole: its own orientation and stamps are needed beside its position.
        return [part.strip().partition(".")[0] for name in named for part in name.split(",")]

    @property
    def preparation(self) -> dict[str, Any]:
        """What :func:`palpate.prepare` is to do."""
        from palpate.cli.quantities import quantity, span, units_of
        from palpate.preparation import Columns

        names = ("time", "penetration", "force", "velocity", "position", "orientation")
        given: dict[str, Any] = {
            "columns": Columns(**{name: getattr(self, name) for name in names}),
            "units": units_of("--unit", self.unit),
            "flip": self._turned,
            "surface": self._surface,
            "window": (self.start, self.stop),
        }
        for name in ("velocity_window", "rate", "normal", "force_frame", "strict"):
            given[name] = getattr(self, name)
        if self.tare is not None:
            given["tare"] = self.tare if self.tare == "find" else span("--tare", self.tare)
        if self.delay is not None:
            given["delay"] = quantity("--delay", self.delay, "time")
        if self.tool_weight is not None:
            given["tool_weight"] = quantity("--tool-weight", self.tool_weight, "force")
        if self.spot is not None:
            wide = self.spot == "inf"
            given["spot"] = 1e6 if wide else quantity("--spot", self.spot, "penetration")
        return given

    @property
    def _turned(self) -> tuple[str, ...]:
        turned = {"force": self.flip_force, "penetration": self.flip_penetration}
        return tuple(channel for channel, turn in turned.items() if turn)

    @property
    def _surface(self) -> Any:
        from palpate.cli.quantities import quantity
        from palpate.errors import InvalidParameterError

        if self.surface in (None, "estimate", "fit", "baseline", "threshold"):
            return self.surface
        try:
            return quantity("--surface", str(self.surface), "penetration")
        except InvalidParameterError as error:
            raise InvalidParameterError(f"{error}; or threshold, baseline, fit, estimate") from None

    @property
    def options(self) -> dict[str, Any]:
        """The options that were given, by their names without dashes before them."""
        usual = Reading()
        return {
            field.name.replace("_", "-"): getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name not in ("config", "save_config")
            and getattr(self, field.name) != getattr(usual, field.name)
        }

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
            settings["surface"] = searched_surface(kind)
        if self.exponent is not None:
            settings["exponent"] = kept_exponent(self.exponent, kind)
        return settings

    def gate(self, contact: "Contact") -> "ContactGate | None":
        """Return the gate asked for, the rest of it chosen from the data; None where none is."""
        from palpate.preparation import choose_gate

        if self.min_penetration is None and self.min_force is None:
            return None

        return choose_gate(
            contact, minimum_penetration=self.min_penetration, minimum_force=self.min_force
        )


def searched_surface(kind: "type[ContactEstimator]") -> str:
    """The setting by which a method searches for the surface, where it can."""
    from palpate.errors import InvalidParameterError

    if "surface" not in kind().settings:
        raise InvalidParameterError(
            f"--surface estimate is for a method that can, not for {kind.method}: "
            "--surface fit finds it before the law is looked for"
        )
    return "estimate"


def kept_exponent(exponent: float, kind: "type[ContactEstimator]") -> float:
    """The exponent that was given, for a method whose law has one."""
    from palpate.errors import InvalidParameterError

    if "exponent" not in kind().settings:
        raise InvalidParameterError(
            f"--exponent is for a method that can keep one; the law of {kind.method} has none"
        )
    return exponent
