"""All topics of a recording, with their units, frames and reports."""

from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import partial
from itertools import accumulate

from palpate.errors import list_names
from palpate.input.recordings.messages.layout import (
    UndecodableError,
    message_fields,
    normal_name,
    one_line,
    walk_cdr,
    walk_ros1,
)
from palpate.input.recordings.messages.protobuf import JsonTopic
from palpate.input.recordings.messages.topic import LOG_TIME, BinaryTopic, Series, Topic, find_stamp
from palpate.input.recordings.opening import Draft, Request, within
from palpate.input.recordings.recording import Recording

NOT_ASKED = "not requested"
_NONE_REQUESTED = "holds no numbers that were requested"
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
        name = one_line(name)
        type_name = normal_name(one_line(type_name))
        key = name, type_name, encoding, form
        if key in self._topics:
            return self._topics[key]
        if self._types.setdefault(name, type_name) != type_name:
            name = f"{name} ({type_name})"
        topic = Topic(self.request)
        topic.omitted = NOT_ASKED
        if self.request.wants(name):
            try:
                topic = _make_topic(encoding, form, type_name, definition, self.request)
            except UndecodableError as error:
                topic.omitted = str(error)
        topic.name = name
        topic.type_name = type_name
        self._topics[key] = topic
        return topic

    def lost(self, sentence: str) -> None:
        """Report an unreadable part, once."""
        if sentence not in self.losses:
            self.losses.append(sentence)

    @property
    def messages(self) -> int:
        """The number of messages in the files, read or not."""
        return sum(topic.messages for topic in self._topics.values())

    def recording(self) -> Recording:
        """Return the recording.

        Raises
        ------
        RecordingError
            No topic could be read, or a requested one is missing.
        """
        for topic in self._topics.values():
            self._report(topic)
            for name, series in topic.series.items():
                self._add(topic.name + name, series)
                self.types[topic.name] = topic.type_name
        unread = {topic.name for topic in self._topics.values() if topic.omitted == NOT_ASKED}
        if unread:
            self.omit(NOT_ASKED, list_names(sorted(unread)))
        self._check(list(self.channels))
        self.request.report(1.0)
        return self.done()

    def _report(self, topic: Topic) -> None:
        """Report what of a topic is not in the recording."""
        if topic.omitted == NOT_ASKED:
            return
        if topic.undecodable:
            self.lost(
                f"{topic.name}: {topic.undecodable} of {topic.messages} messages could not be "
                f"decoded: {topic.reason}"
            )
        why = ""
        if topic.omitted:
            why = f"was not read: {topic.omitted}"
        elif not topic.messages:
            why = "is empty"
        elif not topic.series:
            why = "holds no numbers" if self.request.channels is None else _NONE_REQUESTED
        if why:
            title = f"{topic.name} ({topic.type_name}, {topic.messages} messages)"
            self.omissions.append(f"{title} {why}")
        if topic.series and topic.skipped:
            self.omit(topic.name, f"palpate skips long lists: {list_names(sorted(topic.skipped))}")

    def _add(self, above: str, series: Series) -> None:
        names = {path: f"{above}.{path}" for path in series.columns}
        names[LOG_TIME] = f"{above}.log_time"
        for path in list(series.columns):
            self.channels[names[path]], faults = series.finish(path)
            if faults is not None:
                self.faults[names[path]] = faults
        clock = names[find_stamp(series.times & names.keys()) or LOG_TIME]
        if not self.channels[clock].any():  # nobody set the stamp
            clock = names[LOG_TIME]
        self.clocks |= dict.fromkeys(names.values(), clock)
        self.units |= {names[path]: "ns" for path in names.keys() & {LOG_TIME, *series.times}}
        self._describe(above, names, series)

    def _describe(self, above: str, names: dict[str, str], series: Series) -> None:
        for path, name in names.items():
            fields = accumulate(path.split(".")[:-1], "{}.{}".format)
            units = (_find_unit(*series.types[field]) for field in fields if field in series.types)
            if unit := next(filter(None, units), None):
                self.units.setdefault(name, unit)
        frame = next((series.frames[path] for path in _FRAMES if path in series.frames), [""])
        if len(frame) > 1:
            self.omit(above, f"its frame changes ({frame[0]!r}, {frame[1]!r}, …) and is ignored")
        elif frame[0]:
            self.frames |= dict.fromkeys(names.values(), frame[0])
        # The child frame of a transform; velocities of an odometry are in it.
        moving = series.frames.get("child_frame_id", [""])
        if len(moving) > 1 or not moving[0] or above.endswith("]"):  # tf: it is in the name
            return
        self.notes[f"{above}.child_frame_id"] = moving[0]
        if series.types.get("twist") == ("nav_msgs/msg/Odometry", "twist"):
            velocities = (name for path, name in names.items() if path.startswith("twist."))
            self.frames |= dict.fromkeys(velocities, moving[0])

    def _check(self, names: list[str]) -> None:
        if not self._topics and self.losses:
            raise self.error(f"no topic can be read: {self.losses[0]}")
        for channel in self.request.channels or ():
            if not any(within(name, channel) for name in names):
                topics = sorted({topic.name for topic in self._topics.values()})
                why = [f" ({text})" for text in self.omissions if text.startswith(f"{channel} ")]
                raise self.error(
                    f"{channel!r} has no readable numbers{''.join(why[:1])}; "
                    f"available topics: {list_names(topics)}"
                )
        if not names:
            reasons = ". ".join(["readable numbers", *[*self.losses, *self.omissions][:2]])
            raise self.error(
                f"no topic has {reasons}; record a topic with the force and one with the position"
            )


def _find_unit(type_name: str, field: str) -> str | None:
    """The unit of a field of a message type; None if the type does not define it."""
    package, *_, name = type_name.replace(".", "/").split("/")
    return _UNITS.get((name, field)) if package in _PACKAGES else None


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
        from palpate.input.recordings.messages.protobuf import ProtobufTopic  # needs protobuf

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
