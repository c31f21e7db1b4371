"""From the options of the command line to sinks."""

from collections.abc import Mapping
from importlib import import_module

from palpate.errors import InvalidParameterError
from palpate.live.sinks.sink import Sink
from palpate.live.sources.opening import NO_ROS1
from palpate.validation import shown

#: Where estimates are published back, by what stands before the colon of an address: a module, and
#: its :class:`~palpate.live.sinks.publishing.Wire`, which is made of the rest of the address.
PUBLISHERS: Mapping[str, tuple[str, str]] = {
    "zmq": ("palpate.live.sinks.zeromq", "ZeroMQWire"),
    "dds": ("palpate.live.sinks.dds", "DDSWire"),
    "zenoh": ("palpate.live.sinks.zenoh", "ZenohWire"),
}


def open_publisher(address: str) -> Sink:
    """Return the sink that publishes estimates on a wire, such as ``zmq:tcp://127.0.0.1:5556``.

    Raises
    ------
    InvalidParameterError
        There is no such wire.
    MissingExtraError
        What it needs is not installed.
    """
    scheme, colon, rest = address.partition(":")
    if scheme == "ros1":
        raise InvalidParameterError(NO_ROS1)
    if not colon or scheme not in PUBLISHERS:
        known = ", ".join(f"{name}:…" for name in PUBLISHERS)
        raise InvalidParameterError(f"--publish must be one of {known}, not {shown(address)}")
    from palpate.live.sinks.publishing import Publisher

    module, wire = PUBLISHERS[scheme]
    publisher = Publisher(getattr(import_module(module), wire)(rest))
    publisher.check()
    return publisher
