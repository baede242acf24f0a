"""What the dashboard shows of a run: the replies of the engine, its trail, a history of numbers."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator
from functools import cache, partial
from math import inf, nan
from typing import Any, Literal, assert_never

from diffbotctl.blocks.slam import place_arguments
from diffbotctl.geometry.deskew import compose
from diffbotctl.messages import BUILT_IN, LogLine, MapPose, MapUpdate
from diffbotctl.messages import fields as message_fields
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.recording.json_codec import message_reader
from diffbotctl.render.map_scene import Scene, parse_scene
from diffbotctl.time import SECOND
from diffbotctl.ui.map.state import MapState
from diffbotctl.ui.run_text import newest_message, newest_odometry

HISTORY_MAX_VALUES = 1200  # of each field: two minutes at ten a second
NO_UNITS = ("1", "see kind")  # in a declaration: a ratio, and what depends on another field
LOG_MAX_LINES = 100  # more than the highest terminal shows

Fields = dict[str, Any]
Request = Literal["scene", "list_topics", "snapshot", "list_blocks", "read_log", "list_parameters"]
# The requests whose replies a RunView takes, with their fields.
REQUESTS: dict[Request, Fields] = {
    "scene": {},
    "list_topics": {},
    "snapshot": {},
    "list_blocks": {},
    "read_log": {"last": LOG_MAX_LINES},
    "list_parameters": {},
}


class RunView(MapState):
    """Everything that panels draw. Updated with the replies to REQUESTS."""

    def __init__(self, engine: str = "") -> None:
        super().__init__(Scene("", ""))
        self.engine = engine
        self.numbers: dict[str, deque[tuple[float, float]]]  # (s, value) by field
        self.numbers = defaultdict(partial(deque, maxlen=HISTORY_MAX_VALUES))
        self.log: list[LogLine] = []
        self.rates: dict[str, Fields] = {}
        self.blocks: list[Fields] = []
        self.parameters: list[Fields] = []
        self.held: Fields | None = None
        self.readers: dict[str, Any] = {}
        self.ended = False

    def take_reply(self, request: Request, reply: Fields) -> None:
        """Update what the reply to `request` contains."""
        match request:
            case "scene":
                self.scene = parse_scene(reply)
            case "list_topics":
                self._take_topics(reply)
            case "snapshot":
                self._take_messages(reply)
            case "list_blocks":
                self.blocks = reply["blocks"]
            case "read_log":
                self.log = [LogLine(**line) for line in reply["lines"]]
            case "list_parameters":
                self.parameters = reply["parameters"]
            case _:
                assert_never(request)

    def take_trail(self, reply: Fields) -> None:
        """Put the trail in a reply to `read_history` before the one that was drawn here."""
        here = list(self.trail.points)
        self.trail.points.clear()
        for x, y in [*reply["trail"], *here]:
            self.trail.add((x, y))

    @property
    def has_map(self) -> bool:
        """Whether there is a robot, or another pose, to draw on a map."""
        return self.scene.robot is not None or newest_odometry(self.snapshot) is not None

    @property
    def map_block(self) -> str:
        """Name of the block that locates the robot in the map; empty without one."""
        messages = self.snapshot.messages.items()
        wire = next((wire for wire, message in messages if isinstance(message, MapPose)), "")
        return wire.rpartition(".")[0]

    @property
    def asks_place(self) -> bool:
        """Whether a click on the map states where the robot is in it."""
        pose = newest_message(self.snapshot, MapPose)
        return pose is not None and pose.state in ("ambiguous", "lost")

    def place_call(self, x: float, y: float, heading: float | None) -> Fields:
        """The fields of `call_action` that state this place, given in odom."""
        pose = newest_message(self.snapshot, MapPose)
        assert pose is not None, "only where `asks_place`"
        x, y, turn = compose(pose.odom, (x, y, heading or 0.0))
        arguments = place_arguments(x, y, None if heading is None else turn)
        return {"action": f"{self.map_block}.place", "arguments": arguments}

    @property
    def map_request(self) -> Fields | None:
        """The fields of `read_map`; None while the map is as it was read."""
        update = newest_message(self.snapshot, MapUpdate)
        read = self.tiles
        if update is None or (update.map, update.version) == (read.map, read.version):
            return None
        return {"map": read.map, "since": read.read}

    def take_map(self, reply: Fields) -> bool:
        """Take the tiles in a reply to `read_map`. True when there are more."""
        return self.tiles.take_reply(reply)

    def take_history(self, topic: str, reply: Fields) -> None:
        """Put the numbers in a reply to `read_history` before those that came since."""
        for name, values in reply["fields"].items():
            history = self.numbers[f"{topic}.{name}"]
            begin = history[0][0] if history else inf
            earlier = [
                (time, nan if value is None else value)
                for time, value in zip(reply["times"], values, strict=True)
                if time < begin
            ]
            room = HISTORY_MAX_VALUES - len(history)
            history.extendleft(reversed(earlier[max(len(earlier) - room, 0) :]))

    def unit(self, name: str) -> str:
        """The unit of a field, `block.port.field`; empty where it has none or it is not known."""
        wire, _, field = name.rpartition(".")
        row = self.rates.get(wire)
        kind = None if row is None else BUILT_IN.get(row["type"])
        return "" if kind is None else declared_units(kind).get(field, "")

    @property
    def fields(self) -> list[str]:
        """Every number that can be plotted, `block.port.field`."""
        return sorted(self.numbers)

    @property
    def live_parameters(self) -> list[Fields]:
        """The parameters that may change while the pipeline runs."""
        return [row for row in self.parameters if row["live"]]

    def _take_topics(self, reply: Fields) -> None:
        """Rates, and a reader for the type of each wire."""
        self.rates = {row["topic"]: row for row in reply["topics"]}
        for wire, row in self.rates.items():
            if wire not in self.readers and row["type"] in BUILT_IN:
                self.readers[wire] = message_reader(BUILT_IN[row["type"]])

    def _take_messages(self, reply: Fields) -> None:
        self.held = reply["held"]
        for wire, values in reply["messages"].items():
            self._add_numbers(wire, values)
        messages = {
            wire: self.readers[wire](values)
            for wire, values in reply["messages"].items()
            if wire in self.readers
        }
        self.update(RunSnapshot(reply["time"], messages, 0, 0))

    def _add_numbers(self, wire: str, values: Fields) -> None:
        time = values["time"] / SECOND
        for name, value in _numbers(values):
            history = self.numbers[f"{wire}.{name}"]
            if not history or history[-1][0] < time:
                history.append((time, value))


@cache
def declared_units(kind: type) -> dict[str, str]:
    """The unit of each field of a message class; none for a ratio."""
    units = {name: field.unit for name, (_, field) in message_fields(kind).items()}
    return {name: "" if unit in NO_UNITS else unit for name, unit in units.items()}


def _numbers(values: Fields) -> Iterator[tuple[str, float]]:
    for name, value in values.items():
        if name != "time" and isinstance(value, int | float):  # a flag counts as 0 or 1
            yield name, float(value)
