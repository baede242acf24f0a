"""What the dashboard shows of a run: the replies of the engine, its trail, a history of numbers."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator
from functools import partial
from typing import Any, Literal, assert_never

from diffbotctl.messages import BUILT_IN, LogLine
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.recording.json_codec import message_reader
from diffbotctl.render.map_scene import Scene, parse_scene
from diffbotctl.time import SECOND
from diffbotctl.ui.map.state import MapState

HISTORY_MAX_VALUES = 1200  # of each field: two minutes at ten a second
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


def _numbers(values: Fields) -> Iterator[tuple[str, float]]:
    for name, value in values.items():
        if name != "time" and isinstance(value, int | float):  # a flag counts as 0 or 1
            yield name, float(value)
