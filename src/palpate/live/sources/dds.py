"""Samples of ROS 2 over DDS, without an installation of ROS: ``dds:/pose,/wrench``."""

import time
from typing import TYPE_CHECKING, Any

from palpate.errors import PalpateError
from palpate.live.arrivals import Arrival
from palpate.live.sources.opening import SourceOptions
from palpate.live.wires import ros_topics
from palpate.live.wires.addresses import WireAddress, parsed
from palpate.live.wires.ros_topics import Message, RosTopics

if TYPE_CHECKING:
    from cyclonedds.builtin import BuiltinDataReader, DcpsEndpoint
    from cyclonedds.core import WaitSet
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.sub import DataReader

OPTIONS = (*ros_topics.OPTIONS, "domain", "interface")
#: s: that ``open`` waits for the topics, so that one of a wrong type is refused at once.
PATIENCE = 0.5
_AT_ONCE = 256  # messages that are taken together


def open_source(address: str, options: SourceOptions | None = None) -> "DDS":
    """Return the source of an address such as ``/pose,/wrench?domain=3&interface=eth0``."""
    return DDS(parsed("dds", address, OPTIONS), options or SourceOptions())


class DDS(RosTopics):
    """Topics of ROS 2, found by discovery; a reader begins as soon as its topic's type is known.

    Parameters
    ----------
    address : WireAddress
        Topics and options: those of :class:`~palpate.live.wires.ros_topics.RosTopics`, ``domain``,
        and ``interface``, of the network: this machine only unless given.
    options : SourceOptions
        What is known of the samples.
    """

    def __init__(self, address: WireAddress, options: SourceOptions) -> None:
        super().__init__(address, options)
        self._domain = address.whole("domain", 0, 0, 230)
        self._interface = address.options.get("interface")
        self._participant: DomainParticipant | None = None
        self._discovery: BuiltinDataReader | None = None
        self._waits: WaitSet | None = None
        self._readers: dict[int, DataReader[Any]] = {}

    def open(self) -> None:
        """Join the domain and look for the topics; one that comes later is waited for."""
        from palpate.live.wires.dds_domain import participant

        self._participant = participant(self._domain, self._interface)
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import WaitSet

        self._waits = WaitSet(self._participant)
        self._discovery = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._wake_for(self._discovery)
        until = time.monotonic() + PATIENCE
        while len(self._readers) < len(self.topics) and time.monotonic() < until:
            self._waits.wait(max(round(1e9 * (until - time.monotonic())), 0))
            self._discover()
        self.await_topics()

    def _wake_for(self, reader: Any) -> None:
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState

        assert self._waits is not None
        every = InstanceState.Any | ViewState.Any | SampleState.Any
        self._waits.attach(ReadCondition(reader, every))

    def _discover(self) -> None:
        """Meet publishers that are new."""
        from cyclonedds.core import InstanceState

        assert self._discovery is not None
        for found in self._discovery.take(_AT_ONCE):
            if found.sample_info.instance_state != InstanceState.Alive:
                continue
            for index, name in enumerate(self.names):
                if found.topic_name == f"rt{name}":
                    self._meet(index, found)

    def _meet(self, index: int, found: "DcpsEndpoint") -> None:
        type_name = ros_topics.ros2_type(found.type_name)
        topic = self.topics[index]
        if index in self._readers:
            if type_name != topic.type_name:
                self.refuse(f"{topic.name}: a publisher of the type {type_name} is not followed")
            return
        self.accept(index, type_name)
        self._readers[index] = self._reader(topic.name, type_name, found.qos)

    def _reader(self, name: str, type_name: str, offered: Any) -> "DataReader[Any]":
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        from palpate.live.wires.dds_domain import DEPTH, raw_type
        from palpate.live.wires.dds_domain import PATIENCE as BLOCKING

        assert self._participant is not None
        # One who asks for more than a publisher offers gets nothing; sensors often offer less.
        kind = offered[Policy.Reliability]
        if kind != Policy.Reliability.BestEffort:
            kind = Policy.Reliability.Reliable(round(1e9 * BLOCKING))
        qos = Qos(
            kind,
            Policy.Durability.Volatile,
            Policy.History.KeepLast(DEPTH),
            Policy.DataRepresentation(
                use_cdrv0_representation=True, use_xcdrv2_representation=True
            ),
        )
        topic = Topic(self._participant, f"rt{name}", raw_type(type_name))
        reader: DataReader[Any] = DataReader(self._participant, topic, qos=qos)
        self._wake_for(reader)
        return reader

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None where none came in time [s]."""
        if self._waits is None:
            raise PalpateError(f"{self.name} is not open")
        until, waited = time.monotonic() + timeout, False
        ready = self.ready
        while not ready:
            if self._receive(waited=waited):
                if not ready and time.monotonic() >= until:
                    return None
                continue
            left = until - time.monotonic()
            if left <= 0.0:
                self.settle()
                return None
            waited = True
            self._waits.wait(round(1e9 * left))
            self._discover()
        return ready.popleft()

    def _receive(self, *, waited: bool) -> bool:
        """Take what is there; whether there was anything."""
        something = False
        for index, reader in self._readers.items():
            first = waited
            for message in reader.take(_AT_ONCE):
                something = True
                info = message.sample_info
                if not info.valid_data:  # a publisher has gone
                    continue
                sent = Message(
                    index, message.raw, info.source_timestamp, sender=info.publication_handle
                )
                self.receive(sent, waited=first)
                first = False
        return something

    def close(self) -> None:
        """Leave the domain."""
        self.settle()
        self._readers.clear()
        self._waits = self._discovery = self._participant = None
