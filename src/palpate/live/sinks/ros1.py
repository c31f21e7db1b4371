"""Estimates to ROS 1: ``--publish ros1:/palpate``."""

from collections.abc import Sequence

from palpate.live.sinks.publishing import Publisher, RosWire
from palpate.live.wires.addresses import parsed, topics_of
from palpate.live.wires.ros1_process import OPTIONS, Bridge

# Messages that wait in rospy for each subscriber, 20 s at 1 kHz.
WAITING = 20_000


def open_publisher(address: str) -> Publisher:
    """Return the sink of an address such as ``/palpate?master=http://robot:11311``."""
    publisher = Publisher(ROS1Wire(address))
    publisher.check()
    return publisher


class ROS1Wire(RosWire):
    """Two topics of ROS 1, by rospy in a process of its own.

    Parameters
    ----------
    address : str
        The topics' prefix, and the option ``master``.
    """

    def __init__(self, address: str) -> None:
        given = parsed("ros1", address, OPTIONS)
        super().__init__("ros1", topics_of(given, 1)[0], ros1=True)
        self._master = given.text("master", "")
        self._bridge: Bridge | None = None

    def open(self) -> None:
        """Become a node."""
        types = []
        for _, type_name in self.topics:
            text, checksum = self.encoder.definition_of(type_name)
            types.append((type_name.replace("/msg/", "/"), checksum, text))
        names = [name for name, _ in self.topics]
        task = {"mode": "publish", "topics": names, "types": types, "queue": WAITING}
        self._bridge = Bridge(task, self._master)

    def send(self, names: tuple[str, ...], values: Sequence[Sequence[float]]) -> int:
        """Send estimates; it waits where there is no room."""
        assert self._bridge is not None  # it is open
        self._bridge.write([(0, each) for each in self.estimates(names, values)])
        return 0

    def tell(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> None:
        """Send what is said in words."""
        assert self._bridge is not None  # it is open
        self._bridge.write([(1, self.encoder.status(state, source, stamp, values))])

    def close(self) -> None:
        """Leave ROS."""
        super().close()
        if self._bridge is not None:
            self._bridge.close()
        self._bridge = None
