"""Messages as the viewers Foxglove, Lichtblick and PlotJuggler draw them: `foxglove.*` in JSON.

Frames are `odom`, `base_link` (REP-105) and a sensor's name; times are ns since 1970, because
viewers show the time of day. What is not finite is not drawn: JSON has no word for it.

What a recording carries for viewers beside the run's own topics.

Made by the recorder's process from the messages that pass through it; no part of the run, so that
neither a replay nor a digest ever sees them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from math import cos, isfinite, sin
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.config import lookup
from diffbotctl.messages import LogLine, Odometry, Range
from diffbotctl.time import SECOND

SCHEMAS = ("FrameTransform", "PoseInFrame", "LaserScan", "Log")
LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4}  # foxglove.LogLevel
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


class SensorMount(NamedTuple):
    """Where a sensor sits in base_link: x, y in m, heading in rad; `frame` is its name."""

    frame: str
    x: float
    y: float
    heading: float


def odometry_transform(epoch: int, pose: Odometry) -> bytes | None:
    """foxglove.FrameTransform of base_link in odom."""
    return transform(
        epoch + pose.time, "odom", SensorMount("base_link", pose.x, pose.y, pose.heading)
    )


def transform(time: int, parent: str, child: SensorMount) -> bytes | None:
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


TRANSFORMS = "tf"  # topic, as ROS tools call it
MOUNTS_AGAIN = 5_000_000_000  # ns; viewers that begin in the middle learn where sensors sit

Made = tuple[str, bytes]  # topic and message
Maker = Callable[[int, Any], Iterator[Made]]


def schema(name: str) -> bytes:
    """The published JSON Schema of foxglove.`name`."""
    path: Path = lookup.folder("schemas") / "foxglove" / f"{name}.json"
    return path.read_bytes()


class Viewers:
    """Makes viewers' messages from a run's. `mounts` maps a range's wire to its sensor's place."""

    def __init__(self, epoch: int, wires: dict[str, type], mounts: dict[str, SensorMount]) -> None:
        self.epoch = epoch
        self.mounts = {wire: mount for wire, mount in mounts.items() if wire in wires}
        self.topics: dict[str, str] = {}
        self.makers: list[tuple[int, Maker]] = []
        self.mounts_due = 0
        for place, (wire, kind) in enumerate(wires.items(), 1):
            maker = self._maker(wire, kind)
            if maker is not None:
                self.makers.append((place, maker))

    def made(self, instant: tuple[Any, ...]) -> Iterator[Made]:
        """What to write beside an instant: (time, message or None for each wire)."""
        time = instant[0]
        if self.mounts and time >= self.mounts_due:
            self.mounts_due = time + MOUNTS_AGAIN
            yield from self._sensors(time)
        for place, maker in self.makers:
            message = instant[place]
            if message is not None:
                yield from maker(time, message)

    def _maker(self, wire: str, kind: type) -> Maker | None:
        if kind is Odometry:
            moves = TRANSFORMS not in self.topics  # a second one would fight with the first
            self.topics[TRANSFORMS] = "FrameTransform"
            self.topics[f"{wire}.pose"] = "PoseInFrame"
            return lambda time, message: self._pose(wire, moves, message)
        if kind is Range:
            if wire not in self.mounts:
                return None
            self.topics[TRANSFORMS] = "FrameTransform"
            self.topics[f"{wire}.scan"] = "LaserScan"
            return lambda time, message: self._scan(wire, message)
        if kind is LogLine:
            self.topics[f"{wire}.lines"] = "Log"
            return lambda time, message: self._line(wire, message)
        return None

    def _sensors(self, time: int) -> Iterator[Made]:
        for mount in set(self.mounts.values()):
            placed = transform(self.epoch + time, "base_link", mount)
            if placed is not None:
                yield TRANSFORMS, placed

    def _pose(self, wire: str, moves: bool, message: Odometry) -> Iterator[Made]:
        moved = odometry_transform(self.epoch, message) if moves else None
        posed = pose_in_frame(self.epoch, message)
        if moved is not None:
            yield TRANSFORMS, moved
        if posed is not None:
            yield f"{wire}.pose", posed

    def _scan(self, wire: str, message: Range) -> Iterator[Made]:
        frame = self.mounts[wire].frame
        yield f"{wire}.scan", laser_scan(self.epoch, message, frame)

    def _line(self, wire: str, line: LogLine) -> Iterator[Made]:
        time = self.epoch + line.time
        yield f"{wire}.lines", log(time, line.level, line.source, line.text)
