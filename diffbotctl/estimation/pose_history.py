"""The poses of the path so far, which a later explanation of the counts corrects."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import cos, sin

Pose = tuple[float, float, float]
"""x, y (m) and heading (rad) in odom."""
Correction = tuple[float, float]
"""Way ahead (m) and turn (rad) in addition to those of one frame."""
FRAMES_MAX = 800  # 20 s at 40 Hz; what was explained otherwise for longer is corrected from there


class PoseHistory:
    """The last poses, one a frame, oldest first."""

    def __init__(self) -> None:
        self._poses: deque[Pose] = deque(maxlen=FRAMES_MAX)

    def add(self, pose: Pose) -> None:
        """Note the pose at the end of a frame."""
        self._poses.append(pose)

    def before(self, frames: int, start: Pose) -> Pose:
        """The pose before the last `frames`: `start` when the path has no more, or the oldest pose
        that is kept."""
        poses = self._poses
        if frames < len(poses):
            return poses[-frames - 1]
        return poses[0] if len(poses) == FRAMES_MAX else start

    def move(self, moved: Pose, origin: Pose) -> None:
        """Move all poses as a rigid path whose pose `origin` changes by `moved` (m, m, rad)."""
        for index, pose in enumerate(self._poses):
            self._poses[index] = turned(pose, moved, origin)

    def correct(self, corrections: Sequence[Correction], start: Pose) -> Pose:
        """Add to each of the last frames, and go the path from there again. Returns its end."""
        poses = self._poses
        first = max(len(poses) - len(corrections), 0)
        before = corrected = self.before(len(poses) - first, start)
        for index in range(first, len(poses)):
            pose = poses[index]
            ahead, turn = corrections[index - len(poses)]
            difference = corrected[2] - before[2]
            c, s = cos(difference), sin(difference)
            x, y = pose[0] - before[0], pose[1] - before[1]
            heading = pose[2] + difference
            middle = heading + 0.5 * turn
            corrected = (
                corrected[0] + x * c - y * s + ahead * cos(middle),
                corrected[1] + x * s + y * c + ahead * sin(middle),
                heading + turn,
            )
            before = pose
            poses[index] = corrected
        return corrected


def turned(pose: Pose, moved: Pose, origin: Pose) -> Pose:
    """A pose of a rigid path whose pose `origin` changes by `moved` (m, m, rad)."""
    x, y = pose[0] - origin[0], pose[1] - origin[1]
    c, s = cos(moved[2]), sin(moved[2])
    return (
        origin[0] + moved[0] + x * c - y * s,
        origin[1] + moved[1] + x * s + y * c,
        pose[2] + moved[2],
    )
