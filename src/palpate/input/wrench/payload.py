"""The payload of a force-torque sensor: tool, mount, zero and clock, from one log of its wrench."""

import dataclasses
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from palpate.digits import rounded, with_error
from palpate.errors import RecordingError
from palpate.findings import MARKS, Finding, Mark, spoken, worst
from palpate.input.channels.frames import cross, interpolate_columns
from palpate.input.recordings.units import GRAVITY
from palpate.validation import Floats, frozen
from palpate.writing import as_toml, write_text

VERSION = 1  # of the fields
TENSOR = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])  # of xx, yy, zz, xy, xz, yz
LARGEST = 1_000_000  # bytes; a payload has 2 kB, and 150 bytes for each knot of its drift
_ERRORS = ("_error", "turn", "share", "free_time")  # ends of the names of what may be unknown
_MARKS = ("mass_mark", "mount_mark", "delay_mark")


def _unknown_vector() -> Floats:
    return np.full(3, math.nan)


@frozen(eq=False)
class Payload:
    """The tool on a wrist sensor, the mount of the sensor, and its reading without contact.

    With the specific force g = Rᵀ(g₀ − p̈), the angular velocity ω and the angular acceleration α
    of the pose, turned to the axes of the sensor by the mount, the wrench in free air is

        f = m g' − (α× + ω×ω×) m c + b_f,   τ = m c × g' − (I α + ω × I ω) + b_τ

    with g' = g − (α× + ω×ω×) d at the sensor, the mass m, the centre of mass c, the lever d, the
    inertia I and the bias b. ``sign`` times the recorded wrench obeys it; the remainder is the
    force of the material on the tool.

    Parameters
    ----------
    mass : float
        kg.
    centre : numpy.ndarray, shape (3,)
        Centre of mass from the origin of the sensor, in its axes, m.
    mount : numpy.ndarray, shape (3, 3)
        Rotation of the sensor in the flange, the frame of the pose: v_flange = mount · v_sensor.
    bias : numpy.ndarray, shape (6,)
        Mean wrench of the unloaded sensor, in its axes, N and N·m.
    inertia : numpy.ndarray, shape (6,), or None
        xx, yy, zz, xy, xz, yz about the origin of the sensor, in its axes, kg·m²; None if the tool
        does not turn.
    lever : numpy.ndarray, shape (3,)
        From the origin of the pose to that of the sensor, in the axes of the sensor, m.
    delay : float
        s, positive if the wrench is late behind the pose.
    sign : float
        −1 if the sensor reads the force that the tool exerts, else 1.
    bias_times : numpy.ndarray, shape (k,)
        Times of the drift, s, on the clock of the wrench; empty without drift.
    bias_changes : numpy.ndarray, shape (k, 6)
        Wrench that is added to the mean bias at these times, N and N·m; linear in between.
    mass_error : float
        Standard error, kg.
    centre_error, mount_error, lever_error : numpy.ndarray, shape (3,)
        Standard errors, m, rad (about the axes of the sensor) and m.
    bias_error : numpy.ndarray, shape (6,)
        Standard errors, N and N·m.
    inertia_error : numpy.ndarray, shape (6,), or None
        Standard errors, kg·m².
    delay_error : float
        Standard error, s.
    turn : float
        Largest angle between the directions of gravity in free air, in the axes of the sensor, rad.
    axes : int
        Number of axes about which gravity turns: 0, 1 or 2.
    free_share : float
        Fraction of the log in free air.
    free_time : float
        Time in free air, s.
    mass_mark, mount_mark, delay_mark : str
        ``"trust"``, ``"with-care"`` or ``"do-not-trust"``.
    findings : tuple of Finding
        Reasons for the marks, with the remedy.
    version : int
        Version of these fields in a file.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> tool = palpate.Payload(
    ...     mass=0.5, centre=np.array([0.0, 0.0, 0.04]), mount=np.eye(3), bias=np.zeros(6)
    ... )
    >>> tool.save("tool.toml")
    >>> palpate.Payload.load("tool.toml").mass
    0.5
    """

    #: Standard acceleration of free fall, m/s².
    gravity: ClassVar[float] = GRAVITY
    mass: float
    centre: Floats
    mount: Floats
    bias: Floats
    inertia: Floats | None = None
    lever: Floats = field(default_factory=lambda: np.zeros(3))
    delay: float = 0.0
    sign: float = 1.0
    bias_times: Floats = field(default_factory=lambda: np.zeros(0))
    bias_changes: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    mass_error: float = math.nan
    centre_error: Floats = field(default_factory=_unknown_vector)
    mount_error: Floats = field(default_factory=_unknown_vector)
    lever_error: Floats = field(default_factory=_unknown_vector)
    bias_error: Floats = field(default_factory=lambda: np.full(6, math.nan))
    inertia_error: Floats | None = None
    delay_error: float = math.nan
    turn: float = math.nan
    axes: int = 0
    free_share: float = math.nan
    free_time: float = math.nan
    mass_mark: Mark = "trust"
    mount_mark: Mark = "trust"
    delay_mark: Mark = "trust"
    findings: tuple[Finding, ...] = ()
    version: int = 1

    def __repr__(self) -> str:
        mass = with_error(self.mass, self.mass_error, unit="kg")
        centre = ", ".join(rounded(1e3 * each, 3) for each in self.centre.tolist())
        late = with_error(1e3 * self.delay, 1e3 * self.delay_error, unit="ms")
        marks = f"mass {spoken(self.mass_mark)}, mount {spoken(self.mount_mark)}"
        return f"<Payload of {mass} at ({centre}) mm; force {late} late; {marks}>"

    @property
    def mark(self) -> Mark:
        """The worst of the marks of mass, mount and delay."""
        return worst(self.mass_mark, self.mount_mark, self.delay_mark)

    def wrench(
        self, specific_force: Floats, angular_velocity: Floats, angular_acceleration: Floats
    ) -> Floats:
        """Return the wrench of weight and inertia in the axes of the sensor, without the bias.

        Parameters
        ----------
        specific_force, angular_velocity, angular_acceleration : numpy.ndarray, shape (k, 3)
            In the axes of the flange: m/s², rad/s and rad/s².

        Returns
        -------
        numpy.ndarray, shape (k, 6)
            N and N·m.
        """
        g, w, a = (
            np.asarray(vectors) @ self.mount
            for vectors in (specific_force, angular_velocity, angular_acceleration)
        )
        inertia = self.parameters[4:10][TENSOR]
        moment = self.mass * self.centre

        def swing(arm: Floats) -> Floats:
            """−(α× + ω×ω×) arm."""
            turned: Floats = -cross(a, arm) - cross(w, cross(w, arm))
            return turned

        at_sensor = g + swing(self.lever)
        force = self.mass * at_sensor + swing(moment)
        torque = cross(moment, at_sensor) - a @ inertia - cross(w, w @ inertia)
        return np.hstack([force, torque])

    def unload(self, force: Floats, time: Floats, motion: Floats) -> Floats:
        """Return a force, shape (k, 3), less weight, inertia and bias, by a motion, shape (k, 9+).

        It is in the axes of the sensor, with the sign of the payload, at times of the log that the
        bias was found from.
        """
        load = self.wrench(motion[:, :3], motion[:, 3:6], motion[:, 6:9]) + self.bias_at(time)
        rest: Floats = force - load[:, :3]
        return rest

    @property
    def parameters(self) -> Floats:
        """Mass, m c, inertia and m d, in which the wrench is linear, shape (13,)."""
        inertia = np.zeros(6) if self.inertia is None else self.inertia
        moment = self.mass * self.centre
        return np.concatenate([[self.mass], moment, inertia, self.mass * self.lever])

    def bias_at(self, time: Floats) -> Floats:
        """Return the bias at some times of the log that it was found from, shape (k, 6)."""
        bias: Floats = np.tile(self.bias, (len(time), 1))
        if len(self.bias_times):
            bias += interpolate_columns(time, self.bias_times, self.bias_changes)
        return bias

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as numbers, lists and dictionaries."""
        values = {entry.name: getattr(self, entry.name) for entry in dataclasses.fields(self)}
        for name, value in values.items():
            if isinstance(value, np.ndarray | np.generic):
                values[name] = value.tolist()
        findings = [finding.as_dict() for finding in self.findings]
        values["findings"] = [{k: v for k, v in f.items() if v is not None} for f in findings]
        return values

    def save(self, path: Path, comments: Sequence[str] = (), inputs: Sequence[Path] = ()) -> None:
        """Write the payload to a TOML file, which :meth:`load` reads, completely or not at all.

        Parameters
        ----------
        path : Path
            The file.
        comments : sequence of str
            Lines for people. Default: none.
        inputs : sequence of Path
            Files that must not be overwritten. Default: none.
        """
        values = {name: value for name, value in self.as_dict().items() if value is not None}
        lines = ["payload of a force-torque sensor, SI units", *comments]
        write_text(Path(path), as_toml(values, lines), inputs)

    @classmethod
    def load(cls, path: Path) -> "Payload":
        """Read a payload that :meth:`save` or ``palpate payload LOG --save-config`` wrote.

        Parameters
        ----------
        path : Path
            The file.

        Raises
        ------
        RecordingError
            The file cannot be read, or is no payload.
        """
        try:
            with Path(path).open("rb") as file:
                content = file.read(LARGEST + 1)
            if len(content) > LARGEST:
                raise ValueError(f"it has more than {LARGEST} bytes")
            return _payload_of(tomllib.loads(content.decode()))
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or 'cannot be read'}") from None
        except (ValueError, RecursionError) as error:
            remedy = "palpate payload LOG --save-config FILE writes one"
            raise RecordingError(f"{path}: not a payload in TOML: {error}; {remedy}") from None


def _payload_of(values: Mapping[str, Any]) -> Payload:
    """Return the payload of the values in a file; raise ValueError if one is wrong."""
    fields = {entry.name: entry for entry in dataclasses.fields(Payload)}
    if unknown := sorted(values.keys() - fields.keys()):
        raise ValueError(f"unknown field {unknown[0]!r}")
    for name, entry in fields.items():
        required = entry.default is entry.default_factory is dataclasses.MISSING
        if (required or name == "version") and name not in values:
            raise ValueError(f"field {name!r} is missing")
    if values["version"] != VERSION:
        raise ValueError(f"version {values['version']!r} is not {VERSION}")
    arguments = dict[str, Any]()
    for name, value in values.items():
        try:
            arguments[name] = _parse_field(name, value)
        except (KeyError, TypeError, ValueError, OverflowError):
            raise _wrong(name, value) from None
    payload = Payload(**arguments)
    orthogonal = np.abs(payload.mount @ payload.mount.T - np.eye(3)).max() < 1e-6
    knots = len(payload.bias_times) == len(payload.bias_changes)
    conditions = {
        "mass": payload.mass >= 0.0,
        "mount": orthogonal and np.linalg.det(payload.mount) > 0.0,
        "sign": abs(payload.sign) == 1.0,
        "bias_times": knots and (np.diff(payload.bias_times) > 0.0).all(),
    }
    for name, holds in conditions.items():
        if not holds:
            raise _wrong(name, values.get(name))
    return payload


def _wrong(name: str, value: Any) -> ValueError:
    return ValueError(f"{name} is {str(value)[:80]!r}")


def _parse_field(name: str, value: Any) -> Any:
    """Return one field as its type; raise if it has another one."""
    if name == "findings":
        return tuple(Finding.from_dict(finding) for finding in value)
    if name in _MARKS:
        return MARKS[MARKS.index(value)]
    if name in ("version", "axes"):
        return int(value)
    shape = np.shape(getattr(_TEMPLATE, name))
    array = np.array(value, dtype=np.float64)
    if name == "bias_changes" and array.size == 0:
        array = array.reshape(0, 6)
    any_length = 0 in shape and array.ndim == len(shape) and array.shape[1:] == shape[1:]
    fits = array.shape == shape or any_length
    if not fits or not (name.endswith(_ERRORS) or np.isfinite(array).all()):
        raise ValueError
    return array if shape else float(array)


#: A payload of arrays with their shapes; 0 is any length.
_TEMPLATE = Payload(
    0.0, np.zeros(3), np.eye(3), np.zeros(6), np.zeros(6), inertia_error=np.zeros(6)
)
