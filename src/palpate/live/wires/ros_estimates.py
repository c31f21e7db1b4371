"""Estimates as messages that every user of ROS can echo and plot.

``…/estimate`` is a ``std_msgs/Float64MultiArray`` for each sample, whose layout names its numbers:
one dimension, with all the names, and commas between them, as its label. ``…/status`` is a
``diagnostic_msgs/DiagnosticArray`` a few times a second: the state in words, and each number with
its name and unit.
"""

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate.errors import MissingExtraError
from palpate.live.wires.ordering import NANO

ESTIMATE, STATUS = "std_msgs/msg/Float64MultiArray", "diagnostic_msgs/msg/DiagnosticArray"
#: What is published: the end of a topic's name, and its type.
TOPICS = (("estimate", ESTIMATE), ("status", STATUS))
# DiagnosticStatus: OK, WARN, ERROR, STALE.
_LEVELS = {"invalid": 1, "held": 1, "lost": 3}


class RosEncoder:
    """Makes messages of ROS 2, in CDR."""

    def __init__(self) -> None:
        try:
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise MissingExtraError(
                "messages of ROS need rosbags: pip install 'palpate[live]'"
            ) from None
        self._store = get_typestore(Stores.LATEST)
        self._names: tuple[str, ...] = ()
        self._template, self._at, self._form = bytearray(), 0, struct.Struct("")

    def hash_of(self, type_name: str) -> str:
        """Return the hash of a type's description, by which ROS 2 distinguishes versions of it."""
        return self._store.hash_rihs01(type_name)

    def estimate(self, names: tuple[str, ...], values: Sequence[float]) -> bytes:
        """Return the message of one sample; only its numbers are written anew."""
        if names != self._names:
            self._prepare(names)
        self._form.pack_into(self._template, self._at, *values)
        return bytes(self._template)

    def _prepare(self, names: tuple[str, ...]) -> None:
        types, size = self._store.types, len(names)
        dimension = types["std_msgs/msg/MultiArrayDimension"](",".join(names), size, size)
        layout = types["std_msgs/msg/MultiArrayLayout"]([dimension], 0)
        message = types[ESTIMATE](layout, np.zeros(size))
        # The numbers are the last of it.
        self._template = bytearray(self._bytes(message, ESTIMATE))
        self._form = struct.Struct(f"<{size}d")
        self._at = len(self._template) - self._form.size
        self._names = names

    def status(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> bytes:
        """Return the message that says the state in words.

        Parameters
        ----------
        state : str
            A :class:`~palpate.live.states.State`, in small letters.
        source : str
            Where the samples come from.
        stamp : int
            ns, by the robot's clock.
        values : dict
            What is said, by name; numbers are written with 15 digits.
        """
        types = self._store.types
        time = types["builtin_interfaces/msg/Time"](*divmod(max(stamp, 0), NANO))
        header = types["std_msgs/msg/Header"](time, "")
        pairs = [
            types["diagnostic_msgs/msg/KeyValue"](
                name, value if isinstance(value, str) else f"{value:.15g}"
            )
            for name, value in values.items()
        ]
        one: Any = types["diagnostic_msgs/msg/DiagnosticStatus"](
            _LEVELS.get(state, 0), "palpate", state, source, pairs
        )
        return self._bytes(types[STATUS](header, [one]), STATUS)

    def _bytes(self, message: object, type_name: str) -> bytes:
        return bytes(self._store.serialize_cdr(message, type_name, little_endian=True))
