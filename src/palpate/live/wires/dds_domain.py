"""DDS by Cyclone DDS, without ROS: participants, and ROS's types with their bytes as they came."""

import os
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from palpate.errors import InvalidParameterError, MissingExtraError, PalpateError
from palpate.live.wires.ros_topics import dds_type
from palpate.recordings.messages.fields import Field, Group, Many, Number, Text

if TYPE_CHECKING:
    from cyclonedds.domain import Domain, DomainParticipant

#: Of an address: which domain, and the network interface that is used.
OPTIONS = ("domain", "interface")
# Samples of a topic that wait, 20 s at 1 kHz: with ROS's usual 10 a loop that is held up for 10 ms
# loses some.
DEPTH = 20_000
#: s: that a reliable writer waits for a reader that has no room, before it gives up a sample.
PATIENCE = 1.0
# Loopback cannot multicast everywhere; so the first 32 participants of this machine are greeted one
# by one.
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
        Its number.
    interface : str, optional
        Name of the network interface, or ``auto`` for the one that Cyclone DDS chooses. Unless
        given, what ``CYCLONEDDS_URI`` says, and without it this machine only.

    Raises
    ------
    PalpateError
        It cannot: there is no such interface, or this process has the domain on another one.
    """
    try:
        from cyclonedds.core import DDSException
        from cyclonedds.domain import Domain, DomainParticipant
    except ImportError:
        raise MissingExtraError(
            "ROS 2 over DDS needs cyclonedds, which has wheels for some versions of Python only: "
            "pip install 'palpate[live]'"
        ) from None
    configuration = _configuration(interface)
    where = f"domain {domain} on interface {interface or 'lo'}"
    try:
        before = _opened.get(domain)
        if before is None:
            _opened[domain] = configuration, Domain(domain, configuration or None)
        elif before[0] != configuration:
            raise InvalidParameterError(f"dds: {where}: this process has it on another one")
        return DomainParticipant(domain)
    except DDSException as error:
        raise PalpateError(f"dds: {where} cannot be joined: {_reason(error)}") from None


def _configuration(interface: str | None) -> str:
    given = os.environ.get("CYCLONEDDS_URI", "")
    if interface == "auto" or (interface is None and given):
        return given
    if interface in (None, "lo"):
        return _LOOPBACK
    assert interface is not None
    if not all(each.isalnum() or each in "-_.:" for each in interface):
        raise InvalidParameterError(
            f"dds: interface must be a name such as eth0, not {interface!r}"
        )
    return _INTERFACE.format(name=interface)


def _reason(error: Exception) -> str:
    words = " ".join(str(error).split())
    return words[:120] or type(error).__name__


@lru_cache(maxsize=64)
def raw_type(type_name: str) -> Any:
    """Return a type of ROS 2, such as ``geometry_msgs/msg/WrenchStamped``, as Cyclone DDS has it.

    Its name and fields are ROS's, which peers compare. Of its messages only the bytes are kept, in
    CDR with their head, as ``raw``: cyclonedds's own decoder takes 20 times as long as ours.
    ``raw_type(name).of(data)`` is a message of these bytes.
    """
    from palpate.recordings.messages.definitions import message_fields

    made = _struct(message_fields(type_name, "ros2msg", ""))
    # A base class would become part of the type that peers compare.
    made.deserialize = made.deserialize_key = made.of = classmethod(_of_bytes)
    made.serialize = _bytes_of
    return made


def _of_bytes(cls: Any, data: bytes, *_: Any, **__: Any) -> Any:
    message = cls.__new__(cls)
    message.raw = data
    return message


def _bytes_of(message: Any, *_: Any, **__: Any) -> bytes:
    raw: bytes = message.raw
    return raw


@lru_cache(maxsize=256)
def _struct(group: Group) -> Any:
    from cyclonedds.idl import make_idl_struct

    fields = {
        name or "structure_needs_at_least_one_member": _type(field) for name, field in group.fields
    }
    return make_idl_struct(group.name.rpartition("/")[2], dds_type(group.name), fields)


def _type(field: Field) -> Any:
    import cyclonedds.idl.types

    types: Any = cyclonedds.idl.types  # its sequences and arrays have no types of their own
    if isinstance(field, Group):
        return _struct(field)
    if isinstance(field, Text):
        return str
    if isinstance(field, Number):
        if field.dtype == "b1":
            return bool
        kind = {"f": "float", "i": "int", "u": "uint"}[field.dtype[0]]
        return getattr(types, f"{kind}{8 * field.size}")
    assert isinstance(field, Many)
    element = _type(field.element)
    if field.length is None:
        return types.sequence[element]
    return types.array[element, field.length]
