"""Scan stop: a wanted velocity and a laser scan in, one that touches nothing out."""

from __future__ import annotations

from typing import Any

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.geometry.footprint import (
    Footprint,
    Point,
    PointTracker,
    moved,
    placed,
    points_of,
    seen_from,
)
from diffbotctl.messages import Odometry, Scan, Stop, StopCode, Twist
from diffbotctl.params import Param

OBSTACLE: StopCode = "obstacle"
STALE = "scan_stale"
SHARES = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1)  # of the wanted velocity that are tried, in this order
STRIDE = 0.01  # m that a corner moves between two looks along the way
CLOSER = 1e-6  # m; less is no coming closer but arithmetic
NEAREST = 0.12  # m; what the LDS-01 says is too close to measure is nearer than this (data sheet)
STILL = 1e-3  # m/s or rad/s; slower is standing


class ScanStop(Block):
    """Let the robot move only as fast as it can still stop before its outline touches what it sees.

    It follows the wanted curve in thought, for as long as it takes to react and to brake, and looks
    whether any point of the scan comes nearer to the outline than `margin`. Then it tries slower
    ones, then the turn alone, then none. What leads away from a thing is always allowed. Between
    two scans the points are moved as the odometry says, so that things must stand still.

    blocks:
      guard: {block: scan_stop, in: {twist: limiter.twist, scan: robot.scan, odometry: o.odometry}}
    """

    margin = Param(
        float,
        unit="m",
        default=0.05,
        minimum=0.0,
        live=True,
        help="Distance that is kept free around the robot's outline.",
    )
    stale_after = Param(
        float,
        unit="s",
        default=0.6,
        minimum=0.02,
        maximum=2.0,
        help="A scan older than this counts as none; then the robot stands.",
    )
    sensor = Param(str, default="scan", help="Name of the scanner in the robot file.")
    sensors = FromRobot("sensors")
    front = FromRobot("body.front")
    back = FromRobot("body.back")
    width = FromRobot("body.width")
    braking = FromRobot("limits.braking")
    speed = FromRobot("limits.speed")
    track = FromRobot("drive.track")
    telemetry = FromRobot("board.telemetry")
    command_delay = FromRobot("link.command_delay")
    lag = FromRobot("drive.left.motor.lag")

    twist = In(Twist, fresh_for=0.5, help="The wanted velocity.")
    scan = In(Scan, trigger=False, fresh_for="stale_after", help="The distances all round.")
    odometry = In(Odometry, help="How the robot moves between two scans.")
    safe = Out(Twist, name="twist", help="The velocity that is allowed.")
    stop = Out(Stop, help="What holds the robot, and that it is released.")

    def reset(self) -> None:
        mounted: Any = self.sensors.get(self.sensor)
        self.mount = (mounted.at.x, mounted.at.y, mounted.at.heading) if mounted else (0.0,) * 3
        self.outline = Footprint(self.front, self.back, 0.5 * self.width)
        self.reaction = 1.0 / self.telemetry + self.command_delay + self.lag
        self.way = PointTracker()
        self.points: list[Point] = []  # in the frame of `way`
        self.taken: Scan | None = None
        self.answered: Twist | None = None
        self.held = ""
        self.waiting_since: int | None = None  # for the first scan, while motion is wanted

    def react(
        self, now: int, twist: Twist | None, scan: Scan | None, odometry: Odometry | None
    ) -> tuple[Twist | None, Stop | None]:
        if odometry is not None and odometry.time != self.way.time:
            self.way.see(odometry.time, odometry.linear, odometry.angular)
        if scan is not None and scan is not self.taken:
            self._take(scan)
        if twist is None or twist is self.answered:
            return None, None
        self.answered = twist
        if abs(twist.linear) < STILL and abs(twist.angular) < STILL:
            return twist._replace(time=now), self._tell(now, "")
        if scan is None:
            return Twist(now, 0.0, 0.0), self._tell_stale(now)
        near = self._near(now)
        for linear, angular in ((twist.linear, twist.angular), (0.0, twist.angular)):
            for share in SHARES:
                if abs(linear) + abs(angular) and self.is_free(
                    near, linear * share, angular * share
                ):
                    held = OBSTACLE if linear != twist.linear else ""
                    return Twist(now, linear * share, angular * share), self._tell(now, held)
        return Twist(now, 0.0, 0.0), self._tell(now, OBSTACLE)

    def is_free(self, near: list[Point], linear: float, angular: float) -> bool:
        """Whether the outline keeps its margin on this curve until the robot could stand.

        `near`: points in base_link, now. Those already within the margin must not come nearer.
        """
        outline, margin = self.outline, self.margin
        seconds = self.stopping_time(linear, angular)
        # No point of the outline moves farther than its farthest corner can.
        way = (abs(linear) + abs(angular) * outline.reach) * seconds
        near = [point for point in near if outline.clearance(*point) < margin + way]
        if not near:
            return True
        before = [outline.clearance(*point) for point in near]
        steps = int(way / STRIDE) + 1
        for step in range(1, steps + 1):
            pose = moved(linear, angular, seconds * step / steps)
            for (x, y), first in zip(seen_from(near, *pose), before, strict=True):
                clear = outline.clearance(x, y)
                if clear < margin and clear < first - CLOSER:
                    return False
        return True

    def stopping_time(self, linear: float, angular: float) -> float:
        """Seconds at full speed that lead as far as reacting and then braking to standstill.

        Braking by b from v takes v^2 / 2b of way, as long as v / 2b at full speed; a turn rate w
        brakes by 2b / track at the wheels' b.
        """
        turning = 0.25 * abs(angular) * self.track / self.braking
        return float(self.reaction + max(0.5 * abs(linear) / self.braking, turning))

    def _take(self, scan: Scan) -> None:
        """Note a scan's points where they stand."""
        self.taken = scan
        x, y, heading = self.mount
        most = self.outline.reach + self.margin + self.speed * self.stale_after
        most += self.speed * self.stopping_time(self.speed, 0.0) + max(abs(x), abs(y))
        seen = points_of(scan.start, scan.step, scan.distances, NEAREST, most)
        on_robot = placed(seen, x, y, heading)
        self.points = placed(on_robot, *self.way.at(scan.time))

    def _near(self, now: int) -> list[Point]:
        """The points in base_link that anything could reach."""
        return seen_from(self.points, *self.way.at(now))

    def _tell_stale(self, now: int) -> Stop | None:
        """Say that there is no scan; at first a scanner has the time of a turn, and more."""
        if self.taken is None:
            self.waiting_since = now if self.waiting_since is None else self.waiting_since
            if now - self.waiting_since < self.stale_after * 1e9:
                return None
        return self._tell(now, STALE)

    def _tell(self, now: int, code: str) -> Stop | None:
        """A Stop when something begins to hold the robot, or has ceased to."""
        if code == self.held:
            return None
        self.held = code
        return Stop(now, code, CAUSES[code], False)


CAUSES = {
    "": "",
    OBSTACLE: "something that the scanner sees is in the way",
    STALE: "no fresh scan comes from the sensor",
}
