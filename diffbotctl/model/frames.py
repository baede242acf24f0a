"""The frames of a robot (REP-105, REP-120), and the solids attached to them.

`odom` is the pose at the start of the run; `base_footprint` lies on the ground below the middle of
the axle; `base_link` is the middle of the axle, x forward, y left, z up. Solids are boxes,
cylinders and spheres of uniform density, in m, kg and kg m2.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

from diffbotctl.config.robot import Robot
from diffbotctl.geometry.distance_sensors import TYPES, sensor_facts
from diffbotctl.geometry.lidars import LIDARS

MAP, WORLD, GROUND, BASE = "map", "odom", "base_footprint", "base_link"
ON_ROBOT = (*TYPES, *LIDARS)  # types of sensors that are mounted on the robot
CASTER_SHARE = 0.8  # of the longer overhang: default position of the caster


class RobotFrame(NamedTuple):
    """Pose of a frame in its parent: m, and rad about the parent's z axis.

    `moves`: what changes the pose: `odometry`, `wheel` (rotation about its own y axis) or nothing.
    """

    name: str
    parent: str
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    heading: float = 0.0
    moves: Literal["", "odometry", "wheel"] = ""


def axle_height(robot: Robot) -> float:
    """Height of the middle of the axle above the ground, m: the mean of both wheels' radii."""
    return 0.25 * (robot.drive.left.wheel.diameter + robot.drive.right.wheel.diameter)


def caster_x(robot: Robot) -> float:
    """Position of the caster, m forward of the axle."""
    body = robot.body
    if body.caster.x is not None:
        return body.caster.x
    return CASTER_SHARE * (-body.back if body.back >= body.front else body.front)


def sensor_frame(name: str) -> str:
    """The frame of the sensor `name`."""
    return f"{name}_sensor_link"


def robot_frames(robot: Robot) -> Iterator[RobotFrame]:
    """All frames of `robot`, parents first."""
    height = axle_height(robot)
    yield RobotFrame(GROUND, WORLD, moves="odometry")
    yield RobotFrame(BASE, GROUND, z=height)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        radius = 0.5 * getattr(robot.drive, side).wheel.diameter
        y = sign * 0.5 * robot.drive.track
        # Wheels of different size both touch the ground, so their hubs differ in height.
        yield RobotFrame(f"{side}_wheel_link", BASE, y=y, z=radius - height, moves="wheel")
    caster = 0.5 * robot.body.caster.diameter
    yield RobotFrame("caster_link", BASE, caster_x(robot), z=caster - height)
    for name, sensor in robot.sensors.items():
        if sensor.type in ON_ROBOT:
            at = sensor.at
            yield RobotFrame(sensor_frame(name), BASE, at.x, at.y, at.z, at.heading)


Moments = tuple[float, float, float]  # about x, y and z
SENSOR_FACTS = {kind: sensor_facts(kind) for kind in TYPES} | LIDARS


class Box(NamedTuple):
    """A box, `size` along x, y, z."""

    size: tuple[float, float, float]

    def moments(self, mass: float) -> Moments:
        """Moments of inertia about its centre."""
        x, y, z = (length * length for length in self.size)
        twelfth = mass / 12.0
        return twelfth * (y + z), twelfth * (x + z), twelfth * (x + y)


class Cylinder(NamedTuple):
    """A cylinder with its axis along y, like a wheel."""

    radius: float
    length: float

    def moments(self, mass: float) -> Moments:
        """Moments of inertia about its centre."""
        square = self.radius * self.radius
        across = mass / 12.0 * (3.0 * square + self.length * self.length)
        return across, 0.5 * mass * square, across


class Sphere(NamedTuple):
    """A sphere."""

    radius: float

    def moments(self, mass: float) -> Moments:
        """Moments of inertia about its centre."""
        moment = 0.4 * mass * self.radius * self.radius
        return moment, moment, moment


class Solid(NamedTuple):
    """A shape in the frame `frame`, with its centre at `at` (m)."""

    frame: str
    shape: Box | Cylinder | Sphere
    mass: float
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: str = "grey"


def robot_solids(robot: Robot) -> Iterator[Solid]:
    """All solids of `robot`: the chassis, both wheels, the caster, the sensors."""
    body = robot.body
    length = body.front + body.back
    above = body.clearance + 0.5 * body.height - axle_height(robot)
    middle = (0.5 * (body.front - body.back), 0.0, above)
    yield Solid(BASE, Box((length, body.width, body.height)), body.mass, middle, "blue")
    for side in ("left", "right"):
        wheel = getattr(robot.drive, side).wheel
        shape = Cylinder(0.5 * wheel.diameter, wheel.width)
        yield Solid(f"{side}_wheel_link", shape, wheel.mass, colour="black")
    yield Solid("caster_link", Sphere(0.5 * body.caster.diameter), body.caster.mass)
    for name, sensor in robot.sensors.items():
        if sensor.type in ON_ROBOT:
            facts = SENSOR_FACTS[sensor.type]
            yield Solid(sensor_frame(name), Box(facts.size), facts.mass, colour="red")
