"""A run as ROS knows it: topics, frames, joints. The bridge and exported recordings share it.

Delivery is as ROS users expect it: sensors best effort, odometry reliable, description and fixed
frames latched (transient local).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import cos, sin
from typing import Literal, NamedTuple

from diffbotctl.geometry.map_tiles import MapTiles
from diffbotctl.messages import MapUpdate
from diffbotctl.ros2 import conversion
from diffbotctl.ros2.conversion import DiagnosticEntry, Fields
from diffbotctl.ros2.options import ModelFrame
from diffbotctl.time import SECOND

MAP, WORLD, GROUND, BASE = "map", "odom", "base_footprint", "base_link"
LOG_WIRE = "log"
DIAGNOSED = ("Stop", "Link", "GoalState", "Battery", "Imu")
DIAGNOSTICS_PERIOD = SECOND
MAP_PERIOD = 2 * SECOND  # of the run; each message has the whole map

Delivery = Literal["reliable", "best_effort", "latched"]


class RosTopic(NamedTuple):
    """A topic: name without namespace, message type, delivery."""

    name: str
    type: str
    delivery: Delivery = "reliable"


TRANSFORMS = RosTopic("/tf", "tf2_msgs/msg/TFMessage")
FIXED_TRANSFORMS = RosTopic("/tf_static", "tf2_msgs/msg/TFMessage", "latched")
CLOCK = RosTopic("/clock", "rosgraph_msgs/msg/Clock")
DESCRIPTION = RosTopic("robot_description", "std_msgs/msg/String", "latched")
DIAGNOSTICS = RosTopic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
LOG = RosTopic("/rosout", "rcl_interfaces/msg/Log", "latched")
# The first wire of each of these types is published; each wire of the others.
FIRST_WIRE = {
    "Odometry": RosTopic("odom", "nav_msgs/msg/Odometry"),
    "Encoders": RosTopic("joint_states", "sensor_msgs/msg/JointState"),
    "Battery": RosTopic("battery_state", "sensor_msgs/msg/BatteryState"),
    "Imu": RosTopic("imu", "sensor_msgs/msg/Imu", "best_effort"),
    "MapUpdate": RosTopic("map", "nav_msgs/msg/OccupancyGrid", "latched"),
    "MapPose": RosTopic("pose", "geometry_msgs/msg/PoseWithCovarianceStamped"),
}
EACH_WIRE = {
    "Range": RosTopic("range", "sensor_msgs/msg/Range", "best_effort"),
    "Scan": RosTopic("scan", "sensor_msgs/msg/LaserScan", "best_effort"),
}


def choose_topics(kinds: Mapping[str, str]) -> dict[str, RosTopic]:
    """The topic of each wire that has one; `kinds` maps all wires to their types."""
    chosen: dict[str, RosTopic] = {}
    count: dict[str, int] = {}
    for wire, kind in kinds.items():
        count[kind] = number = count.get(kind, 0) + 1
        if wire == LOG_WIRE:
            chosen[wire] = LOG
        elif kind in EACH_WIRE:
            topic = EACH_WIRE[kind]
            name = topic.name if number == 1 else f"{topic.name}_{number}"
            chosen[wire] = topic._replace(name=name)
        elif kind in FIRST_WIRE and number == 1:
            chosen[wire] = FIRST_WIRE[kind]
    return chosen


def diagnosed_wires(kinds: Mapping[str, str]) -> dict[str, str]:
    """The wires whose newest messages make up /diagnostics, with their types."""
    return {
        wire: kind
        for wire, kind in kinds.items()
        if kind in DIAGNOSED and not wire.startswith("operator.")
    }


class Diagnosis:
    """Collects the newest messages of the wires in `kinds`, and decides when to publish them."""

    def __init__(self, kinds: Mapping[str, str]) -> None:
        self.kinds = diagnosed_wires(kinds)
        self.newest: dict[str, tuple[str, Fields]] = {}
        self.due = -DIAGNOSTICS_PERIOD

    def message_received(self, wire: str, message: Fields, now: int) -> list[DiagnosticEntry]:
        """The statuses to publish at `now` (ns), once a second and at each stop; else none."""
        kind = self.kinds.get(wire)
        if kind is not None:
            self.newest[wire] = (kind, message)
        if kind != "Stop" and now < self.due:
            return []
        self.due = now + DIAGNOSTICS_PERIOD
        return conversion.diagnostics(self.newest)


class MapGrid:
    """Collects the tiles of the map, and decides when to publish it as a whole.

    `ask`: requests of the engine, for tiles that are missing; none for a recording.
    """

    def __init__(self, ask: Callable[..., Fields] | None = None) -> None:
        self.tiles, self.ask = MapTiles(), ask
        self.published = ""  # hash of the tiles
        self.due = 0

    def take(self, fields: Fields) -> Fields | None:
        """Take a MapUpdate; nav_msgs/OccupancyGrid without its header when one is due."""
        update, tiles = MapUpdate(**fields), self.tiles
        tiles.take(update)
        if not update.sha256 or update.time < self.due or update.sha256 == self.published:
            return None
        self.due, self.published = update.time + MAP_PERIOD, update.sha256
        if self.ask is not None and not tiles.is_whole:
            while tiles.take_reply(self.ask("read_map", map=tiles.map, since=tiles.read)):
                pass
        return conversion.occupancy_grid(tiles.rows())


def robot_frame(frames: tuple[ModelFrame, ...]) -> str:
    """The frame whose pose in odom is published: that on the ground, if the model is known."""
    return GROUND if frames else BASE


def wheels(frames: tuple[ModelFrame, ...]) -> list[ModelFrame]:
    """The frames that turn with the wheels, left and right."""
    return [frame for frame in frames if frame.moves == "wheel"]


def fixed_frames(frames: tuple[ModelFrame, ...]) -> list[ModelFrame]:
    """The frames that do not move in their parents."""
    return [frame for frame in frames if not frame.moves]


def wheel_joint(frame: str) -> str:
    """The name of a wheel's joint in the URDF, from that of its frame."""
    return frame.removesuffix("_link") + "_joint"


def frame_transform(frame: ModelFrame) -> Fields:
    """geometry_msgs/Transform of a frame in its parent."""
    fields = conversion.transform({"x": frame.x, "y": frame.y, "heading": frame.heading})
    fields["translation"]["z"] = frame.z
    return fields


def wheel_rotation(angle: float) -> Fields:
    """geometry_msgs/Quaternion of a wheel that has turned by `angle` (rad) about its axle, y."""
    return {"y": sin(0.5 * angle), "w": cos(0.5 * angle)}
