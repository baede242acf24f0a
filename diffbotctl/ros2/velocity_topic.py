"""The subscription to cmd_vel, as Twist or TwistStamped, and who publishes there."""

from __future__ import annotations

import time
from contextlib import suppress
from math import nan
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy._rclpy_pybind11 import RCLError  # rclpy exports it nowhere else
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile

from diffbotctl.client.velocity_driver import VelocityDriver
from diffbotctl.client.velocity_rules import VelocitySource
from diffbotctl.ros2.message_fields import nanoseconds
from diffbotctl.ros2.stamps import stamp_complaint

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
    of the publisher that came last, and to Twist while there is none. A publisher that was killed
    is listed for some 20 s more. The type never changes while a publisher drives.
    """

    def __init__(self, node: Any, driver: VelocityDriver) -> None:
        self.node, self.driver = node, driver
        self.publishers: frozenset[str] = frozenset()
        self.types: dict[str, type] = {}  # of the publishers, in the order in which they came
        self.names = ""
        self.complained_at = 0.0
        self.kind: type = Twist
        self.ready_at = 0.0
        self.subscription = self._subscribe()
        self.topic = self.subscription.topic_name
        self.timer = node.create_timer(CHECK_PERIOD_S, self._check)

    def check_publishers(self, _event: Any = None) -> None:
        """Look who publishes, and report changes."""
        found = self.node.get_publishers_info_by_topic(self.topic)
        listed = {bytes(each.endpoint_gid).hex(): TYPES.get(each.topic_type) for each in found}
        known = {gid: kind for gid, kind in self.types.items() if gid in listed}
        self.types = known | {gid: kind for gid, kind in listed.items() if kind is not None}
        publishers = frozenset(listed)
        names = {f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in found}
        if names:  # those of publishers that are gone are still needed
            self.names = ", ".join(sorted(name for name in names if UNKNOWN not in name) or [TOPIC])
        if publishers != self.publishers:
            self.publishers = publishers
            self.driver.publishers_changed(publishers)
        elif names:
            self.driver.publishers_named(publishers, self.names)

    def _check(self) -> None:
        """Look who publishes, and follow a change of type.

        Not in an event of the subscription: the executor would still hold it, and DDS would refuse
        one of another type beside it.
        """
        self.check_publishers()
        published = next(reversed(self.types.values()), self.kind)
        if self.subscription is not None:
            if published is self.kind or self.driver.is_moving:
                return
            self.node.destroy_subscription(self.subscription)
            self.subscription = None
        self.kind = published
        self.ready_at = time.monotonic() + SWITCH_TIME_S
        with suppress(RCLError):  # the old one still exists: again at the next check
            self.subscription = self._subscribe()

    def _subscribe(self) -> Any:
        events = SubscriptionEventCallbacks(matched=self.check_publishers)
        receive = self._twist_received if self.kind is Twist else self._stamped_received
        return self.node.create_subscription(
            self.kind, TOPIC, receive, NEWEST_ONLY, event_callbacks=events
        )

    def _twist_received(self, message: Any, info: Any) -> None:
        now = time.monotonic()
        if now < self.ready_at:
            return
        linear, angular = message.linear.x, message.angular.z
        total = message.linear.y + message.linear.z + message.angular.x + message.angular.y
        if total != total:  # a number that is not finite in an axis that is not used
            linear = nan
        source = VelocitySource(
            self.publishers, self.names, info.get("publication_sequence_number")
        )
        self.driver.velocity_received(now, linear, angular, source)

    def _stamped_received(self, message: Any, info: Any) -> None:
        complaint = stamp_complaint(nanoseconds(message.header.stamp), time.time_ns())
        twist = message.twist
        if complaint and (twist.linear.x or twist.angular.z):  # a zero always counts
            if time.monotonic() - self.complained_at > COMPLAINT_PERIOD_S:
                self.complained_at = time.monotonic()
                self.node.get_logger().warning(f"a velocity of {self.names} {complaint}")
            return
        self._twist_received(twist, info)
