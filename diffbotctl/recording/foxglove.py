"""Messages for the viewers Foxglove, Lichtblick and PlotJuggler: `foxglove.*` in JSON.

The recording's process makes them from the messages of the run; they are no part of the run, so a
replay and a digest ignore them. Frames are `odom`, `base_link` (REP-105) and a sensor's name; times
are ns since 1970, because viewers show the time of day. Values that are not finite are left out:
JSON cannot represent them.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from math import cos, isfinite, sin
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.config import lookup
from diffbotctl.messages import LogLine, Odometry, Range
from diffbotctl.time import SECOND

SCHEMAS = ("FrameTransform", "PoseInFrame", "LaserScan", "Log")
LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4}  # foxglove.LogLevel
# Half the beam width of a Sharp sensor, about 1.5 cm at 30 cm (data sheet GP2Y0A41SK0F). With three
# rays no viewer divides by zero to find the angle between them.
BEAM_HALF_WIDTH_RAD, RAYS = 0.05, 3
TRANSFORMS = "tf"  # topic, as ROS tools call it
MOUNT_PERIOD = 5 * SECOND  # viewers that start in the middle learn where the sensors are

_TIME = '{"sec": %d, "nsec": %d}'
_VECTOR = '{"x": %r, "y": %r, "z": 0.0}'
_TURN = '{"x": 0.0, "y": 0.0, "z": %r, "w": %r}'
_POSE = f'{{"position": {_VECTOR}, "orientation": {_TURN}}}'
_TRANSFORM = (
    f'{{"timestamp": {_TIME}, "parent_frame_id": "%s", "child_frame_id": "%s", '
    f'"translation": {_VECTOR}, "rotation": {_TURN}}}'
)
_POSE_IN_FRAME = f'{{"timestamp": {_TIME}, "frame_id": "odom", "pose": {_POSE}}}'
_SCAN = (
    f'{{"timestamp": {_TIME}, "frame_id": "%s", "pose": {_POSE % (0.0, 0.0, 0.0, 1.0)}, '
    f'"start_angle": {-BEAM_HALF_WIDTH_RAD}, "end_angle": {BEAM_HALF_WIDTH_RAD}, '
    f'"ranges": [%s], "intensities": []}}'
)


class SensorMount(NamedTuple):
    """Pose of a sensor in base_link: x, y in m, heading in rad; `frame` is its name."""

    frame: str
    x: float
    y: float
    heading: float


def schema(name: str) -> bytes:
    """The published JSON Schema of foxglove.`name`."""
    path: Path = lookup.folder("schemas") / "foxglove" / f"{name}.json"
    return path.read_bytes()


def odometry_transform(epoch: int, pose: Odometry) -> bytes | None:
    """foxglove.FrameTransform of base_link in odom; None when it is not finite."""
    base_link = SensorMount("base_link", pose.x, pose.y, pose.heading)
    return frame_transform(epoch + pose.time, "odom", base_link)


def frame_transform(time: int, parent: str, child: SensorMount) -> bytes | None:
    """foxglove.FrameTransform of `child.frame` in the frame `parent`; None when not finite."""
    if not _is_finite(child):
        return None
    pose = (child.x, child.y, *_quaternion(child.heading))
    return (_TRANSFORM % (*divmod(time, SECOND), parent, child.frame, *pose)).encode()


def pose_in_frame(epoch: int, pose: Odometry) -> bytes | None:
    """foxglove.PoseInFrame of base_link in odom; None when it is not finite."""
    if not _is_finite(pose):
        return None
    values = (pose.x, pose.y, *_quaternion(pose.heading))
    return (_POSE_IN_FRAME % (*divmod(epoch + pose.time, SECOND), *values)).encode()


def laser_scan(epoch: int, reading: Range, frame: str) -> bytes:
    """foxglove.LaserScan of a sensor that measures one distance; empty when it measured none."""
    is_measured = reading.state == "measured" and isfinite(reading.distance)
    ranges = ", ".join([repr(reading.distance)] * RAYS) if is_measured else ""
    return (_SCAN % (*divmod(epoch + reading.time, SECOND), frame, ranges)).encode()


def log(epoch: int, line: LogLine) -> bytes:
    """foxglove.Log of one line; an unknown level becomes UNKNOWN."""
    seconds, nanoseconds = divmod(epoch + line.time, SECOND)
    fields = {
        "timestamp": {"sec": seconds, "nsec": nanoseconds},
        "level": LEVELS.get(line.level, 0),
        "message": line.text,
        "name": line.source,
        "file": "",
        "line": 0,
    }
    return json.dumps(fields).encode()


def _is_finite(pose: Odometry | SensorMount) -> bool:
    return isfinite(pose.x) and isfinite(pose.y) and isfinite(pose.heading)


def _quaternion(heading: float) -> tuple[float, float]:
    """z and w of the unit quaternion of a rotation by `heading` about the vertical axis."""
    return sin(heading / 2), cos(heading / 2)


TopicMessage = tuple[str, bytes | None]  # topic and message; None: not finite
Builder = Callable[[Any], Iterable[TopicMessage]]


class ViewerMessages:
    """Makes viewers' messages from a run's.

    `epoch`: ns since 1970 at logical time 0. `mounts` maps the wire of a range to its sensor's
    pose, `topics` each topic to its schema.
    """

    def __init__(self, epoch: int, wires: dict[str, type], mounts: dict[str, SensorMount]) -> None:
        self.epoch = epoch
        self.mounts = {wire: mount for wire, mount in mounts.items() if wire in wires}
        self.topics: dict[str, str] = {}
        self.builders: list[tuple[int, Builder]] = []
        self.mounts_due = 0
        for place, (wire, kind) in enumerate(wires.items(), 1):
            builder = self._builder(wire, kind)
            if builder is not None:
                self.builders.append((place, builder))

    def messages(self, instant: tuple[Any, ...]) -> Iterator[tuple[str, bytes]]:
        """(topic, message) to write with an instant: (time, message or None for each wire)."""
        messages: list[TopicMessage] = []
        time = instant[0]
        if self.mounts and time >= self.mounts_due:
            self.mounts_due = time + MOUNT_PERIOD
            for mount in set(self.mounts.values()):
                transform = frame_transform(self.epoch + time, "base_link", mount)
                messages.append((TRANSFORMS, transform))
        for place, builder in self.builders:
            if instant[place] is not None:
                messages += builder(instant[place])
        return ((topic, data) for topic, data in messages if data is not None)

    def _builder(self, wire: str, kind: type) -> Builder | None:
        epoch = self.epoch
        if kind is Odometry:
            has_transform = TRANSFORMS not in self.topics  # two would contradict each other
            topic = f"{wire}.pose"
            self.topics |= {TRANSFORMS: "FrameTransform", topic: "PoseInFrame"}
            if has_transform:
                return lambda pose: (
                    (TRANSFORMS, odometry_transform(epoch, pose)),
                    (topic, pose_in_frame(epoch, pose)),
                )
            return lambda pose: ((topic, pose_in_frame(epoch, pose)),)
        if kind is Range and wire in self.mounts:
            frame = self.mounts[wire].frame
            self.topics |= {TRANSFORMS: "FrameTransform", f"{wire}.scan": "LaserScan"}
            return lambda reading: ((f"{wire}.scan", laser_scan(epoch, reading, frame)),)
        if kind is LogLine:
            self.topics[f"{wire}.lines"] = "Log"
            return lambda line: ((f"{wire}.lines", log(epoch, line)),)
        return None
