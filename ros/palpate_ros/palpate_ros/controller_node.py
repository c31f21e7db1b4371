"""An example of a controller: it publishes the gain of a force control for the present contact."""

from contextlib import suppress

import rclpy
from palpate_msgs.msg import ContactEstimate
from rclpy.node import Node
from std_msgs.msg import Float64

from palpate_ros.gain import GainController


class ControllerNode(Node):
    """Subscribes to estimates, of ``identify_contact`` or ``palpate live``; publishes a gain."""

    def __init__(self) -> None:
        super().__init__("controller")
        bandwidth = self.declare_parameter("bandwidth", 10.0).value
        oldest = self.declare_parameter("oldest", 0.5).value
        self._controller = GainController(bandwidth, oldest)
        self._action = ""
        self._gains = self.create_publisher(Float64, "~/gain", 10)
        self.create_subscription(
            ContactEstimate, "/identify_contact/estimate", self._take_estimate, 1000
        )
        self.create_timer(0.02, self._watch)

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _take_estimate(self, message: ContactEstimate) -> None:
        self._controller.take(message, self._now())
        self._publish()

    def _watch(self) -> None:
        self._controller.watch(self._now())
        self._publish()

    def _publish(self) -> None:
        self._gains.publish(Float64(data=self._controller.gain))
        if self._controller.action != self._action:
            self._action = self._controller.action
            self.get_logger().info(self._action)


def main() -> None:
    """Run the node."""
    rclpy.init()
    with suppress(KeyboardInterrupt):
        rclpy.spin(ControllerNode())
