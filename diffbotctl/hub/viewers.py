"""What a recording carries for viewers beside the run's own topics.

Made by the recorder's process from the messages that pass through it; no part of the run, so that
neither a replay nor a digest ever sees them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from diffbotctl.config import resources
from diffbotctl.links import foxglove
from diffbotctl.links.foxglove import Mount
from diffbotctl.messages import LogLine, Odometry, Range

TRANSFORMS = "tf"  # topic, as ROS tools call it
MOUNTS_AGAIN = 5_000_000_000  # ns; viewers that begin in the middle learn where sensors sit

Made = tuple[str, bytes]  # topic and message
Maker = Callable[[int, Any], Iterator[Made]]


def schema(name: str) -> bytes:
    """The published JSON Schema of foxglove.`name`."""
    path: Path = resources.folder("schemas") / "foxglove" / f"{name}.json"
    return path.read_bytes()


class Viewers:
    """Makes viewers' messages from a run's. `mounts` maps a range's wire to its sensor's place."""

    def __init__(self, epoch: int, wires: dict[str, type], mounts: dict[str, Mount]) -> None:
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
            placed = foxglove.transform(self.epoch + time, "base_link", mount)
            if placed is not None:
                yield TRANSFORMS, placed

    def _pose(self, wire: str, moves: bool, message: Odometry) -> Iterator[Made]:
        moved = foxglove.odometry_transform(self.epoch, message) if moves else None
        posed = foxglove.pose_in_frame(self.epoch, message)
        if moved is not None:
            yield TRANSFORMS, moved
        if posed is not None:
            yield f"{wire}.pose", posed

    def _scan(self, wire: str, message: Range) -> Iterator[Made]:
        frame = self.mounts[wire].frame
        yield f"{wire}.scan", foxglove.laser_scan(self.epoch, message, frame)

    def _line(self, wire: str, line: LogLine) -> Iterator[Made]:
        time = self.epoch + line.time
        yield f"{wire}.lines", foxglove.log(time, line.level, line.source, line.text)
