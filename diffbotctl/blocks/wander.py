"""Wander: drive straight on, and turn away from obstacles."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, sqrt

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.blocks.scan_stop import points_around
from diffbotctl.geometry.footprint import (
    Footprint,
    MountedDevice,
    Point,
    scanner_near,
    sensor_mount,
)
from diffbotctl.messages import Odometry, Scan, Twist
from diffbotctl.params import Param

SIDE_REACH = 1.5  # m; farther points do not count when choosing a side
FULL_TURN = 2 * pi  # rad; after it a smaller free distance is accepted
TURN_TIMEOUT = 1_500_000_000  # ns without turning
TURN_RATE_MIN = 0.05  # rad/s; slower does not count as turning


class Wander(Block):
    """Drive straight on; where the lane ahead is blocked, turn to the freer side until one is free.

    The lane is as wide as the turning circle, so that the robot can always turn away again. It does
    not prevent collisions: connect `scan_stop` behind it.

    blocks:
      wander: {block: wander, in: {scan: robot.scan, odometry: odometry.odometry}}
    """

    share = Param(
        float,
        unit="1",
        default=0.8,
        above=0.0,
        maximum=1.0,
        live=True,
        help="Speed, as a fraction of the maximum speed of the robot.",
    )
    turn_rate = Param(
        float, unit="rad/s", default=1.0, above=0.0, live=True, help="Turn rate when turning away."
    )
    turn_at = Param(
        float,
        unit="m",
        default=0.25,
        above=0.0,
        live=True,
        help="Free distance ahead of the turning circle at which it turns away.",
    )
    go_at = Param(
        float,
        unit="m",
        default=0.60,
        above=0.0,
        live=True,
        help="Free distance at which it drives on.",
    )
    room = Param(
        float,
        unit="m",
        default=0.08,
        minimum=0.0,
        live=True,
        help="Margin on either side of the turning circle.",
    )
    sensor = Param(str, default="scan", help="Name of the scanner in the robot file.")
    sensors: Mapping[str, MountedDevice] = FromRobot("sensors")
    front = FromRobot("body.front")
    back = FromRobot("body.back")
    width = FromRobot("body.width")
    speed = FromRobot("limits.speed")

    scan = In(Scan, fresh_for=0.6, help="The laser scan.")
    odometry = In(Odometry, help="Triggers the output; shows whether the robot turns.")
    twist = Out(Twist, help="The desired velocity.")

    def reset(self) -> None:
        self.mount = sensor_mount(self.sensors, self.sensor)
        self.nearest = scanner_near(self.sensors, self.sensor)
        self.outline = Footprint(self.front, self.back, 0.5 * self.width)
        self.radius = self.outline.reach
        self.last_scan: Scan | None = None
        self.side = 0  # 1 while it turns left, -1 right
        self.turned_angle = 0.0  # rad since it began to turn
        self.turning_since = 0
        self.last_time: int | None = None

    def react(self, now: int, scan: Scan | None, odometry: Odometry | None) -> Twist | None:
        if scan is None or odometry is None:
            return None
        if scan is not self.last_scan:
            self.last_scan = scan
            self._choose(now, scan)
        if odometry.time == self.last_time:
            return None
        seconds = 0.0 if self.last_time is None else (odometry.time - self.last_time) * 1e-9
        self.last_time = odometry.time
        if not self.side:
            return Twist(now, self.speed * self.share, 0.0)
        self._watch_turn(now, odometry, seconds)
        return Twist(now, 0.0, self.side * self.turn_rate)

    def _choose(self, now: int, scan: Scan) -> None:
        """Decide whether to drive on or to turn, and to which side."""
        reach = self.go_at + SIDE_REACH
        around = points_around(scan, self.mount, self.outline, self.nearest, reach)
        points = [point for _, point in around]
        free = free_distance(points, self.radius, self.radius + self.room)
        if self.side:
            if free > (self.go_at if self.turned_angle < FULL_TURN else self.turn_at):
                self.side = 0
        elif free <= self.turn_at:
            self.side = freer_side(points)
            self.turned_angle, self.turning_since = 0.0, now

    def _watch_turn(self, now: int, odometry: Odometry, seconds: float) -> None:
        """Reverse the turn when the robot does not turn, because a guard prevents it."""
        self.turned_angle += abs(odometry.angular) * seconds
        if abs(odometry.angular) > TURN_RATE_MIN:
            self.turning_since = now
        elif now - self.turning_since > TURN_TIMEOUT:
            self.side, self.turning_since = -self.side, now


def free_distance(points: list[Point], radius: float, half: float) -> float:
    """Metres that a circle of `radius` around the axle can move ahead, in a lane of width 2 `half`.

    `points` in base_link; infinity if no point lies in the lane.
    """
    return min((x - radius for x, y in points if x > 0.0 and abs(y) < half), default=float("inf"))


def freer_side(points: list[Point]) -> int:
    """1 when there is more room ahead on the left, -1 on the right.

    Each point weighs by the inverse square of its distance and by the sine of its bearing.
    """
    weight = 0.0
    for x, y in points:
        square = x * x + y * y
        if x > 0.0 and 0.0 < square < SIDE_REACH * SIDE_REACH:
            weight += y / (square * sqrt(square))
    return -1 if weight > 0.0 else 1
