"""The options of the preparation of a contact, described once: for Python and for --help."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

# Only here, because --help shows these texts and answers without NumPy.
if TYPE_CHECKING:
    from palpate.input.wrench.payload import Payload
    from palpate.method.contact import Delay
    from palpate.method.settings import ForceFrame

RADIUS = 2e-3  # m; as in published recordings that were cut by hand

SurfaceRule = Literal["threshold", "baseline", "fit", "estimate"]


@dataclass(frozen=True, slots=True, kw_only=True)  # help shows it without NumPy
class Options:
    """The options of :func:`palpate.prepare`.

    Its docstring and the command line's --help take each description from here.

    Parameters
    ----------
    velocity_window : float, optional
        Window of a parabola for the velocity, s, if there is no velocity. Default: a smoothing
        spline. It is as noisy as a parabola through 15 samples, at most 15 ms, at least 5 samples.
    flip : sequence of str
        Channels whose sign is reversed: ``"force"``, ``"penetration"``, or both.
    tare : tuple of float or "find", optional
        Subtract the mean force between two times without contact, s, or with ``"find"`` in
        detected free air, and a significant drift. Default: none for a penetration; find for a
        position, if there is free air.
    delay : float, tuple of float or "find"
        Delay of the force behind the position, s, alone or with its standard error; ``"find"``:
        the shift by which a Hunt–Crossley law fits best. Default: 0, with a standard error of half
        a sample. The force is shifted earlier by it; the damping's error bar includes its error.
        :func:`palpate.skew` measures it.
    surface : float or str, optional
        Position of the surface, m, in the corrected penetration, or how to find it:
        ``"threshold"``, ``"baseline"``, ``"fit"`` or ``"estimate"``, by the estimator. Default: 0
        for a penetration, fit for a position. The rules are those of
        :func:`palpate.input.preparation.surface.find_surface`; the estimator begins at that of
        ``"fit"`` if zero is far from it.
    normal : str or sequence of float, optional
        Direction out of the material, in the frame of the position: x, y, z, -x, -y, -z or three
        numbers. Default: the mean direction of the force, weighted by magnitude.
    force_frame : "tool" or "base", optional
        Frame of the force: ``"tool"``, rotated by the orientation, or ``"base"``, that of the
        position. Default: from the recording, else found.
    tool_weight : float, optional
        Weight of the tool to subtract, N, along -z of the position's frame. Default: with an
        orientation palpate finds it, else none. It fails if the log contradicts this one.
    payload : Payload, optional
        Tool and mount of the sensor, found from another log in which the tool turns enough.
        Default: found from this log. With it palpate finds only the bias and the clock.
    tip_offset : sequence of float, optional
        From the origin of the pose, such as a flange, to the tip, in the axes of the pose, m.
        Default: the pose is that of the tip, or the tool does not turn in contact.
    mass : float, optional
        Mass between force sensor and material, kg; its inertia is subtracted from the force.
    rate : float, optional
        Sample rate, Hz, of a recording without time.
    no_time : bool
        Identify the stiffness alone, of a curve without time, or of one whose time is ignored.
        ``time`` and ``window`` count the samples.
    spot : float
        Farthest travel of the probe across the normal within one place, m, or inf. Default: 2 mm.
    window : tuple of float, optional
        (start, stop), s: use only these samples; either may be None.
    strict : bool
        Fail on values that are not numbers and on times that do not increase. Default: exclude
        these samples and report them.
    """

    velocity_window: float | None = None
    flip: Sequence[str] = ()
    tare: tuple[float, float] | Literal["find"] | None = None
    delay: "float | tuple[float, float] | Delay | Literal['find']" = 0.0
    surface: float | SurfaceRule | None = None
    normal: str | Sequence[float] | None = None
    force_frame: "ForceFrame | None" = None
    tool_weight: float | None = None
    payload: "Payload | None" = None
    tip_offset: Sequence[float] | None = None
    mass: float | None = None
    rate: float | None = None
    no_time: bool = False
    spot: float = RADIUS
    window: tuple[float | None, float | None] | None = None
    strict: bool = False


def describe_option(name: str, example: str = "") -> str:
    """Return the description of an option for --help: up to its default, without quotation.

    ``example`` stands before the default.
    """
    entry = re.search(rf"\n    {name} : .*\n((?: {{8}}.*\n)+)", Options.__doc__ or "")
    text = " ".join(entry[1].split()) if entry else ""
    text, _, default = re.sub('``"?|"?``', "", text).partition(" Default: ")
    default = default.partition(". ")[0].rstrip(".")
    return f"{text.rstrip('.')}{example}{f' (default: {default})' if default else ''}."
