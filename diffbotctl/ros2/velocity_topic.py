"""The subscription to cmd_vel, as Twist or TwistStamped, and who publishes there."""

from __future__ import annotations

import time
from math import nan
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile

from diffbotctl.ros2.message_fields import nanoseconds
from diffbotctl.ros2.stamps import stamp_complaint
from diffbotctl.ros2.velocity_driver import VelocityDriver
from diffbotctl.ros2.velocity_rules import VelocitySource

TOPIC = "cmd_vel"
TYPES = {"geometry_msgs/msg/Twist": Twist, "geometry_msgs/msg/TwistStamped": TwistStamped}
UNKNOWN = "_NODE_NAME_UNKNOWN_"  # of a node whose name has not been discovered yet
NEWEST_ONLY = QoSProfile(depth=1)  # an older velocity must never drive
CHECK_PERIOD_S = 0.25
# After a change of type, while DDS replaces the reader: the bridge was seen to send nothing for
# more than 0.3 s then, which the engine takes for a lost operator.
SWITCH_TIME_S = 1.0
COMPLAINT_PERIOD_S = 5.0


class VelocityTopic:
    """Passes velocities to the driver, with the publishers that are alive.

    A participant of DDS knows a topic under one type. The bridge therefore subscribes to the type
    that is published, and to Twist while nothing is.
    """

    def __init__(self, node: Any, driver: VelocityDriver) -> None:
        self.node, self.driver = node, driver
        self.publishers: frozenset[str] = frozenset()
        self.names = ""
        self.complained_at = 0.0
        self.kind: type = Twist
        self.ready_at = 0.0
        self._subscribe()
        self.timer = node.create_timer(CHECK_PERIOD_S, self.check_publishers)

    def check_publishers(self, _event: Any = None) -> None:
        """Look who publishes, report changes, and follow a change of type."""
        found = self.node.get_publishers_info_by_topic(self.subscription.topic_name)
        wanted = {TYPES[each.topic_type] for each in found if each.topic_type in TYPES}
        if wanted and self.kind not in wanted:
            self.kind = wanted.pop()
            self.ready_at = time.monotonic() + SWITCH_TIME_S
            self.node.destroy_subscription(self.subscription)
            self._subscribe()
        publishers = frozenset(bytes(each.endpoint_gid).hex() for each in found)
        names = {f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in found}
        if names:  # those of publishers that are gone are still needed
            self.names = ", ".join(sorted(name for name in names if UNKNOWN not in name) or [TOPIC])
        if publishers != self.publishers:
            self.publishers = publishers
            self.driver.publishers_changed(publishers)

    def _subscribe(self) -> None:
        events = SubscriptionEventCallbacks(matched=self.check_publishers)
        receive = self._twist_received if self.kind is Twist else self._stamped_received
        self.subscription = self.node.create_subscription(
            self.kind, TOPIC, receive, NEWEST_ONLY, event_callbacks=events
        )

    def _twist_received(self, message: Any, info: Any) -> None:
        if time.monotonic() < self.ready_at:
            return
        linear, angular = message.linear.x, message.angular.z
        total = message.linear.y + message.linear.z + message.angular.x + message.angular.y
        if total != total:  # a number that is not finite in an axis that is not used
            linear = nan
        source = VelocitySource(
            self.publishers, self.names, info.get("publication_sequence_number")
        )
        self.driver.velocity_received(linear, angular, source)

    def _stamped_received(self, message: Any, info: Any) -> None:
        complaint = stamp_complaint(nanoseconds(message.header.stamp), time.time_ns())
        twist = message.twist
        if complaint and (twist.linear.x or twist.angular.z):  # a zero always counts
            if time.monotonic() - self.complained_at > COMPLAINT_PERIOD_S:
                self.complained_at = time.monotonic()
                self.node.get_logger().warning(f"a velocity of {self.names} {complaint}")
            return
        self._twist_received(twist, info)
