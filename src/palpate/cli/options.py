"""The options that several commands take: their kinds of values, headings in help, and meaning."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Group, Parameter

from palpate.errors import InvalidParameterError

if TYPE_CHECKING:
    from palpate.diagnosis import Verdict
    from palpate.estimators import ContactEstimator
    from palpate.quantities.derived import QueryOptions
    from palpate.quantities.elastic_modulus import Tip

# The headings under which help shows the options.
WHAT = Group("Options", sort_key=1)
OUTPUT = Group("What is printed and drawn", sort_key=2)
PREPARED = Group("How it is prepared", sort_key=6)
READ = Group("What is read", sort_key=5)
KEPT = Group("Options in a file", sort_key=9)

# Kinds of words; help shows them in place of a value.
Channel: TypeAlias = Annotated[str, Parameter(metavar="CHANNEL")]
Channels: TypeAlias = Annotated[str, Parameter(metavar="CHANNELS")]
Unit: TypeAlias = Annotated[str, Parameter(metavar="UNIT")]
Depth: TypeAlias = Annotated[str, Parameter(metavar="DEPTH")]
Duration: TypeAlias = Annotated[str, Parameter(metavar="DURATION")]
Direction: TypeAlias = Annotated[str, Parameter(metavar="DIRECTION")]
Folder: TypeAlias = Annotated[Path, Parameter(metavar="FOLDER")]
Address: TypeAlias = Annotated[str, Parameter(metavar="ADDRESS")]

FigureFile: TypeAlias = Annotated[Path | None, Parameter(group=OUTPUT, metavar="FILE")]
Dark: TypeAlias = Annotated[bool, Parameter(group=OUTPUT, negative="")]
OutputFile: TypeAlias = Annotated[Path, Parameter(name=["--output", "-o"], metavar="FILE")]
ResultFolder: TypeAlias = Annotated[Folder, Parameter(name=["--output", "-o"], group=OUTPUT)]

UNTRUSTED = 3  # exit status

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*?)\s*$")
#: In rad/s; a bare number is in Hz.
_FREQUENCIES = {"Hz": math.tau, "rad/s": 1.0, "mHz": 1e-3 * math.tau, "kHz": 1e3 * math.tau}
_FORMS = "sphere:radius=5mm, punch:diameter=4mm or cone:angle=30deg (between axis and side)"
_ANGLE = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*(deg|°|rad)\s*$")


def _laws(_: object) -> Iterable[str]:
    from palpate.estimators.by_law import law_names

    return law_names()


def names_in(*registries: str, prefix: str = "") -> Callable[[object], Iterable[str]]:
    """What completes a value: the names in registries, each such as ``palpate.lab.MATERIALS``."""

    def complete(_: object) -> Iterable[str]:
        for module, _, name in (each.rpartition(".") for each in registries):
            yield from (f"{prefix}{each}" for each in getattr(import_module(module), name))

    return complete


Law: TypeAlias = Annotated[str | None, Parameter(metavar="LAW", completer=_laws)]
_METHOD = Parameter(metavar="METHOD", completer=names_in("palpate.estimators.ESTIMATORS"))
Method: TypeAlias = Annotated[str | None, _METHOD]


@Parameter(name="*")
@dataclass(frozen=True)
class MethodOptions:
    """Which law is identified, and by which method."""

    law: Law = None
    """The law: auto, the everyday one that explains the samples best; any, the best of all; or one,
    such as half-space, flat or half-space+single; Hunt-Crossley's unless given."""
    method: Method = None
    "The estimator, such as single-stage; the usual one of the law unless given."

    @property
    def kind(self) -> "type[ContactEstimator]":
        """The estimator's class."""
        return self._found[0]

    @property
    def settings(self) -> dict[str, Any]:
        """Its settings by which it finds the law that is asked for."""
        return self._found[1]

    @cached_property
    def _found(self) -> "tuple[type[ContactEstimator], dict[str, Any]]":
        from palpate.estimators.by_law import estimator_by_law

        return estimator_by_law(self.law, self.method)

    @property
    def options(self) -> dict[str, str]:
        """What repeats the choice, by option."""
        law = {} if self.law is None else {"law": self.law}
        return {**law, "method": self.kind.method}


@Parameter(name="*", group=OUTPUT)
@dataclass(frozen=True)
class FigureOptions:
    """Where a figure goes to, and how it looks."""

    figure: FigureFile = None
    "Draw it to this file (.svg, .pdf or .png)."
    dark: Dark = False
    "Draw on a dark background."
    width: Annotated[str | None, Parameter(metavar="WIDTH")] = None
    "Width of the figure as it is printed, 60mm to 400mm: a journal's column is 88mm."

    def check(self, inputs: Sequence[Path] = ()) -> None:
        """Say before the work what could not be drawn after it."""
        if self.figure is None:
            if self.width is not None:
                raise InvalidParameterError("--width is that of a figure: name one with --figure")
            return
        from palpate.figures import check_figure

        self._metres()
        check_figure(self.figure, inputs=inputs)

    def save(self, draw: str, what: Any, inputs: Sequence[Path] = ()) -> None:
        """Draw by a function such as ``palpate.figures.draw``, where a figure is wanted."""
        if self.figure is not None:
            from palpate.figures import save

            module, _, name = draw.rpartition(".")
            rendered = getattr(import_module(module), name)(
                what, dark=self.dark, width=self._metres()
            )
            save(rendered, self.figure, inputs=inputs)

    def _metres(self) -> float | None:
        from palpate.figures.style import NARROWEST, WIDEST

        width = None if self.width is None else quantity("--width", self.width, "penetration")
        if width is None or NARROWEST <= width <= WIDEST:
            return width
        limits = f"from {1e3 * NARROWEST:g}mm to {1e3 * WIDEST:g}mm"
        raise InvalidParameterError(f"--width must be {limits}, such as 88mm, not {self.width!r}")


@Parameter(name="*", group=Group("How it is judged", sort_key=3))
@dataclass(frozen=True)
class VerdictOptions:
    """Where the numbers are wanted, and which verdict is a failure."""

    at: Depth | None = None
    "Working depth, such as 3mm; the median penetration unless given."
    fail_on: Literal["do-not-trust", "with-care"] | None = None
    "End with exit status 3 on this verdict or a worse one."

    @property
    def depth(self) -> float | None:
        """The working depth, m, where one is asked for."""
        return positive("--at", self.at, "penetration", 1e100)

    @property
    def options(self) -> dict[str, str]:
        """What was asked for of the numbers, by option."""
        return {} if self.at is None else {"at": self.at}

    def status(self, verdicts: "Iterable[Verdict]") -> int:
        """Return 3 where a verdict is to fail, else 0."""
        from palpate.findings import MARKS

        if self.fail_on is None:
            return 0
        failing = MARKS[MARKS.index(self.fail_on) :]
        return UNTRUSTED if any(each.overall in failing for each in verdicts) else 0


@Parameter(name="*", group=Group("What follows from the law", sort_key=4))
@dataclass(frozen=True)
class QuantityOptions:
    """Which impact and which tip the numbers that follow from the law are for."""

    impact_speed: Annotated[str | None, Parameter(metavar="SPEED")] = None
    "Speed of the rebound's impact, such as 0.5m/s; the fastest approach unless given."
    tip: Annotated[str | None, Parameter(metavar="SHAPE")] = None
    "Gives the elastic modulus: sphere:radius=5mm, punch:radius=2mm, cone:angle=30deg (half)."
    poisson: float | None = None
    "Poisson's ratio of the material, for --tip; 0.5, incompressible as soft tissue, unless given."
    frequency: Annotated[str | None, Parameter(metavar="FREQUENCY")] = None
    "Prints K', B' and tan delta of a small oscillation, such as 2Hz, within the motion's band."

    @property
    def options(self) -> dict[str, str | float]:
        """What was asked for, by option."""
        given = {name.replace("_", "-"): value for name, value in vars(self).items()}
        return {name: value for name, value in given.items() if value is not None}

    @property
    def query(self) -> "QueryOptions":
        """What is asked for, SI."""
        from palpate.quantities.derived import QueryOptions
        from palpate.validation import number_in

        speed, ratio = positive("--impact-speed", self.impact_speed, "velocity", 1e6), self.poisson
        if ratio is not None:
            if self.tip is None:
                raise InvalidParameterError(f"--poisson needs --tip, such as {_FORMS}")
            ratio = number_in("--poisson", ratio, -1.0, 0.5, open_low=True)
        tip = None if self.tip is None else tip_of(self.tip)
        return QueryOptions(
            speed, tip, ratio, positive("--frequency", self.frequency, _FREQUENCIES, 1e12)
        )


def quantity(option: str, text: str, channel: str | Mapping[str, float]) -> float:
    """A number with a unit of a channel, in SI; without a unit it is in SI already.

    Or with one of other units, by their sizes, the first where there is none.
    """
    from palpate.recordings.recording import UNITS

    found = _NUMBER.match(text)
    units = UNITS[channel] if isinstance(channel, str) else channel
    si = next(iter(units))
    if found is None or (found[2] or si) not in units:
        raise InvalidParameterError(
            f"{option} must be a number and one of {', '.join(units)}, such as 3{list(units)[1]}, "
            f"not {text!r}"
        )
    return float(found[1]) * units[found[2] or si]


def positive(
    option: str, text: str | None, channel: str | Mapping[str, float], most: float
) -> float | None:
    """A quantity above zero and at most so much, SI; None where it was not given."""
    from palpate.validation import number_in

    if text is None:
        return None
    return number_in(option, quantity(option, text, channel), 0.0, most, open_low=True)


def quantities(options: Any, **channels: str) -> dict[str, float]:
    """Those of some options that were given, in SI, each in the units of a channel."""
    return {
        name: quantity(f"--{name.replace('_', '-')}", text, channel)
        for name, channel in channels.items()
        if (text := getattr(options, name)) is not None
    }


def units_of(option: str, pairs: tuple[str, ...]) -> dict[str, str]:
    """Channels and their units, CHANNEL=UNIT each, or several with commas between them."""
    units = {}
    for pair in (each for given in pairs for each in given.split(",")):
        channel, sign, unit = pair.partition("=")
        if not sign:
            raise InvalidParameterError(
                f"{option} must be CHANNEL=UNIT, such as penetration=mm, not {pair!r}"
            )
        units[channel] = unit
    return units


def tip_of(text: str) -> "Tip":
    """Return the tip of a text such as ``sphere:radius=5mm``.

    Raises
    ------
    InvalidParameterError
        It is not of one of the forms, or a size is out of its range.
    """
    from palpate.quantities.elastic_modulus import Cone, FlatPunch, Sphere

    kind, _, size = text.partition(":")
    name, _, value = (part.strip() for part in size.partition("="))
    option, round_ = f"--tip {kind}:{name}", {"sphere": Sphere, "punch": FlatPunch}
    if kind in round_ and name in ("radius", "diameter"):
        length = quantity(option, value, "penetration")
        return round_[kind](length if name == "radius" else 0.5 * length)
    if kind == "cone" and name in ("angle", "opening"):
        found = _ANGLE.match(value)  # without its unit 1.2 might be either
        if found is None:
            raise InvalidParameterError(f"{option} must be such as 30deg or 0.52rad, not {value!r}")
        angle = float(found[1]) if found[2] == "rad" else math.radians(float(found[1]))
        return Cone(angle if name == "angle" else 0.5 * angle)
    raise InvalidParameterError(f"--tip must be such as {_FORMS}, not {text!r}")
