"""The pose of the robot in the map: the newest answer of the map, and the odometry since then."""

from __future__ import annotations

from math import cos, remainder, sin, sqrt, tau

from diffbotctl.geometry.deskew import PlanePose, compose
from diffbotctl.messages import MapPose, MapUpdate, Odometry, PoseCovariance


class MapLocalization:
    """Composes answers and odometry.

    The covariance of a pose p after an answer at the odometry a is F C F' + Q: C is that of the
    answer, F = d p / d a, and Q that of the motion between them. For dead reckoning, the odometry's
    own covariances at both poses give Q = P(p) - F P(a) F'.
    """

    def __init__(self) -> None:
        self.odom: PlanePose = (0.0, 0.0, 0.0)  # in the map
        self.update: MapUpdate | None = None
        self.at: Odometry | None = None  # the odometry of the scan that the answer is for

    def take(self, update: MapUpdate, at: Odometry | None) -> None:
        """Take an answer, and the odometry of its scan."""
        if at is None and self.at is None:
            return
        self.update, self.at = update, at or self.at
        self.odom = (update.x, update.y, update.heading)

    def pose(self, odometry: Odometry, late: str) -> MapPose:
        """The pose at the time of `odometry`. `late`: why there are no new answers."""
        pose = compose(self.odom, (odometry.x, odometry.y, odometry.heading))
        update, at = self.update, self.at
        if update is None or at is None:
            covariance = odometry.covariance
            return MapPose(odometry.time, *pose, covariance, "starting", self.odom, late)
        covariance = added_covariance(update.covariance, at, odometry, self.odom[2])
        state, cause = update.state, update.cause
        if late and state in ("mapping", "localised"):
            state, cause = "odometry", late
        return MapPose(odometry.time, *pose, covariance, state, self.odom, cause)


def added_covariance(
    answer: PoseCovariance, at: Odometry, now: Odometry, turn: float
) -> PoseCovariance:
    """Covariance of the pose in the map at `now`, after an `answer` at the pose `at`.

    `turn`: heading of odom in the map (rad).
    """
    c, s = cos(turn), sin(turn)
    dx, dy = now.x - at.x, now.y - at.y
    motion = _difference(now.covariance, _moved(at.covariance, dx, dy))
    moved = _moved(answer, c * dx - s * dy, s * dx + c * dy)
    turned = _turned(motion, turn)
    total = [a + b for a, b in zip(moved, turned, strict=True)]
    return (total[0], total[1], total[2], total[3], total[4], total[5])


def _moved(p: PoseCovariance, dx: float, dy: float) -> PoseCovariance:
    """F P F' of a motion by dx, dy (m) whose direction turns with the heading of `p`."""
    xx, xy, xh, yy, yh, hh = p
    return (
        xx - 2 * dy * xh + dy * dy * hh,
        xy + dx * xh - dy * yh - dx * dy * hh,
        xh - dy * hh,
        yy + 2 * dx * yh + dx * dx * hh,
        yh + dx * hh,
        hh,
    )


def _difference(after: PoseCovariance, before: PoseCovariance) -> PoseCovariance:
    """`after` - `before`, at least zero on the diagonal, and with correlations of at most 1."""
    xx, xy, xh, yy, yh, hh = (a - b for a, b in zip(after, before, strict=True))
    xx, yy, hh = max(xx, 0.0), max(yy, 0.0), max(hh, 0.0)
    return (xx, _limited(xy, xx * yy), _limited(xh, xx * hh), yy, _limited(yh, yy * hh), hh)


def _limited(value: float, squared: float) -> float:
    limit = sqrt(squared)
    return min(max(value, -limit), limit)


def _turned(p: PoseCovariance, angle: float) -> PoseCovariance:
    """`p` with its x and y along axes that are turned by -`angle` (rad)."""
    xx, xy, xh, yy, yh, hh = p
    c, s = cos(angle), sin(angle)
    return (
        c * c * xx - 2 * c * s * xy + s * s * yy,
        c * s * (xx - yy) + (c * c - s * s) * xy,
        c * xh - s * yh,
        s * s * xx + 2 * c * s * xy + c * c * yy,
        s * xh + c * yh,
        hh,
    )


def between(first: PlanePose, second: PlanePose) -> PlanePose:
    """The pose `second` in the frame of `first`."""
    dx, dy = second[0] - first[0], second[1] - first[1]
    c, s = cos(first[2]), sin(first[2])
    return c * dx + s * dy, c * dy - s * dx, remainder(second[2] - first[2], tau)
