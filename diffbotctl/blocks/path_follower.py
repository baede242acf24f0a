"""Path follower: drive along a path without stopping at its points."""

from __future__ import annotations

from math import copysign, cos, hypot, sin

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.messages import Odometry, Path, Twist
from diffbotctl.params import Param

STEP = 0.005  # m, by which the target moves along the path
SIDE_RATIO = 2.0  # a target farther to the side than this multiple of ahead: turn on the spot
SLOWING_TIME = 0.5  # s; near the end the speed is the remaining distance divided by it
SPEED_MIN = 0.03  # m/s; at a lower one friction may hold a wheel

Point = tuple[float, float]


class PathFollower(Block):
    """Follow a path from its first point to its last one, and stand there until another comes.

    It steers in an arc to the point of the path that is `lookahead` away (pure pursuit, R. C.
    Coulter, 1992), so that it cuts corners by about that. For a stop at each point, leave this
    block out: the points of a path to which no block is wired become goals.

    blocks:
      pursuit: {block: path_follower, in: {path: square.path, odometry: odometry.odometry}}
    """

    speed = Param(
        float, unit="m/s", default=0.15, above=0.0, live=True, help="Speed along the path."
    )
    lookahead = Param(
        float,
        unit="m",
        default=0.15,
        minimum=0.02,
        live=True,
        help="Distance of the point that it steers to.",
    )
    tolerance = Param(
        float,
        unit="m",
        default=0.02,
        minimum=STEP,
        help="Distance from the end to stand at.",
    )
    speed_max: float = FromRobot("limits.speed")
    turn_rate: float = FromRobot("limits.turn_rate")

    path = In(Path, trigger=False, help="The points in odom, in order.")
    odometry = In(Odometry)
    twist = Out(Twist)

    def reset(self) -> None:
        self.path_followed: Path | None = None
        self.points: list[Point] = []  # what is left; the first one is the target
        self.has_ended = True

    def react(self, now: int, path: Path | None, odometry: Odometry | None) -> Twist | None:
        if path is None or odometry is None:
            return None
        if path is not self.path_followed:
            self.path_followed, self.has_ended = path, not path.goals
            self.points = [(odometry.x, odometry.y), *((goal.x, goal.y) for goal in path.goals)]
        if self.has_ended:
            return Twist(now, 0.0, 0.0)
        here = odometry.x, odometry.y
        self.points = ahead_of(here, self.points, self.lookahead)
        ahead, left = in_body_frame(self.points[0], odometry)
        remaining = hypot(ahead, left)
        is_last = len(self.points) == 1
        if is_last and (remaining < self.tolerance or ahead <= 0.0):
            self.has_ended = True
            self.log.info("the end of the path is reached")
            return Twist(now, 0.0, 0.0)
        speed = min(self.speed, self.speed_max)
        if is_last:
            speed = min(speed, max(SPEED_MIN, remaining / SLOWING_TIME))
        return Twist(now, *arc_to(ahead, left, speed, self.turn_rate))


def ahead_of(here: Point, points: list[Point], distance: float) -> list[Point]:
    """`points` from the first place along them on that is `distance` (m) away from `here`."""
    points = points.copy()
    while len(points) > 1:
        (x, y), (next_x, next_y) = points[:2]
        if hypot(x - here[0], y - here[1]) >= distance:
            break
        length = hypot(next_x - x, next_y - y)
        if length <= STEP:
            del points[0]
        else:
            ratio = STEP / length
            points[0] = x + ratio * (next_x - x), y + ratio * (next_y - y)
    return points


def in_body_frame(point: Point, pose: Odometry) -> Point:
    """A point in odom as metres ahead of the robot and to its left."""
    x, y = point[0] - pose.x, point[1] - pose.y
    cosine, sine = cos(pose.heading), sin(pose.heading)
    return cosine * x + sine * y, cosine * y - sine * x


def arc_to(ahead: float, left: float, speed: float, turn_rate: float) -> tuple[float, float]:
    """The velocity (m/s, rad/s) of the arc that touches the heading and leads to a point.

    A point far to the side or behind is first turned to on the spot.
    """
    if ahead <= 0.0 or abs(left) > SIDE_RATIO * ahead:
        return 0.0, copysign(0.5 * turn_rate, left)
    curvature = 2.0 * left / (ahead * ahead + left * left)
    speed = min(speed, turn_rate / max(abs(curvature), 1e-9))
    return speed, speed * curvature
