"""Options for reading a file and selecting its samples."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_args

from cyclopts import Parameter

from palpate.cli.options import (
    KEPT,
    PREPARED,
    READ,
    SENSITIVITIES,
    STIFFNESSES,
    Channel,
    Channels,
    MaxSize,
    MethodOptions,
    Unit,
    parse_units,
    quantities,
    quantity,
    si_parameter,
)
from palpate.cli.printing import open_with_progress
from palpate.errors import InvalidParameterError, MissingChannelError, RecordingError
from palpate.input.preparation.options import SurfaceRule, describe_option
from palpate.writing import as_toml, check_marked, write_text

if TYPE_CHECKING:
    from palpate.identification.quantities.elastic_modulus import Tip
    from palpate.identifying import Identification
    from palpate.input.recordings import Recording
    from palpate.method.contact import Contact
    from palpate.method.estimators import ContactEstimator
    from palpate.method.settings import ContactGate

#: One file or several.
Files: TypeAlias = tuple[Path, ...]

_READ = Parameter(group=READ)
_PREPARED = Parameter(group=PREPARED)
_FLAG = Parameter(group=PREPARED, negative="")

_Axis: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]


def negative_number_parameter(metavar: str) -> Parameter:
    """An option whose value may begin with a minus sign, such as -3ms."""
    return Parameter(group=PREPARED, allow_leading_hyphen=True, metavar=metavar, show_choices=False)


def _help(name: str, example: str = "") -> Parameter:
    """The description that :class:`~palpate.input.preparation.options.Options` has of an option."""
    return Parameter(help=describe_option(name, example))


@Parameter(name="*")
@dataclasses.dataclass(frozen=True)
class ReadingOptions:
    """How to read a file, and which of its samples to use."""

    companion: Annotated[Path | None, Parameter("--with", group=READ, metavar="FILE")] = None
    "Second file of one contact: it has the force, or the position; the clocks may differ."
    time: Annotated[Channel, _READ] = "time_s"
    "Time channel (auto-detected if absent)."
    penetration: Annotated[Channel, _READ] = "penetration_m"
    "Penetration channel, positive inside the material (auto-detected if absent)."
    force: Annotated[Channel, _READ] = "force_N"
    "Force channel, compression positive; or x,y,z channels, or a topic (auto-detected if absent)."
    velocity: Annotated[Channel, _READ] = "velocity_m_s"
    "Velocity channel; if absent or none, computed from the penetration."
    position: Annotated[Channels | None, _READ] = None
    "Position channel of the probe, instead of a penetration; or x,y,z channels, or a topic."
    orientation: Annotated[Channels | None, _READ] = None
    "Orientation of the probe, quaternion channels x,y,z,w or three angles; or a topic."
    orientation_form: Annotated[Literal["rpy", "rotation-vector"] | None, _READ] = None
    "Three angles: rpy (about the fixed axes x, y, z) or rotation-vector (default: by the names)."
    torque: Annotated[Channels | None, _READ] = None
    "Torque of the sensor, x,y,z channels, or a topic (default: that of the force's sensor)."
    unit: Annotated[tuple[Unit, ...], _READ] = ()
    "Units, such as penetration=mm,force=mN (default: from the file or channel names, else SI)."
    rate: Annotated[float | None, _READ, _help("rate")] = None
    no_time: Annotated[
        bool,
        Parameter(group=READ, negative=""),
        _help("no_time", "; --start and --stop count samples"),
    ] = False
    curve: Annotated[int | None, _READ] = None
    "Index, from 0, of the curve to read in a file with several."
    episode: Annotated[int | None, _READ] = None
    "Number of the episode to read in a data set (default: all, as contacts with one object)."
    sheet: Annotated[str | None, Parameter(group=READ, metavar="NAME|K")] = None
    "Sheet of a spreadsheet: its name or its number from 1 (default: all that hold a table)."
    header_row: Annotated[int | None, _READ] = None
    "Line of the column names in a text (default: above the largest block of numbers)."
    sensitivity: Annotated[float | None, si_parameter(SENSITIVITIES, "SIZE", READ)] = None
    "Deflection of a cantilever per volt, such as 40nm/V, for a force curve in volts."
    spring_constant: Annotated[float | None, si_parameter(STIFFNESSES, "SIZE", READ)] = None
    "Spring constant of a cantilever, such as 0.05N/m (default: from the file)."
    max_size: MaxSize = None
    "Largest size of the data in memory, such as 8GB (default: 4 GiB)."
    start: Annotated[float | None, _READ] = None
    "Use samples from this time on, s."
    stop: Annotated[float | None, _READ] = None
    "Use samples up to this time, s."
    strict: Annotated[
        bool, Parameter(group=READ, negative=""), _help("strict", "; on damaged files too")
    ] = False

    min_penetration: Annotated[float | None, si_parameter("penetration", "DEPTH", PREPARED)] = None
    "Least penetration in contact, such as 2mm (default: chosen by the method or from the data)."
    min_force: Annotated[float | None, si_parameter("force", "FORCE", PREPARED)] = None
    "Least force in contact, such as 0.5N (default: chosen by the method or from the data)."
    velocity_window: Annotated[
        float | None,
        si_parameter("time", "DURATION", PREPARED),
        _help("velocity_window", ", such as 30ms"),
    ] = None
    flip_force: Annotated[bool, _FLAG] = False
    "Reverse the sign of the force: compression must be positive."
    flip_penetration: Annotated[bool, _FLAG] = False
    "Reverse the sign of the penetration: into the material must be positive."
    tare: Annotated[
        Literal["find"] | str | None,
        negative_number_parameter("find|SPAN"),
        _help("tare", ", such as 0:2"),
    ] = None
    delay: Annotated[
        Literal["find"] | str | None,
        negative_number_parameter("find|DURATION"),
        _help("delay", ", such as 5ms or 5ms+-0.2ms"),
    ] = None
    reject_outliers: Annotated[bool, _PREPARED] = True
    "Exclude dropouts, spikes, saturated samples and touches from where another place is loaded."
    surface: Annotated[
        SurfaceRule | str | None,
        negative_number_parameter("DEPTH"),
        _help("surface", ", such as 0.7mm"),
    ] = None
    exponent: Annotated[float | None, _PREPARED] = None
    "Fix the exponent of the law, known from the shape of the tip, such as 1.5 for a sphere."
    weak_prior: Annotated[bool, _PREPARED] = True
    "Keep B >= 0 and n from 1 to 2 where a motion one way leaves them open."
    normal: Annotated[
        _Axis | str | None, negative_number_parameter("DIRECTION"), _help("normal")
    ] = None
    force_frame: Annotated[Literal["tool", "base"] | None, _PREPARED, _help("force_frame")] = None
    tool_weight: Annotated[
        str | None,
        Parameter(group=PREPARED, metavar="WEIGHT"),
        _help("tool_weight", ", such as 1.2N"),
    ] = None
    payload: Annotated[
        Path | None,
        Parameter(group=PREPARED, metavar="FILE"),
        _help("payload", ": the file of palpate payload --save-config"),
    ] = None
    tip_offset: Annotated[
        str | None, negative_number_parameter("X,Y,Z"), _help("tip_offset", ", such as 3mm,0,140mm")
    ] = None
    mass: Annotated[
        float | None,
        si_parameter({"kg": 1.0, "g": 1e-3}, "MASS", PREPARED),
        _help("mass", ", such as 20g"),
    ] = None
    spot: Annotated[
        Literal["inf"] | str | None,
        negative_number_parameter("DEPTH"),
        _help("spot", ", such as 5mm"),
    ] = None

    save_config: Annotated[Path | None, Parameter(group=KEPT)] = None
    "Write the options to this TOML file, with the choices that palpate made as comments."

    def contact(
        self,
        files: Sequence[Path],
        choice: Mapping[str, str] | None = None,
        *,
        tip: "Tip | None" = None,
    ) -> "Contact":
        """Read the files, each a contact with one object; save the choice of law and method.

        The tip finds the contact point of force curves.
        """
        from palpate.input.preparation.preparing import join_contacts

        if self.companion is not None and len(files) > 1:
            raise InvalidParameterError("--with joins a second file to one file: pass one")
        if self.save_config is not None:
            check_marked(self.save_config)
        contact = join_contacts([self._contact(file, tip) for file in files])
        if self.save_config is not None:
            from palpate.output.results.saved import how_made

            options = {**(choice or {}), **self.options}
            text = as_toml(options, how_made(contact, files))
            write_text(self.save_config, text)
        return contact

    def _force_curve(self, recording: "Recording", tip: "Tip") -> "Contact | None":
        """Return the contact of a force curve, from the contact point that the tip finds."""
        from palpate.identification.quantities.indentation import (
            fit_force_curve,
            prepare_force_curve,
            read_force_curve,
            refuse_options,
        )

        curve = read_force_curve(recording)
        if curve is None:
            return None
        fixed = ["exponent"] if self.exponent is not None else []
        refuse_options([*self.changed_preparation, *fixed])
        return prepare_force_curve(curve, fit_force_curve(curve, tip))

    def _contact(self, file: Path, tip: "Tip | None") -> "Contact":
        from palpate.input.preparation import prepare

        recording = None
        try:
            given = ("strict", "curve", "episode", "sheet", "header_row")
            calibration = ("sensitivity", "spring_constant")
            options = {name: getattr(self, name) for name in (*given, *calibration)}
            recording = open_with_progress(file, self._channels, max_size=self.max_size, **options)
            if tip is not None:
                curve = self._force_curve(recording, tip)
                if curve is not None:
                    return curve
            second = self.companion and open_with_progress(
                self.companion,
                None,
                max_size=self.max_size,
                strict=self.strict,
            )
            return prepare(recording, companion=second, **self.preparation)
        except MissingChannelError as error:
            if recording is not None and recording.losses:  # the column may be in a lost part
                raise RecordingError(f"{error}; {recording.losses[0]}") from None
            names = "name channels with --time, --penetration or --position, --force, --velocity; "
            hint = f"{'' if error.missing else names}palpate info {file} lists them"
            if recording is not None and recording.table:
                hint = f"{recording.table}; {hint}"
            raise RecordingError(f"{error} ({hint})") from None

    @property
    def _channels(self) -> list[str] | None:
        """The topics to read, if the options name a topic for each channel; else None, for all."""
        named = [self.force, self.position or self.penetration]
        if self.companion or not all(name.startswith("/") for name in named):
            return None
        more = (self.orientation, self.torque, self.velocity, self.time)
        named += [name for name in more if name and name.startswith("/")]
        # Whole topics, because their orientation and time stamps are needed too.
        return [part.strip().partition(".")[0] for name in named for part in name.split(",")]

    @property
    def preparation(self) -> dict[str, Any]:
        """The arguments for :func:`palpate.prepare`."""
        from palpate.input.channels import Columns

        names = ("time", "penetration", "force", "velocity", "position", "orientation", "torque")
        as_given = ("velocity_window", "rate", "no_time", "normal", "force_frame", "mass", "strict")
        given: dict[str, Any] = {
            "columns": Columns(
                orientation_form=self.orientation_form,
                **{name: getattr(self, name) for name in names},
            ),
            "units": parse_units("--unit", self.unit),
            "flip": channels_to_flip(self),
            "surface": self._surface,
            "window": (self.start, self.stop),
            **{name: getattr(self, name) for name in as_given},
        }
        if self.tare is not None:
            given["tare"] = self.tare if self.tare == "find" else _span("--tare", self.tare)
        if self.delay is not None:
            given["delay"] = self.delay if self.delay == "find" else parse_delay(self.delay)
        given |= quantities(self, tool_weight="force")
        if self.payload is not None:
            from palpate.input.wrench import Payload

            given["payload"] = Payload.load(self.payload)
        if self.tip_offset is not None:
            three = self.tip_offset.split(",")
            given["tip_offset"] = [quantity("--tip-offset", x, "penetration") for x in three]
        if self.spot == "inf":
            return {**given, "spot": 1e6}
        return given | quantities(self, spot="penetration")

    @property
    def changed_preparation(self) -> dict[str, Any]:
        """The arguments for :func:`palpate.prepare` that are not the default ones."""
        preparation = ReadingOptions().preparation
        return {
            name: value for name, value in self.preparation.items() if value != preparation[name]
        }

    @property
    def _surface(self) -> Any:
        if self.surface in (None, *get_args(SurfaceRule)):
            return self.surface
        try:
            return quantity("--surface", str(self.surface), "penetration")
        except InvalidParameterError as error:
            text = f"{error}; or threshold, baseline, fit or estimate"
            raise InvalidParameterError(text) from None

    @property
    def options(self) -> dict[str, Any]:
        """The options that differ from their defaults, by name without leading dashes."""
        return {
            "with" if name == "companion" else name.replace("_", "-"): value
            for name, value in vars(self).items()
            if name != "save_config" and value != getattr(ReadingOptions, name)
        }

    def choose_default_law(
        self,
        choosing: MethodOptions,
        *,
        timeless: bool = False,
    ) -> MethodOptions:
        """Return the options, with the default law if neither law nor method is requested.

        The default selects the law. Variable projection remains the default for requests that only
        it supports.
        """
        able = self.weak_prior and self.surface != "estimate" and not timeless
        return choosing.choose_default_law(self.exponent) if able else choosing

    def settings(self, contact: "Contact", kind: "type[ContactEstimator]") -> dict[str, Any]:
        """Return the constructor arguments for an estimator of this kind, with its gate."""
        return {"gate": self._gate(contact, alone=kind.chooses_samples), **self.chosen(kind)}

    def chosen(self, kind: "type[ContactEstimator]") -> dict[str, Any]:
        """Return the estimator settings that the options request, without the gate."""
        settings: dict[str, Any] = {} if self.reject_outliers else {"outlier_rejection": False}
        if self.surface == "estimate":
            settings["surface"] = "estimate"
            if "surface" not in kind().settings:
                raise InvalidParameterError(
                    f"the method {kind.method} cannot estimate the surface: pass --surface fit, "
                    "which finds it before the identification"
                )
        if self.exponent is not None:
            settings["exponent"] = check_fixed_exponent(self.exponent, kind)
        if not self.weak_prior and "weak_prior" in kind().settings:
            settings["weak_prior"] = False
        return settings

    def compared(self, contact: "Contact", **watched: Any) -> "dict[str, Identification]":
        """Identify the same samples with every method."""
        from palpate.identifying import compare

        outliers = None if self.reject_outliers else False
        settings = {"outlier_rejection": outliers, "exponent": self.exponent, **watched}
        return compare(contact, gate=self._gate(contact), **settings)

    def _gate(self, contact: "Contact", *, alone: bool = False) -> "ContactGate | None":
        from palpate.input.preparation.gate import requested_gate

        return requested_gate(contact, self.min_penetration, self.min_force, alone=alone)


def channels_to_flip(options: Any) -> tuple[str, ...]:
    """The channels whose sign the options reverse."""
    return tuple(name for name in ("force", "penetration") if getattr(options, f"flip_{name}"))


def _span(option: str, text: str) -> tuple[float, float]:
    """Parse two times, START:STOP, s."""
    start, colon, stop = text.partition(":")
    if not colon:
        raise InvalidParameterError(f"{option} must be START:STOP in seconds, not {text!r}")
    return quantity(option, start, "time"), quantity(option, stop, "time")


def parse_delay(text: str) -> float | tuple[float, float]:
    """Parse a duration, or a duration and its standard error: 14ms+-0.2ms."""
    late, sign, error = text.replace("±", "+-").partition("+-")
    found = quantity("--delay", late, "time")
    return (found, quantity("--delay", error, "time")) if sign else found


def check_fixed_exponent(exponent: float, kind: "type[ContactEstimator]") -> float:
    """Return the exponent; raise if the method cannot fix one."""
    if "exponent" not in kind().settings:
        raise InvalidParameterError(
            f"the method {kind.method} cannot fix an exponent: drop --exponent or change --method"
        )
    return exponent
