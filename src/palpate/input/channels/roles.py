"""Choosing the channels for time, position and force, by their names and units."""

import re
import shlex
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, fields, replace
from os.path import commonprefix
from typing import TypeAlias

import numpy as np

from palpate.errors import MissingChannelError, RecordingError, list_names
from palpate.findings import Check, Finding
from palpate.input.channels.frames import (
    OrientationForm,
    Step,
    Transforms,
    add_quaternion,
    chain_in_use,
    find_roll_pitch_yaw,
    frames_in,
    rotate,
    state_poses,
)
from palpate.input.channels.kinds import OF_UNIT, PREFERRED, WORDS, RecordedKinds
from palpate.input.channels.row_kinds import (
    is_contact_table,
    refuse_several_contacts,
    separate_topics,
    state_penetration,
)
from palpate.input.channels.vectors import COUNTED, ONE_OF_MANY, Vector
from palpate.input.recordings import Recording
from palpate.input.recordings.cantilever import VOLTS
from palpate.input.recordings.opening import within
from palpate.input.recordings.recording import holds_numbers
from palpate.input.recordings.units import (
    OTHER_UNITS,
    UNITS,
    WEIGHTS,
    divide_unit,
    find_unit,
    is_wanted,
    split_name,
)
from palpate.validation import frozen

#: Channels that have one role together: one channel, or the components of a vector.
Names: TypeAlias = tuple[str, ...]


@frozen
class Columns:
    """Names of the channels; palpate auto-detects a channel that has no default name.

    A name is a channel, three channels ``x,y,z`` of a vector, or a topic or group that contains a
    single one, such as ``/ft``.

    Parameters
    ----------
    time, penetration, force, velocity : str
        Channels in s, m, N and m/s; with velocity ``"none"`` palpate computes the velocity.
    segment : str
        Channel with a label that changes where a new contact begins.
    position : str, optional
        Position of the probe, m, along one axis or in space, instead of a penetration.
    orientation : str, optional
        Orientation of the probe, a quaternion x, y, z, w, or three angles; it rotates a force in
        the tool's frame.
    orientation_form : "rpy" or "rotation-vector", optional
        Meaning of three angles: roll, pitch, yaw about the fixed axes x, y, z, or axis times angle.
    torque : str, optional
        Torque of the sensor, N·m; with it palpate finds the tool's centre of mass.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> recording = {"t": np.arange(3) / 1000, "z": [1e-3, 2e-3, 3e-3], "Fz": [1.0, 2.0, 3.0]}
    >>> columns = palpate.Columns(time="t", penetration="z", force="Fz")
    >>> palpate.prepare(recording, columns=columns).force.tolist()
    [1.0, 2.0, 3.0]
    """

    time: str = "time_s"
    penetration: str = "penetration_m"
    force: str = "force_N"
    velocity: str = "velocity_m_s"
    segment: str = "segment"
    position: str | None = None
    orientation: str | None = None
    orientation_form: OrientationForm | None = None
    torque: str | None = None

    def __repr__(self) -> str:
        values = ((field.name, getattr(self, field.name), field.default) for field in fields(self))
        changed = (f"{name}={value!r}" for name, value, default in values if value != default)
        return f"Columns({', '.join(changed)})"


@frozen
class Roles:
    """The channels chosen for a contact.

    Attributes
    ----------
    depth : tuple of str
        The penetration or position, one channel or three.
    is_penetration : bool
        Whether it is a penetration: measured from the surface into the material.
    force : tuple of str
        One channel or three.
    time : str or None
        The common time channel; None if the channels have their own clocks, or no time.
    velocity, segment : str or None
        The channels, if there are any.
    orientation : tuple of str
        Four channels, or none.
    orientation_frame : str or None
        The frame whose orientation it is, if transforms state it.
    torque : tuple of str
        Three channels, or none; only with an orientation.
    reasons : mapping
        Role to the reason for its choice, as text.
    findings : tuple of Finding
        Reports of assumptions.
    recording : Recording
        The recording with the poses that palpate computed from it.
    """

    depth: Names
    is_penetration: bool
    force: Names
    time: str | None = None
    velocity: str | None = None
    segment: str | None = None
    orientation: Names = ()
    orientation_frame: str | None = None
    torque: Names = ()
    reasons: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    recording: Recording = field(kw_only=True, repr=False, compare=False)

    @property
    def by_role(self) -> dict[str, Names]:
        """The channels of each role except the time."""
        return {
            "depth": self.depth,
            "force": self.force,
            "orientation": self.orientation,
            "torque": self.torque,
            "velocity": () if self.velocity is None else (self.velocity,),
            "segment": () if self.segment is None else (self.segment,),
        }


def choose_roles(recording: Recording, columns: Columns | None = None) -> Roles:
    """Choose the channels of a contact.

    It is the channel with the requested name, else the channel with the default name, else the only
    channel whose name or unit fits.

    Raises
    ------
    MissingChannelError
        No channel has the given name, or none fits.
    RecordingError
        Several channels fit: the message names them and the option.
    """
    return _Choosing(recording, Columns() if columns is None else columns).roles()


def explain_roles(recording: Recording) -> tuple[dict[str, tuple[str, str]], str]:
    """Return each channel's role (empty without one) and the reason, and the error if any."""
    choosing = _Choosing(recording, Columns())
    uses: dict[str, tuple[str, str]] = {}
    refusal = ""
    try:
        uses = _uses_of(choosing.roles(), choosing.recording.clocks)
    except RecordingError as error:
        refusal = error.reason
    channels = choosing.recording.channels
    return {n: uses.get(n) or ("", _reason_against(choosing, n)) for n in channels}, refusal


def contact_groups(recording: Recording, columns: Columns) -> list[str]:
    """Return the groups of a file that each hold a contact with a separate clock; may be empty.

    Only HDF5 and MATLAB files have groups. They count if several contain position and force and no
    option names either. Topics are not groups: they are recorded at the same time.
    """
    default = Columns()
    is_named = (columns.penetration, columns.force) != (default.penetration, default.force)
    if is_named or columns.position is not None or recording.types:
        return []
    choosing = _Choosing(recording, columns)
    depths = choosing.depths()[1]
    return choosing.groups(depths, choosing.forces(len(depths[0]))) if depths else []


@frozen
class Offer:
    """The channels of a file that could be the position and the force of a contact.

    Attributes
    ----------
    recording : Recording
        The file, with the poses that palpate computed from it.
    depths, forces : list of tuple of str
        Channels or vectors that fit; empty without any.
    time : str or None
        The time channel of the file, if it has one for all channels.
    """

    recording: Recording
    depths: list[Names]
    forces: list[Names]
    time: str | None

    def clock_of(self, names: Names) -> str | None:
        """Return the clock of channels; None without one."""
        return self.recording.clocks.get(names[0], self.time)


def offer_of(recording: Recording, columns: Columns) -> Offer:
    """Return what a file offers; a channel that is named but not in this file is not an error."""
    depths: list[Names] = []
    forces: list[Names] = []
    time: Names = ()
    with suppress(RecordingError):
        choosing = _Choosing(recording, columns)
        recording = choosing.recording
        with suppress(MissingChannelError):
            depths = choosing.depths()[1]
        with suppress(MissingChannelError):
            forces = choosing.forces(len(depths[0]) if depths else 3)
        with suppress(MissingChannelError):
            time = choosing.named("time") or choosing.time_of((depths or forces or [("",)])[0])
    return Offer(recording, depths, forces, next(iter(time), None))


# Names of quantities in messages, in the order in which a message lists them.
_SPOKEN = {
    "penetration": "a penetration", "position": "a position", "force": "a force",
    "velocity": "a velocity", "acceleration": "an acceleration", "torque": "a torque",
    "stress": "a stress", "strain": "a strain", "orientation": "an orientation",
    "angle": "an angle",
}  # fmt: skip
_DEFAULT_REASONS = {"orientation": "the only quaternion", "torque": "of the sensor of the force"}
_PLAIN_TIMES = ("time", "t", "timestamp", "stamp")
_REMEDIES = {
    "position": "record the position of the probe, or name its channel with --position, or its "
    "file with --with",
    "force": "record the force, or name its channel with --force, or its file with --with",
    "both": "record both, or name their channels with --position and --force",
    "angle": "record the pose of the tool or tf, or name the position's channels with --position",
    "deflection": "pass the calibration of the cantilever, such as --sensitivity 40nm/V if the "
    "deflection is in volts, and --spring-constant 0.05N/m",
    "strain": "multiply the stress by the area and the strain by the length of the specimen, and "
    "name the products with --force and --position",
}


# palpate prefers channels of one quantity by these rows, in this order: each keeps the channels
# that fit it, if any do.
_PREFERENCES: tuple[
    tuple[Collection[str], Callable[["_Choosing", Names, str], bool]],
    ...,
] = (
    (WORDS, lambda choosing, names, _: names[0] in choosing.recording.plots),
    # Millimetres rather than volts.
    ((*UNITS, "position"), lambda choosing, names, kind: choosing.kinds.converts(names[0], kind)),
    # The vector of a sample rather than one of several in it.
    (("position", "force"), lambda _choosing, names, _: "][" not in names[0]),
    # A constant is a fixed frame, or not measured.
    (("position", "force"), lambda choosing, names, _: choosing.kinds.moves(names)),
    (PREFERRED, lambda _, names, kind: not PREFERRED[kind].isdisjoint(split_name(names[0]))),
    (("position",), lambda choosing, names, _: names in choosing.chains),
    # The sum of the contacts beside it.
    (("force",), lambda _, names, __: len(names) > 1 and "total" in split_name(names[0])),
)


class _Choosing:
    """Chooses the channels of each role, and composes the poses that they need."""

    def __init__(self, recording: Recording, columns: Columns) -> None:
        recording, self.replaced = state_poses(recording)
        recording, self.penetrations = state_penetration(recording)
        self.columns = columns
        self.kinds: RecordedKinds = RecordedKinds(recording, self.penetrations.values())
        self.transforms = Transforms(recording)
        self.chains: dict[Names, list[Step]] = {}  # keys: channels of the position
        self.reasons: dict[str, str] = {}
        self.findings: list[Finding] = []
        if columns.position is None:
            self._add_possible_chains()
        else:
            self._add_named_chain(columns.position)

    @property
    def recording(self) -> Recording:
        """The recording, with the poses that palpate computed from it."""
        return self.kinds.recording

    @recording.setter
    def recording(self, recording: Recording) -> None:
        self.kinds.recording = self.transforms.recording = recording

    # Chains of transforms.

    def _add_possible_chains(self) -> None:
        """Compose the chain of transforms to the frame of each possible force."""
        if not self.transforms.names or self.depths()[0]:
            return
        frames = {self.recording.frames.get(names[0], "") for names in self.forces(3)}
        for frame in sorted(frames - {""}):
            self._add_chain(self.transforms.chain(frame))
        positions = {names[0] for names in self._candidates("position", 3)}
        if not self.chains and positions <= self.transforms.names:  # a force in the base's axes
            for frame in sorted(frames - {""}):
                for steps in self._chains_from(frame):
                    self._add_chain(steps)
        if self.chains:
            self.replaced |= self.transforms.names - {names[0] for names in self.chains}

    def _chains_from(self, frame: str) -> list[list[Step]]:
        """The chains down from a frame, or from the root above it, as base_link above base."""
        to_root = self.transforms.chain(frame)
        chains = self.transforms.chains_below(frame)
        if to_root and not chains:
            return self.transforms.chains_below(to_root[0].parent)
        return chains

    def _add_named_chain(self, position: str) -> None:
        """Compose the chain of transforms whose two frames the user names, if it is none yet."""
        ends = frames_in(position)
        if ends is None or any(within(name, position) for name in self.recording.channels):
            return
        steps = self.transforms.chain(ends[1], ends[0])
        if not steps:
            message = f"no chain of transforms leads from {ends[0]!r} to {ends[1]!r}; list them"
            source = self.recording.source
            raise RecordingError.of(source, f"{message} with palpate info {source or 'FILE'}")
        self._add_chain(steps, position)

    def _add_chain(self, steps: list[Step], name: str | None = None) -> Names:
        """Compose a chain under its name; return its rotation's channels, none if it is fixed."""
        if not steps:
            return ()
        if name is None:
            topic = next((step.topic for step in reversed(steps) if not step.static), "/tf")
            name = f"{topic}[{steps[0].parent}>{steps[-1].child}]"
        translation = f"{name}.transform.translation"
        rotation = f"{name}.transform.rotation"
        position = Vector(translation, tuple(f"{translation}.{axis}" for axis in "xyz"))
        orientation = Vector(rotation, tuple(f"{rotation}.{axis}" for axis in "xyzw"))
        if position.components not in self.chains:
            composed = self.transforms.compose(steps, name)
            if composed is None:
                return ()
            self.recording, findings = composed
            self.findings += findings
            self.kinds.add_vectors([position, orientation])
            self.chains[position.components] = steps
        return orientation.components

    def _report_chains(self, depth: Names, frame: str | None) -> Iterable[Finding]:
        """Report the chains of transforms in use and the rows excluded from them."""
        steps = self.chains.get(depth)
        if steps is not None:
            yield chain_in_use(steps, is_position=True)
        turning = next((chain for chain in self.chains.values() if chain[-1].child == frame), None)
        if turning is not None and turning is not steps:
            yield chain_in_use(turning, is_position=False)
        yield from self.findings

    # The channels of each role.

    def roles(self) -> Roles:
        """Return the chosen channels.

        Raises
        ------
        RecordingError
            A channel is missing, or several fit.
        """
        is_penetration, depths = self.depths()
        forces = self.forces(len(depths[0]) if depths else 1)
        role = "penetration" if is_penetration else "position"
        if not depths or not forces:
            absent = ["position"] * (not depths) + ["force"] * (not forces)
            raise _missing_roles(self, absent)
        if len(depths) > 1 or len(forces) > 1:
            raise _question(self, role, depths, forces)
        depth, force = depths[0], forces[0]
        self._explain_choice(role, depth)
        self._explain_choice("force", force)
        time = self.named("time")
        if not time and not self.recording.clocks:
            time = self.time_of(depth)
        contacts = depth[0] in self.penetrations.values() or is_contact_table(self.recording)
        if is_penetration and contacts:
            clock = self.recording.clocks.get(depth[0])
            refuse_several_contacts(self.recording, next(iter(time), clock))
        orientation, frame = self._orientation(depth, force)
        has_torque = orientation and len(depth) == len(force) == 3
        roles = Roles(
            depth,
            is_penetration,
            force,
            next(iter(time), None),
            next(iter(self._velocity(depth, is_penetration)), None),
            next(iter(self.named("segment")), None),
            orientation,
            frame,
            self._torque(force) if has_torque else (),
            self.reasons,
            (
                *self._report_assumptions(depth, force),
                *self._report_chains(depth, frame),
                *self._report_inconvertible(),
            ),
            recording=self.recording,
        )
        return _with_clock_of_each_topic(roles)

    def depths(self) -> tuple[bool, list[Names]]:
        """Return whether the depths are penetrations, and all channels or vectors that fit."""
        if self.columns.position is not None:
            return False, [self._find_named_channels("position", self.columns.position)]
        named = self.named("penetration")
        positions = self._candidates("position", 3) or self._candidates("position", 1)
        penetrations = [named] if named else self._candidates("penetration", 1)
        if not penetrations:
            return False, positions
        arrays = {names[0].rpartition("[")[0] for names in penetrations}
        one_array = len(arrays) == 1 and arrays != {""}
        # A picture, not runs side by side.
        if one_array and len(penetrations) > max(len(self.forces(1)), 1) and positions:
            return False, positions
        return True, penetrations

    def forces(self, size: int) -> list[Names]:
        """Return the channels or vectors that could be the force, if possible of the same size."""
        named = self.named("force")
        if named:
            return [named]
        sizes = (3, 1) if size == 3 else (1, 3)
        return self._candidates("force", sizes[0]) or self._candidates("force", sizes[1])

    def _candidates(self, kind: str, size: int) -> list[Names]:
        """Channels or vectors that measure this quantity; commanded ones only if alone."""
        recorded = [n for n in self.kinds.measuring(kind, size) if n[0] not in self.replaced]
        if kind == "position":  # a fixed transform is not a probe, even if there is nothing else
            fixed = self.transforms.names
            recorded = [n for n in recorded if n[0] not in fixed or self.kinds.moves(n)]
        measured = [names for names in recorded if not is_wanted(names[0])]
        for kinds, fits in _PREFERENCES:
            if kind in kinds:
                measured = [names for names in measured if fits(self, names, kind)] or measured
        if self.recording.episode is not None:  # actions are in every data set
            return measured
        return measured or recorded

    def groups(self, depths: list[Names], forces: list[Names]) -> list[str]:
        """Return the groups that each hold one depth and one force on a separate clock.

        Without clocks, return the groups whose names count runs or tests.
        """
        names = [depth[0] for depth in depths]
        if len(names) < 2:
            return []
        clocks = {self.recording.clocks.get(name) for name in names}
        if None in clocks or len(clocks) != len(names):
            timed = any(self.kinds.of(name) == "time" for name in self.recording.channels)
            groups = (split_name(name.rpartition("/")[0]) for name in names)
            if timed or any(ONE_OF_MANY.isdisjoint(words) for words in groups):
                return []
        of_depth = _differing_groups(names)
        of_force = _differing_groups([force[0] for force in forces])
        return of_depth if set(of_depth) == set(of_force) else []

    def time_of(self, depth: Names) -> Names:
        """Return the time channel; for runs side by side, the one with the depth's number."""
        times = self._candidates("time", 1)
        number = _numbers(depth)
        plain = [names for names in times if names[0].lower() in _PLAIN_TIMES]
        numbered = [names for names in times if number and _numbers(names) == number]
        chosen = next(iter(numbered or plain or times), ())
        if chosen:
            self._explain_choice("time", chosen)
        return chosen

    def _velocity(self, depth: Names, is_penetration: bool) -> Names:
        if self.columns.velocity == "none":
            return ()
        if named := self.named("velocity"):
            return named
        if not is_penetration or len(depth) != 1:  # the direction of a velocity is unknown
            return ()
        velocities = self._candidates("velocity", 1)
        if len(velocities) != 1:
            return ()
        self._explain_choice("velocity", velocities[0])
        return velocities[0]

    def _orientation(self, depth: Names, force: Names) -> tuple[Names, str | None]:
        """Return the orientation, and its frame if transforms state it.

        It is the named one, else the orientation of the force's frame from transforms, else the one
        in the position's topic or group, else the only one, else the only roll, pitch and yaw.
        """
        if self.columns.orientation is not None:
            named = self._find_named_channels("orientation", self.columns.orientation)
            return self._quaternion_of(named) if len(named) == 3 else named, None
        base = self.recording.frames.get(depth[0], "")
        frame = self.recording.frames.get(force[0], "")
        if len(depth) == len(force) == 3 and base and frame:
            steps = self.transforms.chain(frame, base)
            if channels := self._add_chain(steps):
                return channels, steps[-1].child
            self._turn_force(force, frame, base)
        quaternions = self._candidates("orientation", 4)
        angles = find_roll_pitch_yaw(self.recording.channels)
        if not quaternions and len(angles) == 1:
            return self._quaternion_of(angles[0]), None
        pose = depth[0].rsplit(".", 2)[0]
        in_pose = [names for names in quaternions if within(names[0], pose)]
        in_group = [names for names in quaternions if _share_source(names[0], depth[0])]
        unique = (names[0] for names in (in_pose, in_group, quaternions) if len(names) == 1)
        return next(unique, ()), None

    def _turn_force(self, force: Names, frame: str, base: str) -> None:
        """Turn a force whose frame is at rest to that of the position."""
        turning = None if frame == base else self.transforms.fixed_turn(frame, base)
        if turning is None:
            return
        turn, steps = turning
        recording = self.recording
        vectors = np.column_stack([recording.numbers(name) for name in force])
        turned = rotate(vectors, np.broadcast_to(turn, (len(vectors), 4)))
        self.recording = replace(
            recording,
            channels={**recording.channels, **dict(zip(force, turned.T, strict=True))},
            frames={**recording.frames, **dict.fromkeys(force, base)},
        )
        self.findings.append(chain_in_use(steps, is_position=False))

    def _quaternion_of(self, angles: Names) -> Names:
        form = self.columns.orientation_form
        self.recording, names, finding = add_quaternion(self.recording, angles, form)
        self.findings.append(finding)
        return names

    def _torque(self, force: Names) -> Names:
        """Return the torque: the named one, else that with the name nearest to the force's."""
        if self.columns.torque is not None:
            return self._find_named_channels("torque", self.columns.torque)
        clocks = self.recording.clocks
        shared = {
            # The first letters that the names share: ``wrench[3]`` and ``wrench[0]``.
            names: len(commonprefix((names[0], force[0])))  # noqa: RUF071
            for names in self._candidates("torque", 3)
            if _share_source(names[0], force[0]) and clocks.get(names[0]) == clocks.get(force[0])
        }
        nearest = [names for names, size in shared.items() if size == max(shared.values())]
        return nearest[0] if len(nearest) == 1 else ()

    def named(self, role: str) -> Names:
        """Return the requested channels, else the channels with the default name if present."""
        name = getattr(self.columns, role)
        if name == getattr(Columns(), role) and name not in self.recording.channels:
            return ()
        return self._find_named_channels(role, name)

    def _find_named_channels(self, role: str, name: str) -> Names:
        channels = self.recording.channels
        if channel := self._channel(name):
            self.reasons[role] = "has this name"
            return (channel,)
        parts = tuple(self._channel(part.strip()) or part.strip() for part in name.split(","))
        if len(parts) > 1:
            for part in parts:
                self.recording.channel(part)
            if len(parts) not in (3, 4):
                message = f"--{role} {name!r} must name one channel or three, x,y,z"
                raise RecordingError.of(self.recording.source, message)
            self.reasons[role] = "have these names"
            return parts
        kind = "position" if role == "penetration" else role
        single = [(n,) for n in channels if within(n, name) and self.kinds.of(n) == kind]
        for fitting in (self._named_vectors(name, kind), single):
            if len(fitting) == 1:
                self.reasons[role] = f"the {role} of {name}"
                return fitting[0]
        raise MissingChannelError(name, list(channels), self.recording.source)

    def _named_vectors(self, name: str, kind: str) -> list[Names]:
        """The vectors of a quantity in a topic or group, else those with its name."""
        size = 4 if kind == "orientation" else 3
        arrays = (array for array in self.kinds.arrays if array not in self.kinds.vectors)
        sized = [vector for vector in (*self.kinds.vectors, *arrays) if len(vector) == size]
        below = [v for v in sized if within(v.stem, name) and self.kinds.measures(v, kind)]
        same = [v for v in sized if v.stem == name and (size == 4 or not v.second)]
        return [vector.components for vector in below or same]

    def _channel(self, name: str) -> str | None:
        """The channel of this name, or the only channel that has this name before a unit."""
        channels = self.recording.channels
        if name in channels:
            return name
        matches = [channel for channel in channels if divide_unit(channel)[0].strip() == name]
        return matches[0] if len(matches) == 1 else None

    # Reasons and reports.

    def _explain_choice(self, role: str, names: Sequence[str]) -> None:
        reason = f"the only {role}{' in space' if len(names) == 3 else ''}"
        self.reasons.setdefault(role, reason)

    def _report_inconvertible(self) -> Iterable[Finding]:
        """Report channels in units of other quantities, such as a depth in volts."""
        names = [
            name
            for name in self.recording.channels
            if (kind := self.kinds.of(name)) in ("penetration", "position", "force")
            and self.recording.unit_of(name) in OTHER_UNITS
            and not self.kinds.converts(name, kind)
        ]
        if names:
            listed = ", ".join(map(repr, names[:6]))
            yield Check.IGNORED.finding(f"palpate ignores {listed}: in no unit of length or force")

    def _report_assumptions(self, *chosen: Names) -> Iterable[Finding]:
        arrays = [v.components for v in self.kinds.assumed if v.components in chosen]
        if arrays and self.columns.position is None:
            listed = " and ".join(", ".join(names) for names in arrays)
            message = f"palpate takes {listed} for x, y and z, because of their numbers"
            remedy = "if they are runs or sensors, choose one with --position and --force"
            yield Check.VECTORS.finding(message, remedy)


# The role of each channel, for a table.


def _uses_of(roles: Roles, clocks: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    """The role of the chosen channels and of their clocks, with the reason."""
    uses: dict[str, tuple[str, str]] = {}
    depth = "penetration" if roles.is_penetration else "position"
    reason_of_time = roles.reasons.get("time", "clock of these channels")
    for role, names in roles.by_role.items():
        role = depth if role == "depth" else role
        default = _DEFAULT_REASONS.get(role, "has this name")
        uses |= dict.fromkeys(names, (role, roles.reasons.get(role, default)))
        times = {clocks.get(name, roles.time) for name in names}
        uses |= {time: ("time", reason_of_time) for time in times if time}
    return uses


def _reason_against(choosing: _Choosing, name: str) -> str:
    """Why a channel has no role."""
    recording, kinds = choosing.recording, choosing.kinds
    values = recording.channels[name]
    kind = kinds.of(name)
    if values.dtype.kind in "OUS" and not holds_numbers(values):
        return "text"
    if name in recording.clocks.values():
        return "a clock"
    if is_wanted(name):
        return "commanded"
    if name in choosing.penetrations:
        return "its negative is the penetration"
    if kind in (*UNITS, "position") and not kinds.converts(name, kind):
        quantity = "length" if kind in ("penetration", "position") else kind
        return f"in {recording.unit_of(name)}, no {quantity}"
    if kind in ("position", "force") and not kinds.moves((name,)):
        return "never changes"
    if kind is None or kind == "nothing":
        return "unknown quantity"
    return _SPOKEN.get(kind, f"a {kind}")


# Errors: no channel fits, or several do.


def _missing_roles(choosing: _Choosing, absent: list[str]) -> MissingChannelError:
    """The error that says which quantities are recorded, and which are missing."""
    recording = choosing.recording
    recorded = _recorded_kinds(choosing) - {*absent}
    if "penetration" in recorded:
        recorded -= {"position"}
    listed = " and ".join(name for kind, name in _SPOKEN.items() if kind in recorded)
    lacking = " and ".join(f"no {role}" for role in absent)
    message = f"there is {listed}, and {lacking}" if listed else f"there is {lacking}"
    for name, values in recording.channels.items():
        if values.dtype.kind in "OUS" and choosing.kinds.of(name) in absent:
            message += f"; {name!r} holds text, not numbers"
            break
    unknown = list(_unknown_units(choosing))
    if unknown:
        message += f"; palpate does not know the unit {' or '.join(unknown[:3])}"
    remedy = _remedy_of(choosing, absent, recorded)
    names = list(recording.channels)
    return MissingChannelError(absent[0], names, recording.source, f"{message}; {remedy}")


def _recorded_kinds(choosing: _Choosing) -> set[str | None]:
    """The quantities of all vectors, and of all channels outside of them."""
    kinds = choosing.kinds
    singles = {kinds.of(name) for name in kinds.outside_vectors()}
    return singles | {kinds.of_vector(vector) for vector in kinds.vectors}


def _unknown_units(choosing: _Choosing) -> Iterable[str]:
    for name in choosing.recording.channels:
        unit = find_unit(name) if choosing.kinds.of(name) is None else None
        if unit and unit not in OF_UNIT and unit not in WEIGHTS:
            yield f"{unit} of {name!r}"


def _remedy_of(choosing: _Choosing, absent: list[str], recorded: set[str | None]) -> str:
    """Return the advice for the roles that no channel can have."""
    if {"stress", "strain"} <= recorded:
        return _REMEDIES["strain"]
    if absent == ["position"] and "angle" in recorded:
        return _REMEDIES["angle"]
    recording = choosing.recording
    weights = [name for name in recording.channels if recording.unit_of(name) in WEIGHTS]
    if weights and absent == ["force"]:
        name = weights[0]
        unit = f"{recording.unit_of(name)}f"
        return f"if {name!r} is the force, in {unit}, pass --force {shlex.quote(name)}"
    in_volts = recording.unit_of("deflection") in VOLTS
    is_curve = "deflection" in recording.channels and (in_volts or "segment" in recording.channels)
    if is_curve and "force" in absent:
        return _REMEDIES["deflection"]
    if unnamed := _match_unknown_names(choosing, absent):
        what = "its channel" if len(absent) == 1 else "their channels"
        return f"name {what}, such as {_options(unnamed, unnamed)}"
    return _REMEDIES[absent[0] if len(absent) == 1 else "both"]


_SMALLEST_STATE = 9  # a position, its orientation and a force


def _array_of(names: Sequence[str]) -> str:
    """Return the name of the array whose columns these are; empty if they are none."""
    stem = names[0].rpartition("[")[0] if len(names) > 1 else ""
    return stem if list(names) == [f"{stem}[{k}]" for k in range(len(names))] else ""


def _match_unknown_names(choosing: _Choosing, absent: list[str]) -> dict[str, str]:
    """Map the missing roles to channels with unknown names; {} if they cannot be matched.

    A single role may be a vector: ``state``, an array with a position and a quaternion. Several
    roles may be the columns of a table without names.
    """
    kinds = choosing.kinds
    names = choosing.recording.channels
    roles = absent
    if len(absent) == 1:
        vectors = (v for v in kinds.vectors if len(v) == 3 and kinds.of_vector(v) is None)
        unknown = [v.stem for v in vectors if v.stem and not is_wanted(v.stem)]
    else:
        unknown = [name for name in names if kinds.of(name) is None]
        timed = any(kinds.of(name) == "time" for name in names)
        if len(unknown) + timed < len(names):
            return {}
        if (state := _array_of(unknown)) and len(unknown) >= _SMALLEST_STATE:
            # A position and an orientation come first, and a wrench or a force last.
            force = len(unknown) - (6 if len(unknown) >= 12 else 3)
            starts = {"position": 0, "force": force}
            return {
                role: ",".join(f"{state}[{k}]" for k in range(starts[role], starts[role] + 3))
                for role in absent
                if role in starts
            }
        if not timed:
            roles = ["time", *absent]
    return dict(zip(roles, unknown, strict=False)) if len(unknown) >= len(roles) else {}


def _question(
    choosing: _Choosing, role: str, depths: list[Names], forces: list[Names]
) -> RecordingError:
    """The error that several channels fit, with options that choose one, or all three."""
    same = [names for names in forces if _numbers(names) == _numbers(depths[0])]
    first = {role: depths[0], "force": (same or forces)[0]}
    example = {role: _array_of(names) or ",".join(names) for role, names in first.items()}
    if groups := choosing.groups(depths, forces):
        example = dict.fromkeys(example, groups[0])
    candidates = {role: depths, "force": forces}
    several = {role: names for role, names in candidates.items() if len(names) > 1}
    questions = [
        f"{len(names)} channels could be the {role}: "
        + list_names([_array_of(each) or _shorten(each) for each in names])
        for role, names in several.items()
    ]
    message = f"{'; '.join(questions)}; choose one, such as {_options(example, several)}"
    if all(_may_be_axes(choosing, names) for names in several.values()):
        axes = {
            "position" if role == "penetration" else role: ",".join(name for [name] in names)
            for role, names in several.items()
        }
        message += f"; or, for x, y and z of one vector, {_options(axes, axes)}"
    if list(several) == ["force"] and len(forces) > 2 and len(forces[0]) == 1:
        message += "; or, if they share the load, name a column with their sum"
    return RecordingError.of(choosing.recording.source, message)


def _may_be_axes(choosing: _Choosing, candidates: list[Names]) -> bool:
    """Whether three channels may be the axes of one vector."""
    if [len(names) for names in candidates] != [1, 1, 1]:
        return False
    axes = tuple(names[0] for names in candidates)
    counted = not COUNTED.isdisjoint(split_name(" ".join(axes)))
    return not counted and choosing.kinds.is_one(Vector("", axes))


def _with_clock_of_each_topic(roles: Roles) -> Roles:
    """The same roles, with a clock for each topic if the rows were joined from several topics."""
    position = (*roles.depth, roles.segment) if roles.segment else roles.depth
    velocity = roles.by_role["velocity"]
    topics = position, roles.force, roles.orientation, roles.torque, velocity
    clocks = roles.recording.clocks
    [time, *others] = {roles.time or clocks.get(name) for names in topics for name in names}
    if time is None or others:
        return roles
    recording = separate_topics(roles.recording, time, topics)
    return roles if recording is None else replace(roles, time=None, recording=recording)


def _share_source(name: str, reference: str) -> bool:
    """Whether two channels are of one topic of messages, or of vectors in one group."""
    topic, dot, _ = name.partition(".")
    if dot and topic == reference.partition(".")[0]:
        return True
    # ``/ft/wrench/force/x`` and ``/ft/wrench/torque/x`` differ only in the name of the vector.
    vectors = [re.sub(r"[/.][xyzw]$", "", full, flags=re.I) for full in (name, reference)]
    return vectors[0].rpartition("/")[0] == vectors[1].rpartition("/")[0]


def _shorten(names: Names) -> str:
    """The names in one text; of a vector of messages only once: ``ft.force.x,y,z``."""
    first, *others = (name.rpartition(".") for name in names)
    is_vector = {stem for stem, _, _ in others} == {first[0]}
    return ",".join([names[0], *(axis for *_, axis in others)]) if is_vector else " ".join(names)


def _numbers(names: Sequence[str]) -> list[str]:
    """The numbers in the name of a channel."""
    return re.findall(r"\d+", divide_unit(names[0])[0])


def _differing_groups(names: list[str]) -> list[str]:
    """Return the names without the ending that they all share: their groups."""
    parts = [re.split(r"(?=[/.])", name) for name in names]
    common = 0
    while common < min(map(len, parts)) and len({parts_of[-common - 1] for parts_of in parts}) == 1:
        common += 1
    return ["".join(parts_of[: len(parts_of) - common]) for parts_of in parts]


def _options(values: Mapping[str, str], roles: Iterable[str]) -> str:
    """Options of the command line that name the channels of these roles."""
    return " ".join(f"--{role} {shlex.quote(values[role])}" for role in roles)
