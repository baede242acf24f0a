"""Publishers of the bridge: each wire of the run becomes messages on ROS topics.

Reliability as ROS users expect it: sensors best effort, odometry reliable, description and fixed
frames latched (transient local).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import cos, sin
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, JointState, LaserScan, Range
from std_msgs.msg import String

from diffbotctl.ros2 import conversion
from diffbotctl.ros2.conversion import Fields, SensorModel
from diffbotctl.ros2.message_fields import fill, fill_header
from diffbotctl.ros2.options import BridgeOptions, ModelFrame
from diffbotctl.ros2.stamps import StampClock, seconds_and_nanoseconds

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None  # not part of every installation; `ros2 --check` names it

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ROSOUT = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
QUEUE_DEPTH = 10
DIAGNOSTICS_PERIOD_S = 1.0
DIAGNOSED = ("Stop", "Link", "GoalState", "Battery")
WORLD, GROUND, BASE = "odom", "base_footprint", "base_link"
SENSOR_TOPICS = {"Range": "range", "Scan": "scan"}

Publish = Callable[[Fields, int], None]


class RunPublishers:
    """Publishes the messages of the wires in `wires`, which maps each to its type."""

    def __init__(self, node: Any, options: BridgeOptions, clock: StampClock) -> None:
        self.node, self.options, self.clock = node, options, clock
        self.prefix = options.frame_prefix
        self.publish: dict[str, Publish] = {}
        self.kinds: dict[str, str] = {}
        self.newest: dict[str, tuple[str, Fields]] = {}
        self.diagnosed_at = 0.0
        self.diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", QUEUE_DEPTH)
        self.transforms = self._transform_publisher("/tf", QoSProfile(depth=100))
        self._publish_model()

    def choose_wires(self, kinds: dict[str, str]) -> list[str]:
        """Create the publishers for a run with these wires; the wires to subscribe."""
        makers: dict[str, Callable[[str], Publish]] = {
            "Odometry": self._odometry,
            "Encoders": self._joint_states,
            "Battery": self._battery,
        }
        count: dict[str, int] = {}
        for wire, kind in kinds.items():
            if wire == "log":
                self.publish[wire] = self._rosout()
            elif kind in SENSOR_TOPICS:
                name = SENSOR_TOPICS[kind]
                count[kind] = count.get(kind, 0) + 1
                topic = name if count[kind] == 1 else f"{name}_{count[kind]}"
                self.publish[wire] = self._sensor(wire, kind, topic)
            elif kind in makers:
                self.publish[wire] = makers.pop(kind)(wire)
            if kind in DIAGNOSED and not wire.startswith("operator."):
                self.kinds[wire] = kind
        return list(dict.fromkeys([*self.publish, *self.kinds]))

    def message_received(self, wire: str, message: Fields) -> None:
        """Publish one message of the run."""
        kind = self.kinds.get(wire)
        if kind is not None:
            self.newest[wire] = (kind, message)
        publish = self.publish.get(wire)
        if publish is not None:
            publish(message, self.clock.stamp(message["time"], time.time_ns()))
        now = time.monotonic()
        if kind == "Stop" or now - self.diagnosed_at >= DIAGNOSTICS_PERIOD_S:
            self.diagnosed_at = now
            self._publish_diagnostics()

    def _transform_publisher(self, topic: str, profile: QoSProfile) -> Any:
        return None if TFMessage is None else self.node.create_publisher(TFMessage, topic, profile)

    def _publish_model(self) -> None:
        """Publish description and fixed frames once; they are latched."""
        model = self.options.model
        self.description = self.node.create_publisher(String, "robot_description", LATCHED)
        if model.urdf:
            self.description.publish(String(data=model.urdf))
        self.fixed = self._transform_publisher("/tf_static", LATCHED)
        if self.fixed is not None:
            transforms = [self._fixed_frame(frame) for frame in model.frames if not frame.moves]
            self.fixed.publish(TFMessage(transforms=transforms))

    def _fixed_frame(self, frame: ModelFrame) -> Any:
        transform = TransformStamped(child_frame_id=self.prefix + frame.name)
        fields = conversion.transform({"x": frame.x, "y": frame.y, "heading": frame.heading})
        fields["translation"]["z"] = frame.z
        fill(transform.transform, fields)
        return fill_header(transform, time.time_ns(), self.prefix + frame.parent)

    def _odometry(self, wire: str) -> Publish:
        publisher = self.node.create_publisher(Odometry, "odom", QUEUE_DEPTH)
        frames = self.options.model.frames
        child = self.prefix + (GROUND if frames else BASE)
        message = Odometry(child_frame_id=child)
        transform = TransformStamped(child_frame_id=child)
        transforms = None if TFMessage is None else TFMessage(transforms=[transform])
        frame = self.prefix + WORLD

        def publish(fields: Fields, stamp: int) -> None:
            publisher.publish(fill_header(fill(message, conversion.odometry(fields)), stamp, frame))
            if transforms is not None:
                fill(transform.transform, conversion.transform(fields))
                fill_header(transform, stamp, frame)
                self.transforms.publish(transforms)

        return publish

    def _joint_states(self, wire: str) -> Publish:
        publisher = self.node.create_publisher(JointState, "joint_states", QUEUE_DEPTH)
        model = self.options.model
        wheels = [frame for frame in model.frames if frame.moves == "wheel"]
        message = JointState(name=[wheel_joint(frame.name) for frame in wheels])
        moving = [self._fixed_frame(frame) for frame in wheels]
        transforms = None if TFMessage is None else TFMessage(transforms=moving)

        def publish(fields: Fields, stamp: int) -> None:
            if not wheels:
                return
            angles = conversion.wheel_angles(fields, model.counts_per_turn)
            message.position = list(angles)
            publisher.publish(fill_header(message, stamp, ""))
            for transform, angle in zip(moving, angles, strict=True):
                rotation = transform.transform.rotation  # about the axle, the y axis
                rotation.y, rotation.w = sin(0.5 * angle), cos(0.5 * angle)
                fill_header(transform, stamp, self.prefix + BASE)
            if transforms is not None:
                self.transforms.publish(transforms)

        return publish

    def _sensor(self, wire: str, kind: str, topic: str) -> Publish:
        sensor = self.options.model.sensors.get(wire, SensorModel(BASE, 0.0, 0.0))
        is_scan = kind == "Scan"
        message = LaserScan() if is_scan else Range()
        convert = conversion.scan if is_scan else conversion.range_fields
        publisher = self.node.create_publisher(type(message), topic, qos_profile_sensor_data)
        frame = self.prefix + sensor.frame

        def publish(fields: Fields, stamp: int) -> None:
            publisher.publish(fill_header(fill(message, convert(fields, sensor)), stamp, frame))

        return publish

    def _battery(self, wire: str) -> Publish:
        publisher = self.node.create_publisher(BatteryState, "battery_state", QUEUE_DEPTH)

        def publish(fields: Fields, stamp: int) -> None:
            message = fill(BatteryState(), conversion.battery(fields))
            publisher.publish(fill_header(message, stamp, ""))

        return publish

    def _rosout(self) -> Publish:
        publisher = self.node.create_publisher(Log, "/rosout", ROSOUT)

        def publish(fields: Fields, stamp: int) -> None:
            message = fill(Log(), conversion.log_line(fields))
            message.stamp.sec, message.stamp.nanosec = seconds_and_nanoseconds(stamp)
            publisher.publish(message)

        return publish

    def _publish_diagnostics(self) -> None:
        message = fill_header(DiagnosticArray(), time.time_ns(), "")
        for entry in conversion.diagnostics(self.newest):
            values = [KeyValue(key=key, value=value) for key, value in entry.values.items()]
            status = DiagnosticStatus(
                level=entry.level,
                name=f"{self.options.engine}: {entry.name}",
                message=entry.message,
                hardware_id=self.options.engine,
                values=values,
            )
            message.status.append(status)
        self.diagnostics.publish(message)


def wheel_joint(frame: str) -> str:
    """The name of a wheel's joint in the URDF, from that of its frame."""
    return frame.removesuffix("_link") + "_joint"
