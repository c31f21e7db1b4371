"""Frames: rotations, and poses that a recording states as transforms, matrices or angles.

A quaternion x, y, z, w rotates a vector v to v + w c + u × c with u = (x, y, z) and c = 2 u × v.
"""

import math
import re
from collections import defaultdict, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Literal, TypeAlias, get_args

import numpy as np

from palpate.errors import RecordingError, list_names
from palpate.findings import Check, Finding, Severity
from palpate.input.recordings.recording import Recording
from palpate.method.rows import count_true, row_norms, typical_step
from palpate.validation import Floats, Integers, Mask, Values, check_choice, frozen

UNIT_LENGTH = 0.02  # deviation of a quaternion's norm from 1 by rounding and interpolation
GAP = 10.0  # median steps: palpate does not interpolate across longer ones
FARTHEST = 1e30  # m; a translation beyond it comes from a bit error
MOST_EXCLUDED = 0.02  # fraction of the rows of a transform; more is a finding with care
_SHOWN = 8  # frames of a chain in a message


INVERSE = (-1.0, -1.0, -1.0, 1.0)  # times a quaternion x, y, z, w
_NO_TURN = np.array([[0.0, 0.0, 0.0, 1.0]])


def cross(a: Floats, b: Floats) -> Floats:
    """Return a × b of each row, as ``numpy.cross``, in a third of its time for few rows."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        product[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return product


def rotate(vectors: Floats, quaternions: Floats) -> Floats:
    """Rotate vectors, shape (k, 3), by unit quaternions, shape (k, 4)."""
    axis = quaternions[..., :3]
    across = 2.0 * cross(axis, vectors)
    rotated: Floats = vectors + quaternions[..., 3:] * across + cross(axis, across)
    return rotated


def multiply(left: Floats, right: Floats) -> Floats:
    """Return the quaternions that rotate by ``right`` first and by ``left`` then."""
    u, v = left[..., :3], right[..., :3]
    a, b = left[..., 3:], right[..., 3:]
    scalar = a * b - (u * v).sum(axis=-1, keepdims=True)
    return np.concatenate([a * v + b * u + cross(u, v), scalar], axis=-1)


def align_signs(quaternions: Floats) -> Floats:
    """Return the same rotations with signs that do not jump: q and −q are one rotation."""
    turns = (quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0
    return quaternions * np.cumprod(np.concatenate([[1.0], 1.0 - 2.0 * turns]))[:, None]


def interpolate_columns(at: Floats, time: Floats, columns: Floats) -> Floats:
    """Interpolate columns, shape (k, m), linearly."""
    return np.column_stack([np.interp(at, time, column) for column in columns.T])


def interpolate_rotation(at: Floats, time: Floats, quaternions: Floats) -> Floats:
    """Interpolate unit quaternions with aligned signs by slerp: sin((1−s) θ) q₀ + sin(s θ) q₁."""
    k = np.clip(np.searchsorted(time, at, "right"), 1, time.size - 1)
    start = quaternions[k - 1]
    end = quaternions[k]
    s = ((at - time[k - 1]) / (time[k] - time[k - 1]))[:, None]
    angle = np.arccos(np.clip((start * end).sum(axis=1, keepdims=True), -1.0, 1.0)) / np.pi
    mixed = (1.0 - s) * np.sinc((1.0 - s) * angle) * start + s * np.sinc(s * angle) * end
    unit: Floats = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return unit


def lie_between_samples(at: Values, time: Values) -> Mask:
    """Whether each time lies between two samples of a clock without a gap between them."""
    step = typical_step(time)
    after = np.searchsorted(time, at)
    high = time[np.minimum(after, time.size - 1)]
    low = time[np.maximum(after - 1, 0)]
    inside = (after > 0) & (after < time.size) & (high - low <= GAP * step)
    result: Mask = inside | ((after < time.size) & (high == at))
    return result


def _quaternion_of_matrix(m: Floats) -> Floats:
    """Quaternions of rotation matrices, shape (3, 3, k); the best conditioned of four formulas."""
    (a, b, c), (d, e, f), (g, h, i) = m
    forms = [
        (1.0 + a - e - i, b + d, c + g, h - f),
        (b + d, 1.0 - a + e - i, f + h, c - g),
        (c + g, f + h, 1.0 - a - e + i, d - b),
        (h - f, c - g, d - b, 1.0 + a + e + i),
    ]
    stacked = np.array(forms).transpose(0, 2, 1)
    norms = np.linalg.norm(stacked, axis=2)
    best = np.argmax(np.nan_to_num(norms), axis=0), np.arange(m.shape[2])
    return align_signs(stacked[best] / norms[best][:, None])


def quaternion_of_vector(vectors: Floats) -> Floats:
    """Return the quaternions of rotation vectors: axis times angle, rad."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    axis = 0.5 * np.sinc(angle / (2.0 * np.pi)) * vectors
    return align_signs(np.concatenate([axis, np.cos(0.5 * angle)], axis=1))


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
    length = row_norms(orientation)
    return float((np.abs(length - 1.0) > UNIT_LENGTH).mean()) <= 0.1


def unit_quaternions(orientation: Floats, source: str = "") -> Floats:
    """Return an orientation with norms of 1.

    Raises
    ------
    RecordingError
        The orientations are not quaternions: their norm is not 1.
    """
    length = row_norms(orientation)
    if not are_quaternions(orientation):
        raise RecordingError.of(
            source,
            "the orientation is not a quaternion x, y, z, w: its norm is "
            f"{float(np.nanmedian(length)):.3g}, not 1; choose its channels with --orientation",
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: Floats = orientation / length[:, None]
    return unit


def add_channels(recording: Recording, channels: Mapping[str, Values], origin: str) -> Recording:
    """Return the recording with channels on the clock and in the frame of one of its channels."""
    clock, frame = recording.clocks.get(origin), recording.frames.get(origin)
    clocks = {} if clock is None else dict.fromkeys(channels, clock)
    frames = {} if frame is None else dict.fromkeys(channels, frame)
    return replace(
        recording,
        channels={**recording.channels, **channels},
        clocks={**recording.clocks, **clocks},
        frames={**recording.frames, **frames},
    )


OrientationForm = Literal["rpy", "rotation-vector"]
_ROLL = re.compile(r"(?<![^\W\d_])roll(?![^\W\d_])", re.I)
_DEGREES = re.compile(r"°|(?<![^\W\d_])deg(?:rees?)?(?![^\W\d_])", re.I)
LARGEST_ANGLE = 1.05 * 2.0 * math.pi  # rad; larger ones are degrees


def find_roll_pitch_yaw(names: Iterable[str]) -> list[tuple[str, ...]]:
    """Find the channels that differ only in the words roll, pitch and yaw."""
    channels = {*names}
    vectors: list[tuple[str, ...]] = []
    for name in sorted(channels):
        for roll in _ROLL.finditer(name):
            words = ["pitch", "yaw"]
            if roll[0][0].isupper():
                words = [w.upper() if roll[0].isupper() else w.capitalize() for w in words]
            pitch, yaw = (f"{name[: roll.start()]}{word}{name[roll.end() :]}" for word in words)
            if pitch in channels and yaw in channels:
                vectors.append((name, pitch, yaw))
    return vectors


def add_quaternion(
    recording: Recording, angles: Sequence[str], form: OrientationForm | None
) -> tuple[Recording, tuple[str, ...], Finding]:
    """Add the quaternions of three angles, R = Rz(yaw) Ry(pitch) Rx(roll), or rotation vectors.

    Returns
    -------
    tuple
        The recording, the channels of the quaternions, and the convention that was used.

    Raises
    ------
    RecordingError
        The form of the angles is neither given nor stated by their names.
    """
    listed = ", ".join(angles)
    if form is None and find_roll_pitch_yaw(angles):
        form = "rpy"
    if form is None:
        raise RecordingError.of(
            recording.source,
            f"the orientation {listed} has three channels; pass --orientation-form rpy for roll, "
            "pitch, yaw about the fixed axes x, y, z, or --orientation-form rotation-vector for "
            "axis times angle",
        )
    check_choice("orientation_form", form, get_args(OrientationForm))
    values = np.column_stack([recording.numbers(name) for name in angles])
    unit = recording.unit_of(angles[0]) or angles[0]
    degrees = bool(_DEGREES.search(unit)) or float(np.nanmax(np.abs(values))) > LARGEST_ANGLE
    values = np.radians(values) if degrees else values
    if form == "rpy":
        roll, pitch, yaw = (quaternion_of_vector(values * axis) for axis in np.eye(3))
        turns = align_signs(multiply(multiply(yaw, pitch), roll))
        meaning = "angles about the fixed axes x, y, z, in this order"
    else:
        turns = quaternion_of_vector(values)
        meaning = "a rotation vector"
    quaternion = _quaternion_channels(f"quaternion of {listed}", turns)
    message = f"palpate takes {listed} for {meaning}, in {'degrees' if degrees else 'rad'}"
    remedy = "if they are others, convert them to a quaternion and name it with --orientation"
    finding = Check.TRANSFORMS.finding(message, remedy)
    return add_channels(recording, quaternion, angles[0]), tuple(quaternion), finding


def _quaternion_channels(stem: str, turns: Floats) -> dict[str, Floats]:
    return {f"{stem}.{axis}": column for axis, column in zip("xyzw", turns.T, strict=True)}


#: Poses and wrenches in the frame of the base: libfranka's RobotState, Universal Robots' RTDE.
IN_BASE = re.compile(
    r"(?:.*[./])?(?:O_T_EE|O_F_ext_hat_K|actual_TCP_(?:pose|force))(?![^\W\d_]|_[^\W\d])", re.I
)
_LAST_OF_16 = re.compile(r"(.*[^\d_.])(\[15\]|_?15)")
_LAST_OF_6 = re.compile(r"((?:.*[./])?actual_TCP_pose)(\[5\]|_5)", re.I)


def state_poses(recording: Recording) -> tuple[Recording, frozenset[str]]:
    """Add the poses that are stated as matrices or rotation vectors, under the array's name.

    A homogeneous matrix is an array of 16 numbers in column order: elements 3, 7 and 11 are 0 and
    the last is 1. The second half of a UR's ``actual_TCP_pose`` is a rotation vector.

    Returns
    -------
    tuple
        The recording, and the channels to use only if an option names them.
    """
    replaced = set[str]()
    stated = recording
    for name in recording.channels:
        if IN_BASE.match(name):
            twin = re.sub("O_F(?=_ext_hat_K)", "K_F", re.sub("o_f(?=_ext_hat_k)", "k_f", name))
            replaced |= {twin} - {name}
        is_matrix = _LAST_OF_16.fullmatch(name)
        array = is_matrix or _LAST_OF_6.fullmatch(name)
        if not array:
            continue
        last = 15 if is_matrix else 5
        names = [array[1] + array[2].replace(str(last), str(k)) for k in range(last + 1)]
        numbers = _stack_channels(recording, names)
        if numbers is None:
            continue
        stem = array[1]
        pose: dict[str, Floats] = {}
        with np.errstate(all="ignore"):
            if is_matrix:
                if not _is_homogeneous(numbers):
                    continue
                pose = {f"{stem}.position.{a}": numbers[12 + k] for k, a in enumerate("xyz")}
                turns = _quaternion_of_matrix(numbers.reshape(4, 4, -1).transpose(1, 0, 2)[:3, :3])
                replaced.update(names)
            else:
                turns = quaternion_of_vector(numbers[3:].T)
        pose |= _quaternion_channels(f"{stem}.orientation", turns)
        stated = add_channels(stated, pose, name)
    return stated, frozenset(replaced)


def _stack_channels(recording: Recording, names: Sequence[str]) -> Floats | None:
    """The numbers of an array, a row for each element; None if one is missing."""
    columns = [recording.channels[name] for name in names if name in recording.channels]
    numeric = all(column.ndim == 1 and column.dtype.kind in "fiu" for column in columns)
    if len(columns) < len(names) or not numeric or len({len(column) for column in columns}) > 1:
        return None
    return np.array(columns, dtype=np.float64)


def _is_homogeneous(numbers: Floats) -> bool:
    """Whether arrays of 16 numbers are homogeneous matrices, by the last row."""
    last_row = numbers[3::4, np.isfinite(numbers).all(axis=0)]
    return last_row.size > 0 and bool((last_row == np.array([[0.0], [0.0], [0.0], [1.0]])).all())


# Chains of transforms: tf states the pose of each frame in its parent.

_TRANSFORM = re.compile(r"((.*)\[([^>]*)>(.*)\]\.(?:transform\.)?)translation\.x")


@frozen
class Step:
    """One transform of a chain.

    Attributes
    ----------
    parent, child : str
        Its frames.
    topic : str
        The topic.
    above : str
        The beginning of the names of its channels, such as ``/tf[base>tool].transform.``
    rows : int
        Number of messages.
    """

    parent: str
    child: str
    topic: str
    above: str
    rows: int

    @property
    def static(self) -> bool:
        """Whether its topic is one of fixed transforms, as ``/tf_static``."""
        return self.topic.endswith("_static")


#: The times of a transform, ns, and its translation and quaternion, shape (k, 7); at rest k = 1.
_Link: TypeAlias = tuple[Integers, Floats]


def _interpolate(link: _Link, at: Integers) -> tuple[Floats, Floats]:
    """The translation of a transform by linear interpolation, and its rotation by slerp."""
    stamps, rows = link
    if stamps.size == 1:
        return rows[:, :3], rows[:, 3:]
    seconds = (at - at[0]).astype(np.float64)
    time = (stamps - at[0]).astype(np.float64)
    place = interpolate_columns(seconds, time, rows[:, :3])
    return place, interpolate_rotation(seconds, time, rows[:, 3:])


class Transforms:
    """The tree of transforms in a recording.

    Parameters
    ----------
    recording : Recording
        The recording. Only transforms with a clock in ns count, as messages have.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.names = set[str]()  # the first channels of translations and rotations
        self._above: dict[str, dict[str, Step]] = defaultdict(dict)
        for name, column in recording.channels.items():
            transform = _TRANSFORM.fullmatch(name)
            if not (transform and self._is_complete(transform[1])):
                continue
            parent, child = transform[3].lstrip("/"), transform[4].lstrip("/")
            step = Step(parent, child, transform[2], transform[1], len(column))
            self.names |= {name, f"{step.above}rotation.x"}
            longest = self._above[child].get(parent)
            if longest is None or step.rows > longest.rows:  # a transform on two topics
                self._above[child][parent] = step

    @staticmethod
    def _channels(above: str) -> list[str]:
        place = [f"{above}translation.{axis}" for axis in "xyz"]
        return place + [f"{above}rotation.{axis}" for axis in "xyzw"]

    def _is_complete(self, above: str) -> bool:
        names = self._channels(above)
        clocks = {self.recording.clocks.get(name) for name in names}
        [time, *others] = [self.recording.channels.get(clock or "") for clock in clocks]
        timed = not others and time is not None and time.dtype.kind == "i"
        return timed and _stack_channels(self.recording, names) is not None

    def chain(self, child: str, ancestor: str | None = None) -> list[Step]:
        """Return the steps down to a frame from its ancestor, or from the root; may be empty.

        Raises
        ------
        RecordingError
            The ancestor is not unique: there are several roots, several ways, or a circle.
        """
        child = child.lstrip("/")
        ancestor = None if ancestor is None else ancestor.lstrip("/")
        below: dict[str, Step | None] = {child: None}
        waiting = deque([child])
        roots: list[str] = []
        several = False
        while waiting:
            frame = waiting.popleft()
            if frame == ancestor:
                return self._descend(frame, below)
            parents = self._above.get(frame, {})
            if not parents:
                roots.append(frame)
            for parent, step in parents.items():
                several |= parent in below
                if parent not in below:
                    below[parent] = step
                    waiting.append(parent)
        if ancestor is not None or roots == [child]:
            return []
        if len(roots) == 1 and not several:
            return self._descend(roots[0], below)
        message = f"the transforms above {child!r} go round in a circle; record a fixed frame"
        if roots:
            options = list_names([f"--position '/tf[{root}>{child}]'" for root in roots[:3]])
            message = f"several chains of transforms end in {child!r}; choose one: {options}"
        raise RecordingError.of(self.recording.source, message)

    def _descend(self, frame: str, below: Mapping[str, Step | None]) -> list[Step]:
        steps = []
        while (step := below[frame]) is not None:
            steps.append(step)
            frame = step.child
        return steps

    def chains_below(self, ancestor: str) -> list[list[Step]]:
        """Return the chains from a frame down to each frame that has no other below it."""
        ancestor = ancestor.lstrip("/")
        parents = {parent for above in self._above.values() for parent in above}
        if ancestor not in parents:
            return []
        chains = (self.chain(end, ancestor) for end in sorted(self._above.keys() - parents))
        return [chain for chain in chains if chain]

    def fixed_turn(self, child: str, reference: str) -> tuple[Floats, list[Step]] | None:
        """Return the quaternion of a frame in another at rest to it, and the steps between them.

        None if they are at rest to each other by no transforms from one root.
        """
        turns: list[Floats] = []
        path: list[Step] = []
        roots = set[str]()
        for frame in (reference, child):
            try:
                steps = self.chain(frame)
            except RecordingError:  # several roots
                return None
            links = [self._link(step, []) for step in steps]
            if any(time.size > 1 for time, _ in links):
                return None
            turn = _NO_TURN
            for _, rows in links:
                turn = multiply(turn, rows[:, 3:])
            turns.append(turn)
            path += steps
            roots.add(steps[0].parent if steps else frame.lstrip("/"))
        if len(roots) > 1 or not path:
            return None
        return multiply(turns[0] * INVERSE, turns[1])[0], path

    def compose(self, steps: Sequence[Step], name: str) -> tuple[Recording, list[Finding]] | None:
        """Add the pose at the end of a chain, in the frame at its beginning.

        The fastest moving transform gives the times; the others are interpolated.

        Parameters
        ----------
        steps : sequence of Step
            The chain.
        name : str
            The pose's name, such as ``/tf[base>tool]``.

        Returns
        -------
        tuple or None
            The recording with the pose, and reports of excluded rows; None if no transform moves.

        Raises
        ------
        RecordingError
            A transform has no valid row, or the moving transforms have no time in common.
        """
        findings = list[Finding]()
        with np.errstate(all="ignore"):
            links = [self._link(step, findings) for step in steps]
            clocks = [time for time, _ in links if time.size > 1]
            if not clocks:
                return None
            at = min(clocks, key=typical_step)
            for time in clocks:
                at = at[lie_between_samples(at, time)]
            if not at.size:
                message = f"the transforms of {name} are at no time all known; record them together"
                raise RecordingError.of(self.recording.source, message)
            place = np.zeros((1, 3))
            turn = _NO_TURN
            for link in links:
                translation, rotation = _interpolate(link, at)
                place = place + rotate(translation, turn)
                turn = multiply(turn, rotation)
            turn = align_signs(np.broadcast_to(turn, (at.size, 4)))
            turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        pose = np.hstack([np.broadcast_to(place, (at.size, 3)), turn])
        names = self._channels(f"{name}.transform.")
        stamp = f"{name}.header.stamp"
        recording = self.recording
        composed = replace(
            recording,
            channels={**recording.channels, stamp: at, **dict(zip(names, pose.T, strict=True))},
            clocks={**recording.clocks, **dict.fromkeys([*names, stamp], stamp)},
            frames={**recording.frames, **dict.fromkeys(names, steps[0].parent)},
            units={**recording.units, stamp: "ns", **dict.fromkeys(names[:3], "m")},
        )
        return composed, findings

    def _link(self, step: Step, findings: list[Finding]) -> _Link:
        names = self._channels(step.above)
        recording = self.recording
        rows = np.column_stack([recording.numbers(name) for name in names])
        time = recording.channels[recording.clocks[names[0]]]
        length = row_norms(rows[:, 3:])
        valid = np.abs(length - 1.0) <= UNIT_LENGTH
        valid &= (np.abs(rows[:, :3]) <= FARTHEST).all(axis=1)
        title = step.above.removesuffix(".").removesuffix(".transform")
        if not valid.any():
            message = f"no rotation of {title} is a quaternion of length 1; record it again"
            raise RecordingError.of(recording.source, message)
        if count := count_true(~valid):
            message = f"palpate excluded {count} of {len(rows)} rows of {title}: no valid pose"
            severity: Severity = "with-care" if count > MOST_EXCLUDED * len(rows) else "note"
            remedy = "check what publishes this transform"
            findings.append(Check.TRANSFORMS.finding(message, remedy, severity=severity))
        rows[:, 3:] /= length[:, None]
        time, unique = np.unique(time[valid], return_index=True)
        rows = rows[valid][unique]
        rows[:, 3:] = align_signs(rows[:, 3:])
        at_rest = bool((rows == rows[0]).all())
        if step.static and not at_rest:
            message = f"the fixed transform {title} changes: palpate uses its last value"
            finding = Check.TRANSFORMS.finding(message, "publish it on /tf", severity="with-care")
            findings.append(finding)
        if step.static or at_rest:
            return time[-1:], rows[-1:]
        return time, rows


def chain_in_use(steps: Sequence[Step], *, is_position: bool) -> Finding:
    """Say which chain of transforms is the position, or only rotates the force."""
    frames: list[str] = [steps[0].parent, *(step.child for step in steps)]
    if len(frames) > _SHOWN:
        frames[_SHOWN // 2 : -_SHOWN // 2] = [f"… {len(frames) - _SHOWN} more …"]
    chain = f"the chain of transforms {' > '.join(frames)}"
    if is_position:
        remedy = "choose another with --position, such as --position '/tf[base>tool]'"
        return Check.TRANSFORMS.finding(f"the position is that of {chain}", remedy)
    remedy = "choose another orientation with --orientation"
    return Check.TRANSFORMS.finding(f"the force is rotated by {chain}", remedy)


def frames_in(name: str) -> tuple[str, str] | None:
    """Return the two frames in a name such as ``/tf[base>tool]``; None if it has none."""
    frames = re.fullmatch(r"[^\[]*\[([^>]+)>([^\]]+)\]", name)
    return None if frames is None else (frames[1], frames[2])
