"""Estimates to ROS 2 over Zenoh: ``--publish zenoh:/palpate``."""

import time
import uuid
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from palpate.errors import PalpateError
from palpate.live.sinks.publishing import RosWire
from palpate.live.wires.addresses import parsed, topics_of
from palpate.live.wires.ros_topics import dds_type
from palpate.live.wires.zenoh_session import OPTIONS, attachment, key_of, opened

if TYPE_CHECKING:
    import zenoh


class ZenohWire(RosWire):
    """Two topics under rmw_zenoh's keys, which wait where there is no room.

    Parameters
    ----------
    address : str
        The topics' prefix, and options: ``domain``, ``connect``, ``listen`` and ``scouting``, such
        as ``/palpate?connect=tcp/192.168.1.2:7447``.
    """

    def __init__(self, address: str) -> None:
        self._address = parsed("zenoh", address, OPTIONS)
        super().__init__("zenoh", topics_of(self._address, 1)[0])
        self._domain = self._address.whole("domain", 0, 0, 1_000_000)
        self._session: zenoh.Session | None = None
        self._publishers: list[zenoh.Publisher] = []
        self._tokens: list[Any] = []
        self._numbers = [0, 0]
        self._sender = uuid.uuid4().bytes

    def open(self) -> None:
        """Open the session, and become a node that ``ros2 topic list`` finds."""
        self._session = opened(self._address)
        import zenoh

        node = f"@ros2_lv/{self._domain}/{self._session.zid()}/0"
        self._declare(f"{node}/0/NN/%/%/palpate")
        for index, (name, type_name) in enumerate(self.topics):
            kind, checksum = dds_type(type_name), self.encoder.hash_of(type_name)
            self._publishers.append(
                self._session.declare_publisher(
                    key_of(self._domain, name, type_name, checksum),
                    congestion_control=zenoh.CongestionControl.BLOCK,
                    express=True,  # not kept back to be sent with others
                )
            )
            mangled = name.replace("/", "%")
            # Of its quality of service only the depth is not ROS's default.
            self._declare(
                f"{node}/{index + 1}/MP/%/%/palpate/{mangled}/{kind}/{checksum}/::,1000:,:,:,,"
            )

    def _declare(self, key: str) -> None:
        assert self._session is not None  # it is open
        self._tokens.append(self._session.liveliness().declare_token(key))

    def send(self, names: tuple[str, ...], values: Sequence[Sequence[float]]) -> int:
        """Send estimates; it waits where there is no room."""
        for each in self.estimates(names, values):
            self._put(0, each)
        return 0

    def tell(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> None:
        """Send what is said in words."""
        self._put(1, self.encoder.status(state, source, stamp, values))

    def _put(self, index: int, data: bytes) -> None:
        import zenoh

        self._numbers[index] += 1
        attached = attachment(self._numbers[index], time.time_ns(), self._sender)
        try:
            self._publishers[index].put(data, attachment=attached)
        except zenoh.ZError as error:
            raise PalpateError(f"{self.name}: {str(error).partition(' at /')[0]}") from None

    def close(self) -> None:
        """Close the session."""
        super().close()
        self._publishers.clear()
        self._tokens.clear()
        if self._session is not None:
            self._session.close()  # type: ignore[no-untyped-call]
        self._session = None
