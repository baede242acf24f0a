"""What the server knows about the run: metadata, newest messages, rates, past stops, history."""

import re
import struct
from collections import deque
from collections.abc import Callable, Iterable
from itertools import islice, pairwise
from math import ceil, isfinite, nan
from typing import Any, NamedTuple

from diffbotctl import messages
from diffbotctl.control_socket.connection import Client, Subscriptions
from diffbotctl.control_socket.engine_channel import EngineLink, EngineUpdate
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.control_socket.requests import ALL, LOG_LINES_MAX
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.engine.profiler import BlockLoad
from diffbotctl.engine.stop_places import StopPlaces, pose_wire, stops_in_force
from diffbotctl.errors import closest_match
from diffbotctl.geometry.map_tiles import MapTiles
from diffbotctl.geometry.trail import Trail
from diffbotctl.graph import LOG, Graph
from diffbotctl.message_types import parts
from diffbotctl.messages import (
    Canvas,
    GoalState,
    LogLine,
    MapUpdate,
    Message,
    Odometry,
    Setting,
    Stop,
    TurtlePlacement,
    TurtlePose,
    fields,
)
from diffbotctl.recording.black_box_store import BlackBoxStore
from diffbotctl.time import MILLISECOND, SECOND

HISTORY_PERIOD = 200 * MILLISECOND  # of logical time, between two samples
HISTORY_SAMPLES = 600  # of each topic: two minutes
TRAIL_SPACING_M, TRAIL_MAX_POINTS = 0.02, 1000
REPLY_MAX_VALUES = 20_000  # of a reply; a type with more than 30 fields is sent with gaps
VALUE_DIGITS = 6  # more than a screen has rows
NUMBER_TYPES = (int, float, bool)


class TopicHistory:
    """The last numbers of one topic, as bytes: a tenth of the memory of the messages."""

    def __init__(self, kind: type) -> None:
        self.names = [
            name
            for name, (hint, _) in fields(kind).items()
            if name != "time" and any(part in NUMBER_TYPES for part in parts(hint))
        ]
        self.format = struct.Struct(f"{1 + len(self.names)}d")  # with the time
        self.samples: deque[bytes] = deque(maxlen=HISTORY_SAMPLES)
        self.trail = Trail(TRAIL_SPACING_M, TRAIL_MAX_POINTS) if kind is Odometry else None
        self.time = -1

    def add(self, message: Message) -> None:
        """Add a sample, unless this message is one already."""
        if message.time == self.time:
            return
        self.time = message.time
        numbers = (_number(getattr(message, name)) for name in self.names)
        self.samples.append(self.format.pack(float(message.time), *numbers))
        if self.trail is not None and isinstance(message, Odometry):
            self.trail.add((message.x, message.y))

    def reply(self) -> dict[str, Any]:
        """The samples as JSON values; null where there is no finite number."""
        step = ceil(len(self.samples) * len(self.names) / REPLY_MAX_VALUES) or 1
        rows = [self.format.unpack(sample) for sample in islice(self.samples, 0, None, step)]
        times, *columns = zip(*rows, strict=True) if rows else ((), *[() for _ in self.names])
        return {
            "times": [round(time / SECOND, 3) for time in times],
            "fields": {
                name: [_rounded(value) for value in column]
                for name, column in zip(self.names, columns, strict=True)
            },
            "trail": []
            if self.trail is None
            else [[round(x, 3), round(y, 3)] for x, y in self.trail.points],
        }


class RunHistory:
    """The histories of all topics, sampled every HISTORY_PERIOD."""

    def __init__(self, kinds: dict[str, type]) -> None:
        self.topics = {wire: TopicHistory(kind) for wire, kind in kinds.items()}
        self.due = 0

    def sample(self, now: int, newest: dict[str, Message]) -> None:
        if now < self.due:
            return
        self.due = now + HISTORY_PERIOD
        for wire, message in newest.items():
            self.topics[wire].add(message)


def _number(value: Any) -> float:
    try:
        return float(value)
    except (OverflowError, TypeError, ValueError):  # too great, or none
        return nan


def _rounded(value: float) -> float | None:
    return float(f"{value:.{VALUE_DIGITS}g}") if isfinite(value) else None


RATE_SPAN = 3 * SECOND  # over which a rate is measured: two reports of 1 Hz are always in it
TIMES_MAX = 512  # message times kept a wire; above 256 Hz the span of the rate is shorter
STOPS_MAX = 20  # that are kept
SILENCE_MAX_S = 2.0  # the link of a robot is reported each second


class RunInfo(NamedTuple):
    """Metadata of the run. Speeds are the robot's limits; None without a robot.

    `drivers` maps a node that is no block to the class of its driver.
    """

    name: str
    version: str
    pid: int
    pipeline: str
    robot: str
    port: str
    graph: Graph
    command: str | None  # the wire that leaves for the robot
    drivers: dict[str, type]
    speed: float | None  # m/s
    turn_rate: float | None  # rad/s
    is_replay: bool  # then commands are refused
    is_paced: bool  # False: logical time does not follow the clock of the machine
    scene: dict[str, Any]  # what a map draws that does not change, the reply to `scene`
    motion_inputs: frozenset[str] = frozenset()  # wires of inputs on which motion depends
    readers: frozenset[str] = frozenset()  # wires that a program or a device reads


class StopEpisode(NamedTuple):
    """One stop: its time, its wire, and the newest message of every wire at that time."""

    time: int
    wire: str
    stop: Stop
    before: dict[str, Message]


class TopicRate(NamedTuple):
    """Messages a second over the last RATE_SPAN, gaps in s; nan where there are too few."""

    rate: float
    least_gap: float
    most_gap: float
    messages: int


class RunState:
    """Follows the engine's updates. The blocks of `graph` are the server's own copy of them: their
    live parameters follow too."""

    def __init__(self, graph: Graph) -> None:
        self.blocks = {node.name: node.block for node in graph.nodes}
        self.inputs = {wire for node in graph.nodes for wire in node.wires.values()}
        self.changes = LiveChanges(graph, {})
        self.changed: set[tuple[str, str]] = set()
        self.wires = graph.kinds
        self.subscriptions = Subscriptions(graph.kinds)
        self.newest: dict[str, Message] = {}
        self.counts = dict.fromkeys(self.wires, 0)
        self.times: dict[str, deque[int]] = {wire: deque(maxlen=TIMES_MAX) for wire in self.wires}
        self.stops: deque[StopEpisode] = deque(maxlen=STOPS_MAX)
        # Of those, the ones since the robot was last free to move: each began while an earlier one
        # was in force.
        self.standstill: deque[StopEpisode] = deque(maxlen=STOPS_MAX)
        self.places = StopPlaces()
        self.pose_wire = pose_wire(graph)
        self.history = RunHistory(self.wires)
        self.lines: deque[LogLine] = deque(maxlen=LOG_LINES_MAX)
        self.errors: dict[str, LogLine] = {}
        self.loads: dict[str, BlockLoad] = {}
        self.parsers: dict[str, Callable[[dict[str, Any]], Any]] = {}  # of inputs, by wire
        self.tiles = MapTiles()
        self.now = 0

    def update(self, update: EngineUpdate) -> None:
        if update.loads is not None:
            self.loads = {name: BlockLoad(*load) for name, load in update.loads.items()}
        for instant in update.instants:
            self._add_instant(instant)

    def _add_instant(self, instant: tuple[Any, ...]) -> None:
        self.now = now = instant[0]
        for wire, message in zip(self.wires, instant[1:], strict=True):
            if message is None:
                continue
            message = self._without_tiles(message)
            was_stopped = type(message) is Stop and self.stop_in_force() is not None
            self.newest[wire] = message
            self.counts[wire] += 1
            self.times[wire].append(now)
            if wire == self.pose_wire and isinstance(message, Odometry):
                self.places.move(message)
            elif type(message) is Stop and message.code:
                is_reported = wire.startswith("operator.")  # by the gate too
                if not is_reported and self.places.begins(wire, message):
                    if not was_stopped:
                        self.standstill.clear()
                    self.stops.append(StopEpisode(now, wire, message, dict(self.newest)))
                    self.standstill.append(self.stops[-1])
            elif type(message) is Stop:
                self.places.ends(wire)
            elif type(message) is TurtlePlacement and not message.is_present:
                self._forget_pose(message.number)
            elif type(message) is Setting:
                self.changes.set(now, message)
                self.changed.add((message.block, message.name))
            elif type(message) is LogLine and wire == LOG:
                self.lines.append(message)
                if message.level == "error":
                    self.errors[message.source] = message
        self.history.sample(now, self.newest)

    def _without_tiles(self, message: Any) -> Any:
        """An update of the map without its tiles, which `read_map` sends; any other message."""
        if type(message) is not MapUpdate:
            return message
        self.tiles.take(message)
        return message._replace(places=(), tiles=())

    def _forget_pose(self, number: int) -> None:
        """A turtle that was removed has no pose any more."""
        for wire, message in list(self.newest.items()):
            if type(message) is TurtlePose and message.number == number:
                del self.newest[wire]

    def turtles(self) -> dict[str, int] | None:
        """The number of each further turtle on the canvas by its name; None without a canvas."""
        canvas = next((each for each in self.newest.values() if type(each) is Canvas), None)
        if canvas is None:
            return None
        return dict(zip(canvas.names, map(int, canvas.turtles[::4]), strict=False))

    def absent_turtle(self, wire: str) -> str:
        """That the turtle to which `wire` belongs is not there; empty for all other wires."""
        found, turtles = OF_TURTLE.fullmatch(wire), self.turtles()
        if found is None or turtles is None or int(found[1]) in turtles.values():
            return ""
        return f"there is no turtle {found[1]} on the canvas"

    def silence(self, wire: str) -> str:
        """Why nothing comes on `wire`, or how old its newest message is; empty if it is new."""
        age = self.age(wire)
        if absence := self.absent_turtle(wire):
            return absence
        if age is None:
            return f"no message has come on {wire} yet"
        return f"the newest message on {wire} is {age:.0f} s old" if age > SILENCE_MAX_S else ""

    def rate(self, wire: str) -> TopicRate:
        """The rate of `wire` over the last RATE_SPAN."""
        recent = [time for time in self.times[wire] if time >= self.now - RATE_SPAN]
        count = self.counts[wire]
        if len(recent) < 2:
            return TopicRate(0.0, nan, nan, count)
        gaps = [(later - earlier) / SECOND for earlier, later in pairwise(recent)]
        # A wire without new messages must not keep the rate that it had.
        span = max(self.now - recent[0], recent[-1] - recent[0], 1) / SECOND
        return TopicRate((len(recent) - 1) / span, min(gaps), max(gaps), count)

    def age(self, wire: str) -> float | None:
        """Seconds since the last message on `wire`; None before the first."""
        times = self.times[wire]
        return (self.now - times[-1]) / SECOND if times else None

    def goal_state(self) -> GoalState | None:
        """The newest goal state; None before the first, or where no block follows goals."""
        states = [message for message in self.newest.values() if isinstance(message, GoalState)]
        return max(states, key=lambda state: state.time, default=None)

    def stop_in_force(self) -> tuple[str, Stop] | None:
        """A stop in force and its wire, a latched one first; None when nothing stops the robot."""
        return next(iter(self.stops_in_force()), None)

    def stops_in_force(self) -> list[tuple[str, Stop]]:
        """Every stop in force, with its wire; a latched one first."""
        return stops_in_force(self.newest)


# The last part of a ROS name: the wire here, or the message class with the same content.
ROS_TOPICS: dict[str, str | type] = {
    "cmd_vel": "operator.twist",
    "odom": messages.Odometry,
    "pose": messages.Odometry,  # turtlesim's
    "scan": messages.Scan,
    "range": messages.Range,
    "sonar": messages.Range,
    "goal": "operator.goal",
    "goal_pose": "operator.goal",
    "path": "operator.path",
    "plan": messages.Path,
    "status": GoalState,
    "battery_state": messages.Battery,
    "imu": messages.Imu,
    "color_sensor": messages.Color,
    "wheel_cmd": messages.Wheels,
    "lwheel": "robot.encoders",
    "rwheel": "robot.encoders",
    "joint_states": "robot.encoders",
    "twist": messages.Twist,
    "current_goal": messages.Goal,
    "rosout": "log",
    "rosout_agg": "log",
}


FURTHER_TURTLE = re.compile(r"turtle([2-9]|[1-9]\d+)")  # turtlesim's; turtle1 is the robot itself
OF_TURTLE = re.compile(r"(?:input\.)?turtle(\d+)(?:_twist|_goal|\.pose)")  # wires of `turtles`


class RequestContext(NamedTuple):
    """Context of a request handler: run metadata and state, the link to the engine, the client.

    `store` is that of the black box; None for a run without one.
    """

    info: RunInfo
    state: RunState
    engine: EngineLink
    client: Client
    store: BlackBoxStore | None = None

    def wire(self, name: str) -> str:
        """The wire called `name`, also by its ROS name, or by its block.

        A block stands for its only output, or for the one that has its name. Raises
        RefusalError with the closest name.
        """
        wires = self.state.wires
        if name in wires:
            return name
        if (dotted := name.strip("/").replace("/", ".")) in wires:
            return dotted
        ros_wire = _ros_wire(name, wires, self.state.turtles())
        if ros_wire is not None:
            return ros_wire
        outputs = [wire for wire in wires if wire.rpartition(".")[0] == name]
        if f"{name}.{name}" in outputs:
            return f"{name}.{name}"
        if len(outputs) == 1:
            return outputs[0]
        near = outputs[0] if outputs else closest_match(name.strip("/").replace("/", "."), wires)
        fix = f"did you mean {near}?" if near else "`diffbotctl topic list` shows them all"
        raise RefusalError("E-REQUEST", f"there is no topic '{name}'", fix)

    def topics(self, name: str) -> list[str]:
        """The wires called `name`, which may be ALL."""
        return list(self.state.wires) if name == ALL else [self.wire(name)]

    def require_source(self, name: str) -> None:
        """Raise RefusalError unless `name` is a source of the log, or ALL."""
        book = self.info.graph.book
        sources = [] if book is None else list(book.logs)
        if name not in (ALL, *sources):
            cause = f"there is no block '{name}'"
            raise RefusalError("E-REQUEST", cause, suggestion(name, sources))


def _ros_wire(name: str, wires: dict[str, type], turtles: dict[str, int] | None) -> str | None:
    """The wire that a ROS user means by `name`, such as `/odom`; None when there is none.

    `turtles`: the numbers of the further turtles by their names; None without a canvas.
    """
    *namespace, last = name.strip("/").split("/")
    numbered = (part for part in namespace if FURTHER_TURTLE.fullmatch(part))
    named = (f"turtle{turtles[part]}" for part in namespace if turtles and part in turtles)
    turtle = next(named, next(numbered, None))
    if turtle is None and turtles is not None and namespace not in ([], ["turtle1"]):
        return None  # a turtle that is not there
    if turtle is not None:
        own = {"cmd_vel": f"input.{turtle}_twist", "goal": f"input.{turtle}_goal"}
        wire = own.get(last, f"{turtle}.{last}")
        return wire if wire in wires else None
    meaning = ROS_TOPICS.get(last)
    if isinstance(meaning, str):
        return meaning if meaning in wires else None
    return next((wire for wire, kind in wires.items() if kind is meaning), None)


def suggestion(name: str, names: Iterable[str]) -> str:
    """The fix for a name that does not exist."""
    names = list(names)
    near = closest_match(name, names)
    return f"did you mean {near}?" if near else f"there is {', '.join(names) or 'none'}"
