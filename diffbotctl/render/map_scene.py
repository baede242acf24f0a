"""The static parts of a map: walls, the outline of the robot, its sensors.

The control socket sends them in its reply to the request `scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import cos, sin
from typing import Any, NamedTuple

from diffbotctl.block import outputs
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.robot import Robot, SensorSection
from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS
from diffbotctl.geometry.distance_sensors import sensor_facts
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.graph import Graph
from diffbotctl.messages import Odometry
from diffbotctl.model.frames import sensor_frame

Numbers = list[list[float]]
COMMAND_TOPICS = ("operator.goal", "operator.twist")


def describe_scene(configuration: Configuration, graph: Graph | None, port: str) -> dict[str, Any]:
    """The scene as JSON values, in metres and radians.

    Outline and sensors are in base_link. The world is in the frame of the displayed pose: odom if a
    block estimates the pose, else the frame of the world. The world is empty for a real robot.
    `robot` is None for a pipeline without one; without `graph` there are no sensors. `commands` are
    the topics of the operator that blocks follow: what a screen can offer.
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
        "sensors": [] if robot is None or graph is None else _sensors(robot, configuration),
        "commands": _commands(configuration),
        "coast_time": 0.0 if robot is None else _coast_time(robot),
    }


def _coast_time(robot: Robot) -> float:
    """Time (s) by which a robot that is to stop goes on at its speed: the delay of the link, and
    the lag of its motors, which it follows as a first-order system."""
    return robot.link.command_delay + max(robot.drive.left.motor.lag, robot.drive.right.motor.lag)


def _commands(configuration: Configuration) -> list[str]:
    followed = {wire for use in configuration.blocks for wire in use.wires.values()}
    return sorted(followed & set(COMMAND_TOPICS))


def _world(configuration: Configuration) -> tuple[Numbers, Numbers, Numbers]:
    """Walls, round obstacles, and the corners of the field (empty if there is none)."""
    world, place = configuration.world, _place(configuration)
    right, top = world.field or (0.0, 0.0)
    corners = [place(x, y) for x, y in ((0.0, 0.0), (right, 0.0), (right, top), (0.0, top))]
    walls = [[*place(*wall.start), *place(*wall.end)] for wall in world.walls]
    rounds = [[*place(*obstacle.at), obstacle.radius] for obstacle in world.obstacles]
    if world.field is None:
        return walls, rounds, []
    walls += [[*start, *end] for start, end in pairwise([*corners, corners[0]])]
    return walls, rounds, [[*corner] for corner in corners]


def _place(configuration: Configuration) -> Callable[[float, float], tuple[float, float]]:
    """A function from the frame of the world to that of the displayed pose."""
    has_odometry = any(
        out.kind is Odometry for use in configuration.blocks for out in outputs(use.cls).values()
    )
    if not has_odometry or configuration.nominal is None:
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


def _sensors(robot: Robot, configuration: Configuration) -> list[dict[str, Any]]:
    """The sensors whose distances are on a wire, with the name of the wire."""
    sensors = []
    for wire, name in configuration.sensor_wires().items():
        sensor = robot.sensors[name]
        scanner = LIDARS.get(sensor.type)
        facts = scanner or sensor_facts(sensor.type, sensor.near, sensor.reach)
        sensors.append({"topic": wire, **_mount_of(name, sensor, facts.reach)})
    return sensors


def _mount_of(name: str, sensor: SensorSection, reach: float) -> dict[str, Any]:
    at, frame = sensor.at, sensor_frame(name)
    return {"x": at.x, "y": at.y, "heading": at.heading, "reach": reach, "frame": frame}


class SceneOutline(NamedTuple):
    """Outline of the robot in m from the middle of the axle, with its wheels and limits."""

    front: float
    back: float
    width: float
    track: float
    left_diameter: float
    right_diameter: float
    speed: float  # m/s
    turn_rate: float  # rad/s


class SceneBeam(NamedTuple):
    """A distance sensor: its frame, its pose in base_link (m, rad), and its topic."""

    topic: str
    x: float
    y: float
    heading: float
    reach: float
    frame: str = ""


class Scene(NamedTuple):
    """Walls are (x1, y1, x2, y2), round obstacles (x, y, radius), in m in the frame of the pose.

    `field`: the corners of a field that is always displayed as a whole; empty if there is none.
    `commands`: those of COMMAND_TOPICS that blocks follow.
    """

    title: str
    simulated: str
    walls: tuple[tuple[float, ...], ...] = ()
    rounds: tuple[tuple[float, ...], ...] = ()
    robot: SceneOutline | None = None
    beams: tuple[SceneBeam, ...] = ()
    field: tuple[tuple[float, float], ...] = ()
    commands: tuple[str, ...] = COMMAND_TOPICS


def parse_scene(reply: dict[str, Any]) -> Scene:
    """The scene from the reply to the request `scene`."""
    robot = reply["robot"]
    return Scene(
        reply["title"],
        reply["simulated"],
        tuple(tuple(wall) for wall in reply["walls"]),
        tuple(tuple(obstacle) for obstacle in reply["rounds"]),
        None if robot is None else SceneOutline(**robot),
        tuple(SceneBeam(**beam) for beam in reply["sensors"]),
        tuple((x, y) for x, y in reply.get("field", ())),
        tuple(reply.get("commands", COMMAND_TOPICS)),  # an older engine does not say
    )
