"""Choosing the channels for time, position and force, by their names and units."""

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from os.path import commonprefix

import numpy as np

from palpate.errors import MissingChannelError, RecordingError, list_names
from palpate.findings import Check, Finding
from palpate.preparation.channel_kinds import (
    _OF_UNIT,
    JOINTS,
    PREFERRED,
    SLIDES,
    channel_kind,
)
from palpate.preparation.contact_rows import (
    is_contact_table,
    refuse_several_contacts,
    state_penetration,
)
from palpate.preparation.joined_rows import separate_topics
from palpate.preparation.vectors import (
    COUNTED,
    ONE_OF_MANY,
    Vector,
    find_flattened_arrays,
    find_vectors,
)
from palpate.recordings import Recording
from palpate.recordings.opening import within
from palpate.recordings.poses import (
    IN_BASE,
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
from palpate.recordings.recording import holds_numbers
from palpate.recordings.units import (
    OTHER_UNITS,
    UNITS,
    divide_unit,
    find_unit,
    is_wanted,
    split_name,
    unit_size,
)


@dataclass(frozen=True, slots=True)
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
        named = ((each.name, getattr(self, each.name), each.default) for each in fields(self))
        return f"Columns({', '.join(f'{n}={name!r}' for n, name, usual in named if name != usual)})"


@dataclass(frozen=True, slots=True)
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

    depth: tuple[str, ...]
    is_penetration: bool
    force: tuple[str, ...]
    time: str | None = None
    velocity: str | None = None
    segment: str | None = None
    orientation: tuple[str, ...] = ()
    orientation_frame: str | None = None
    torque: tuple[str, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    recording: Recording = field(kw_only=True, repr=False, compare=False)

    @property
    def by_role(self) -> dict[str, tuple[str, ...]]:
        """The channels of each role except the time."""
        single = {"velocity": self.velocity, "segment": self.segment}
        own = {role: () if name is None else (name,) for role, name in single.items()}
        names = "depth", "force", "orientation", "torque"
        return {**{name: getattr(self, name) for name in names}, **own}


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
    return _Choosing(recording, Columns()).uses()


def contact_groups(recording: Recording, columns: Columns) -> list[str]:
    """Return the groups of a file that each hold a contact with a separate clock; may be empty.

    Only HDF5 and MATLAB files have groups. They count if several contain position and force and no
    option names either. Topics are not groups: they are recorded at the same time.
    """
    usual, stated = Columns(), (columns.penetration, columns.force, columns.position)
    if stated != (usual.penetration, usual.force, None) or recording.types:
        return []
    choosing = _Choosing(recording, columns)
    depths = choosing.depths()[1]
    return choosing.groups(depths, choosing.forces(len(depths[0]))) if depths else []


@dataclass(frozen=True, slots=True)
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
    depths: list[tuple[str, ...]]
    forces: list[tuple[str, ...]]
    time: str | None

    def clock_of(self, names: tuple[str, ...]) -> str | None:
        """Return the clock of channels; None without one."""
        return self.recording.clocks.get(names[0], self.time)


def offer_of(recording: Recording, columns: Columns) -> Offer:
    """Return what a file offers; a channel that is named but not in this file is not an error."""
    depths, forces = list[tuple[str, ...]](), list[tuple[str, ...]]()
    time: tuple[str, ...] = ()
    with suppress(RecordingError):
        choosing = _Choosing(recording, columns)
        recording = choosing.recording
        with suppress(MissingChannelError):
            depths = choosing.depths()[1]
        with suppress(MissingChannelError):
            forces = choosing.forces(len(depths[0]) if depths else 3)
        with suppress(MissingChannelError):
            time = choosing._given("time") or choosing._time((depths or forces or [("",)])[0])
    return Offer(recording, depths, forces, next(iter(time), None))


# Names of quantities in messages, in the order in which a message lists them.
_SPOKEN = {
    "penetration": "a penetration", "position": "a position", "force": "a force",
    "velocity": "a velocity", "acceleration": "an acceleration", "torque": "a torque",
    "stress": "a stress", "strain": "a strain", "orientation": "an orientation",
    "angle": "an angle",
}  # fmt: skip
_USUAL_REASONS = {"orientation": "the only quaternion", "torque": "of the sensor of the force"}
_REMEDIES = {
    "position": "record the position of the probe, or name its channel with --position, or its "
    "file with --with",
    "force": "record the force, or name its channel with --force, or its file with --with",
    "both": "record both, or name their channels with --position and --force",
    "angle": "record the pose of the tool or tf, or name the position's channels with --position",
    "strain": "multiply the stress by the area and the strain by the length of the specimen, and "
    "name the products with --force and --position",
}


@dataclass
class _Choosing:
    recording: Recording
    columns: Columns
    reasons: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.kinds: dict[str, str | None] = {}
        self.recording, self.replaced = state_poses(self.recording)
        self.recording, self.penetrations = state_penetration(self.recording)
        self.kinds |= dict.fromkeys(self.penetrations.values(), "penetration")
        self.transforms = Transforms(self.recording)
        self.chains: dict[tuple[str, ...], list[Step]] = {}  # keys: channels of the position
        self.findings: list[Finding] = []
        names = self.recording.channels
        self.arrays = find_flattened_arrays(names)
        found = find_vectors(names)
        # If there are depth[0], depth[1] and depth[2], then force[k] are three runs, not axes.
        runs = any(self._vector_kind(each) == "penetration" for each in found)
        found = [v for v in found if not (runs and v.components[0].endswith("]"))]
        self.vectors = [each for each in found if self._is_one(each)]
        self.assumed = self._assume_vectors()
        self.vectors += self.assumed
        self.vectors += [v for v in self.arrays if IN_BASE.match(v.stem) and v not in self.vectors]
        self._add_chains()

    def _add_chains(self) -> None:
        """Compose the named chain of transforms, else that to the frame of each possible force."""
        position, frames = self.columns.position, self.recording.frames
        if position is None and self.transforms.names and not self.depths()[0]:
            known = sorted({frames.get(names[0], "") for names in self.forces(3)} - {""})
            for frame in known:
                self._add_chain(self.transforms.chain(frame))
            others = {names[0] for names in self._candidates("position", 3)}
            if not self.chains and others <= self.transforms.names:  # a force in the base's axes
                for frame in known:
                    above = self.transforms.chain(frame)  # at rest, such as base_link > base
                    below = self.transforms.chains_below(frame)
                    if above and not below:
                        below = self.transforms.chains_below(above[0].parent)
                    for steps in below:
                        self._add_chain(steps)
            if self.chains:
                self.replaced |= self.transforms.names - {names[0] for names in self.chains}
        ends = None if position is None else frames_in(position)
        if ends is None or any(within(name, str(position)) for name in self.recording.channels):
            return
        if not (steps := self.transforms.chain(ends[1], ends[0])):
            words = f"no chain of transforms leads from {ends[0]!r} to {ends[1]!r}; list them with "
            source = self.recording.source
            raise RecordingError.of(source, f"{words}palpate info {source or 'FILE'}")
        self._add_chain(steps, str(position))

    def _add_chain(self, steps: list[Step], name: str | None = None) -> tuple[str, ...]:
        """Compose a chain under its name; return its rotation's channels, none if it is fixed."""
        if not steps:
            return ()
        if name is None:
            topic = next((step.topic for step in reversed(steps) if not step.static), "/tf")
            name = f"{topic}[{steps[0].parent}>{steps[-1].child}]"
        place, turn = (f"{name}.transform.{part}" for part in ("translation", "rotation"))
        vectors = [
            Vector(place, tuple(f"{place}.{a}" for a in "xyz")),
            Vector(turn, tuple(f"{turn}.{a}" for a in "xyzw")),
        ]
        if vectors[0].components not in self.chains:
            if (composed := self.transforms.compose(steps, name)) is None:
                return ()
            self.recording, findings = composed
            self.transforms.recording = self.recording
            self.findings += findings
            self.vectors += [each for each in vectors if each not in self.vectors]
            self.chains[vectors[0].components] = steps
        return vectors[1].components

    def roles(self) -> Roles:
        is_penetration, depths = self.depths()
        forces = self.forces(len(depths[0]) if depths else 1)
        role = "penetration" if is_penetration else "position"
        if not depths or not forces:
            raise self._missing_roles(bool(depths), bool(forces))
        if len(depths) > 1 or len(forces) > 1:
            raise self._question({role: depths, "force": forces})
        [depth], [force] = depths, forces
        self._because(role, depth)
        self._because("force", force)
        time = self._given("time")
        if not time and not self.recording.clocks:
            time = self._time(depth)
        contacts = depth[0] in self.penetrations.values() or is_contact_table(self.recording)
        if is_penetration and contacts:
            own = self.recording.clocks.get(depth[0])
            refuse_several_contacts(self.recording, next(iter(time), own))
        orientation, frame = self._orientation(depth, force)
        findings = *self._assumptions(depth, force), *self._chain_findings(depth, frame)
        roles = Roles(
            depth,
            is_penetration,
            force,
            next(iter(time), None),
            next(iter(self._velocity(depth, is_penetration)), None),
            next(iter(self._given("segment")), None),
            orientation,
            frame,
            self._torque(force) if orientation and len(depth) == len(force) == 3 else (),
            self.reasons,
            (*findings, *self._inconvertible()),
            recording=self.recording,
        )
        return _with_clock_of_each_topic(roles)

    def uses(self) -> tuple[dict[str, tuple[str, str]], str]:
        """Return each channel's role (empty without one) and the reason, and the error if any."""
        uses: dict[str, tuple[str, str]] = {}
        refusal = ""
        try:
            roles = self.roles()
        except RecordingError as error:
            refusal = str(error).removeprefix(f"{self.recording.source}: ")
        else:
            depth = "penetration" if roles.is_penetration else "position"
            for role, names in roles.by_role.items():
                role = depth if role == "depth" else role
                usual = _USUAL_REASONS.get(role, "has this name")
                uses |= dict.fromkeys(names, (role, self.reasons.get(role, usual)))
                clocks = {self.recording.clocks.get(name, roles.time) for name in names}
                reason = self.reasons.get("time", "clock of these channels")
                uses |= {clock: ("time", reason) for clock in clocks if clock}
        every = self.recording.channels
        return {n: uses.get(n) or ("", self._reason_against(n)) for n in every}, refusal

    def _reason_against(self, name: str) -> str:
        """Why a channel has no role."""
        values, kind = self.recording.channels[name], self._kind(name)
        if values.dtype.kind in "OUS" and not holds_numbers(values):
            return "text"
        if name in self.recording.clocks.values():
            return "a clock"
        if is_wanted(name):
            return "commanded"
        if name in self.penetrations:
            return "its negative is the penetration"
        if kind in (*UNITS, "position") and not self._convertible(name, kind):
            return f"in {self.recording.unit_of(name)}, no {_quantity(kind)}"
        if kind in ("position", "force") and not self._moves((name,)):
            return "never changes"
        if kind is None or kind == "nothing":
            return "unknown quantity"
        return _SPOKEN.get(kind, f"a {kind}")

    def _inconvertible(self) -> Iterable[Finding]:
        """Report channels in units of other quantities, such as a depth in volts."""
        names = [
            name
            for name in self.recording.channels
            if (kind := self._kind(name)) in ("penetration", "position", "force")
            and self.recording.unit_of(name) in OTHER_UNITS
            and not self._convertible(name, kind)
        ]
        if names:
            listed = ", ".join(map(repr, names[:6]))
            yield Check.IGNORED.finding(f"palpate ignores {listed}: in no unit of length or force")

    def depths(self) -> tuple[bool, list[tuple[str, ...]]]:
        """Return whether the depths are penetrations, and all channels or vectors that fit."""
        if self.columns.position is not None:
            return False, [self._find_named_channels("position", self.columns.position)]
        given = self._given("penetration")
        positions = self._candidates("position", 3) or self._candidates("position", 1)
        found = [given] if given else self._candidates("penetration", 1)
        arrays = {names[0].rpartition("[")[0] for names in found}
        one_array = len(arrays) == 1 and arrays != {""}
        picture = one_array and len(found) > max(len(self.forces(1)), 1)  # no runs side by side
        return (False, positions) if (picture and positions) or not found else (True, found)

    def forces(self, size: int) -> list[tuple[str, ...]]:
        """Return the channels or vectors that could be the force, if possible of the same size."""
        given = self._given("force")
        sizes = (3, 1) if size == 3 else (1, 3)
        found = [[given] if given else self._candidates("force", size) for size in sizes]
        return found[0] or found[1]

    def groups(self, depths: list[tuple[str, ...]], forces: list[tuple[str, ...]]) -> list[str]:
        """Return the groups that each hold one depth and one force on a separate clock.

        Without clocks, return the groups whose names count runs or tests.
        """
        names = [each[0] for each in depths]
        clocks = {self.recording.clocks.get(name) for name in names}
        if len(names) < 2:
            return []
        if None in clocks or len(clocks) != len(names):
            own = [set(split_name(name.rpartition("/")[0])) for name in names]
            timed = any(self._kind(name) == "time" for name in self.recording.channels)
            if timed or any(ONE_OF_MANY.isdisjoint(each) for each in own):
                return []
        of_depth, of_force = (_differing_groups([n[0] for n in each]) for each in (depths, forces))
        return of_depth if set(of_depth) == set(of_force) else []

    def _time(self, depth: tuple[str, ...]) -> tuple[str, ...]:
        """Return the time channel; for runs side by side, the one with the depth's number."""
        found = self._candidates("time", 1)
        number = _numbers(depth)
        own = [names for names in found if _numbers(names) == number]
        plain = [n for n in found if n[0].lower() in ("time", "t", "timestamp", "stamp")]
        chosen = (number and own[:1]) or plain[:1] or found[:1]
        if chosen:
            self._because("time", chosen[0])
        return chosen[0] if chosen else ()

    def _velocity(self, depth: tuple[str, ...], is_penetration: bool) -> tuple[str, ...]:
        if self.columns.velocity == "none":
            return ()
        if given := self._given("velocity"):
            return given
        # With a position, the direction and sign of a velocity are unknown.
        found = self._candidates("velocity", 1) if is_penetration and len(depth) == 1 else []
        if len(found) != 1:
            return ()
        self._because("velocity", found[0])
        return found[0]

    def _orientation(
        self, depth: tuple[str, ...], force: tuple[str, ...]
    ) -> tuple[tuple[str, ...], str | None]:
        """Return the orientation, and its frame if transforms state it.

        It is the named one, else the orientation of the force's frame from transforms, else the one
        in the position's topic or group, else the only one, else the only roll, pitch and yaw.
        """
        if self.columns.orientation is not None:
            named = self._find_named_channels("orientation", self.columns.orientation)
            return self._quaternion_of(named) if len(named) == 3 else named, None
        own, frame = (self.recording.frames.get(names[0], "") for names in (depth, force))
        if len(depth) == len(force) == 3 and own and frame:
            steps = self.transforms.chain(frame, own)
            if channels := self._add_chain(steps):
                return channels, steps[-1].child
            self._turn_force(force, frame, own)
        found, pose = self._candidates("orientation", 4), depth[0].rsplit(".", 2)[0]
        near = [names for names in found if within(names[0], pose)]
        group = [names for names in found if _share_source(names[0], depth[0])]
        if not found and len(angles := find_roll_pitch_yaw(self.recording.channels)) == 1:
            return self._quaternion_of(angles[0]), None
        return next((each[0] for each in (near, group, found) if len(each) == 1), ()), None

    def _turn_force(self, force: tuple[str, ...], frame: str, own: str) -> None:
        """Turn a force whose frame is at rest to that of the position."""
        if frame == own or (found := self.transforms.fixed_turn(frame, own)) is None:
            return
        turn, steps = found
        felt = np.column_stack([self.recording.numbers(name) for name in force])
        turned = rotate(felt, np.broadcast_to(turn, (len(felt), 4)))
        self.recording = replace(
            self.recording,
            channels={**self.recording.channels, **dict(zip(force, turned.T, strict=True))},
            frames={**self.recording.frames, **dict.fromkeys(force, own)},
        )
        self.findings.append(chain_in_use(steps, is_position=False))

    def _quaternion_of(self, angles: tuple[str, ...]) -> tuple[str, ...]:
        form = self.columns.orientation_form
        self.recording, names, finding = add_quaternion(self.recording, angles, form)
        self.findings.append(finding)
        return names

    def _torque(self, force: tuple[str, ...]) -> tuple[str, ...]:
        """Return the torque: the named one, else that with the name nearest to the force's."""
        if self.columns.torque is not None:
            return self._find_named_channels("torque", self.columns.torque)
        clock = self.recording.clocks.get(force[0])
        found = [
            names
            for names in self._candidates("torque", 3)
            if _share_source(names[0], force[0]) and self.recording.clocks.get(names[0]) == clock
        ]
        # The first letters that the names share: ``wrench[3]`` and ``wrench[0]``.
        shared = [len(commonprefix((names[0], force[0]))) for names in found]  # noqa: RUF071
        nearest = [n for n, size in zip(found, shared, strict=True) if size == max(shared)]
        return nearest[0] if len(nearest) == 1 else ()

    def _chain_findings(self, depth: tuple[str, ...], frame: str | None) -> Iterable[Finding]:
        """Report the chains of transforms in use and the rows excluded from them."""
        steps = self.chains.get(depth)
        if steps is not None:
            yield chain_in_use(steps, is_position=True)
        turning = next((each for each in self.chains.values() if each[-1].child == frame), None)
        if turning is not None and turning is not steps:
            yield chain_in_use(turning, is_position=False)
        yield from self.findings

    def _given(self, role: str) -> tuple[str, ...]:
        """Return the requested channels, else the channels with the default name if present."""
        name = getattr(self.columns, role)
        if name == getattr(Columns(), role) and name not in self.recording.channels:
            return ()
        return self._find_named_channels(role, name)

    def _find_named_channels(self, role: str, name: str) -> tuple[str, ...]:
        channels = self.recording.channels
        if found := self._channel(name):
            self.reasons[role] = "has this name"
            return (found,)
        parts = tuple(self._channel(part.strip()) or part.strip() for part in name.split(","))
        if len(parts) > 1:
            for part in parts:
                self.recording.channel(part)
            if len(parts) not in (3, 4):
                words = f"--{role} {name!r} must name one channel or three, x,y,z"
                raise RecordingError.of(self.recording.source, words)
            self.reasons[role] = "have these names"
            return parts
        size = 4 if role == "orientation" else 3
        kind = "position" if role == "penetration" else role
        vectors = [*self.vectors, *(each for each in self.arrays if each not in self.vectors)]
        sized = [each for each in vectors if len(each) == size]
        below = [each for each in sized if within(each.stem, name) and self._is(each, kind)]
        below = below or [v for v in sized if v.stem == name and (size == 4 or not v.second)]
        single = [each for each in channels if within(each, name) and self._kind(each) == kind]
        for fitting in ([each.components for each in below], [(each,) for each in single]):
            if len(fitting) == 1:
                self.reasons[role] = f"the {role} of {name}"
                return fitting[0]
        raise MissingChannelError(name, list(channels), self.recording.source)

    def _channel(self, name: str) -> str | None:
        """The channel of this name, or the only channel that has this name before a unit."""
        if name in self.recording.channels:
            return name
        found = [each for each in self.recording.channels if divide_unit(each)[0].strip() == name]
        return found[0] if len(found) == 1 else None

    def _missing_roles(self, has_depth: bool, has_force: bool) -> MissingChannelError:
        """The error that says which quantities are recorded, and which are missing."""
        names = list(self.recording.channels)
        used = {name for vector in self.vectors for name in vector.components}
        kinds = {self._vector_kind(vector) for vector in self.vectors}
        kinds |= {self._kind(name) for name in names if name not in used}
        has = {"position": has_depth, "force": has_force}
        absent = [role for role in has if not has[role]]
        kinds -= {*absent, *(("position",) if "penetration" in kinds else ())}
        there = " and ".join(words for kind, words in _SPOKEN.items() if kind in kinds)
        lacking = " and ".join(f"no {role}" for role in absent)
        words = f"there is {there}, and {lacking}" if there else f"there is {lacking}"
        units = {name: find_unit(name) for name in names if self._kind(name) is None}
        unknown = [f"{u} of {name!r}" for name, u in units.items() if u and u not in _OF_UNIT]
        channels = self.recording.channels
        texts = [n for n in names if self._kind(n) in absent and channels[n].dtype.kind in "OUS"]
        if texts:
            words += f"; {texts[0]!r} holds text, not numbers"
        if unknown:
            words += f"; palpate does not know the unit {' or '.join(unknown[:3])}"
        remedy = _REMEDIES[absent[0] if len(absent) == 1 else "both"]
        if {"stress", "strain"} <= kinds:
            remedy = _REMEDIES["strain"]
        elif absent == ["position"] and "angle" in kinds:
            remedy = _REMEDIES["angle"]
        elif unnamed := self._match_unknown_names(absent):
            words_for = "its channel" if len(absent) == 1 else "their channels"
            remedy = f"name {words_for}, such as {_options(unnamed, unnamed)}"
        return MissingChannelError(absent[0], names, self.recording.source, f"{words}; {remedy}")

    def _match_unknown_names(self, absent: Sequence[str]) -> dict[str, str]:
        """Map the missing roles to channels with unknown names; {} if they cannot be matched.

        A single role may be a vector: ``state``, an array with a position and a quaternion. Several
        roles may be the columns of a table without names.
        """
        names = self.recording.channels
        unknown = [name for name in names if self._kind(name) is None]
        timed = any(self._kind(name) == "time" for name in names)
        if len(absent) == 1:
            stems = (v.stem for v in self.vectors if len(v) == 3 and self._vector_kind(v) is None)
            unknown = [stem for stem in stems if stem and not is_wanted(stem)]
        elif len(unknown) + timed < len(names):
            return {}
        roles = [*absent] if timed or len(absent) == 1 else ["time", *absent]
        return dict(zip(roles, unknown, strict=False)) if len(unknown) >= len(roles) else {}

    def _question(self, found: Mapping[str, list[tuple[str, ...]]]) -> RecordingError:
        """The error that several channels fit, with options that choose one, or all three."""
        (role, depths), (_, forces) = found.items()
        same = [names for names in forces if _numbers(names) == _numbers(depths[0])]
        one = {role: ",".join(depths[0]), "force": ",".join((same or forces)[0])}
        if groups := self.groups(depths, forces):
            one = dict.fromkeys(one, groups[0])
        several = {each: names for each, names in found.items() if len(names) > 1}
        said = [
            f"{len(names)} channels could be the {each}: {list_names([*map(' '.join, names)])}"
            for each, names in several.items()
        ]
        words = f"{'; '.join(said)}; choose one, such as {_options(one, several)}"
        if all(self._may_be_axes(names) for names in several.values()):
            axes = {role: ",".join(names[0] for names in each) for role, each in several.items()}
            axes = {"position" if each == "penetration" else each: v for each, v in axes.items()}
            words += f"; or, for x, y and z of one vector, {_options(axes, axes)}"
        if list(several) == ["force"] and len(forces) > 2 and len(forces[0]) == 1:
            words += "; or, if they share the load, name a column with their sum"
        return RecordingError.of(self.recording.source, words)

    def _may_be_axes(self, found: list[tuple[str, ...]]) -> bool:
        joined = tuple(names[0] for names in found)
        single = [len(names) for names in found] == [1, 1, 1]
        counted = not COUNTED.isdisjoint(split_name(" ".join(joined)))
        return single and not counted and self._is_one(Vector("", joined))

    def _candidates(self, kind: str, size: int) -> list[tuple[str, ...]]:
        """Channels or vectors that measure this quantity; commanded ones only if alone."""
        recording = self.recording
        if size > 1:
            found = [v.components for v in self.vectors if len(v) == size and self._is(v, kind)]
        else:
            used = {name for vector in self.vectors for name in vector.components}
            used.update(recording.clocks.values())
            kinds_of_values = "fiuO" if kind != "time" else "fiuOmM"
            found = [
                (name,)
                for name, values in recording.channels.items()
                if name not in used
                and values.ndim == 1
                and values.dtype.kind in kinds_of_values
                and self._kind(name) == kind
                and (values.dtype.kind != "O" or holds_numbers(values))
            ]
        found = [names for names in found if names[0] not in self.replaced]
        if kind == "position":  # a fixed transform is not a probe, even if there is nothing else
            found = [n for n in found if n[0] not in self.transforms.names or self._moves(n)]
        measured = [names for names in found if not is_wanted(names[0])]
        measured = [names for names in measured if names[0] in recording.plots] or measured
        if kind in UNITS or kind == "position":  # prefer millimetres to volts
            fitting = [names for names in measured if self._convertible(names[0], kind)]
            measured = fitting or measured
        if kind in ("position", "force"):  # a constant is a fixed frame, or not measured
            measured = [names for names in measured if self._moves(names)] or measured
        words = PREFERRED.get(kind, frozenset())
        measured = [n for n in measured if not words.isdisjoint(split_name(n[0]))] or measured
        if kind == "position":
            measured = [names for names in measured if names in self.chains] or measured
        commanded = found if recording.episode is None else []  # actions are in every data set
        return measured or commanded

    def _convertible(self, name: str, kind: str) -> bool:
        unit = self.recording.unit_of(name)
        return not unit or unit_size("penetration" if kind == "position" else kind, unit) > 0.0

    def _moves(self, names: tuple[str, ...]) -> bool:
        """Whether any of the channels changes: a fixed frame is not a probe."""
        columns = (self.recording.channels[name] for name in names)
        return any(len(each) > 1 and bool((each != each[0]).any()) for each in columns)

    def _is_one(self, vector: Vector) -> bool:
        """Whether all components have one length and one clock, and a vector has this size."""
        recording, names = self.recording, vector.components
        lengths = {len(recording.channels[name]) for name in names}
        clocks = {recording.clocks.get(name) for name in names}
        right_size = vector.second or len(names) == 3 or self._vector_kind(vector) == "orientation"
        return len(lengths) == len(clocks) == 1 and right_size

    def _assume_vectors(self) -> list[Vector]:
        """Return position and force if both are arrays written as columns and nothing else fits.

        Numbered columns may as well be three runs or sensors, so otherwise the user must choose.
        """
        arrays = [each for each in self.arrays if not is_wanted(each.components[0])] or self.arrays
        taken = [v for kind in ("position", "force") for v in arrays if self._is(v, kind)]
        own = {name for each in arrays for name in each.components}
        rest = [n for n in self.recording.channels if n not in own and not is_wanted(n)]
        others = {self._kind(name) for name in rest}
        if [self._vector_kind(each) for each in taken] != ["position", "force"]:
            return []
        stems = [each.stem for each in taken]
        seconds = [each for each in arrays if each.second and each.stem in stems]
        return [] if others & {"position", "penetration", "force"} else taken + seconds

    def _assumptions(self, *chosen: tuple[str, ...]) -> Iterable[Finding]:
        arrays = [each.components for each in self.assumed if each.components in chosen]
        if arrays and self.columns.position is None:
            listed = " and ".join(", ".join(names) for names in arrays)
            words = f"palpate takes {listed} for x, y and z, because of their numbers"
            remedy = "if they are runs or sensors, choose one with --position and --force"
            yield Check.VECTORS.finding(words, remedy)

    def _is(self, vector: Vector, kind: str) -> bool:
        if vector.second:
            return kind == self._vector_kind(vector)
        return self._vector_kind(vector) == kind and (len(vector) != 4 or kind == "orientation")

    def _vector_kind(self, vector: Vector) -> str | None:
        if vector.second:
            first = channel_kind(vector.stem)
            if len(vector) == 4:
                return "angle" if first == "angle" else "orientation"  # seven joints are no pose
            return "angle" if first == "position" else "torque"
        name = vector.components[0]
        if channel_kind(name) == "torque":  # the stem of tx, ty and tz is that of a time
            return "torque"
        if "*" not in vector.stem and self._is_joint(name):
            return "angle"
        unit = self.recording.unit_of(name)
        # The stem of x, y, z is empty; then the component's name decides.
        return channel_kind(vector.stem, unit) or channel_kind(name, unit)

    def _kind(self, name: str) -> str | None:
        if name not in self.kinds:
            recording = self.recording
            kind = channel_kind(name, recording.unit_of(name) or "-")
            slides = not SLIDES.isdisjoint(split_name(name))
            if kind in ("position", "velocity") and self._is_joint(name):
                kind = "angle"
            kind = "position" if kind == "angle" and slides else kind
            if kind is None and name in recording.plots:
                kind = {"signal": "force", "axis": "position"}[recording.plots[name]]
            self.kinds[name] = "time" if recording.channels[name].dtype.kind in "mM" else kind
        return self.kinds[name]

    def _is_joint(self, name: str) -> bool:
        """Whether a channel is one of ROS's joints."""
        types = self.recording.types
        return any(types[each] == JOINTS and within(name, each) for each in types)

    def _because(self, role: str, names: Sequence[str]) -> None:
        words = f"the only {role}{' in space' if len(names) == 3 else ''}"
        self.reasons.setdefault(role, words)


def _with_clock_of_each_topic(roles: Roles) -> Roles:
    """The same roles, with a clock for each topic if the rows were joined from several topics."""
    position = (*roles.depth, roles.segment) if roles.segment else roles.depth
    velocity = () if roles.velocity is None else (roles.velocity,)
    topics = position, roles.force, roles.orientation, roles.torque, velocity
    own = roles.recording.clocks
    clocks = {roles.time or own.get(name) for names in topics for name in names}
    [time, *others] = clocks
    if time is None or others:
        return roles
    recording = separate_topics(roles.recording, time, topics)
    return roles if recording is None else replace(roles, time=None, recording=recording)


def _quantity(kind: str) -> str:
    """The quantity that the units of a role measure."""
    return "length" if kind in ("penetration", "position") else kind


def _share_source(one: str, other: str) -> bool:
    """Whether two channels are of one topic of messages, or of vectors in one group."""
    topic, dot, _ = one.partition(".")
    if dot and topic == other.partition(".")[0]:
        return True
    # ``/ft/wrench/force/x`` and ``/ft/wrench/torque/x`` differ only in the name of the vector.
    vectors = [re.sub(r"[/.][xyzw]$", "", name, flags=re.I) for name in (one, other)]
    groups = [name.rpartition("/")[0] for name in vectors]
    return groups[0] == groups[1]


def _numbers(names: Sequence[str]) -> list[str]:
    """The numbers in the name of a channel."""
    return re.findall(r"\d+", divide_unit(names[0])[0])


def _differing_groups(names: list[str]) -> list[str]:
    """Return the names without the ending that they all share: their groups."""
    parts = [re.split(r"(?=[/.])", name) for name in names]
    common, most = 0, min(map(len, parts))
    while common < most and len({tuple(each[len(each) - common - 1 :]) for each in parts}) == 1:
        common += 1
    return ["".join(each[: len(each) - common]) for each in parts]


def _options(values: Mapping[str, str], roles: Iterable[str]) -> str:
    """Options of the command line that name the channels of these roles."""
    return " ".join(f"--{role} {shlex.quote(values[role])}" for role in roles)
