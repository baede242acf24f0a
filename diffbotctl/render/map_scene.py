"""What a map draws of a run that does not change: walls, the robot's outline, its sensors.

What a map draws that does not change during a run, as the control socket's `scene` tells it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import cos, sin
from typing import Any, NamedTuple

from diffbotctl.block import outputs
from diffbotctl.blocks.range_sensor import REACH, RangeSensor
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import VIRTUAL_PORTS
from diffbotctl.graph import Graph
from diffbotctl.messages import Odometry
from diffbotctl.model.laser_scanners import LASER_SCANNERS

Numbers = list[list[float]]


def describe_scene(configuration: Configuration, graph: Graph | None, port: str) -> dict[str, Any]:
    """Plain values in metres and radians; outline and sensors in base_link, the world in the frame
    of the pose that is shown: odom where a block reckons it, else the world's own.

    The world is known of a simulated robot only. `robot` is None for a pipeline without one;
    without `graph` no sensor is placed.
    """
    robot = configuration.robot
    walls, rounds, field = _world(configuration) if port in VIRTUAL_PORTS else ([], [], [])
    return {
        "title": configuration.name,
        "simulated": VIRTUAL_PORTS.get(port, "") if robot is not None else "",
        "walls": walls,
        "rounds": rounds,
        "field": field,
        "robot": None if robot is None else _outline(robot),
        "sensors": [] if robot is None or graph is None else _sensors(robot, graph),
    }


def _world(configuration: Configuration) -> tuple[Numbers, Numbers, Numbers]:
    """Walls, round obstacles, and the corners of the field, if there is one."""
    world, place = configuration.world, _place(configuration)
    right, top = world.field or (0.0, 0.0)
    corners = [place(x, y) for x, y in ((0.0, 0.0), (right, 0.0), (right, top), (0.0, top))]
    walls = [[*place(*wall.start), *place(*wall.end)] for wall in world.walls]
    rounds = [[*place(*thing.at), thing.radius] for thing in world.obstacles]
    if world.field is None:
        return walls, rounds, []
    walls += [[*start, *end] for start, end in pairwise([*corners, corners[0]])]
    return walls, rounds, [[*corner] for corner in corners]


def _place(configuration: Configuration) -> Callable[[float, float], tuple[float, float]]:
    """A function from the world's frame to that of the pose that is shown."""
    reckoned = any(
        out.kind is Odometry for use in configuration.blocks for out in outputs(use.cls).values()
    )
    if not reckoned or configuration.nominal is None:
        return lambda x, y: (x, y)
    start = configuration.nominal.simulation.start
    c, s = cos(start.heading), sin(start.heading)

    def place(x: float, y: float) -> tuple[float, float]:
        x, y = x - start.x, y - start.y
        return x * c + y * s, y * c - x * s

    return place


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
    for name, sensor in robot.sensors.items():
        if sensor.type in LASER_SCANNERS:
            place = {"x": sensor.at.x, "y": sensor.at.y, "heading": sensor.at.heading}
            found.append(
                {"topic": f"robot.{name}", **place, "reach": LASER_SCANNERS[sensor.type].reach}
            )
    return found


class SceneOutline(NamedTuple):
    """The robot from above, in metres from the middle of its axle; wheels and limits beside it."""

    front: float
    back: float
    width: float
    track: float
    left_diameter: float
    right_diameter: float
    speed: float  # m/s
    turn_rate: float  # rad/s


class SceneBeam(NamedTuple):
    """A distance sensor in base_link: metres and radians, and the topic that has its distances."""

    topic: str
    x: float
    y: float
    heading: float
    reach: float


class Scene(NamedTuple):
    """Walls are (x1, y1, x2, y2), round obstacles (x, y, radius), metres in the pose's frame.

    `field`: the corners of a field that is always shown whole; empty: what matters is shown.
    """

    title: str
    simulated: str
    walls: tuple[tuple[float, ...], ...] = ()
    rounds: tuple[tuple[float, ...], ...] = ()
    robot: SceneOutline | None = None
    beams: tuple[SceneBeam, ...] = ()
    field: tuple[tuple[float, float], ...] = ()


def parse_scene(said: dict[str, Any]) -> Scene:
    """The scene from the answer of the verb."""
    robot = said["robot"]
    return Scene(
        said["title"],
        said["simulated"],
        tuple(tuple(wall) for wall in said["walls"]),
        tuple(tuple(thing) for thing in said["rounds"]),
        None if robot is None else SceneOutline(**robot),
        tuple(SceneBeam(**beam) for beam in said["sensors"]),
        tuple((x, y) for x, y in said.get("field", ())),
    )
