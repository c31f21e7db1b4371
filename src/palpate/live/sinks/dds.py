"""Estimates to ROS 2 over DDS: ``--publish dds:/palpate``."""

from collections.abc import Sequence
from typing import Any

from palpate.live.sinks.publishing import RosWire
from palpate.live.wires.addresses import parsed, topics_of
from palpate.live.wires.dds_domain import DEPTH, OPTIONS, PATIENCE, participant, raw_type


class DDSWire(RosWire):
    """Two topics of a domain, reliable.

    Parameters
    ----------
    address : str
        The topics' prefix, and the options ``domain`` and ``interface``.
    """

    def __init__(self, address: str) -> None:
        given = parsed("dds", address, OPTIONS)
        super().__init__("dds", topics_of(given, 1)[0])
        self._domain = given.whole("domain", 0, 0, 230)
        self._interface = given.options.get("interface")
        self._writers: list[tuple[Any, Any]] = []

    def open(self) -> None:
        """Join the domain."""
        member = participant(self._domain, self._interface)
        from cyclonedds.core import Policy, Qos
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        qos = Qos(
            Policy.Reliability.Reliable(round(1e9 * PATIENCE)),
            Policy.Durability.Volatile,
            Policy.History.KeepLast(DEPTH),
        )
        for name, type_name in self.topics:
            kind = raw_type(type_name)
            topic: Any = Topic(member, f"rt{name}", kind)
            self._writers.append((DataWriter(member, topic, qos=qos), kind))

    def send(self, names: tuple[str, ...], values: Sequence[Sequence[float]]) -> int:
        """Send estimates; return how many no reader took in time."""
        return sum(not self._write(0, each) for each in self.estimates(names, values))

    def tell(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> None:
        """Send what is said in words."""
        self._write(1, self.encoder.status(state, source, stamp, values))

    def _write(self, index: int, data: bytes) -> bool:
        from cyclonedds.core import DDSException

        writer, kind = self._writers[index]
        try:
            writer.write(kind.of(data))
        except DDSException:
            return False
        return True

    def close(self) -> None:
        """Leave the domain."""
        super().close()
        self._writers.clear()
