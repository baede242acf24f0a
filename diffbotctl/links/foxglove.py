"""Messages as the viewers Foxglove, Lichtblick and PlotJuggler draw them: `foxglove.*` in JSON.

Frames are `odom`, `base_link` (REP-105) and a sensor's name; times are ns since 1970, because
viewers show the time of day. What is not finite is not drawn: JSON has no word for it.
"""

from __future__ import annotations

import json
from math import cos, isfinite, sin
from typing import NamedTuple

from diffbotctl.messages import Odometry, Range

SCHEMAS = ("FrameTransform", "PoseInFrame", "LaserScan", "Log")
LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4}  # foxglove.LogLevel
SECOND = 1_000_000_000
# Half the width of a Sharp sensor's beam, about 1.5 cm at 30 cm (data sheet GP2Y0A41SK0F); and with
# three rays no viewer divides by zero to find the angle between them.
BEAM, RAYS = 0.05, 3

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
    f'"start_angle": {-BEAM}, "end_angle": {BEAM}, "ranges": [%s], "intensities": []}}'
)


class Mount(NamedTuple):
    """Where a sensor sits in base_link: x, y in m, heading in rad; `frame` is its name."""

    frame: str
    x: float
    y: float
    heading: float


def odometry_transform(epoch: int, pose: Odometry) -> bytes | None:
    """foxglove.FrameTransform of base_link in odom."""
    return transform(epoch + pose.time, "odom", Mount("base_link", pose.x, pose.y, pose.heading))


def transform(time: int, parent: str, child: Mount) -> bytes | None:
    """foxglove.FrameTransform of the frame `child.frame` in `parent`."""
    if not _finite(child.x, child.y, child.heading):
        return None
    place = (child.x, child.y, *_turn(child.heading))
    return (_TRANSFORM % (*divmod(time, SECOND), parent, child.frame, *place)).encode()


def pose_in_frame(epoch: int, pose: Odometry) -> bytes | None:
    """foxglove.PoseInFrame of base_link in odom."""
    if not _finite(pose.x, pose.y, pose.heading):
        return None
    place = (pose.x, pose.y, *_turn(pose.heading))
    return (_POSE_IN_FRAME % (*divmod(epoch + pose.time, SECOND), *place)).encode()


def laser_scan(epoch: int, reading: Range, frame: str) -> bytes:
    """foxglove.LaserScan of a sensor that measures one distance; empty when it measured none."""
    seen = reading.state == "measured" and isfinite(reading.distance)
    ranges = ", ".join([repr(reading.distance)] * RAYS) if seen else ""
    return (_SCAN % (*divmod(epoch + reading.time, SECOND), frame, ranges)).encode()


def log(time: int, level: str, name: str, text: str) -> bytes:
    """foxglove.Log of one line; a level it does not know becomes UNKNOWN."""
    said = {
        "timestamp": {"sec": time // SECOND, "nsec": time % SECOND},
        "level": LEVELS.get(level, 0),
        "message": text,
        "name": name,
        "file": "",
        "line": 0,
    }
    return json.dumps(said).encode()


def _finite(*values: float) -> bool:
    return all(map(isfinite, values))


def _turn(heading: float) -> tuple[float, float]:
    """z and w of the unit quaternion that turns by `heading` about the upward axis."""
    return sin(heading / 2), cos(heading / 2)
