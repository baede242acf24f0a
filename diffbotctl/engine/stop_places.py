"""Stops that end and begin again at the same place are one stop.

A guard in front of an obstacle releases the robot and stops it again with every change of a reading
or of the command, and may do so several times a second. For a person that is one stop: it begins
with the first one, and it has ended when the robot has left the place.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot
from typing import Any, NamedTuple

from diffbotctl.control.pose_sd import PLACE_RADIUS
from diffbotctl.graph import Graph
from diffbotctl.messages import Odometry, Stop

REQUESTING_DRIVERS = ("operator.", "robot.")


def pose_wire(graph: Graph) -> str | None:
    """The wire of `graph` with the robot's pose; that of a block before that of a driver."""
    wires = [wire for wire, kind in graph.kinds.items() if kind is Odometry]
    return min(wires, key=lambda wire: wire in graph.sources, default=None)


def stops_in_force(messages: Mapping[str, Any]) -> list[tuple[str, Stop]]:
    """The stops in force among the newest `messages`, by wire; a latched one first.

    Those of blocks: what the board and the operator send asks the safety gate for a stop, which
    stays the newest message of its wire after `resume`.
    """
    stops = [
        (wire, message)
        for wire, message in messages.items()
        if isinstance(message, Stop) and message.code and not wire.startswith(REQUESTING_DRIVERS)
    ]
    return sorted(stops, key=lambda item: not item[1].latched)


class PlacedStop(NamedTuple):
    """A stop that ends by itself, and where the robot was when it began."""

    code: str
    x: float
    y: float
    has_ended: bool = False


class StopPlaces:
    """Joins the stops of each source. A latched stop is one by itself: a person has ended it.

    So is each stop of a robot without odometry.
    """

    def __init__(self) -> None:
        self.position: tuple[float, float] | None = None
        self.placed: dict[str, PlacedStop] = {}

    def state(self) -> tuple[Any, ...]:
        """The state between two instants, for a snapshot."""
        return self.position, {source: tuple(stop) for source, stop in self.placed.items()}

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restore a `state`."""
        self.position, placed = state
        self.placed = {source: PlacedStop(*stop) for source, stop in placed.items()}

    def begins(self, source: str, stop: Stop) -> bool:
        """Whether a stop of `source`, with a code, is another one than the last."""
        last = self.placed.pop(source, None)
        if stop.latched or self.position is None:
            return True
        is_new = last is None or last.code != stop.code or self._has_left(last)
        begun = PlacedStop(stop.code, *self.position) if last is None or is_new else last
        self.placed[source] = begun._replace(has_ended=False)
        return is_new

    def ends(self, source: str) -> bool:
        """Whether the last stop of `source`, which its source has ended, is over now.

        Else `move` returns it when the robot has left its place.
        """
        last = self.placed.get(source)
        if last is None or self._has_left(last):
            self.placed.pop(source, None)
            return True
        self.placed[source] = last._replace(has_ended=True)
        return False

    def move(self, odometry: Odometry) -> list[tuple[str, str]]:
        """Take the robot's pose. Returns source and code of the stops that are over now."""
        self.position = odometry.x, odometry.y
        over = [(source, stop) for source, stop in self.placed.items() if self._is_over(stop)]
        for source, _ in over:
            del self.placed[source]
        return [(source, stop.code) for source, stop in over]

    def _is_over(self, stop: PlacedStop) -> bool:
        return stop.has_ended and self._has_left(stop)

    def _has_left(self, stop: PlacedStop) -> bool:
        if self.position is None:
            return True
        return hypot(self.position[0] - stop.x, self.position[1] - stop.y) > PLACE_RADIUS
