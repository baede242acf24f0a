"""Drives towards a wall with each type of distance sensor, of the robot `book_2wd`."""

from __future__ import annotations

from typing import NamedTuple

FRONT, WALL = 0.08, 0.8  # m, of the sensor and the body; of the wall
MARGIN = 0.05  # m, that the stop leaves, and what braking may use of it
GAP_MIN = 0.02  # m, that is left of it
BEYOND = 1.2  # m; x of a goal behind the wall
DRIVE_TIME_S = 8  # until the robot has long stopped
STOP_SETS = (
    f"world.walls=[{{from: [{WALL} m, -1 m], to: [{WALL} m, 1 m]}}]",
    "robot.drive.polarity=checked_by_hand",
    "follower.patience=20 s",
)
ECHO = (
    "robot.sensors.front.type=hc_sr04",
    "robot.sensors.front.pin=none",
    "robot.sensors.front.trigger=24",
    "robot.sensors.front.echo=50",
    "robot.board.telemetry=30 Hz",
)


class StoppingSensor(NamedTuple):
    """A distance sensor: what selects it in the robot, and where it ceases to measure."""

    sets: tuple[str, ...]
    nearest: float
    """m; below it the sensor does not measure"""

    @property
    def gap_max(self) -> float:
        """The largest distance (m) from the wall at which the robot should stand.

        It stops before the margin is used up, or where the sensor ceases to measure, which is
        farther away: there it brakes from its present speed.
        """
        return self.nearest + MARGIN


STOPPING_SENSORS = {
    "GP2Y0A41": StoppingSensor((), 0.05),
    "GP2Y0A21": StoppingSensor(("robot.sensors.front.type=sharp_gp2y0a21yk0f",), 0.10),
    "GP2Y0A02": StoppingSensor(("robot.sensors.front.type=sharp_gp2y0a02yk0f",), 0.20),
    "HC-SR04": StoppingSensor(ECHO, 0.05),
}


def gap(x: float) -> float:
    """Distance (m) of the sensor from the wall when the robot is at `x`."""
    return WALL - FRONT - x
