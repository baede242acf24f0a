"""The run that a hub stands before, as the engine tells it once.

What the hub knows of the run: the newest message of each wire, rates, and past stops.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import Any, NamedTuple

from diffbotctl.control_socket.engine_channel import EngineUpdate
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.engine.profiler import BlockLoad
from diffbotctl.graph import Graph
from diffbotctl.messages import GoalState, LogLine, Message, Setting, Stop
from diffbotctl.time import SECOND


class RunInfo(NamedTuple):
    """The run that a hub stands before. Speeds are the robot's limits; None without a robot.

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
    is_replay: bool  # nothing that is commanded can reach anything
    scene: dict[str, Any]  # what a map draws that does not change, as the verb `scene` answers


RATE_SPAN = 2 * SECOND  # ns over which a rate is taken: long enough for 1 Hz, short enough to show
MOST_TIMES = 512  # message times kept a wire; above 256 Hz the span of the rate is shorter
MOST_LINES = 500  # lines of the log remembered
MOST_EPISODES = 20  # stops remembered


class StopEpisode(NamedTuple):
    """One stop: who said it when, and the newest message of every wire at that moment."""

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
    """Follows the engine's news. The blocks of `graph` are the hub's own copy of them: their live
    parameters follow too."""

    def __init__(self, graph: Graph) -> None:
        wires = graph.kinds
        self.changes = LiveChanges(graph, {})
        self.changed: set[tuple[str, str]] = set()
        self.wires = wires
        self.names = list(wires)
        self.stops = [wire for wire, kind in wires.items() if kind is Stop]
        self.latest: dict[str, Message] = {}
        self.counts = dict.fromkeys(wires, 0)
        self.times: dict[str, deque[int]] = {wire: deque(maxlen=MOST_TIMES) for wire in wires}
        self.episodes: deque[StopEpisode] = deque(maxlen=MOST_EPISODES)
        self.lines: deque[LogLine] = deque(maxlen=MOST_LINES)
        self.errors: dict[str, LogLine] = {}
        self.loads: dict[str, BlockLoad] = {}
        self.now = 0
        self.lost = 0

    def take(self, news: EngineUpdate) -> None:
        """Take what the engine sent."""
        self.lost += news.lost
        if news.loads is not None:
            self.loads = {name: BlockLoad(*load) for name, load in news.loads.items()}
        for instant in news.instants:
            self._instant(instant)

    def _instant(self, instant: tuple[Any, ...]) -> None:
        self.now = now = instant[0]
        for wire, message in zip(self.names, instant[1:], strict=True):
            if message is not None:
                self.latest[wire] = message
                self.counts[wire] += 1
                self.times[wire].append(now)
                if type(message) is Stop and message.code:
                    self._remember(now, wire, message)
                elif type(message) is Setting:
                    self.changes.set(now, message)
                    self.changed.add((message.block, message.name))
        if type(instant[-1]) is LogLine:  # its wire is the last one
            self._note(instant[-1])

    def _note(self, line: LogLine) -> None:
        self.lines.append(line)
        if line.level == "error":
            self.errors[line.source] = line

    def _remember(self, now: int, wire: str, stop: Stop) -> None:
        if wire.startswith("operator."):
            return  # the echo of a block's stop, or a wish that the gate will speak of
        self.episodes.append(StopEpisode(now, wire, stop, dict(self.latest)))

    def rate(self, wire: str) -> TopicRate:
        """How often `wire` has lately carried a message."""
        recent = [time for time in self.times[wire] if time >= self.now - RATE_SPAN]
        count = self.counts[wire]
        if len(recent) < 2:
            return TopicRate(0.0, float("nan"), float("nan"), count)
        gaps = [(b - a) / SECOND for a, b in pairwise(recent)]
        # A wire that has fallen silent must not keep the rate that it had.
        span = max(self.now - recent[0], recent[-1] - recent[0], 1) / SECOND
        return TopicRate((len(recent) - 1) / span, min(gaps), max(gaps), count)

    def age(self, wire: str) -> float | None:
        """Seconds since the last message on `wire`; None before the first."""
        times = self.times[wire]
        return (self.now - times[-1]) / SECOND if times else None

    def goal_state(self) -> GoalState | None:
        """What was last said of a goal; None where no block follows any, or before its first."""
        said = [message for message in self.latest.values() if isinstance(message, GoalState)]
        return max(said, key=lambda each: each.time) if said else None

    def holding(self) -> tuple[str, Stop] | None:
        """The gravest stop in force and the wire that says so."""
        found = [(wire, self.latest[wire]) for wire in self.stops if wire in self.latest]
        held = [
            (wire, stop)
            for wire, stop in found
            if isinstance(stop, Stop) and stop.code and not wire.startswith("operator.")
        ]
        return min(held, key=lambda each: not each[1].latched) if held else None
