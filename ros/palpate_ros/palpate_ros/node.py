"""The node: topics, tf and parameters around :class:`~palpate_ros.identifier.ContactIdentifier`."""

import sys
from collections import deque
from dataclasses import fields
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, WrenchStamped
from palpate_msgs.msg import ContactEstimate
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import JointState
from tf2_ros import Buffer, TransformListener

import palpate
from palpate_ros.identifier import ContactIdentifier, Settings


class ContactNode(Node):
    """Subscribes to poses, or joint states with tf, and to wrenches; publishes estimates."""

    def __init__(self) -> None:
        super().__init__("identify_contact")
        given: dict[str, Any] = {}
        for each in fields(Settings):
            default = list(each.default) if isinstance(each.default, tuple) else each.default
            given[each.name] = self.declare_parameter(each.name, default).value
        given["direction"] = tuple(given["direction"])
        self._identifier = ContactIdentifier(Settings(**given))
        frames = {"base_frame": "base_link", "tool_frame": "tool0", "source": "pose"}
        self._frames = {
            name: self.declare_parameter(name, default).value for name, default in frames.items()
        }
        # A depth of 10, the usual one, loses samples as soon as the node is blocked for 10 ms.
        reading = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._estimates = self.create_publisher(ContactEstimate, "~/estimate", 1000)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        if self._frames["source"] == "joints":
            self._buffer = Buffer()
            self._listener = TransformListener(self._buffer, self)
            self._stamps: deque[Time] = deque(maxlen=1000)  # of joints without a transform yet
            self.create_subscription(JointState, "joint_states", self._take_joints, reading)
        else:
            self.create_subscription(PoseStamped, "pose", self._take_pose, reading)
        self.create_subscription(WrenchStamped, "wrench", self._take_wrench, reading)
        self.create_timer(0.2, self._diagnose)

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _take_pose(self, message: PoseStamped) -> None:
        self._publish(self._identifier.take_pose(message, self._now()), message.header.frame_id)

    def _take_joints(self, message: JointState) -> None:
        """Take the tool's poses at the stamps of the joints, as soon as tf has them."""
        base, tool = self._frames["base_frame"], self._frames["tool_frame"]
        self._stamps.append(Time.from_msg(message.header.stamp))
        while self._stamps and self._buffer.can_transform(base, tool, self._stamps[0]):
            transform = self._buffer.lookup_transform(base, tool, self._stamps.popleft())
            self._publish(self._identifier.take_pose(transform, self._now()), base)

    def _take_wrench(self, message: WrenchStamped) -> None:
        frame = self._frames["base_frame"]
        self._publish(self._identifier.take_wrench(message, self._now()), frame)

    def _publish(self, estimates: list[dict[str, Any]], frame: str) -> None:
        for values in estimates:
            message = ContactEstimate(**values)
            message.header.stamp = Time(nanoseconds=round(1e9 * values["time"])).to_msg()
            message.header.frame_id = frame
            self._estimates.publish(message)

    def _diagnose(self) -> None:
        found = self._identifier.diagnose(self._now())
        status = DiagnosticStatus(
            level=bytes([found.level]),
            name="palpate: contact",
            message=found.message,
            hardware_id=self.get_name(),
            values=[KeyValue(key=name, value=value) for name, value in found.values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def main() -> None:
    """Run the node."""
    rclpy.init()
    try:
        rclpy.spin(ContactNode())
    except KeyboardInterrupt:
        pass
    except palpate.PalpateError as error:  # of a parameter, or the file of the payload
        sys.exit(f"identify_contact: {error}")
