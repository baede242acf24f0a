"""What the dashboard knows of a run: its newest messages, its trail, the history of its numbers."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

from diffbotctl.messages import BUILT_IN, LogLine
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.recording.json_codec import message_reader
from diffbotctl.render.map_scene import Scene, scene_of
from diffbotctl.ui.map.trail import Trail, TurtleTrail
from diffbotctl.ui.run_text import newest_odometry

HISTORY_MAX_VALUES = 1200  # numbers kept of each field: two minutes at ten a second
LOG_MAX_LINES = 100  # of the log: more than the highest terminal shows

Fields = dict[str, Any]


class RunView:
    """Everything that panels draw. Fed by the answers of `scene`, `topics` and `look`."""

    def __init__(self, about: Fields) -> None:
        self.engine = str(about.get("engine", ""))
        self.scene = Scene("", "")
        self.picture = RunSnapshot(0, {}, 0, 0)
        self.sheet = TurtleTrail()
        self.trail = Trail()
        self.numbers: dict[str, deque[tuple[float, float]]] = {}
        self.log: list[LogLine] = []
        self.rates: dict[str, Fields] = {}
        self.blocks: list[Fields] = []
        self.parameters: list[Fields] = []
        self.held: Fields | None = None
        self.readers: dict[str, Any] = {}
        self.ended = False

    def take_scene(self, said: Fields) -> None:
        """Take the answer of `scene`."""
        self.scene = scene_of(said)

    def take_topics(self, said: Fields) -> None:
        """Take the answer of `topics`: rates, and each wire's type."""
        self.rates = {row["topic"]: row for row in said["topics"]}
        for wire, row in self.rates.items():
            if wire not in self.readers and row["type"] in BUILT_IN:
                self.readers[wire] = message_reader(BUILT_IN[row["type"]])

    def take_look(self, said: Fields) -> None:
        """Take the answer of `look`."""
        self.held = said["held"]
        for wire, values in said["messages"].items():
            self._note(wire, values)
        messages = {
            wire: self.readers[wire](values)
            for wire, values in said["messages"].items()
            if wire in self.readers
        }
        self.picture = RunSnapshot(said["time"], messages, 0, 0)
        self.sheet.see(self.picture)
        odometry = newest_odometry(self.picture)
        if odometry is not None:
            self.trail.see((odometry.x, odometry.y))

    def take_log(self, said: Fields) -> None:
        """Take the answer of `log`."""
        self.log = [LogLine(**line) for line in said["lines"]]

    @property
    def fields(self) -> list[str]:
        """Every number that can be plotted, `block.port.field`."""
        return sorted(self.numbers)

    def _note(self, wire: str, values: Fields) -> None:
        time = values["time"] / 1e9
        for name, value in _numbers(values):
            kept = self.numbers.get(f"{wire}.{name}")
            if kept is None:
                kept = self.numbers[f"{wire}.{name}"] = deque(maxlen=HISTORY_MAX_VALUES)
            if not kept or kept[-1][0] < time:
                kept.append((time, value))


def _numbers(values: Fields) -> Iterator[tuple[str, float]]:
    for name, value in values.items():
        if name != "time" and isinstance(value, int | float):  # a flag counts as 0 or 1
            yield name, float(value)
