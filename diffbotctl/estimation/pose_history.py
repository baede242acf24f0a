"""The poses of the path so far, which a later explanation of the counts corrects from a time on."""

from __future__ import annotations

from collections import deque
from math import cos, sin

Pose = tuple[float, float, float]
"""x, y (m) and heading (rad) in odom."""
POSES_MAX = 800  # 20 s at 40 Hz; explanations of the counts that last longer differ in little


class PoseHistory:
    """The last poses, oldest first, with their times (ns)."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, Pose]] = deque(maxlen=POSES_MAX)

    def clear(self) -> None:
        """Forget the path."""
        self._poses.clear()

    def add(self, time: int, pose: Pose) -> None:
        """Note the pose at `time` (ns)."""
        self._poses.append((time, pose))

    def before(self, time: int, start: Pose) -> Pose:
        """The last pose before `time` (ns): `start` when the path began later, or the oldest pose
        that is kept."""
        poses = self._poses
        if not poses or time <= poses[0][0]:
            return poses[0][1] if len(poses) == POSES_MAX else start
        return next(pose for at, pose in reversed(poses) if at < time)

    def move(self, moved: Pose, since: int, origin: Pose) -> None:
        """Move the poses from `since` (ns) on as a rigid path: `moved` (m, m, rad) is the change of
        `origin`, about which the path turns."""
        for index in range(len(self._poses) - 1, -1, -1):
            time, pose = self._poses[index]
            if time < since:
                return
            self._poses[index] = (time, turned(pose, moved, origin))


def turned(pose: Pose, moved: Pose, origin: Pose) -> Pose:
    """A pose of a rigid path whose pose `origin` changes by `moved` (m, m, rad)."""
    x, y = pose[0] - origin[0], pose[1] - origin[1]
    c, s = cos(moved[2]), sin(moved[2])
    return (
        origin[0] + moved[0] + x * c - y * s,
        origin[1] + moved[1] + x * s + y * c,
        pose[2] + moved[2],
    )
