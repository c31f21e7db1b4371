"""The options of the preparation of a contact, each described once: for Python and for --help."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

# Only here, because --help shows these texts and answers without NumPy.
if TYPE_CHECKING:
    from palpate.contact import Delay
    from palpate.settings import ForceFrame
    from palpate.wrench.payload import Payload

LARGEST_RATE = 1e9  # samples a second
RADIUS = 2e-3  # m; as in published recordings that were cut by hand

SurfaceRule = Literal["threshold", "baseline", "fit", "estimate"]


class Option(NamedTuple):
    """The description of one argument of :func:`palpate.prepare`.

    ``text`` begins the docstring and --help; then come ``detail`` and ``command``, which only
    Python or only the command line needs, and the default. ``limits`` are those of a number, of
    which ``above`` excludes the lower one.
    """

    kind: str
    text: str
    detail: str = ""
    default: str = ""
    command: str = ""
    limits: tuple[float, float] | None = None
    above: bool = False

    @property
    def docstring(self) -> str:
        """The description for Python."""
        default = f"Default: {self.default}." if self.default else ""
        return " ".join(filter(None, (f"{self.text}.", self.detail, default)))

    @property
    def help(self) -> str:
        """The description for the command line, without the marks of a docstring."""
        default = f" (default: {self.default})" if self.default else ""
        text = f"{self.text}{self.command}{default}."
        return text.replace('``"', "").replace('"``', "").replace("−", "-")


@dataclass(frozen=True, kw_only=True, slots=True)
class Options:
    """The options of :func:`palpate.prepare`, which describes each."""

    velocity_window: Annotated[
        "float | None",
        Option(
            "float, optional",
            "Window of a parabola for the velocity, s, if there is no velocity",
            "The spline is as noisy as a parabola through 15 samples, at most 15 ms, at least 5 "
            "samples.",
            default="a smoothing spline",
            command=", such as 30ms",
        ),
    ] = None
    flip: Annotated[
        "Sequence[str]",
        Option(
            "sequence of str",
            'Channels whose sign is reversed: ``"force"``, ``"penetration"``, or both',
        ),
    ] = ()
    tare: Annotated[
        'tuple[float, float] | Literal["find"] | None',
        Option(
            'tuple of float or "find", optional',
            'Subtract the mean force in detected free air and a significant drift (``"find"``), or '
            "the mean force between two times without contact, s",
            default="none for a penetration; find for a position, if there is free air",
            command=", such as 0:2",
        ),
    ] = None
    delay: Annotated[
        'float | tuple[float, float] | Delay | Literal["find"]',
        Option(
            'float, tuple of float or "find"',
            "Delay of the force behind the position, s, which is shifted earlier by it, also with "
            'its standard error; or ``"find"``: the shift by which a Hunt–Crossley law fits best',
            "(delay, error); negative if the force is early. :func:`palpate.skew` measures it. The "
            "damping's error bar includes its error.",
            default="0, with a standard error of half a sample",
            command=", such as 5ms or 5ms+-0.2ms",
        ),
    ] = 0.0
    surface: Annotated[
        "float | SurfaceRule | None",
        Option(
            "float or str, optional",
            'How to find the surface: ``"threshold"``, ``"baseline"``, ``"fit"``, or '
            '``"estimate"``, by the estimator; or its position in the corrected penetration, m',
            ":func:`palpate.preparation.surface.find_surface` has the rules; the estimator begins "
            "at that of fit, if zero is far from it.",
            default="0 for a penetration, fit for a position",
            command=", such as 0.7mm",
        ),
    ] = None
    normal: Annotated[
        "str | Sequence[float] | None",
        Option(
            "str or sequence of float, optional",
            "Direction out of the material, in the frame of the position: x, y, z, -x, -y, -z or "
            "three numbers",
            default="the mean direction of the force, weighted by magnitude",
        ),
    ] = None
    force_frame: Annotated[
        "ForceFrame | None",
        Option(
            '"tool" or "base", optional',
            'Frame of the force: ``"tool"``, rotated by the orientation, or ``"base"``, that of '
            "the position",
            default="from the recording, else found",
        ),
    ] = None
    tool_weight: Annotated[
        "float | None",
        Option(
            "float, optional",
            "Weight of the tool to subtract, N, along −z of the position's frame",
            "With an orientation palpate finds the weight itself, and fails if the log contradicts "
            "this one.",
            command=", such as 1.2N",
            limits=(0.0, 1e6),
        ),
    ] = None
    payload: Annotated[
        "Payload | None",
        Option(
            "Payload, optional",
            "Tool and mount of the sensor, from another log in which the tool turns enough",
            "palpate then finds only the bias and the clock.",
            command=": the file of palpate payload --save-config",
        ),
    ] = None
    tip_offset: Annotated[
        "Sequence[float] | None",
        Option(
            "sequence of float, optional",
            "From the origin of the pose, such as a flange, to the tip, in the axes of the pose, m",
            default="the pose is that of the tip, or the tool does not turn in contact",
            command=", such as 3mm,0,140mm",
        ),
    ] = None
    mass: Annotated[
        "float | None",
        Option(
            "float, optional",
            "Mass between force sensor and material, kg; its inertia is subtracted from the force",
            command=", such as 20g",
            limits=(0.0, 1e6),
        ),
    ] = None
    rate: Annotated[
        "float | None",
        Option(
            "float, optional",
            "Sample rate, Hz, of a recording without time",
            limits=(0.0, LARGEST_RATE),
            above=True,
        ),
    ] = None
    no_time: Annotated[
        bool,
        Option(
            "bool",
            "Identify the stiffness alone, of a curve without time or of one whose time is ignored",
            "``time`` counts the samples, as does ``window``.",
            command="; --start and --stop count samples",
        ),
    ] = False
    spot: Annotated[
        float,
        Option(
            "float",
            "Farthest travel of the probe across the normal within one place, m",
            "``math.inf`` never cuts.",
            default="2 mm",
            command=", such as 5mm, or inf",
            limits=(0.0, 1e6),
            above=True,
        ),
    ] = RADIUS
    window: Annotated[
        "tuple[float | None, float | None] | None",
        Option(
            "tuple of float, optional",
            "(start, stop), s: use only these samples; either may be None",
        ),
    ] = None
    strict: Annotated[
        bool,
        Option(
            "bool",
            "Fail on values that are not numbers and on times that do not increase, instead of "
            "excluding and reporting these samples",
            command="; on damaged files too",
        ),
    ] = False


def describe_options(holder: type) -> dict[str, Option]:
    """Return the descriptions of the annotated fields of a class, by name."""
    annotations = {
        name: annotation
        for owner in reversed(holder.__mro__)
        for name, annotation in getattr(owner, "__annotations__", {}).items()
    }
    return {
        name: annotation.__metadata__[0]
        for name, annotation in annotations.items()
        if hasattr(annotation, "__metadata__")
    }


#: The description of each option.
OPTIONS = describe_options(Options)
