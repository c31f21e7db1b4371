"""Choosing the channels for time, position and force, by their names and units."""

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields

from palpate.errors import MissingChannelError, RecordingError
from palpate.recordings import Recording
from palpate.recordings.opening import within
from palpate.recordings.recording import UNITS, plain_unit, stated_unit, unit_in_name

_INDEX = re.compile(r"^(.*)\[(\d+)\]$")
_LETTERS = ("xyzw", "xyz")
_DIGITS = ("0123", "012", "1234", "123")
# Arrays of two vectors: force and torque, or position and quaternion.
_PAIRED = {"012345": (3, 6), "123456": (3, 6), "0123456": (3, 7), "1234567": (3, 7)}


@dataclass(frozen=True, slots=True)
class Vector:
    """Channels that are the components of one vector.

    Attributes
    ----------
    stem : str
        The common part of their names: ``/ft.wrench.force`` of ``/ft.wrench.force.x``, ``f*_N``
        of ``fx_N``.
    components : tuple of str
        The channels, in the order x, y, z (w) or of their numbers.
    second : bool
        Whether it is the second vector in an array of six or seven: a torque or a quaternion.
    """

    stem: str
    components: tuple[str, ...]
    second: bool = False

    def __len__(self) -> int:
        return len(self.components)


def vectors_of(names: Iterable[str]) -> list[Vector]:
    """Find vectors of three or four components, in order of first appearance.

    ``force.x``, ``force.y``, ``force.z``; ``pos[0]``, ``pos[1]``, ``pos[2]``; ``fx_N``, ``fy_N``,
    ``fz_N``; ``q0`` to ``q3``, ``F1`` to ``F3``. A ``.w`` makes it a quaternion; six or seven
    numbered channels are two vectors.
    """
    families: dict[str, dict[str, str]] = defaultdict(dict)
    for name in names:
        for stem, place in _places(name):
            families[stem].setdefault(place, name)
    found: list[Vector] = []
    taken: set[str] = set()
    for stem, places in families.items():
        for vector in _vectors(stem, places):
            if taken.isdisjoint(vector.components):
                found.append(vector)
                taken.update(vector.components)
    return found


def _places(name: str) -> Iterable[tuple[str, str]]:
    """Each way to read a name as a component: the common part, and the letter or number."""
    if (indexed := _INDEX.match(name)) is not None:
        yield indexed[1], indexed[2]
        return
    stem, dot, last = name.rpartition(".")
    if dot and last.lower() in ("x", "y", "z", "w"):
        yield stem, last.lower()
        return
    for k, sign in enumerate(name):
        if sign.lower() in "wxyz" or sign.isdigit():
            yield f"{name[:k]}*{name[k + 1 :]}", sign.lower()


def _vectors(stem: str, places: dict[str, str]) -> Iterable[Vector]:
    for order in _LETTERS:
        if all(place in places for place in order):
            yield Vector(stem, tuple(places[place] for place in order))
            return
    # Numbered channels must be complete: three of ten numbered columns are not a vector.
    for order in (*_DIGITS, *_PAIRED):
        if sorted(places) == list(order):
            components = tuple(places[place] for place in order)
            first, last = _PAIRED.get(order, (len(order), 0))
            yield Vector(stem, components[:first])
            if last:
                yield Vector(stem, components[first:last], second=True)
            return


# What a channel measures, by its unit and the words of its name.

# Words that state what a channel without a unit measures. The last such word of a name counts:
# "/tool.wrench.torque" is a torque.
WORDS: dict[str, tuple[str, ...]] = {
    "time": ("time", "t", "stamp", "timestamp", "seconds", "sec"),
    "force": ("force", "forces", "wrench", "load", "ft", "f", "fx", "fy", "fz", "fn", "fts"),
    "torque": ("torque", "torques", "moment", "tau", "mx", "my", "mz", "tx", "ty", "tz"),
    "penetration": ("penetration", "indentation", "depth", "deformation", "compression"),
    "position": (
        "position", "positions", "pos", "p", "x", "y", "z", "px", "py", "pz", "s", "pose", "tip",
        "tcp", "ee", "translation", "displacement", "disp", "height", "location", "stroke",
    ),
    "velocity": ("velocity", "vel", "speed", "v", "vx", "vy", "vz", "linear", "xd"),
    "orientation": ("orientation", "quaternion", "quat", "q", "rotation", "rot"),
    "nothing": ("angular", "acceleration", "accel", "acc", "covariance", "effort", "current"),
}  # fmt: skip
_KIND = {word: kind for kind, words in WORDS.items() for word in words}
#: Words for commanded, not measured, channels.
WANTED = frozenset(
    ("command", "commands", "commanded", "cmd", "desired", "des", "target", "targets", "setpoint",
     "reference", "ref", "goal", "goals", "action", "actions", "planned", "demand", "demanded")
)  # fmt: skip
TIP = frozenset(("tip", "tcp", "probe"))
_OF_UNIT = {
    **dict.fromkeys(UNITS["time"], ("time",)),
    **dict.fromkeys(UNITS["force"], ("force",)),
    **dict.fromkeys(UNITS["penetration"], ("penetration", "position")),
    **dict.fromkeys(UNITS["velocity"], ("velocity",)),
    **dict.fromkeys(("Nm", "N·m", "N*m", "mNm"), ("torque",)),
}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+")


def kind_of(name: str, unit: str | None = None) -> str | None:
    """Return what a channel measures: a key of ``WORDS``, or None if its name does not tell.

    Parameters
    ----------
    name : str
        Name of the channel, or the common part of the components of a vector.
    unit : str, optional
        Unit in the recording. Default: the unit at the end of the name.
    """
    unit = plain_unit(unit) if unit else stated_unit(name)
    possible = _OF_UNIT.get(unit or "")
    kinds = [_KIND[word] for word in split_name(name) if word in _KIND and word != unit]
    if possible is None:
        return kinds[-1] if kinds else None
    fitting = [kind for kind in kinds if kind in possible]
    return fitting[-1] if fitting else possible[-1]


def is_wanted(name: str) -> bool:
    """Whether the name suggests a commanded, not a measured, channel."""
    return not WANTED.isdisjoint(split_name(name))


def split_name(name: str) -> list[str]:
    """The words of a name in lower case, without its unit: ``Fz [mN]`` is fz."""
    unit = stated_unit(name)
    if unit is not None:
        name = re.sub(rf"[\[(_/ ]*{re.escape(unit)}[\])\s]*$", "", name)
    return [word.lower() for word in _WORD.findall(name)]


# Choosing the channels of a contact, with reasons.


@dataclass(frozen=True, slots=True)
class Columns:
    """Names of the channels; palpate auto-detects a channel that has no default name.

    A name is that of a channel, of three channels ``x,y,z`` of a vector, or of a topic or group
    that holds one, such as ``/ft``.

    Parameters
    ----------
    time, penetration, force, velocity : str
        Channels in s, m, N and m/s; with velocity ``"none"`` palpate computes the velocity.
    segment : str
        Channel with a label that changes where a new contact begins.
    position : str, optional
        Position of the probe, m, along one axis or in space, instead of a penetration.
    orientation : str, optional
        Orientation of the probe, a quaternion x, y, z, w; it rotates a force in the tool's frame.
    """

    time: str = "time_s"
    penetration: str = "penetration_m"
    force: str = "force_N"
    velocity: str = "velocity_m_s"
    segment: str = "segment"
    position: str | None = None
    orientation: str | None = None

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
    reasons : mapping
        Role to the reason for its choice, as text.
    """

    depth: tuple[str, ...]
    is_penetration: bool
    force: tuple[str, ...]
    time: str | None = None
    velocity: str | None = None
    segment: str | None = None
    orientation: tuple[str, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)

    @property
    def by_role(self) -> dict[str, tuple[str, ...]]:
        """The channels of each role except the time."""
        single = {"velocity": self.velocity, "segment": self.segment}
        own = {role: () if name is None else (name,) for role, name in single.items()}
        return {"depth": self.depth, "force": self.force, "orientation": self.orientation, **own}


def roles_of(recording: Recording, columns: Columns | None = None) -> Roles:
    """Choose the channels of a contact.

    A channel is chosen by the given name, else by its default name, else because it is the only one
    whose name or unit fits.

    Raises
    ------
    MissingChannelError
        No channel has the given name, or none fits.
    RecordingError
        Several channels fit: the message names them and the option.
    """
    return _Choosing(recording, Columns() if columns is None else columns).roles()


@dataclass
class _Choosing:
    recording: Recording
    columns: Columns
    reasons: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.vectors = vectors_of(self.recording.channels)
        self.kinds: dict[str, str | None] = {}

    def roles(self) -> Roles:
        if self.columns.position is not None:
            depth, is_penetration = self._named("position", self.columns.position), False
        else:
            depth = self._given("penetration") or self._only("penetration", 1)
            is_penetration = bool(depth)
            depth = depth or self._only("position", 3) or self._only("position", 1)
        if not depth:
            raise self._missing("penetration_m")
        sizes = (3, 1) if len(depth) == 3 else (1, 3)
        force = self._given("force") or self._only("force", sizes[0])
        force = force or self._only("force", sizes[1])
        if not force:
            raise self._missing("force_N")
        time = self._given("time")
        if not time and not self.recording.clocks:
            time = self._only("time", 1)
        return Roles(
            depth,
            is_penetration,
            force,
            next(iter(time), None),
            next(iter(self._velocity(depth, is_penetration)), None),
            next(iter(self._given("segment")), None),
            self._orientation(depth),
            self.reasons,
        )

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

    def _orientation(self, depth: tuple[str, ...]) -> tuple[str, ...]:
        """The named orientation, else that in the position's topic or group, else the only one."""
        if self.columns.orientation is not None:
            return self._named("orientation", self.columns.orientation)
        found = self._candidates("orientation", 4)
        own = [names for names in found if _group(names[0]) == _group(depth[0])]
        return own[0] if len(own) == 1 else found[0] if len(found) == 1 else ()

    def _given(self, role: str) -> tuple[str, ...]:
        """The named channels, or those of the default name if present."""
        name = getattr(self.columns, role)
        if name == getattr(Columns(), role) and name not in self.recording.channels:
            return ()
        return self._named(role, name)

    def _named(self, role: str, name: str) -> tuple[str, ...]:
        channels = self.recording.channels
        if name in channels:
            self.reasons[role] = "has this name"
            return (name,)
        parts = tuple(part.strip() for part in name.split(","))
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
        below = [
            vector
            for vector in self.vectors
            if within(vector.stem, name) and len(vector) == size and self._is(vector, kind)
        ] or [vector for vector in self.vectors if vector.stem == name and len(vector) == size]
        if len(below) == 1:
            self.reasons[role] = f"the {role} of {name}"
            return below[0].components
        single = [each for each in channels if within(each, name) and self._kind(each) == kind]
        if len(single) == 1:
            self.reasons[role] = f"the {role} of {name}"
            return (single[0],)
        raise self._missing(name)

    def _missing(self, name: str) -> MissingChannelError:
        return MissingChannelError(name, list(self.recording.channels), self.recording.source)

    def _only(self, role: str, size: int) -> tuple[str, ...]:
        """The only channel or vector that fits, or none; raise if several fit."""
        found = self._candidates(role, size)
        if len(found) > 1:
            listed = ", ".join(" ".join(names) for names in found[:6])
            words = f"{len(found)} channels could be the {role}: {listed}{', …' * (len(found) > 6)}"
            raise RecordingError.of(self.recording.source, f"{words}; choose one with --{role}")
        if found:
            self._because(role, found[0])
        return found[0] if found else ()

    def _candidates(self, kind: str, size: int) -> list[tuple[str, ...]]:
        """Channels or vectors that measure this quantity; commanded ones only if alone."""
        recording = self.recording
        if size > 1:
            found = [v.components for v in self.vectors if len(v) == size and self._is(v, kind)]
        else:
            used = {name for vector in self.vectors for name in vector.components}
            used.update(recording.clocks.values())
            found = [
                (name,)
                for name, values in recording.channels.items()
                if name not in used
                and values.ndim == 1
                and values.dtype.kind in "fiu"
                and self._kind(name) == kind
            ]
        measured = [names for names in found if not is_wanted(names[0])]
        if kind == "position":  # of several bodies, the tip touches the material
            tips = [names for names in measured if not TIP.isdisjoint(split_name(names[0]))]
            measured = tips or measured
        if measured and kind == "time":
            plain = [n for n in measured if n[0].lower() in ("time", "t", "timestamp", "stamp")]
            return plain[:1] if plain else measured[:1]
        return measured or found

    def _is(self, vector: Vector, kind: str) -> bool:
        if vector.second:
            return kind == "orientation" and len(vector) == 4
        name = vector.components[0]
        unit = self.recording.units.get(name) or unit_in_name(name)
        # The stem of x, y, z is empty; then the component's name decides.
        found = kind_of(vector.stem, unit) or kind_of(name, unit)
        return found == kind and (len(vector) != 4 or kind == "orientation")

    def _kind(self, name: str) -> str | None:
        if name not in self.kinds:
            self.kinds[name] = kind_of(name, self.recording.units.get(name))
        return self.kinds[name]

    def _because(self, role: str, names: Sequence[str]) -> None:
        self.reasons[role] = f"the only {role}{' in space' if len(names) == 3 else ''}"


def _group(name: str) -> str:
    """The topic of a message channel, or the group of an array."""
    topic, dot, _ = name.partition(".")
    return topic if dot else name.rpartition("/")[0]
