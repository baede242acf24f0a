"""Messages for the viewers Foxglove, Lichtblick and PlotJuggler: `foxglove.*` in JSON.

The recording's process makes them from the messages of the run; they are no part of the run, so a
replay and a digest ignore them. Frames are those of the robot's model (REP-105); times are ns since
1970, because viewers show the time of day. JSON cannot represent values that are not finite: such
messages are left out, and such a ray of a scan is 0.
"""

import json
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping
from math import cos, isfinite, sin
from typing import Any

from diffbotctl.config import lookup
from diffbotctl.geometry.map_tiles import FREE, OCCUPIED, UNKNOWN, CellRows, MapTiles
from diffbotctl.geometry.trail import Trail
from diffbotctl.messages import Goal, LogLine, MapPose, MapUpdate, Odometry, Path, Range, Scan
from diffbotctl.model.frames import BASE, GROUND, MAP, WORLD, RobotFrame
from diffbotctl.recording import scene_update
from diffbotctl.recording.viewer_model import ViewerModel
from diffbotctl.time import SECOND

SCHEMAS = ("FrameTransform", "PoseInFrame", "LaserScan", "Log", "SceneUpdate", "Grid")
UINT8 = 1  # foxglove.NumericType
LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4}  # foxglove.LogLevel
# Half the beam width of a Sharp sensor, about 1.5 cm at 30 cm (data sheet GP2Y0A41SK0F). With three
# rays no viewer divides by zero to find the angle between them.
BEAM_HALF_WIDTH_RAD, RAYS = 0.05, 3
TRANSFORMS = "tf"  # topic, as ROS tools call it
FIXED_PERIOD = 5 * SECOND  # viewers that start in the middle learn what does not change
WALLS, ROBOT, GOAL, PATH, TRAIL = "walls", "robot", "goal", "path", "trail"  # topics of the scene
TRAIL_PERIOD = SECOND  # each message has the whole trail
GRID_PERIOD = 5 * SECOND  # each message has the whole map
GRID_CELLS_MAX = 1 << 18  # of a message, 350 kB; a larger map is in its tiles alone
CELL_BYTES = bytes.maketrans((UNKNOWN + FREE + OCCUPIED).encode(), bytes([127, 0, 255]))
TRAIL_SPACING_M, TRAIL_MAX_POINTS = 0.02, 500

_TIME = '{"sec": %d, "nsec": %d}'
_VECTOR = '{"x": %r, "y": %r, "z": %r}'
_TURN = '{"x": 0.0, "y": 0.0, "z": %r, "w": %r}'
_POSE = f'{{"position": {_VECTOR}, "orientation": {_TURN}}}'
_TRANSFORM = (
    f'{{"timestamp": {_TIME}, "parent_frame_id": "%s", "child_frame_id": "%s", '
    f'"translation": {_VECTOR}, "rotation": {_TURN}}}'
)
_POSE_IN_FRAME = f'{{"timestamp": {_TIME}, "frame_id": "odom", "pose": {_POSE}}}'
_SCAN = (
    f'{{"timestamp": {_TIME}, "frame_id": "%s", "pose": {_POSE % (0.0, 0.0, 0.0, 0.0, 1.0)}, '
    f'"start_angle": %r, "end_angle": %r, "ranges": [%s], "intensities": []}}'
)


def schema(name: str) -> bytes:
    """The published JSON Schema of foxglove.`name`, without white space."""
    text = (lookup.folder("schemas") / "foxglove" / f"{name}.json").read_text()
    return json.dumps(json.loads(text), separators=(",", ":")).encode()


def odometry_transform(epoch: int, pose: Odometry, child: str) -> bytes | None:
    """foxglove.FrameTransform of the frame `child` of the robot in odom; None when not finite."""
    frame = RobotFrame(child, WORLD, pose.x, pose.y, heading=pose.heading)
    return frame_transform(epoch + pose.time, frame)


def frame_transform(time: int, frame: RobotFrame) -> bytes | None:
    """foxglove.FrameTransform of a frame in its parent; None when it is not finite."""
    place = (frame.x, frame.y, frame.z)
    if not all(map(isfinite, (*place, frame.heading))):
        return None
    pose = (*place, *_quaternion(frame.heading))
    return (_TRANSFORM % (*divmod(time, SECOND), frame.parent, frame.name, *pose)).encode()


def pose_in_frame(epoch: int, pose: Odometry) -> bytes | None:
    """foxglove.PoseInFrame of the robot in odom; None when it is not finite."""
    if not (isfinite(pose.x) and isfinite(pose.y) and isfinite(pose.heading)):
        return None
    values = (pose.x, pose.y, 0.0, *_quaternion(pose.heading))
    return (_POSE_IN_FRAME % (*divmod(epoch + pose.time, SECOND), *values)).encode()


def laser_scan(epoch: int, reading: Range, frame: str) -> bytes:
    """foxglove.LaserScan of a sensor that measures one distance; empty when it measured none."""
    is_measured = reading.state == "measured" and isfinite(reading.distance)
    ranges = ", ".join([repr(reading.distance)] * RAYS) if is_measured else ""
    angles = (-BEAM_HALF_WIDTH_RAD, BEAM_HALF_WIDTH_RAD)
    return (_SCAN % (*divmod(epoch + reading.time, SECOND), frame, *angles, ranges)).encode()


def full_scan(epoch: int, scan: Scan, frame: str) -> bytes:
    """foxglove.LaserScan of a lidar at the middle of its turn; 0 for a ray that measured nothing.

    Its time is one for all rays.
    """
    last = scan.start + scan.step * max(len(scan.distances) - 1, 0)
    ranges = ", ".join([repr(each) if isfinite(each) else "0.0" for each in scan.distances])
    middle = epoch + scan.time - round(0.5 * SECOND * scan.duration)
    return (_SCAN % (*divmod(middle, SECOND), frame, scan.start, last, ranges)).encode()


def grid(time: int, cells: CellRows) -> bytes | None:
    """foxglove.Grid of the robot's map: 0 free, 127 unknown, 255 occupied; None for a large one."""
    width = len(cells.rows[0]) if cells.rows else 0
    if not 0 < width * len(cells.rows) <= GRID_CELLS_MAX:
        return None
    letters = "".join(cells.rows).encode().translate(CELL_BYTES)
    seconds, nanoseconds = divmod(time, SECOND)
    fields = {
        "timestamp": {"sec": seconds, "nsec": nanoseconds},
        "frame_id": MAP,
        "pose": {
            "position": {"x": cells.x, "y": cells.y, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        },
        "column_count": width,
        "cell_size": {"x": cells.resolution, "y": cells.resolution},
        "row_stride": width,
        "cell_stride": 1,
        "fields": [{"name": "occupancy", "offset": 0, "type": UINT8}],
        "data": b64encode(letters).decode(),
    }
    return json.dumps(fields).encode()


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


def _quaternion(heading: float) -> tuple[float, float]:
    """z and w of the unit quaternion of a rotation by `heading` about the vertical axis."""
    return sin(heading / 2), cos(heading / 2)


def _is_of_several(wire: str) -> bool:
    """Whether it is a wire of one robot of several: `left.odometry.odometry`."""
    return wire.count(".") > 1


TopicMessage = tuple[str, bytes | None]  # topic and message; None: not finite
Builder = Callable[[Any], Iterable[TopicMessage]]


class ViewerMessages:
    """Makes viewers' messages from a run's.

    `epoch`: ns since 1970 at logical time 0. `wires` are those of the run, with their classes;
    `topics` maps each topic for viewers to its schema. `has_grids`: whether the robot's map is
    among them, as one message with all cells; a recording has it in tiles alone.
    """

    def __init__(
        self,
        epoch: int,
        wires: Mapping[str, type],
        model: ViewerModel,
        has_grids: bool = True,
    ) -> None:
        self.epoch = epoch
        self.model = model
        self.has_grids = has_grids
        self.topics: dict[str, str] = {}
        self.builders: dict[str, Builder] = {}
        self.places: list[tuple[int, Builder]] = []  # in an instant
        self.trail = Trail(TRAIL_SPACING_M, TRAIL_MAX_POINTS)
        self.has_moved = False  # since the last message with the trail
        self.map_tiles = MapTiles()
        self.trail_due = self.fixed_due = self.grid_due = 0
        for place, (wire, kind) in enumerate(wires.items(), 1):
            builder = self._builder(wire, kind)
            if builder is not None:
                self.builders[wire] = builder
                self.places.append((place, builder))
        self._add_fixed_topics()

    def messages(self, instant: tuple[Any, ...]) -> Iterator[tuple[str, bytes]]:
        """(topic, message) to write with an instant: (time, message or None for each wire)."""
        messages: list[TopicMessage] = []
        if instant[0] >= self.fixed_due:
            self.fixed_due = instant[0] + FIXED_PERIOD
            messages += self.fixed(instant[0])
        for place, builder in self.places:
            if instant[place] is not None:
                messages += builder(instant[place])
        return ((topic, data) for topic, data in messages if data is not None)

    def of_wire(self, wire: str, message: Any) -> Iterator[tuple[str, bytes]]:
        """(topic, message) for one message of a wire that is in `builders`."""
        for topic, data in self.builders[wire](message):
            if data is not None:
                yield topic, data

    def fixed(self, now: int) -> Iterator[TopicMessage]:
        """What does not change during a run: walls, solids of the robot, fixed frames."""
        time, model = self.epoch + now, self.model
        for frame in model.frames:
            if frame.moves != "odometry":
                yield TRANSFORMS, frame_transform(time, frame)
        if model.solids:
            yield ROBOT, scene_update.robot(time, model.solids)
        if WALLS in self.topics:
            yield WALLS, scene_update.walls(time, model.walls, model.rounds)

    def _add_fixed_topics(self) -> None:
        if self.model.frames:
            self.topics |= {TRANSFORMS: "FrameTransform", ROBOT: "SceneUpdate"}
        if self.model.walls or self.model.rounds:
            self.topics[WALLS] = "SceneUpdate"

    def _builder(self, wire: str, kind: type) -> Builder | None:
        epoch = self.epoch
        if kind in (Goal, Path) and _is_of_several(wire):
            return None  # one goal beside the paths of all would belong to none
        if kind is Odometry:
            return self._odometry_builder(wire)
        if kind in (Range, Scan) and wire in self.model.sensors:
            frame = self.model.sensors[wire]
            self.topics[f"{wire}.scan"] = "LaserScan"
            make = laser_scan if kind is Range else full_scan
            return lambda reading: ((f"{wire}.scan", make(epoch, reading, frame)),)
        if kind is LogLine:
            self.topics[f"{wire}.lines"] = "Log"
            return lambda line: ((f"{wire}.lines", log(epoch, line)),)
        if kind is Goal:
            self.topics[GOAL] = "SceneUpdate"
            return lambda goal: ((GOAL, scene_update.goal(epoch + goal.time, goal)),)
        if kind is MapUpdate and self.has_grids:
            self.topics[f"{wire}.grid"] = "Grid"
            return lambda update: ((f"{wire}.grid", self._grid(update)),)
        if kind is MapPose:
            self.topics[TRANSFORMS] = "FrameTransform"
            return lambda pose: ((TRANSFORMS, self._map_transform(pose)),)
        if kind is Path:
            self.topics[PATH] = "SceneUpdate"
            return lambda path: ((PATH, scene_update.path(epoch + path.time, path)),)
        return None

    def _grid(self, update: MapUpdate) -> bytes | None:
        """The map with this update; None while tiles are still to come, or it is too early."""
        self.map_tiles.take(update)
        if not update.sha256 or update.time < self.grid_due:
            return None
        self.grid_due = update.time + GRID_PERIOD
        return grid(self.epoch + update.time, self.map_tiles.rows())

    def _map_transform(self, pose: MapPose) -> bytes | None:
        x, y, heading = pose.odom
        return frame_transform(
            self.epoch + pose.time, RobotFrame(WORLD, MAP, x, y, heading=heading)
        )

    def _odometry_builder(self, wire: str) -> Builder:
        epoch, topic = self.epoch, f"{wire}.pose"
        is_first = TRAIL not in self.topics  # two transforms would contradict each other
        self.topics[topic] = "PoseInFrame"
        if not is_first or _is_of_several(wire):
            return lambda pose: ((topic, pose_in_frame(epoch, pose)),)
        self.topics |= {TRANSFORMS: "FrameTransform", TRAIL: "SceneUpdate"}
        child = GROUND if self.model.frames else BASE

        def build(pose: Odometry) -> Iterator[TopicMessage]:
            yield TRANSFORMS, odometry_transform(epoch, pose, child)
            yield topic, pose_in_frame(epoch, pose)
            yield TRAIL, self._trail(pose)

        return build

    def _trail(self, pose: Odometry) -> bytes | None:
        """The trail with this pose; None while there is nothing new in it, or it is too early."""
        if isfinite(pose.x) and isfinite(pose.y):
            self.has_moved = self.trail.add((pose.x, pose.y)) or self.has_moved
        if not self.has_moved or pose.time < self.trail_due:
            return None
        self.has_moved, self.trail_due = False, pose.time + TRAIL_PERIOD
        return scene_update.trail(self.epoch + pose.time, self.trail.points)
