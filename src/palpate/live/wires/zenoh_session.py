"""Zenoh as rmw_zenoh uses it: sessions, keys, and what is attached to each message."""

import json
import struct
from typing import TYPE_CHECKING, NamedTuple

from palpate.errors import InvalidParameterError, MissingExtraError, PalpateError
from palpate.live.wires.addresses import WireAddress
from palpate.live.wires.ros_topics import dds_type
from palpate.validation import shown

if TYPE_CHECKING:
    import zenoh

#: Of an address: the domain, and how the session reaches the others.
OPTIONS = ("domain", "connect", "listen", "scouting")
#: Where rmw_zenoh's router listens.
ROUTER = "tcp/127.0.0.1:7447"
# bytes: longer messages end in the session, before they take memory.
_LONGEST = 1 << 20
# Number and time of sending, each int64, then how many bytes the publisher's identity has, and it.
_ATTACHED = struct.Struct("<qqB16s")
# As rmw_zenoh 0.2.0 to 0.2.3 wrote it, each with its name before it.
_NAMED = struct.Struct("<16sq17sq11sB16s")
_NAMES = (b"\x0fsequence_number", b"\x10source_timestamp", b"\x0asource_gid")


class Attached(NamedTuple):
    """What rmw_zenoh attaches to a message."""

    number: int
    written: int  # ns since 1970
    sender: bytes


def attachment(number: int, written: int, sender: bytes) -> bytes:
    """Return what is attached to a message: its number, when it is sent, and by whom (16 bytes)."""
    return _ATTACHED.pack(number, written, 16, sender)


def attached(data: bytes) -> Attached | None:
    """Return what is attached, or None where it is not what rmw_zenoh attaches."""
    if len(data) == _ATTACHED.size and data[16] == 16:
        number, written, _, sender = _ATTACHED.unpack(data)
        return Attached(number, written, sender)
    if len(data) == _NAMED.size:
        first, number, second, written, third, size, sender = _NAMED.unpack(data)
        if (first, second, third) == _NAMES and size == 16:
            return Attached(number, written, sender)
    return None


def key_of(domain: int, topic: str, type_name: str, type_hash: str) -> str:
    """Return the key of a topic of ROS 2; the type's name and hash may be ``*``."""
    name = type_name if type_name == "*" else dds_type(type_name)
    return f"{domain}/{topic.strip('/')}/{name}/{type_hash}"


def opened(address: WireAddress) -> "zenoh.Session":
    """Open a session, a client of one router or peer unless ``listen`` says otherwise.

    Raises
    ------
    PalpateError
        Nobody answers, or the address to listen on is in use.
    """
    try:
        import zenoh
    except ImportError:
        raise MissingExtraError(
            "ROS 2 over Zenoh needs eclipse-zenoh: pip install 'palpate[live]'"
        ) from None
    listen = _endpoints(address, "listen", "")
    connect = _endpoints(address, "connect", "" if listen else ROUTER)
    settings = {
        "mode": "peer" if listen else "client",
        "listen/endpoints": listen,
        "connect/endpoints": connect,
        "scouting/multicast/enabled": address.one_of("scouting", ("no", "yes")) == "yes",
        "scouting/gossip/enabled": address.one_of("scouting", ("no", "yes")) == "yes",
        "transport/link/rx/max_message_size": _LONGEST,
    }
    config = zenoh.Config()
    try:
        for name, value in settings.items():
            config.insert_json5(name, json.dumps(value))
    except zenoh.ZError as error:
        raise InvalidParameterError(
            f"zenoh: an address must be such as {ROUTER}: {_first_line(error)}"
        ) from None
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        if "Address already in use" in str(error):
            raise PalpateError(f"zenoh: {', '.join(listen)}: address already in use") from None
        if listen and "listener" in str(error):
            raise PalpateError(
                f"zenoh: cannot listen on {', '.join(listen)}: {_first_line(error)}"
            ) from None
        raise PalpateError(
            f"zenoh: nobody answers at {', '.join(connect)}: start the router, `ros2 run "
            "rmw_zenoh_cpp rmw_zenohd`, or say where it is with connect=tcp/ADDRESS:7447"
        ) from None


def _endpoints(address: WireAddress, name: str, default: str) -> list[str]:
    given = address.text(name, default)
    endpoints = given.split(",") if given else []
    for endpoint in endpoints:
        if "/" not in endpoint:
            raise InvalidParameterError(
                f"zenoh: {name} must be such as {ROUTER}, not {shown(endpoint)}"
            )
    return endpoints


def _first_line(error: Exception) -> str:
    return str(error).partition(" at /")[0].splitlines()[0][:120]
