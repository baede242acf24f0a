"""The run that a hub stands before, as the engine tells it once."""

from __future__ import annotations

from typing import Any, NamedTuple

from diffbotctl.graph import Graph


class About(NamedTuple):
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
