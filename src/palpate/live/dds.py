"""ROS 2 over DDS, with Cyclone DDS: a source of samples, and a wire for estimates."""

import os
import time
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from palpate.errors import InvalidParameterError, MissingExtraError, PalpateError
from palpate.input.recordings.messages import layout
from palpate.live import ros
from palpate.live.ros import RosTopics, RosWire, dds_type
from palpate.live.schema import ESTIMATE_TYPE, message_definition
from palpate.live.sources import SourceOptions
from palpate.live.wires import parse_address

if TYPE_CHECKING:
    from cyclonedds.builtin import BuiltinDataReader
    from cyclonedds.core import WaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.sub import DataReader


#: Options of an address: the domain and the network interface.
OPTIONS = ("domain", "interface")
# Queue length, 20 s at 1 kHz. With ROS's default of 10, a loop that stalls for 10 ms loses samples.
DEPTH = 20_000
#: s for which a reliable writer waits for a reader's full queue before it drops a sample.
PATIENCE = 1.0
# Loopback does not support multicast on every system, so discovery contacts the first 32
# participants of this machine one by one.
_LOOPBACK = """<CycloneDDS><Domain id="any">
<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>31</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
_INTERFACE = """<CycloneDDS><Domain id="any"><General><Interfaces>
<NetworkInterface name="{name}"/></Interfaces></General></Domain></CycloneDDS>"""
_opened: dict[int, tuple[str, "Domain"]] = {}


def participant(domain: int, interface: str | None) -> "DomainParticipant":
    """Join a domain.

    Parameters
    ----------
    domain : int
        Number of the domain.
    interface : str, optional
        Name of the network interface, or ``auto`` for the choice of Cyclone DDS. Default: the
        configuration in ``CYCLONEDDS_URI``, or without it this machine only.

    Raises
    ------
    PalpateError
        The interface does not exist, or this process uses another one for the domain.
    """
    try:
        from cyclonedds.core import DDSException
        from cyclonedds.domain import Domain, DomainParticipant
    except ImportError:
        package = "cyclonedds, which has wheels for some versions of Python only"
        raise MissingExtraError.named("ROS 2 over DDS", package, "live") from None
    configuration = _configuration(interface)
    where = f"domain {domain} on interface {interface or 'lo'}"
    try:
        before = _opened.get(domain)
        if before is None:
            _opened[domain] = configuration, Domain(domain, configuration or None)
        elif before[0] != configuration:
            raise InvalidParameterError(
                f"dds: {where}: this process already uses another interface"
            )
        return DomainParticipant(domain)
    except DDSException as error:
        words = " ".join(str(error).split())[:120] or type(error).__name__
        raise PalpateError(f"dds: cannot join {where}: {words}") from None


def _configuration(interface: str | None) -> str:
    given = os.environ.get("CYCLONEDDS_URI", "")
    if interface == "auto" or (interface is None and given):
        return given
    if interface is None or interface == "lo":
        return _LOOPBACK
    if not all(each.isalnum() or each in "-_.:" for each in interface):
        raise InvalidParameterError(
            f"dds: interface must be a name such as eth0, not {interface!r}"
        )
    return _INTERFACE.format(name=interface)


def _quality_of_service() -> Any:
    from cyclonedds.core import Policy, Qos

    return Qos(
        Policy.Reliability.Reliable(round(1e9 * PATIENCE)),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(DEPTH),
    )


@lru_cache(maxsize=64)
def raw_type(type_name: str) -> Any:
    """Return a ROS 2 type, such as ``geometry_msgs/msg/WrenchStamped``, for Cyclone DDS.

    Its name and fields are ROS's, because peers compare them. A message keeps its bytes (CDR with
    header) undecoded as ``raw``: the decoder of cyclonedds takes 20 times as long as palpate's.
    ``raw_type(name).of(data)`` makes a message from bytes.
    """
    definition = message_definition() if type_name == ESTIMATE_TYPE else ""
    made = _struct(layout.message_fields(type_name, "ros2msg", definition))
    # A base class would become part of the type that peers compare.
    made.deserialize = made.deserialize_key = made.of = classmethod(_decode_bytes)
    made.serialize = lambda message, *_, **__: message.raw
    return made


def _decode_bytes(cls: Any, data: bytes, *_: Any, **__: Any) -> Any:
    message = cls.__new__(cls)
    message.raw = data
    return message


@lru_cache(maxsize=256)
def _struct(group: layout.Group) -> Any:
    from cyclonedds.idl import make_idl_struct

    fields = {
        name or "structure_needs_at_least_one_member": _type(field) for name, field in group.fields
    }
    return make_idl_struct(group.name.rpartition("/")[2], dds_type(group.name), fields)


def _type(field: layout.Field) -> Any:
    import cyclonedds.idl.types

    types: Any = cyclonedds.idl.types  # its sequences and arrays are untyped
    if isinstance(field, layout.Group):
        return _struct(field)
    if isinstance(field, layout.Text):
        return str
    if isinstance(field, layout.Number):
        if field.dtype == "b1":
            return bool
        kind = {"f": "float", "i": "int", "u": "uint"}[field.dtype[0]]
        return getattr(types, f"{kind}{8 * field.size}")
    assert isinstance(field, layout.Many)
    element = _type(field.element)
    if field.length is None:
        return types.sequence[element]
    return types.array[element, field.length]


# Samples of ROS 2 over DDS, without an installation of ROS: ``dds:/pose,/wrench``.

#: s for which ``open`` waits for the topics, so that a wrong type is reported at once.
TAKING_PATIENCE = 0.5
_AT_ONCE = 256  # most messages per read


class _Printed:
    """Takes what Cyclone DDS prints: a line for each malformed packet, which any peer can send.

    It prints from its own threads to the standard error of the process, which would block them if
    nobody read it. Here a pipe takes the lines; what does not fit is dropped.
    """

    def __init__(self) -> None:
        self._before = os.dup(2)
        (self._out, into) = os.pipe()
        for end in (self._out, into):
            os.set_blocking(end, False)
        os.dup2(into, 2)
        os.close(into)

    def take(self) -> list[str]:
        """Return the lines printed since the last call, up to 64 KiB."""
        try:
            return os.read(self._out, 1 << 16).decode(errors="replace").splitlines()
        except BlockingIOError:
            return []

    def close(self) -> None:
        """Let the process print to standard error again."""
        os.dup2(self._before, 2)
        os.close(self._before)
        os.close(self._out)


class DDS(RosTopics):
    """Source that subscribes to ROS 2 topics, as soon as discovery finds their types.

    Parameters
    ----------
    address : str
        Topics and options, such as ``/pose,/wrench?domain=3&interface=eth0``. The options are
        ``domain`` (default: 0), ``interface``, the network interface (default: this machine only),
        and the options of :class:`~palpate.live.ros.RosTopics`.
    options : SourceOptions
        Options of the source.
    """

    def __init__(self, address: str, options: SourceOptions) -> None:
        given = parse_address("dds", address, (*ros.OPTIONS, *OPTIONS))
        super().__init__(given, options)
        self._domain = given.whole("domain", 0, 0, 230)
        self._interface = given.options.get("interface")
        self._participant: DomainParticipant | None = None
        self._discovery: BuiltinDataReader | None = None
        self._waits: WaitSet | None = None
        self._readers: dict[int, DataReader[Any]] = {}
        self._printed: _Printed | None = None

    def open(self) -> None:
        """Join the domain and wait briefly for the topics; later ones are found while it runs."""
        if os.name == "posix" and self._printed is None:
            self._printed = _Printed()
        self._participant = participant(self._domain, self._interface)
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import WaitSet

        self._waits = WaitSet(self._participant)
        self._discovery = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._wake_for(self._discovery)
        until = time.monotonic() + TAKING_PATIENCE
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
        """Subscribe to newly discovered publishers."""
        from cyclonedds.core import InstanceState

        assert self._discovery is not None
        for found in self._discovery.take(_AT_ONCE):
            if found.sample_info.instance_state != InstanceState.Alive:
                continue
            for index, topic in enumerate(self.topics):
                if found.topic_name == f"rt{topic.name}":
                    type_name = ros.ros2_type(found.type_name)
                    if self.accept(index, type_name) and index not in self._readers:
                        self._readers[index] = self._reader(topic.name, type_name, found.qos)

    def _reader(self, name: str, type_name: str, offered: Any) -> "DataReader[Any]":
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        assert self._participant is not None
        # A reader that requests more than the publisher offers receives nothing; sensors often
        # offer best effort only.
        qos = _quality_of_service()
        if offered[Policy.Reliability] == Policy.Reliability.BestEffort:
            qos = Qos(Policy.Reliability.BestEffort, base=qos)
        every = Policy.DataRepresentation(
            use_cdrv0_representation=True,
            use_xcdrv2_representation=True,
        )
        qos = Qos(every, base=qos)
        topic = Topic(self._participant, f"rt{name}", raw_type(type_name))
        reader: DataReader[Any] = DataReader(self._participant, topic, qos=qos)
        self._wake_for(reader)
        return reader

    def _receive(self, seconds: float) -> bool:
        if self._waits is None:
            raise self.not_open_error()
        if seconds > 0.0:
            self._waits.wait(round(1e9 * seconds))
            self._discover()
            for line in self._printed.take() if self._printed is not None else ():
                self.refuse(f"Cyclone DDS: {line}")
        something = False
        for index, reader in self._readers.items():
            waited = seconds > 0.0
            for message in reader.take(_AT_ONCE):
                something = True
                if (info := message.sample_info).valid_data:  # else a publisher has left
                    sender = info.publication_handle
                    written = info.source_timestamp
                    self.receive(index, message.raw, written, sender=sender, waited=waited)
                    waited = False
        return something

    def close(self) -> None:
        """Leave the domain."""
        self.finish_pending()
        self._readers.clear()
        self._waits = self._discovery = self._participant = None
        if self._printed is not None:
            self._printed.close()
            self._printed = None


# Estimates to ROS 2 over DDS: ``--publish dds:/palpate``.


class DDSWire(RosWire):
    """Publishes estimates and status on two reliable topics.

    Parameters
    ----------
    address : str
        Prefix of the topics, and the options ``domain`` and ``interface``.
    """

    def __init__(self, address: str) -> None:
        given = parse_address("dds", address, OPTIONS)
        super().__init__(given)
        self._domain = given.whole("domain", 0, 0, 230)
        self._interface = given.options.get("interface")
        self._writers: list[tuple[Any, Any]] = []

    def open(self) -> None:
        """Join the domain."""
        member = participant(self._domain, self._interface)
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        qos = _quality_of_service()
        for name, type_name in self.topics:
            kind = raw_type(type_name)
            topic: Any = Topic(member, f"rt{name}", kind)
            self._writers.append((DataWriter(member, topic, qos=qos), kind))

    def put(self, topic: int, data: bytes) -> bool:
        """Write a message; return whether it was accepted in time."""
        from cyclonedds.core import DDSException

        writer, kind = self._writers[topic]
        try:
            writer.write(kind.of(data))
        except DDSException:
            return False
        return True

    def close(self) -> None:
        """Leave the domain."""
        self._writers.clear()
