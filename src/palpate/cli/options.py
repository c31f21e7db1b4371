"""The options that several commands share: value types, headings in the help, and meaning."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_origin

from cyclopts import Group, Parameter

from palpate.errors import InvalidParameterError

if TYPE_CHECKING:
    from palpate.findings import Mark
    from palpate.identification.diagnosis import Verdict
    from palpate.identification.quantities.derived import QueryOptions
    from palpate.identification.quantities.elastic_modulus import Tip
    from palpate.identification.quantities.specimen import Specimen
    from palpate.method.estimators import ContactEstimator

# The headings under which help shows the options.
WHAT = Group("Options", sort_key=1)
OUTPUT = Group("Output", sort_key=2)
PREPARED = Group("Preparation", sort_key=6)
READ = Group("Input", sort_key=5)
KEPT = Group("Configuration file", sort_key=9)

# Types of values, as help shows them.
Channel: TypeAlias = Annotated[str, Parameter(metavar="CHANNEL")]
Channels: TypeAlias = Annotated[str, Parameter(metavar="CHANNELS")]
Unit: TypeAlias = Annotated[str, Parameter(metavar="UNIT")]
Depth: TypeAlias = Annotated[str, Parameter(metavar="DEPTH")]
Duration: TypeAlias = Annotated[str, Parameter(metavar="DURATION")]
Direction: TypeAlias = Annotated[str, Parameter(metavar="DIRECTION")]
Shape: TypeAlias = Annotated[str | None, Parameter(metavar="SHAPE")]
Folder: TypeAlias = Annotated[Path, Parameter(metavar="FOLDER")]
Address: TypeAlias = Annotated[str, Parameter(metavar="ADDRESS")]
#: An option without a value, off by default.
Flag: TypeAlias = Annotated[bool, Parameter(negative="")]

FigureFile: TypeAlias = Annotated[Path | None, Parameter(group=OUTPUT, metavar="FILE")]
Dark: TypeAlias = Annotated[bool, Parameter(group=OUTPUT, negative="")]
OutputFile: TypeAlias = Annotated[Path, Parameter(name=["--output", "-o"], metavar="FILE")]
ResultFolder: TypeAlias = Annotated[Folder, Parameter(name=["--output", "-o"], group=OUTPUT)]

UNTRUSTED = 3  # exit status

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*2?)\s*$")
#: In rad/s; a bare number is in Hz.
_FREQUENCIES = {"Hz": math.tau, "rad/s": 1.0, "mHz": 1e-3 * math.tau, "kHz": 1e3 * math.tau}
_FORMS = (
    "sphere:radius=5mm, punch:diameter=4mm, cone:angle=30deg or pyramid:angle=35deg (between axis "
    "and side)"
)
_AREAS = {"m2": 1.0, "mm2": 1e-6, "cm2": 1e-4, "m²": 1.0, "mm²": 1e-6, "cm²": 1e-4}
_ANGLE = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*(deg|°|rad)\s*$")


def _laws(_: object) -> Iterable[str]:
    from palpate.method.estimators.by_law import law_names

    return law_names()


def names_in(*registries: str, prefix: str = "") -> Callable[[object], Iterable[str]]:
    """Return a completion of values: the names in registries such as ``palpate.lab.MATERIALS``."""

    def complete(_: object) -> Iterable[str]:
        for module, _, name in (registry.rpartition(".") for registry in registries):
            yield from (f"{prefix}{each}" for each in getattr(import_module(module), name))

    return complete


Law: TypeAlias = Annotated[str | None, Parameter(metavar="LAW", completer=_laws)]
_METHOD = Parameter(metavar="METHOD", completer=names_in("palpate.method.estimators.ESTIMATORS"))
Method: TypeAlias = Annotated[str | None, _METHOD]


@Parameter(name="*")
@dataclass(frozen=True)
class MethodOptions:
    """Law and method."""

    law: Law = None
    """Contact law: auto, the one that fits best, with relaxation where the material relaxes; or one
    law, such as hunt-crossley (default: auto)."""
    method: Method = None
    "Estimator, such as single-stage (default: the best for the law)."

    @property
    def kind(self) -> "type[ContactEstimator]":
        """The estimator's class."""
        return self._found[0]

    @property
    def settings(self) -> dict[str, Any]:
        """The settings with which it identifies the requested law."""
        return self._found[1]

    @cached_property
    def _found(self) -> "tuple[type[ContactEstimator], dict[str, Any]]":
        from palpate.method.estimators.by_law import estimator_by_law

        return estimator_by_law(self.law, self.method)

    def choose_default_law(self, exponent: float | None = None) -> "MethodOptions":
        """Return law auto if neither law nor method is requested and it can take the exponent."""
        from palpate.method.estimators import ViscoelasticContact

        low, high = ViscoelasticContact.exponents
        known = exponent is None or low <= exponent <= high
        return self if self.options or not known else MethodOptions(law="auto")

    def check(self) -> None:
        """Raise if there is no such law or method, before anything is read."""
        assert self._found

    @property
    def options(self) -> dict[str, str]:
        """The options that were passed."""
        return {name: value for name, value in vars(self).items() if name[0] != "_" and value}


@Parameter(name="*", group=OUTPUT)
@dataclass(frozen=True)
class FigureOptions:
    """File and style of a figure."""

    figure: FigureFile = None
    "Draw a figure to this file (.svg, .pdf or .png)."
    dark: Dark = False
    "Draw on a dark background."
    width: Annotated[str | None, Parameter(metavar="WIDTH")] = None
    "Printed width of the figure, 60mm to 400mm; a journal's column is 88mm."

    def check(self) -> None:
        """Check before the work that the figure can be drawn after it."""
        if self.figure is None:
            if self.width is not None:
                raise InvalidParameterError("--width needs a figure: pass --figure FILE too")
            return
        from palpate.output.figures import check_figure

        self._metres()
        check_figure(self.figure)

    def save(self, draw: str, what: Any, *more: Any) -> None:
        """Draw with a function such as ``palpate.output.figures.draw``, if requested."""
        if self.figure is not None:
            from palpate.output.figures import save

            module, _, name = draw.rpartition(".")
            rendered = getattr(import_module(module), name)(
                what,
                *more,
                dark=self.dark,
                width=self._metres(),
            )
            save(rendered, self.figure)

    @property
    def is_plain(self) -> bool:
        """Whether the figure is so narrow that its caption stands beside it."""
        if self.figure is None:
            return False
        from palpate.output.figures import choose_look

        return choose_look(width=self._metres()).plain

    def _metres(self) -> float | None:
        from palpate.output.figures.style import NARROWEST, WIDEST

        width = None if self.width is None else quantity("--width", self.width, "penetration")
        if width is None or NARROWEST <= width <= WIDEST:
            return width
        limits = f"from {1e3 * NARROWEST:g}mm to {1e3 * WIDEST:g}mm"
        raise InvalidParameterError(f"--width must be {limits}, such as 88mm, not {self.width!r}")


@Parameter(name="*", group=Group("Verdict", sort_key=3))
@dataclass(frozen=True)
class VerdictOptions:
    """Working depth, and the verdict that counts as a failure."""

    at: Depth | None = None
    "Working depth, such as 3mm (default: the median penetration)."
    fail_on: Literal["do-not-trust", "with-care"] | None = None
    """Exit with status 3 where the stiffness has this mark or a worse one; with --frequency or
    --impact-speed, which need the damping, also where the damping has."""

    @property
    def depth(self) -> float | None:
        """The requested working depth, m, if any."""
        return positive("--at", self.at, "penetration", 1e100)

    @property
    def options(self) -> dict[str, str]:
        """The options that were passed."""
        return {} if self.at is None else {"at": self.at}

    def status(self, verdicts: "Iterable[Verdict]", *, damping: bool = False) -> int:
        """Return 3 if a mark of a stiffness, or of a damping if that counts, is a failure."""
        marks = (
            mark
            for verdict in verdicts
            for mark in (verdict.stiffness, *[verdict.damping] * damping)
        )
        return mark_status(self.fail_on, marks)


def mark_status(fail_on: "Mark | None", marks: "Iterable[Mark | None]") -> int:
    """Return 3 if one of the marks is ``fail_on`` or worse, else 0."""
    from palpate.findings import MARKS

    if fail_on is None:
        return 0
    return UNTRUSTED if any(mark in MARKS[MARKS.index(fail_on) :] for mark in marks) else 0


@Parameter(name="*", group=Group("Derived quantities", sort_key=4))
@dataclass(frozen=True)
class QuantityOptions:
    """Impact, tip and frequency of the derived quantities."""

    impact_speed: Annotated[str | None, Parameter(metavar="SPEED")] = None
    "Print the coefficient of restitution at this impact speed, such as 0.5m/s."
    tip: Shape = None
    """Print Young's modulus for this tip: sphere:radius=5mm, punch:radius=2mm, cone:angle=30deg or
    pyramid:angle=35deg."""
    specimen: Annotated[str | None, Parameter(metavar="SIZE")] = None
    "Print Young's modulus S h/A of a specimen between plates: area=314mm2,height=20mm."
    thickness: Depth | None = None
    "Thickness of a sample that is bonded to stiff ground, such as 5um, for --tip sphere."
    poisson: float | None = None
    "Poisson's ratio of the material, for --tip (default: 0.5, incompressible)."
    frequency: Annotated[str | None, Parameter(metavar="FREQUENCY")] = None
    "Print K', B' and tan delta of a small oscillation, such as 2Hz, within the motion's band."

    @property
    def options(self) -> dict[str, str | float]:
        """The options that were passed."""
        given = {name.replace("_", "-"): value for name, value in vars(self).items()}
        return {name: value for name, value in given.items() if value is not None}

    @property
    def query(self) -> "QueryOptions":
        """The request, SI."""
        from palpate.identification.quantities.derived import QueryOptions

        speed = positive("--impact-speed", self.impact_speed, "velocity", 1e6)
        tip, ratio = parse_material(self.tip, self.poisson, self.thickness)
        specimen = None if self.specimen is None else parse_specimen(self.specimen)
        frequency = positive("--frequency", self.frequency, _FREQUENCIES, 1e12)
        return QueryOptions(speed, tip, ratio, frequency, specimen)


def quantity(option: str, text: str, channel: str | Mapping[str, float]) -> float:
    """Return a number with a unit of a channel in SI; without a unit it is in SI already.

    If ``channel`` is a mapping from units to sizes, the number has one of its units; without a unit
    it has the first.
    """
    from palpate.input.recordings.units import UNITS

    found = _NUMBER.match(text)
    units = UNITS[channel] if isinstance(channel, str) else channel
    si = next(iter(units))
    if found is None or (found[2] or si) not in units:
        raise InvalidParameterError(
            f"{option} must be a number and one of {', '.join(units)}, such as 3{list(units)[1]}, "
            f"not {text!r}"
        )
    return float(found[1]) * units[found[2] or si]


#: Units of a cantilever's calibration, and of a size in memory.
SENSITIVITIES = {"m/V": 1.0, "nm/V": 1e-9, "um/V": 1e-6, "µm/V": 1e-6, "nm/mV": 1e-6}
STIFFNESSES = {"N/m": 1.0, "mN/m": 1e-3, "nN/nm": 1.0, "pN/nm": 1e-3, "N/mm": 1e3}
SIZES = {"B": 1.0, "MB": 1e6, "GB": 1e9, "kB": 1e3, "MiB": 2.0**20, "GiB": 2.0**30}


def si_parameter(channel: str | Mapping[str, float], metavar: str, group: Group) -> Parameter:
    """An option whose number may have a unit of a channel, such as 2mm; SI without one."""

    def convert(kind: Any, tokens: Sequence[Any]) -> float | tuple[float, ...]:
        numbers = tuple(quantity("it", token.value, channel) for token in tokens)
        return numbers if get_origin(kind) is tuple else numbers[0]

    return Parameter(group=group, metavar=metavar, converter=convert)


MaxSize: TypeAlias = Annotated[float | None, si_parameter(SIZES, "SIZE", READ)]


def positive(
    option: str,
    text: str | None,
    channel: str | Mapping[str, float],
    most: float,
) -> float | None:
    """Return a quantity in SI, in (0, ``most``]; None if it was not passed."""
    from palpate.validation import number_in

    if text is None:
        return None
    return number_in(option, quantity(option, text, channel), 0.0, most, open_low=True)


def quantities(options: Any, **channels: str) -> dict[str, float]:
    """Return the options that were passed, in SI, each in the units of a channel."""
    return {
        name: quantity(f"--{name.replace('_', '-')}", text, channel)
        for name, channel in channels.items()
        if (text := getattr(options, name)) is not None
    }


def parse_units(option: str, pairs: tuple[str, ...]) -> dict[str, str]:
    """Return units by channel of CHANNEL=UNIT pairs, which commas may join."""
    units = {}
    for pair in (each for given in pairs for each in given.split(",")):
        channel, sign, unit = pair.partition("=")
        if not sign:
            raise InvalidParameterError(
                f"{option} must be CHANNEL=UNIT, such as penetration=mm, not {pair!r}"
            )
        units[channel] = unit
    return units


def parse_material(
    tip: str | None, poisson: float | None, thickness: str | None
) -> "tuple[Tip | None, float | None]":
    """Return the tip, with the thickness of the sample below it, and Poisson's ratio.

    Raises
    ------
    InvalidParameterError
        The tip has none of the forms, the ratio is out of its range, or has no tip; or the
        thickness has no sphere.
    """
    from palpate.identification.quantities.elastic_modulus import Sphere
    from palpate.validation import number_in

    if poisson is not None:
        if tip is None:
            raise InvalidParameterError(f"--poisson needs --tip, such as {_FORMS}")
        number_in("--poisson", poisson, -1.0, 0.5, open_low=True)
    shape = None if tip is None else parse_tip(tip)
    if thickness is not None:
        if not isinstance(shape, Sphere):
            raise InvalidParameterError(
                "--thickness needs --tip sphere:radius=5um, or another size"
            )
        shape = Sphere(shape.radius, quantity("--thickness", thickness, "penetration"))
    return shape, poisson


def parse_tip(text: str) -> "Tip":
    """Return the tip of a text such as ``sphere:radius=5mm``.

    Raises
    ------
    InvalidParameterError
        The text has none of the forms, or a size is out of its range.
    """
    from palpate.identification.quantities.elastic_modulus import Cone, FlatPunch, Pyramid, Sphere

    kind, _, size = text.partition(":")
    name, _, value = (part.strip() for part in size.partition("="))
    option = f"--tip {kind}:{name}"
    round_: dict[str, type[Sphere | FlatPunch]] = {"sphere": Sphere, "punch": FlatPunch}
    pointed: dict[str, type[Cone | Pyramid]] = {"cone": Cone, "pyramid": Pyramid}
    if kind in round_ and name in ("radius", "diameter"):
        length = quantity(option, value, "penetration")
        return round_[kind](length if name == "radius" else 0.5 * length)
    if kind in pointed and name in ("angle", "opening"):
        found = _ANGLE.match(value)  # without a unit 1.2 may be degrees or radians
        if found is None:
            raise InvalidParameterError(f"{option} must be such as 30deg or 0.52rad, not {value!r}")
        angle = float(found[1]) if found[2] == "rad" else math.radians(float(found[1]))
        return pointed[kind](angle if name == "angle" else 0.5 * angle)
    raise InvalidParameterError(f"--tip must be such as {_FORMS}, not {text!r}")


def parse_specimen(text: str) -> "Specimen":
    """Return the specimen of a text such as ``area=314mm2,height=20mm``.

    Raises
    ------
    InvalidParameterError
        The text does not have this form, or a size is out of its range.
    """
    from palpate.identification.quantities.specimen import Specimen

    parts = (each.partition("=") for each in text.split(","))
    sizes = {name.strip(): size for name, _, size in parts}
    if sizes.keys() != {"area", "height"}:
        raise InvalidParameterError(
            f"--specimen must be such as area=314mm2,height=20mm, not {text!r}"
        )
    area = quantity("--specimen area", sizes["area"], _AREAS)
    return Specimen(area, quantity("--specimen height", sizes["height"], "penetration"))
