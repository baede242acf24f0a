"""The frames of a robot and how they hang together, by the names of REP-105 and REP-120.

`odom` is where the run began; `base_footprint` lies on the ground under the middle of the axle;
`base_link` is that middle itself, x forward, y left, z up. What sits on the robot hangs on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from diffbotctl.config.robot import Robot

WORLD, GROUND, BASE = "odom", "base_footprint", "base_link"
ON_ROBOT = ("sharp_gp2y0a41sk0f", "lds01")  # sensors of these kinds ride on the robot
CASTER_SHARE = 0.8  # of the longer overhang: where a caster stands whose place is not given


class RobotFrame(NamedTuple):
    """A frame in its parent: m, and rad about the parent's z axis.

    `moves` says what changes it: `odometry`, `wheel` (it turns about its own y axis) or nothing.
    """

    name: str
    parent: str
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    heading: float = 0.0
    moves: str = ""


def axle_height(robot: Robot) -> float:
    """How high the middle of the axle is above the ground: the mean of both wheels' radii, m."""
    return 0.25 * (robot.drive.left.wheel.diameter + robot.drive.right.wheel.diameter)


def caster_x(robot: Robot) -> float:
    """Where the caster touches the ground, m forward of the axle."""
    body = robot.body
    if body.caster.x is not None:
        return body.caster.x
    return CASTER_SHARE * (-body.back if body.back >= body.front else body.front)


def frames(robot: Robot) -> Iterator[RobotFrame]:
    """Every frame of `robot`, parents first."""
    height = axle_height(robot)
    yield RobotFrame(GROUND, WORLD, moves="odometry")
    yield RobotFrame(BASE, GROUND, z=height)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        radius = 0.5 * getattr(robot.drive, side).wheel.diameter
        aside = sign * 0.5 * robot.drive.track
        # Wheels of unequal size both stand on the ground, so that their hubs differ in height.
        yield RobotFrame(f"{side}_wheel_link", BASE, y=aside, z=radius - height, moves="wheel")
    caster = 0.5 * robot.body.caster.diameter
    yield RobotFrame("caster_link", BASE, caster_x(robot), z=caster - height)
    for name, sensor in robot.sensors.items():
        if sensor.type in ON_ROBOT:
            at = sensor.at
            yield RobotFrame(f"{name}_sensor_link", BASE, at.x, at.y, at.z, at.heading)
