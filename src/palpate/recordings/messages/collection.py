"""All topics of a recording, with their units, frames and reports."""

from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import partial

from palpate.errors import list_names
from palpate.recordings.messages.layout import (
    UndecodableError,
    message_fields,
    normal_name,
    one_line,
    walk_cdr,
    walk_ros1,
)
from palpate.recordings.messages.protobuf import JsonTopic
from palpate.recordings.messages.topic import LOG_TIME, BinaryTopic, Found, Topic, find_stamp
from palpate.recordings.opening import Draft, Request, within
from palpate.recordings.recording import Recording

NOT_ASKED = "not requested"
_FRAMES = ("header.frame_id", "frame_id", "parent_frame_id")

# Units of fields by message type: ROS uses SI (REP 103).
_UNITS = {
    ("Wrench", "force"): "N",
    ("Wrench", "torque"): "N·m",
    ("Pose", "position"): "m",
    ("PointStamped", "point"): "m",
    ("Transform", "translation"): "m",
    ("FrameTransform", "translation"): "m",
    ("Twist", "linear"): "m/s",
    ("Twist", "angular"): "rad/s",
    ("Accel", "linear"): "m/s²",
    ("Accel", "angular"): "rad/s²",
    ("Imu", "angular_velocity"): "rad/s",
    ("Imu", "linear_acceleration"): "m/s²",
    ("Range", "range"): "m",
    ("FluidPressure", "fluid_pressure"): "Pa",
}
_PACKAGES = ("geometry_msgs", "sensor_msgs", "foxglove")


@dataclass(slots=True)
class Collection(Draft):
    """Collects the topics of one or several files."""

    _topics: dict[Hashable, Topic] = field(default_factory=dict)
    _types: dict[str, str] = field(default_factory=dict)

    def topic(
        self, name: str, type_name: str, encoding: str, form: str, definition: bytes
    ) -> Topic:
        """Return the topic for the messages of a channel of the file.

        Parameters
        ----------
        name, type_name, encoding, form : str
            Name and type of the channel, and the encodings of its messages and of their
            definition. Channels that agree in all four are one topic.
        definition : bytes
            The definition of the messages.
        """
        name, type_name = one_line(name), normal_name(one_line(type_name))
        key = name, type_name, encoding, form
        if key in self._topics:
            return self._topics[key]
        if self._types.setdefault(name, type_name) != type_name:
            name = f"{name} ({type_name})"
        topic, reason = Topic(self.request), NOT_ASKED
        if self.request.wants(name):
            try:
                topic, reason = _make_topic(encoding, form, type_name, definition, self.request), ""
            except UndecodableError as error:
                reason = str(error)
        topic.name, topic.type_name, topic.omitted = name, type_name, reason
        self._topics[key] = topic
        return topic

    def lost(self, sentence: str) -> None:
        """Report an unreadable part, once."""
        if sentence not in self.losses:
            self.losses.append(sentence)

    @property
    def messages(self) -> int:
        """The number of messages found, read or not."""
        return sum(topic.messages for topic in self._topics.values())

    def recording(self) -> Recording:
        """Return the recording.

        Raises
        ------
        RecordingError
            No topic could be read, or a requested one is missing.
        """
        for topic in self._topics.values():
            self._say(topic)
            for name, found in topic.found.items():
                self._add(topic.name + name, found)
                self.types[topic.name] = topic.type_name
        unread = {topic.name for topic in self._topics.values() if topic.omitted == NOT_ASKED}
        if unread:
            self.omit(NOT_ASKED, list_names(sorted(unread)))
        self._check(list(self.channels))
        self.request.report(1.0)
        return self.done()

    def _say(self, topic: Topic) -> None:
        what = f"{topic.name} ({topic.type_name}, {topic.messages} messages)"
        if topic.omitted == NOT_ASKED:
            return
        if topic.undecodable:
            count = f"{topic.undecodable} of {topic.messages} messages"
            self.lost(f"{topic.name}: {count} could not be decoded: {topic.reason}")
        if topic.omitted:
            self.omissions.append(f"{what} was not read: {topic.omitted}")
        elif not topic.messages:
            self.omissions.append(f"{what} is empty")
        elif not topic.found:
            asked = "" if self.request.channels is None else " that were requested"
            self.omissions.append(f"{what} holds no numbers{asked}")
        if topic.found and topic.skipped:
            self.omit(topic.name, f"palpate skips long lists: {list_names(sorted(topic.skipped))}")

    def _add(self, above: str, found: Found) -> None:
        names = {path: f"{above}.{path}" for path in found.columns}
        names[LOG_TIME] = f"{above}.log_time"
        for path in list(found.columns):
            self.channels[names[path]], faults = found.finish(path)
            if faults is not None:
                self.faults[names[path]] = faults
        stamp = find_stamp(found.times & names.keys())
        known = stamp is not None and self.channels[names[stamp]].any()
        clock = names[stamp] if stamp is not None and known else names[LOG_TIME]
        self.clocks |= dict.fromkeys(names.values(), clock)
        self.units |= {names[path]: "ns" for path in names.keys() & {LOG_TIME, *found.times}}
        self._describe(above, names, found)

    def _describe(self, above: str, names: dict[str, str], found: Found) -> None:
        units = {path: _find_unit(*where) for path, where in found.types.items()}
        frame = next((found.frames[path] for path in _FRAMES if path in found.frames), [])
        if len(frame) > 1:
            self.omit(above, f"its frame changes ({frame[0]!r}, {frame[1]!r}, …) and is ignored")
        for path, name in names.items():
            parts = path.split(".")
            for k in range(1, len(parts)):
                if (unit := units.get(".".join(parts[:k]))) is not None:
                    self.units.setdefault(name, unit)
            if len(frame) == 1 and frame[0]:
                self.frames[name] = frame[0]
        # The child frame of a transform; velocities of an odometry are in it.
        moving = found.frames.get("child_frame_id", [])
        if len(moving) != 1 or not moving[0] or above.endswith("]"):  # tf: it is in the name
            return
        self.notes[f"{above}.child_frame_id"] = moving[0]
        if found.types.get("twist") == ("nav_msgs/msg/Odometry", "twist"):
            velocities = (name for path, name in names.items() if path.startswith("twist."))
            self.frames |= dict.fromkeys(velocities, moving[0])

    def _check(self, names: list[str]) -> None:
        if not self._topics and self.losses:
            raise self.error(f"no topic can be read: {self.losses[0]}")
        for wanted in self.request.channels or ():
            if not any(within(name, wanted) for name in names):
                there = sorted({topic.name for topic in self._topics.values()})
                why = [each for each in self.omissions if each.startswith(f"{wanted} ")]
                reason = f"{wanted!r} has no readable numbers" + "".join(f" ({w})" for w in why[:1])
                raise self.error(f"{reason}; available topics: {list_names(there)}")
        if not names:
            words = ". ".join(["readable numbers", *[*self.losses, *self.omissions][:2]])
            remedy = "record a topic with the force and one with the position"
            raise self.error(f"no topic has {words}; {remedy}")


def _find_unit(type_name: str, field: str) -> str | None:
    """The unit of a field of a message type; None if the type does not define it."""
    package, _, rest = type_name.replace(".", "/").partition("/")
    if package not in _PACKAGES:
        return None
    return _UNITS.get((rest.rpartition("/")[2], field))


def _make_topic(
    message_encoding: str, schema_encoding: str, type_name: str, schema: bytes, request: Request
) -> Topic:
    """Return a topic that reads messages with these encodings.

    Raises
    ------
    UndecodableError
        palpate cannot read them.
    """
    if message_encoding == "json":
        return JsonTopic(request)
    if message_encoding == "protobuf" and schema_encoding == "protobuf":
        from palpate.recordings.messages.protobuf import ProtobufTopic  # needs protobuf

        return ProtobufTopic(type_name, schema, request)
    if message_encoding not in ("cdr", "ros1"):
        raise UndecodableError(
            f"palpate reads messages in CDR, ROS 1, JSON or protobuf, not {message_encoding[:30]!r}"
        )
    ros1 = message_encoding == "ros1"
    if schema_encoding not in ("ros1msg", "ros2msg", "ros2idl", "omgidl", ""):
        raise UndecodableError(f"palpate cannot read definitions in {schema_encoding[:30]!r}")
    form = "ros1msg" if ros1 else schema_encoding or "ros2msg"
    form = "ros2idl" if form == "omgidl" else form
    fields = message_fields(type_name, form, schema.decode("utf-8", "replace"))
    walk = partial(walk_ros1 if ros1 else walk_cdr, fields=fields)
    return BinaryTopic(walk, request, cdr=not ros1)
