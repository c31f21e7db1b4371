"""Settings of the preparation of a contact, and its frames and normals."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from palpate.contact import Delay
from palpate.errors import InvalidParameterError, NoContactError, RecordingError
from palpate.preparation.payload import Payload
from palpate.preparation.resolution import noise_of
from palpate.preparation.roles import Columns
from palpate.preparation.surfaces import RADIUS, SurfaceRule
from palpate.recordings.poses import UNIT_LENGTH, rotate
from palpate.recordings.units import UNITS, unit_size
from palpate.validation import Floats, check_choice, instance, number_in, pair_in, shown, vector_in

FLIPPED = ("force", "penetration")
LONGEST_DELAY = 10.0  # s
LARGEST_RATE = 1e9  # samples a second

ForceFrame = Literal["tool", "base"]


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Preparation:
    """Settings for making a contact from a recording; see :func:`palpate.prepare` for each.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.
    """

    columns: Columns = dataclasses.field(default_factory=Columns)
    velocity_window: float | None = None
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    flip: Sequence[str] = ()
    tare: tuple[float, float] | Literal["find"] | None = None
    delay: float | tuple[float, float] | Delay | Literal["find"] = 0.0
    surface: float | SurfaceRule | None = None
    normal: str | Sequence[float] | None = None
    force_frame: ForceFrame | None = None
    tool_weight: float | None = None
    payload: Payload | None = None
    tip_offset: Sequence[float] | None = None
    mass: float | None = None
    rate: float | None = None
    no_time: bool = False
    spot: float = RADIUS
    window: tuple[float | None, float | None] | None = None
    strict: bool = False

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the window, s; infinite without one."""
        low, high = self.window or (None, None)
        return -math.inf if low is None else low, math.inf if high is None else high

    def __post_init__(self) -> None:
        instance("columns", self.columns, Columns)
        units = {"penetration" if k == "position" else k: unit for k, unit in self.units.items()}
        object.__setattr__(self, "units", units)
        for channel, unit in units.items():
            _check_unit(channel, unit)
        check_flip(self.flip)
        if isinstance(self.tare, str) and self.tare != "find":
            raise InvalidParameterError(
                f"tare must be 'find' or two times (start, stop) in s, not {shown(self.tare)}"
            )
        if not (self.tare is None or isinstance(self.tare, str)):
            pair_in("tare", self.tare, -1e12, 1e12)
        if isinstance(self.delay, str) and self.delay != "find":
            allowed = "'find', a time in s, or a time and its standard error"
            raise InvalidParameterError(f"delay must be {allowed}, not {shown(self.delay)}")
        if not isinstance(self.delay, str):
            check_delay("delay", self.delay)
        if not (self.surface is None or isinstance(self.surface, str)):
            number_in("surface", self.surface, -1e6, 1e6)
        elif self.surface not in (None, *get_args(SurfaceRule)):
            allowed = "a number in m, threshold, baseline, fit or estimate"
            raise InvalidParameterError(f"surface must be {allowed}, not {shown(self.surface)}")
        if self.normal is not None:
            normal_given(self.normal)
        if self.force_frame is not None:
            check_choice("force_frame", self.force_frame, get_args(ForceFrame))
        if self.tool_weight is not None:
            number_in("tool_weight", self.tool_weight, 0.0, 1e6)
        if self.mass is not None:
            number_in("mass", self.mass, 0.0, 1e6)
        if self.payload is not None:
            instance("payload", self.payload, Payload)
            others = {
                "tool_weight": self.tool_weight is not None,
                "mass": self.mass is not None,
                "an interval of tare": isinstance(self.tare, tuple),
                "no_time": self.no_time,
                "force_frame base": self.force_frame == "base",
            }
            for name, given in others.items():
                if given:
                    raise InvalidParameterError(f"payload excludes {name}: leave one of them out")
        if self.tip_offset is not None:
            vector_in("tip_offset", self.tip_offset, 10.0)
        if self.rate is not None:
            number_in("rate", self.rate, 0.0, LARGEST_RATE, open_low=True)
        if self.no_time and (self.rate is not None or self.delay or self.mass):
            raise InvalidParameterError("no_time excludes rate, delay and mass: leave one out")
        number_in("spot", self.spot, 0.0, 1e6, open_low=True)
        if self.window is not None:
            low, high = self.window
            ends = -1e12 if low is None else low, 1e12 if high is None else high
            pair_in("window", ends, -1e12, 1e12)


def _check_unit(channel: str, unit: Any) -> None:
    if channel not in UNITS:
        raise InvalidParameterError(f"units must name {', '.join(UNITS)}, not {shown(channel)}")
    if not isinstance(unit, str) or not unit_size(channel, unit):
        known = list(UNITS[channel])
        allowed = f"one of {', '.join(known)} or a multiple such as 0.0098{known[0]}"
        raise InvalidParameterError(f"unit of the {channel} must be {allowed}, not {shown(unit)}")


def check_delay(
    name: str, given: float | tuple[float, float] | Delay, sample_time: float = math.nan
) -> Delay:
    """Return a delay, s, alone or with its standard error; by default that is half a sample."""
    if isinstance(given, Delay):
        return given
    late, *errors = given if isinstance(given, tuple) else (given,)
    if len(errors) > 1:
        allowed = "a time in s, or a time and its standard error"
        raise InvalidParameterError(f"{name} must be {allowed}, not {shown(given)}")
    number_in(name, late, -LONGEST_DELAY, LONGEST_DELAY)
    if not errors:
        return Delay(late, 0.5 * sample_time)
    return Delay(late, number_in(f"standard error of the {name}", errors[0], 0.0, LONGEST_DELAY))


def check_flip(flip: Sequence[str]) -> set[str]:
    """Check and return the channels whose sign is reversed."""
    names = {flip} if isinstance(flip, str) else set(flip)
    for channel in names:
        if channel not in FLIPPED:
            allowed = " or ".join(FLIPPED)
            raise InvalidParameterError(f"flip must name {allowed}, not {shown(channel)}")
    return names


# Rotation of forces from the tool's frame to the position's frame.


def rotate_to_base(force: Floats, orientation: Floats, source: str = "") -> Floats:
    """Rotate forces from the tool's frame to the base's frame, with the probe's orientation.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        Forces in the tool's frame.
    orientation : numpy.ndarray, shape (k, 4)
        Quaternions x, y, z, w.

    Raises
    ------
    RecordingError
        The orientations are not quaternions: their norm is not 1.
    """
    return rotate(force, unit_quaternions(orientation, source))


def are_quaternions(orientation: Floats) -> bool:
    """Whether nine of ten norms are 1, to rounding and interpolation."""
    length = np.linalg.norm(orientation, axis=1)
    return float((np.abs(length - 1.0) > UNIT_LENGTH).mean()) <= 0.1


def unit_quaternions(orientation: Floats, source: str = "") -> Floats:
    """Return an orientation with norms of 1.

    Raises
    ------
    RecordingError
        The orientations are not quaternions: their norm is not 1.
    """
    length = np.linalg.norm(orientation, axis=1)
    if not are_quaternions(orientation):
        words = f"its norm is {float(np.nanmedian(length)):.3g}, not 1"
        words = f"the orientation is not a quaternion x, y, z, w: {words}"
        raise RecordingError.of(source, f"{words}; choose its channels with --orientation")
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: Floats = orientation / length[:, None]
    return unit


# The contact normal: given as an axis or a vector, or found from the forces.

AXES = {
    f"{sign}{axis}": float(f"{sign}1") * row
    for axis, row in zip("xyz", np.eye(3), strict=True)
    for sign in ("", "+", "-")
}
NOISES_OF_TOUCH = 6.0  # σ of the norm of the force: a larger change is a touch
FEWEST_TO_DEPEND, LEAST_EXPLAINED, TINY = 20, 0.05, 1e-300
NOISES = 10.0  # σ of the norm of the force; the direction of smaller forces is not used


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """The contact normal: the direction in which the material pushes the probe.

    Attributes
    ----------
    vector : numpy.ndarray, shape (3,)
        Unit vector out of the material, in the frame of the position.
    spread : float
        Angle between forces and normal, rad, rms weighted by force; 0 for a given normal.
    turned : bool
        Whether the forces act on the material, so that their sign must be reversed.
    """

    vector: Floats
    spread: float = 0.0
    turned: bool = False

    def __str__(self) -> str:
        x, y, z = self.vector
        words = f"({x:.4g}, {y:.4g}, {z:.4g})"
        return f"{words} ± {math.degrees(self.spread):.1f}°" if self.spread else words


def normal_given(given: str | Sequence[float]) -> Normal:
    """Parse a given normal: ``"z"``, ``"-z"``, ``"0.8,0.25,0.54"`` or three numbers.

    Raises
    ------
    InvalidParameterError
        The value has another form, or is zero.
    """
    if isinstance(given, str) and (axis := AXES.get(given.strip().lower())) is not None:
        return Normal(axis)
    try:
        parts = given.split(",") if isinstance(given, str) else given
        vector = np.array([float(part) for part in parts])
        if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
            raise ValueError
    except (TypeError, ValueError):
        allowed = "x, y, z, -x, -y, -z or three numbers such as 0.8,0.25,0.54"
        raise InvalidParameterError(f"normal must be {allowed}, not {shown(given)}") from None
    vector = vector / np.abs(vector).max()  # the norm of large numbers overflows
    return Normal(vector / np.linalg.norm(vector))


def normal_found(force: Floats, position: Floats, source: str = "") -> Normal:
    """Find the contact normal: the mean direction of the force, weighted by magnitude.

    n = Σ |F| F / |Σ |F| F|,  spread² = Σ |F|² ∠(F, n)² / Σ |F|²

    A force that grows as the probe moves *against* n acts on the probe, as it should; one that
    grows as the probe moves *along* n acts on the material.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        N, in the frame of the position, tared if possible.
    position : numpy.ndarray, shape (k, 3)
        m.
    source : str
        Name of the file for messages.

    Raises
    ------
    NoContactError
        No force exceeds the noise.
    RecordingError
        The forces have no common direction, or too few samples.
    """
    known = np.isfinite(force).all(axis=1) & np.isfinite(position).all(axis=1)
    if not known.any():
        words = "no sample has both a position and a force; if the rows join several topics, name "
        raise RecordingError.of(source, f"{words}the column of their times with --time")
    f, p = force[known], position[known]
    size = np.linalg.norm(f, axis=1)
    noise = math.sqrt(sum(noise_of(component) ** 2 for component in f.T))
    firm = size > NOISES * noise
    if not firm.any():
        if depends_on_position(f, p):
            raise no_normal(source, f"no force is {NOISES:g} times its noise")
        remedy = "if the probe touches, pass the normal, such as --normal z"
        raise NoContactError.of(source, f"no contact found: no force exceeds the noise; {remedy}")
    total = (f[firm] * size[firm, None]).sum(axis=0)
    length = float(np.linalg.norm(total))
    if not 0.0 < length < math.inf:
        raise no_normal(source, "the forces have no common direction")
    n = total / length
    across = np.linalg.norm(np.cross(f[firm], n), axis=1)
    angle = np.arctan2(across, f[firm] @ n)
    weight = size[firm] ** 2
    spread = math.sqrt(float((weight * angle**2).sum() / weight.sum()))
    if grows(p @ n, f @ n):
        return Normal(-n, spread, turned=True)
    return Normal(n, spread)


def no_normal(source: str, why: str) -> RecordingError:
    """Return the error for a recording whose contact normal cannot be found."""
    remedy = "pass it, such as --normal z"
    return RecordingError.of(source, f"{why}, so palpate cannot find the contact normal; {remedy}")


def depends_on_position(force: Floats, position: Floats) -> bool:
    """Whether a force depends on the position or its changes: then the probe touches.

    A motion with few samples per period looks like noise. R² of white noise on m terms is about
    m/k, and less than 4 m/k.
    """
    f, p = force.reshape(len(force), -1), position.reshape(len(position), -1)
    known = np.isfinite(f).all(axis=1) & np.isfinite(p).all(axis=1)
    f, p = f[known], p[known]
    if len(f) < FEWEST_TO_DEPEND:
        return False
    terms = np.hstack([p, (p - p.mean(axis=0)) ** 2, np.gradient(p, axis=0)])
    rounding = len(f) * (1e-12 * np.abs(f).max(axis=0)) ** 2  # what a constant axis is left with
    f, terms = f - f.mean(axis=0), terms - terms.mean(axis=0)
    terms = terms / np.maximum(np.abs(terms).max(axis=0), TINY)
    left = f - terms @ np.linalg.lstsq(terms, f, rcond=1e-9)[0]
    total = (f**2).sum(axis=0)
    explained = (total - (left**2).sum(axis=0)) / np.maximum(total, rounding + TINY)
    return bool(explained.max() > LEAST_EXPLAINED + 4.0 * terms.shape[1] / len(f))


def never_touches(force: Floats, position: Floats) -> bool:
    """Whether a force, tared or not, is constant within its noise, wherever the probe is."""
    f = force.reshape(len(force), -1)
    known = f[np.isfinite(f).all(axis=1)]
    if not len(known):
        return False
    noise = math.sqrt(sum(noise_of(component) ** 2 for component in known.T))
    changes = np.linalg.norm(known - np.median(known, axis=0), axis=1)
    constant = not (changes > NOISES_OF_TOUCH * noise).any()
    return constant and not depends_on_position(force, position)


def grows(position: Floats, force: Floats) -> bool:
    """Whether the force grows with the position.

    It compares changes over five samples, not values: a probe that travels over a hill moves up and
    down without pressing.
    """
    if len(force) < 20:
        steps = np.diff(position), np.diff(force)
    else:
        smooth = np.ones(5) / 5.0
        moved, felt = (np.convolve(each, smooth, "valid") for each in (position, force))
        steps = moved[5:] - moved[:-5], felt[5:] - felt[:-5]
    return float(np.sum(steps[0] * steps[1])) > 0.0
