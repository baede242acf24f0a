"""Wander: drive on, and turn away from what stands in the way."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, sqrt

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.blocks.scan_stop import points_on_robot
from diffbotctl.geometry.footprint import Footprint, MountedDevice, Point, sensor_mount
from diffbotctl.messages import Odometry, Scan, Twist
from diffbotctl.params import Param

SIDE_REACH = 1.5  # m; farther things do not say which side is freer
FULL_TURN = 2 * pi  # rad; who looked all round takes what there is
TURN_TIMEOUT = 1_500_000_000  # ns of a turn that does not come about
TURN_RATE_MIN = 0.05  # rad/s; slower is no turning


class Wander(Block):
    """Drive straight on; where the way ahead is not free, turn to the freer side until one is.

    A way is free when the robot's whole turning circle fits along it, so that wherever it comes to
    stand it can turn away again. It is no guard: put `scan_stop` behind it.

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
        help="Of the robot's highest speed that it drives with.",
    )
    turn_rate = Param(
        float, unit="rad/s", default=1.0, above=0.0, live=True, help="How fast it turns away."
    )
    turn_at = Param(
        float,
        unit="m",
        default=0.25,
        above=0.0,
        live=True,
        help="Free way before its turning circle at which it turns away.",
    )
    go_at = Param(
        float,
        unit="m",
        default=0.60,
        above=0.0,
        live=True,
        help="Free way that it wants before it drives on.",
    )
    room = Param(
        float,
        unit="m",
        default=0.08,
        minimum=0.0,
        live=True,
        help="Room at either side of its turning circle.",
    )
    sensor = Param(str, default="scan", help="Name of the scanner in the robot file.")
    sensors: Mapping[str, MountedDevice] = FromRobot("sensors")
    front = FromRobot("body.front")
    back = FromRobot("body.back")
    width = FromRobot("body.width")
    speed = FromRobot("limits.speed")

    scan = In(Scan, fresh_for=0.6, help="The distances all round.")
    odometry = In(Odometry, help="Paces its words, and tells whether it turns.")
    twist = Out(Twist, help="Where it wants to go.")

    def reset(self) -> None:
        self.mount = sensor_mount(self.sensors, self.sensor)
        self.radius = Footprint(self.front, self.back, 0.5 * self.width).reach
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
        """Decide whether to drive on or to turn, and where to."""
        points = points_on_robot(scan, self.mount, self.go_at + SIDE_REACH)
        free = free_distance(points, self.radius, self.radius + self.room)
        if self.side:
            if free > (self.go_at if self.turned_angle < FULL_TURN else self.turn_at):
                self.side = 0
        elif free <= self.turn_at:
            self.side = freer_side(points)
            self.turned_angle, self.turning_since = 0.0, now

    def _watch_turn(self, now: int, odometry: Odometry, seconds: float) -> None:
        """Turn the other way when the guard does not let it turn this way."""
        self.turned_angle += abs(odometry.angular) * seconds
        if abs(odometry.angular) > TURN_RATE_MIN:
            self.turning_since = now
        elif now - self.turning_since > TURN_TIMEOUT:
            self.side, self.turning_since = -self.side, now


def free_distance(points: list[Point], radius: float, half: float) -> float:
    """Metres that a circle of `radius` about the axle can go ahead within a lane of `half` width.

    `points` in base_link; infinity where nothing stands in the lane.
    """
    return min((x - radius for x, y in points if x > 0.0 and abs(y) < half), default=float("inf"))


def freer_side(points: list[Point]) -> int:
    """1 when more room is on the left ahead, -1 on the right, by what stands nearest there.

    Each point weighs by the inverse square of its distance, and by the sine of its bearing: what is
    near and aside decides.
    """
    weight = 0.0
    for x, y in points:
        square = x * x + y * y
        if x > 0.0 and 0.0 < square < SIDE_REACH * SIDE_REACH:
            weight += y / (square * sqrt(square))
    return -1 if weight > 0.0 else 1
