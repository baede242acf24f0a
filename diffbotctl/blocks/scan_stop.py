"""Scan stop: limits the velocity by a laser scan, so that the outline touches nothing."""

from __future__ import annotations

from collections.abc import Mapping
from sys import float_info

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.control.velocity_limits import is_turn
from diffbotctl.geometry.footprint import (
    Footprint,
    MountedDevice,
    Point,
    PointTracker,
    arc_motion,
    into_frame,
    out_of_frame,
    scan_points,
    scanner_near,
    sensor_mount,
)
from diffbotctl.messages import Odometry, Scan, Stop, StopCode, Twist
from diffbotctl.params import Param
from diffbotctl.time import SECOND

OBSTACLE: StopCode = "obstacle"
STALE: StopCode = "scan_stale"
BLIND: StopCode = "scan_blind"
# fractions of the desired velocity, in the order in which they are tried
SPEED_RATIOS = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1)
SWEEP_STEP = 0.01  # m that a corner moves between two checks along the path
APPROACH_MIN = 1e-6  # m; smaller differences are rounding errors
STILL_SPEED_MAX = 1e-3  # m/s or rad/s; slower counts as standstill
BLIND_TIME = SECOND  # without one return, after which the scanner counts as blind
# m/s of any point of the outline, where nothing is in reach of the scanner. A covered scanner looks
# the same, and a person can step aside from a robot that is so slow.
OPEN_SPACE_SPEED_MAX = 0.1
# m outside of the outline up to which a part of the robot may be measured: the accuracy of the
# LDS-01 is 15 mm (data sheet)
OWN_ECHO_MAX = 0.015


class ScanStop(Block):
    """Limit the velocity so that the robot can stop before its outline touches an obstacle.

    It predicts the motion along the desired curve for the time of reaction and braking, and checks
    whether any point of the scan comes closer to the outline than `margin`. If so, it tries slower
    velocities, then the turn alone, then standstill. A turn about one wheel becomes a turn on the
    spot where it has no room. Motion away from a point is always allowed.
    Between two scans the points move with the odometry: obstacles are assumed to be static.
    A scan without one return does not show that the way is free: it may come from a scanner that is
    covered or defective. The robot does not start before the first return, and stops 1 s after the
    last one; until then the points of the last return count. Echoes from within the outline are no
    returns, nor is a scan of which more than half is too close. `open_space` is for halls in which
    nothing is in reach of the scanner.

    blocks:
      guard: {block: scan_stop, in: {twist: limiter.twist, scan: robot.scan, odometry: o.odometry}}
    """

    margin = Param(
        float,
        unit="m",
        default=0.05,
        minimum=0.01,
        maximum=1.0,
        live=True,
        help="Distance kept free around the outline of the robot.",
    )
    stale_after = Param(
        float,
        unit="s",
        default=0.6,
        minimum=0.02,
        maximum=2.0,
        help="Maximum age of a scan; without a fresh one the robot stops.",
    )
    open_space = Param(
        bool,
        default=False,
        help="For large empty halls: without one return for 1 s it limits the speed of each point "
        "of the outline to 0.1 m/s, instead of stopping.",
    )
    sensor = Param(str, default="scan", help="Name of the scanner in the robot file.")
    sensors: Mapping[str, MountedDevice] = FromRobot("sensors")
    front = FromRobot("body.front")
    back = FromRobot("body.back")
    width = FromRobot("body.width")
    braking = FromRobot("limits.braking")
    speed = FromRobot("limits.speed")
    track = FromRobot("drive.track")
    telemetry = FromRobot("board.telemetry")
    command_delay = FromRobot("link.command_delay")
    lag = FromRobot("drive.left.motor.lag")

    twist = In(Twist, fresh_for=0.5, help="The desired velocity.")
    scan = In(Scan, trigger=False, fresh_for="stale_after", help="The laser scan.")
    odometry = In(Odometry, help="Motion between two scans.")
    safe = Out(Twist, name="twist", help="The safe velocity.")
    stop = Out(Stop, help="Stop and release events.")

    def reset(self) -> None:
        self.mount = sensor_mount(self.sensors, self.sensor)
        self.nearest = scanner_near(self.sensors, self.sensor)
        self.outline = Footprint(self.front, self.back, 0.5 * self.width)
        self.reaction = 1.0 / self.telemetry + self.command_delay + self.lag
        self.tracker = PointTracker()
        self.points: list[Point] = []  # in the frame of `tracker`
        self.seen_points: list[Point] = []  # those of the last scan with a return
        self.last_scan: Scan | None = None
        self.has_return = False  # in the last scan
        self.has_seen = False  # a return since the start
        self.blind_since = 0  # ns; time of the last scan with a return, or of the first one
        self.last_twist: Twist | None = None
        self.reported_code: StopCode = ""
        self.waiting_since: int | None = None  # for the first scan, since the first command to move

    def react(
        self, now: int, twist: Twist | None, scan: Scan | None, odometry: Odometry | None
    ) -> tuple[Twist | None, Stop | None]:
        if odometry is not None and odometry.time != self.tracker.time:
            self.tracker.update(odometry.time, odometry.linear, odometry.angular)
        if scan is not None and scan is not self.last_scan:
            self._locate_points(scan)
        if twist is None or twist is self.last_twist:
            return None, None
        self.last_twist = twist
        if abs(twist.linear) < STILL_SPEED_MAX and abs(twist.angular) < STILL_SPEED_MAX:
            return twist._replace(time=now), self._stop_event(now, "")
        if scan is None:
            return Twist(now, 0.0, 0.0), self._stale_event(now)
        if not self.has_return:
            is_blind = now - self.blind_since >= BLIND_TIME
            if is_blind and self.open_space:
                twist = self._slowed(twist)
            elif is_blind:
                return Twist(now, 0.0, 0.0), self._stop_event(now, BLIND)
            elif not self.has_seen:
                return Twist(now, 0.0, 0.0), None
        safe, code = self._safe_velocity(now, twist)
        return safe, self._stop_event(now, code)

    def _safe_velocity(self, now: int, twist: Twist) -> tuple[Twist, StopCode]:
        """The fastest safe velocity on the desired curve, else of the turn alone; and the stop
        code."""
        points = into_frame(self.points, *self.tracker.pose_at(now))
        is_turning = is_turn(twist.linear, twist.angular, self.track)
        ratios = SPEED_RATIOS[:1] if is_turning else SPEED_RATIOS
        for linear, tried in ((twist.linear, ratios), (0.0, SPEED_RATIOS)):
            if linear or twist.angular:
                for ratio in tried:
                    safe = Twist(now, linear * ratio, twist.angular * ratio)
                    if self.is_free(points, safe.linear, safe.angular):
                        is_asked = is_turning or linear == twist.linear
                        return safe, "" if is_asked else OBSTACLE
        return Twist(now, 0.0, 0.0), OBSTACLE

    def is_free(self, points: list[Point], linear: float, angular: float) -> bool:
        """True when the outline keeps its margin on this curve until the robot can have stopped.

        `points` in base_link, at present. Those already within the margin must not come closer.
        """
        outline, margin = self.outline, self.margin
        seconds = self.stopping_time(linear, angular)
        # No point of the outline moves farther than its farthest corner can.
        distance = (abs(linear) + abs(angular) * outline.reach) * seconds
        points = outline.near(points, margin + distance)
        if not points:
            return True
        clearances = [outline.clearance(*point) for point in points]
        steps = int(distance / SWEEP_STEP) + 1
        for step in range(1, steps + 1):
            pose = arc_motion(linear, angular, seconds * step / steps)
            for (x, y), before in zip(into_frame(points, *pose), clearances, strict=True):
                clearance = outline.clearance(x, y)
                if clearance < margin and clearance < before - APPROACH_MIN:
                    return False
        return True

    def stopping_time(self, linear: float, angular: float) -> float:
        """Seconds at constant velocity that cover the distance of reaction and braking.

        Braking by b from v takes the distance v^2 / 2b, which is v / 2b at constant speed; a turn
        rate is braked by 2b / track.
        """
        turning = 0.25 * abs(angular) * self.track / self.braking
        return float(self.reaction + max(0.5 * abs(linear) / self.braking, turning))

    def _slowed(self, twist: Twist) -> Twist:
        """`twist` on the same curve, so slow that it is safe where nothing is in reach."""
        fastest = abs(twist.linear) + abs(twist.angular) * self.outline.reach
        ratio = min(1.0, OPEN_SPACE_SPEED_MAX / fastest)
        return twist._replace(linear=twist.linear * ratio, angular=twist.angular * ratio)

    def _locate_points(self, scan: Scan) -> None:
        """Store the points of a scan in the frame of `tracker`.

        Those of the last return are kept until the scanner counts as blind.
        """
        self.has_return = self._detects(scan)
        self.has_seen = self.has_seen or self.has_return
        if self.has_return or self.last_scan is None:
            self.blind_since = scan.time
        self.last_scan = scan
        x, y, _ = self.mount
        reach = self.outline.reach + self.margin + self.speed * self.stale_after
        reach += self.speed * self.stopping_time(self.speed, 0.0) + max(abs(x), abs(y))
        located = [
            out_of_frame([point], *self.tracker.pose_at(time))[0]
            for time, point in points_around(scan, self.mount, self.outline, self.nearest, reach)
        ]
        if self.has_return:
            self.seen_points = located
        elif scan.time - self.blind_since >= BLIND_TIME:
            self.seen_points = []
        self.points = located if self.has_return else self.seen_points + located

    def _detects(self, scan: Scan) -> bool:
        """Whether a ray meets anything outside of the outline, be it too close to be measured.

        Where more than half are too close the scanner is covered, and the rest shows no free way.
        """
        if 2 * sum(far <= 0.0 for far in scan.distances) > len(scan.distances):
            return False
        points = scan_points(scan.start, scan.step, scan.distances, self.nearest, float_info.max)
        return any(
            self.outline.clearance(*out_of_frame([point], *self.mount)[0]) > OWN_ECHO_MAX
            for _, point in points
        )

    def _stale_event(self, now: int) -> Stop | None:
        """A Stop when there is no fresh scan; the first one may take up to `stale_after`."""
        if self.last_scan is None:
            self.waiting_since = now if self.waiting_since is None else self.waiting_since
            if now - self.waiting_since < self.stale_after * 1e9:
                return None
        return self._stop_event(now, STALE)

    def _stop_event(self, now: int, code: StopCode) -> Stop | None:
        """A Stop when the code changes, else None."""
        if code == self.reported_code:
            return None
        self.reported_code = code
        return Stop(now, code, CAUSES[code], False)


CAUSES: dict[StopCode, str] = {
    "": "",
    OBSTACLE: "something that the scanner sees is in the way",
    STALE: "no fresh scan comes from the sensor",
    BLIND: "the scanner measures nothing: it is covered or defective, or the hall is empty "
    "(open_space)",
}


def points_around(
    scan: Scan,
    mount: tuple[float, float, float],
    outline: Footprint,
    nearest: float,
    reach: float,
) -> list[tuple[int, Point]]:
    """The points of a scan within `reach` (m) of the scanner, each in base_link at its own time.

    The time is in ns. An object closer than `nearest` (m) cannot be measured. What is within the
    outline is a part of the robot, such as a mast.
    """
    points = scan_points(scan.start, scan.step, scan.distances, nearest, reach)
    located = out_of_frame([point for _, point in points], *mount)
    turn = SECOND * scan.duration
    rays = len(scan.distances)
    return [
        (scan.time - round(turn * (rays - ray) / rays), point)
        for (ray, _), point in zip(points, located, strict=True)
        if outline.clearance(*point) > 0.0
    ]
