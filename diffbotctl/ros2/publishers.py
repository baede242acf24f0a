"""Publishers of the bridge: each wire of the run becomes messages on ROS topics."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, Imu, JointState, LaserScan, Range
from std_msgs.msg import String

from diffbotctl.ros2 import conversion
from diffbotctl.ros2.conversion import DiagnosticEntry, Fields, SensorModel
from diffbotctl.ros2.message_fields import fill, fill_header
from diffbotctl.ros2.options import BridgeOptions, ModelFrame
from diffbotctl.ros2.stamps import StampClock, seconds_and_nanoseconds
from diffbotctl.ros2.topics import (
    BASE,
    CLOCK,
    DESCRIPTION,
    DIAGNOSTICS,
    FIXED_TRANSFORMS,
    LOG,
    MAP,
    TRANSFORMS,
    WORLD,
    Delivery,
    Diagnosis,
    MapGrid,
    RosTopic,
    choose_topics,
    fixed_frames,
    frame_transform,
    robot_frame,
    wheel_joint,
    wheel_rotation,
    wheels,
)

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None  # not part of every installation; `ros2 --check` names it

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PROFILES: dict[Delivery, QoSProfile] = {
    "reliable": QoSProfile(depth=10),
    "best_effort": qos_profile_sensor_data,
    "latched": LATCHED,
}
MANY = 100  # messages that a queue of transforms or log lines holds

Publish = Callable[[Fields, int], None]


class ClockPublisher:
    """Publishes the time of a run that does not follow the clock of the machine, on /clock."""

    def __init__(self, node: Any) -> None:
        self.publisher = node.create_publisher(Clock, CLOCK.name, PROFILES[CLOCK.delivery])
        self.newest = -1

    def time_passed(self, stamp: int) -> None:
        """Publish `stamp` (ns) if it is later than the last one."""
        if stamp <= self.newest:
            return
        self.newest = stamp
        message = Clock()
        message.clock.sec, message.clock.nanosec = seconds_and_nanoseconds(stamp)
        self.publisher.publish(message)


class RunPublishers:
    """Publishes the messages of the wires in `wires`, which maps each to its type.

    `is_paced`: the run follows the clock of the machine; of any other the time is on /clock.
    `ask`: requests of the engine.
    """

    def __init__(
        self, node: Any, options: BridgeOptions, is_paced: bool, ask: Callable[..., Fields]
    ) -> None:
        self.node, self.options = node, options
        self.clock = StampClock(None if is_paced else 0)
        self.run_time = None if is_paced else ClockPublisher(node)
        self.prefix = options.frame_prefix
        self.publish: dict[str, Publish] = {}
        self.diagnosis = Diagnosis({})
        self.map_grid = MapGrid(ask)
        self.diagnostics = self._publisher(DiagnosticArray, DIAGNOSTICS)
        self.transforms = self._transform_publisher(TRANSFORMS, QoSProfile(depth=MANY))
        self._publish_model()

    def choose_wires(self, kinds: dict[str, str]) -> list[str]:
        makers: dict[str, Callable[[str, RosTopic], Publish]] = {
            "Odometry": self._odometry,
            "Encoders": self._joint_states,
            "Battery": self._battery,
            "Imu": self._imu,
            "Range": self._sensor,
            "Scan": self._sensor,
            "MapUpdate": self._map,
            "MapPose": self._map_pose,
        }
        for wire, topic in choose_topics(kinds).items():
            make = self._rosout if topic is LOG else makers[kinds[wire]]
            self.publish[wire] = make(wire, topic)
        self.diagnosis = Diagnosis(kinds)
        return list(dict.fromkeys([*self.publish, *self.diagnosis.kinds]))

    def message_received(self, wire: str, message: Fields) -> None:
        stamp = self.clock.stamp(message["time"], time.time_ns())
        if self.run_time is not None:
            self.run_time.time_passed(stamp)
        publish = self.publish.get(wire)
        if publish is not None:
            publish(message, stamp)
        entries = self.diagnosis.message_received(wire, message, time.monotonic_ns())
        if entries:
            self._publish_diagnostics(entries, stamp)

    def _publisher(self, kind: type, topic: RosTopic) -> Any:
        return self.node.create_publisher(kind, topic.name, PROFILES[topic.delivery])

    def _transform_publisher(self, topic: RosTopic, profile: QoSProfile) -> Any:
        if TFMessage is None:
            return None
        return self.node.create_publisher(TFMessage, topic.name, profile)

    def _publish_model(self) -> None:
        """Publish description and fixed frames once; they are latched."""
        model = self.options.model
        self.description = self._publisher(String, DESCRIPTION)
        if model.urdf:
            self.description.publish(String(data=model.urdf))
        self.fixed = self._transform_publisher(FIXED_TRANSFORMS, LATCHED)
        if self.fixed is not None:
            transforms = [self._frame(frame) for frame in fixed_frames(model.frames)]
            self.fixed.publish(TFMessage(transforms=transforms))

    def _frame(self, frame: ModelFrame) -> Any:
        transform = TransformStamped(child_frame_id=self.prefix + frame.name)
        fill(transform.transform, frame_transform(frame))
        stamp = time.time_ns() if self.run_time is None else 0
        return fill_header(transform, stamp, self.prefix + frame.parent)

    def _odometry(self, wire: str, topic: RosTopic) -> Publish:
        publisher = self._publisher(Odometry, topic)
        child = self.prefix + robot_frame(self.options.model.frames)
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

    def _joint_states(self, wire: str, topic: RosTopic) -> Publish:
        publisher = self._publisher(JointState, topic)
        model = self.options.model
        turning = wheels(model.frames)
        message = JointState(name=[wheel_joint(frame.name) for frame in turning])
        moving = [self._frame(frame) for frame in turning]
        transforms = None if TFMessage is None else TFMessage(transforms=moving)

        def publish(fields: Fields, stamp: int) -> None:
            if not turning:
                return
            angles = conversion.wheel_angles(fields, model.counts_per_turn)
            message.position = list(angles)
            publisher.publish(fill_header(message, stamp, ""))
            for transform, angle in zip(moving, angles, strict=True):
                fill(transform.transform.rotation, wheel_rotation(angle))
                fill_header(transform, stamp, self.prefix + BASE)
            if transforms is not None:
                self.transforms.publish(transforms)

        return publish

    def _sensor(self, wire: str, topic: RosTopic) -> Publish:
        sensor = self.options.model.sensors.get(wire, SensorModel(BASE, 0.0, 0.0))
        is_scan = topic.type == "sensor_msgs/msg/LaserScan"
        message = LaserScan() if is_scan else Range()
        convert = conversion.scan if is_scan else conversion.range_fields
        publisher = self._publisher(type(message), topic)
        frame = self.prefix + sensor.frame

        def publish(fields: Fields, stamp: int) -> None:
            stamp -= conversion.scan_age(fields)
            publisher.publish(fill_header(fill(message, convert(fields, sensor)), stamp, frame))

        return publish

    def _map(self, wire: str, topic: RosTopic) -> Publish:
        publisher = self._publisher(OccupancyGrid, topic)

        def publish(fields: Fields, stamp: int) -> None:
            grid = self.map_grid.take(fields)
            if grid is not None:
                message = fill_header(fill(OccupancyGrid(), grid), stamp, self.prefix + MAP)
                publisher.publish(message)

        return publish

    def _map_pose(self, wire: str, topic: RosTopic) -> Publish:
        publisher = self._publisher(PoseWithCovarianceStamped, topic)
        transform = TransformStamped(child_frame_id=self.prefix + WORLD)
        frame = self.prefix + MAP

        def publish(fields: Fields, stamp: int) -> None:
            message = fill(PoseWithCovarianceStamped(), conversion.map_pose(fields))
            publisher.publish(fill_header(message, stamp, frame))
            if TFMessage is not None:
                fill(transform.transform, conversion.map_transform(fields))
                fill_header(transform, stamp, frame)
                self.transforms.publish(TFMessage(transforms=[transform]))

        return publish

    def _battery(self, wire: str, topic: RosTopic) -> Publish:
        publisher = self._publisher(BatteryState, topic)

        def publish(fields: Fields, stamp: int) -> None:
            message = fill(BatteryState(), conversion.battery(fields))
            publisher.publish(fill_header(message, stamp, ""))

        return publish

    def _imu(self, wire: str, topic: RosTopic) -> Publish:
        frame = self.prefix + BASE
        publishers: list[Any] = []  # none of a robot without an IMU, which has the wire, too

        def publish(fields: Fields, stamp: int) -> None:
            if not publishers:
                publishers.append(self._publisher(Imu, topic))
            publishers[0].publish(fill_header(fill(Imu(), conversion.imu(fields)), stamp, frame))

        return publish

    def _rosout(self, wire: str, topic: RosTopic) -> Publish:
        profile = QoSProfile(depth=MANY, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = self.node.create_publisher(Log, topic.name, profile)

        def publish(fields: Fields, stamp: int) -> None:
            message = fill(Log(), conversion.log_line(fields))
            message.stamp.sec, message.stamp.nanosec = seconds_and_nanoseconds(stamp)
            publisher.publish(message)

        return publish

    def _publish_diagnostics(self, entries: list[DiagnosticEntry], stamp: int) -> None:
        message = fill_header(DiagnosticArray(), stamp, "")
        for entry in entries:
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
