"""The options that say how a file is read, and which of its samples are used."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter

from palpate.cli.options import (
    KEPT,
    PREPARED,
    READ,
    Channel,
    Channels,
    Unit,
    in_si,
    quantities,
    quantity,
    units_of,
)
from palpate.cli.printing import opened
from palpate.errors import InvalidParameterError, MissingChannelError, RecordingError

if TYPE_CHECKING:
    from palpate.contact import Contact
    from palpate.estimators import ContactEstimator
    from palpate.identifying import Identification
    from palpate.settings import ContactGate

#: One file or several.
Files: TypeAlias = tuple[Path, ...]

_READ = Parameter(group=READ)
_PREPARED = Parameter(group=PREPARED)
_FLAG = Parameter(group=PREPARED, negative="")

_Axis: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]
_Surface: TypeAlias = Literal["threshold", "baseline", "fit", "estimate"]


def _signed(metavar: str) -> Parameter:
    """A text that may begin with a minus sign, as -3ms; its own words stand in its help."""
    return Parameter(group=PREPARED, allow_leading_hyphen=True, metavar=metavar, show_choices=False)


@Parameter(name="*")
@dataclasses.dataclass(frozen=True)
class ReadingOptions:
    """How a file is read, and which of its samples are used."""

    time: Annotated[Channel, _READ] = "time_s"
    "The time; a channel that is not named, and not there, is looked for."
    penetration: Annotated[Channel, _READ] = "penetration_m"
    "The penetration, positive inside the material."
    force: Annotated[Channel, _READ] = "force_N"
    "The force, compression positive; or x,y,z, or a topic such as /ft."
    velocity: Annotated[Channel, _READ] = "velocity_m_s"
    "The velocity, or none; where there is none it is worked out from the penetration."
    position: Annotated[Channels | None, _READ] = None
    "The probe's position in place of the penetration; or x,y,z, or a topic."
    orientation: Annotated[Channels | None, _READ] = None
    "The probe's orientation, a quaternion x,y,z,w; or a topic."
    unit: Annotated[tuple[Unit, ...], _READ] = ()
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

    min_penetration: Annotated[float | None, in_si("penetration", "DEPTH", PREPARED)] = None
    "Least penetration in contact, such as 2mm (default: chosen by the method or from the data)."
    min_force: Annotated[float | None, in_si("force", "FORCE", PREPARED)] = None
    "Least force in contact, such as 0.5N (default: chosen by the method or from the data)."
    velocity_window: Annotated[float | None, in_si("time", "DURATION", PREPARED)] = None
    "Length of the velocity filter, such as 30ms (default: 15 samples, at most 15ms)."
    flip_force: Annotated[bool, _FLAG] = False
    "Turn the sign of the force: compression is to be positive."
    flip_penetration: Annotated[bool, _FLAG] = False
    "Turn the sign of the penetration: into the material is to be positive."
    tare: Annotated[Literal["find"] | str | None, _signed("find|SPAN")] = None
    "Take off the mean force between these times, START:STOP, s; or find such times: find."
    delay: Annotated[str | None, _signed("DURATION")] = None
    "How late the force is, such as 5ms; negative where it is early."
    reject_outliers: Annotated[bool, _PREPARED] = True
    "Leave lost positions, spikes and the end of the sensor's range out."
    surface: Annotated[_Surface | str | None, _signed("DEPTH")] = None
    "Where the material begins: a penetration such as 0.7mm, threshold, baseline, fit, or estimate."
    exponent: Annotated[float | None, _PREPARED] = None
    "Exponent of the law where the shape of the tip tells it, such as 1.5 under a sphere; kept."
    normal: Annotated[_Axis | str | None, _signed("DIRECTION")] = None
    "Contact normal, out of the material: x, y, z, -x, -y, -z or three numbers; else it is found."
    force_frame: Annotated[Literal["tool", "base"] | None, _PREPARED] = None
    "Frame of the force: the tool's, which its orientation turns, or the position's."
    tool_weight: Annotated[str | None, Parameter(group=PREPARED, metavar="WEIGHT")] = None
    "Weight that the sensor carries, such as 1.2N, along -z of the position's frame."
    spot: Annotated[Literal["inf"] | str | None, _signed("DEPTH")] = None
    "How far a travelling probe may go within an episode, such as 5mm; or inf; 2 mm unless given."

    save_config: Annotated[Path | None, Parameter(group=KEPT)] = None
    "Write the options to this TOML file, with what was found as comments."

    def contact(self, files: Sequence[Path], choice: Mapping[str, str] | None = None) -> "Contact":
        """Read the files, each a contact with one object; a choice of law and method is saved."""
        from palpate.preparation.preparing import joined

        contact = joined([self._contact(file) for file in files])
        if self.save_config is not None:
            from palpate.results.saved import as_toml, how_made
            from palpate.writing import write_text

            options = {**(choice or {}), **self.options}
            text = as_toml(options, how_made(contact, files))
            write_text(self.save_config, text, inputs=list(files))
        return contact

    def _contact(self, file: Path) -> "Contact":
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
        from palpate.preparation import Columns

        names = ("time", "penetration", "force", "velocity", "position", "orientation")
        as_given = ("velocity_window", "rate", "normal", "force_frame", "strict")
        given: dict[str, Any] = {
            "columns": Columns(**{name: getattr(self, name) for name in names}),
            "units": units_of("--unit", self.unit),
            "flip": flipped(self),
            "surface": self._surface,
            "window": (self.start, self.stop),
            **{name: getattr(self, name) for name in as_given},
        }
        if self.tare is not None:
            given["tare"] = self.tare if self.tare == "find" else _span("--tare", self.tare)
        given |= quantities(self, delay="time", tool_weight="force")
        if self.spot == "inf":
            return {**given, "spot": 1e6}
        return given | quantities(self, spot="penetration")

    @property
    def _surface(self) -> Any:
        if self.surface in (None, "estimate", "fit", "baseline", "threshold"):
            return self.surface
        try:
            return quantity("--surface", str(self.surface), "penetration")
        except InvalidParameterError as error:
            raise InvalidParameterError(f"{error}; or threshold, baseline, fit, estimate") from None

    @property
    def options(self) -> dict[str, Any]:
        """The options that were given, by their names without dashes before them."""
        return {
            name.replace("_", "-"): value
            for name, value in vars(self).items()
            if name != "save_config" and value != getattr(ReadingOptions, name)
        }

    def settings(self, contact: "Contact", kind: "type[ContactEstimator]") -> dict[str, Any]:
        """Return what an estimator of this kind is to be made with."""
        return {"gate": self._gate(contact, alone=kind.chooses_samples), **self.chosen(kind)}

    def chosen(self, kind: "type[ContactEstimator]") -> dict[str, Any]:
        """Return the settings of an estimator that options ask for, but for its gate."""
        settings: dict[str, Any] = {} if self.reject_outliers else {"outlier_rejection": False}
        if self.surface == "estimate":
            settings["surface"] = "estimate"
            if "surface" not in kind().settings:
                raise InvalidParameterError(
                    f"--surface estimate is for a method that can, not for {kind.method}: "
                    "--surface fit finds it before the law is looked for"
                )
        if self.exponent is not None:
            settings["exponent"] = kept_exponent(self.exponent, kind)
        return settings

    def compared(self, contact: "Contact", **watched: Any) -> "dict[str, Identification]":
        """Identify by every method on the same samples."""
        from palpate.identifying import compare

        outliers = None if self.reject_outliers else False
        settings = {"outlier_rejection": outliers, "exponent": self.exponent, **watched}
        return compare(contact, gate=self._gate(contact), **settings)

    def _gate(self, contact: "Contact", *, alone: bool = False) -> "ContactGate | None":
        from palpate.preparation.gates import gate_asked_for

        return gate_asked_for(contact, self.min_penetration, self.min_force, alone=alone)


def flipped(options: Any) -> tuple[str, ...]:
    """The channels of which the sign is to be turned."""
    return tuple(name for name in ("force", "penetration") if getattr(options, f"flip_{name}"))


def _span(option: str, text: str) -> tuple[float, float]:
    """Two times, START:STOP, s."""
    start, colon, stop = text.partition(":")
    if not colon:
        raise InvalidParameterError(f"{option} must be START:STOP in seconds, not {text!r}")
    return quantity(option, start, "time"), quantity(option, stop, "time")


def kept_exponent(exponent: float, kind: "type[ContactEstimator]") -> float:
    """The exponent that was given, for a method whose law has one."""
    if "exponent" not in kind().settings:
        raise InvalidParameterError(
            f"--exponent is for a method that can keep one; the law of {kind.method} has none"
        )
    return exponent
