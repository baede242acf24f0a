"""What a map draws of a run that does not change: walls, the robot's outline, its sensors."""

from __future__ import annotations

from typing import Any

from diffbotctl.blocks.range_sensor import REACH, RangeSensor
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.robot import Robot
from diffbotctl.graph import Graph

VIRTUAL = {"sim": "SIMULATED", "emulated": "SIMULATED robot, EMULATED board"}


def scene(configuration: Configuration, graph: Graph | None, port: str) -> dict[str, Any]:
    """Plain values in metres and radians; world in odom, outline and sensors in base_link.

    The world is known of a simulated robot only. `robot` is None for a pipeline without one;
    without `graph` no sensor is placed.
    """
    world = configuration.world
    is_known = port in VIRTUAL
    robot = configuration.robot
    return {
        "title": configuration.name,
        "simulated": VIRTUAL.get(port, "") if robot is not None else "",
        "walls": [[*wall.start, *wall.end] for wall in world.walls if is_known],
        "rounds": [[*thing.at, thing.radius] for thing in world.obstacles if is_known],
        "robot": None if robot is None else _outline(robot),
        "sensors": [] if robot is None or graph is None else _sensors(robot, graph),
    }


def _outline(robot: Robot) -> dict[str, float]:
    body, drive, limits = robot.body, robot.drive, robot.limits
    return {
        "front": body.front,
        "back": body.back,
        "width": body.width,
        "track": drive.track,
        "left_diameter": drive.left.wheel.diameter,
        "right_diameter": drive.right.wheel.diameter,
        "speed": limits.speed,
        "turn_rate": limits.turn_rate,
    }


def _sensors(robot: Robot, graph: Graph) -> list[dict[str, Any]]:
    """Each sensor whose distances a block hands out, and the wire that has them."""
    found = []
    for node in graph.nodes:
        if isinstance(node.block, RangeSensor):
            at = robot.sensors[node.block.sensor].at
            place = {"x": at.x, "y": at.y, "heading": at.heading}
            found.append({"topic": f"{node.name}.range", **place, "reach": REACH})
    return found
