"""From topics to the channels of a recording: their names, clocks, frames and units."""

from typing import Any

from numpy.typing import NDArray

from palpate.recordings.messages.topic import LOG_TIME, Found, Topic, stamp_of
from palpate.recordings.messages.units import unit_of
from palpate.recordings.recording import Faults


class Channels:
    """Channels of all topics, and what is known of each."""

    def __init__(self) -> None:
        self.values: dict[str, NDArray[Any]] = {}
        self.units: dict[str, str] = {}
        self.clocks: dict[str, str] = {}
        self.frames: dict[str, str] = {}
        self.types: dict[str, str] = {}
        self.faults: dict[str, Faults] = {}
        self.notes: dict[str, str] = {}
        self.omissions: list[str] = []

    def add(self, topic: Topic) -> None:
        """Take the channels of a topic out of it."""
        for name, found in topic.found.items():
            self._add(topic.name + name, found)
        if topic.found:
            self.types[topic.name] = topic.type_name

    def _add(self, above: str, found: Found) -> None:
        columns = found.rows.columns
        times = set(found.times)
        names = {path: f"{above}.{path}" for path in columns}
        names[LOG_TIME] = f"{above}.log_time"
        for path in list(columns):
            values, faults = columns.pop(path).finish()
            self.values[names[path]] = values
            if faults is not None:
                self.faults[names[path]] = faults
        stamp = stamp_of(times & names.keys())
        clock = names[LOG_TIME]
        if stamp is not None and self.values[names[stamp]].any():
            clock = names[stamp]
        for path, name in names.items():
            self.clocks[name] = clock
            if path == LOG_TIME or path in times:
                self.units[name] = "ns"
        self._describe(above, names, found)

    def _describe(self, above: str, names: dict[str, str], found: Found) -> None:
        units = {path: unit_of(*where) for path, where in found.types.items()}
        frame = next((found.frames[path] for path in _FRAMES if path in found.frames), [])
        if len(frame) > 1:
            self.omissions.append(
                f"{above}: its frame changes ({frame[0]!r}, {frame[1]!r}, …): none is given"
            )
        for path, name in names.items():
            parts = path.split(".")
            for k in range(1, len(parts)):
                unit = units.get(".".join(parts[:k]))
                if unit is not None:
                    self.units.setdefault(name, unit)
            if len(frame) == 1 and frame[0]:
                self.frames[name] = frame[0]
        self._moving(above, names, found)

    def _moving(self, above: str, names: dict[str, str], found: Found) -> None:
        """The frame that moves: of a transform; of an odometry its velocities are in it."""
        moving = found.frames.get("child_frame_id", [])
        if len(moving) != 1 or not moving[0] or above.endswith("]"):  # tf has it in the name
            return
        self.notes[f"{above}.child_frame_id"] = moving[0]
        if found.types.get("twist") == ("nav_msgs/msg/Odometry", "twist"):
            for path in names:
                if path.startswith("twist."):
                    self.frames[names[path]] = moving[0]


_FRAMES = ("header.frame_id", "frame_id", "parent_frame_id")
