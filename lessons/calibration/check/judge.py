"""Two squares, driven by the stated geometry, of a robot whose track and wheels differ from it."""

from math import cos, hypot, pi, sin

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.messages import Encoders, Float64, Goal, GoalState, Odometry, Path, Text

SIDE, TRACK, DIAMETER = 2.0, 0.6, 0.4  # m, as they are stated
NOMINAL = (TRACK, DIAMETER, DIAMETER)
CORNERS = ((SIDE, 0.0, 1), (SIDE, SIDE, 2), (0.0, SIDE, 3), (0.0, 0.0, 4))  # m, m, quarter turns


def moved(pose, left, right, track):
    """The pose after the wheels have rolled `left` and `right` (m)."""
    x, y, heading = pose
    forward, turn = (left + right) / 2.0, (right - left) / track
    if abs(turn) < 1e-12:
        return x + forward * cos(heading), y + forward * sin(heading), heading
    radius, end = forward / turn, heading + turn
    return x + radius * (sin(end) - sin(heading)), y - radius * (cos(end) - cos(heading)), end


def end_of_square(true, stated, side):
    """Where a square to one side (1 left, -1 right) ends that is exact by the stated geometry."""
    pose = 0.0, 0.0, 0.0
    left, right = true[1] / stated[1], true[2] / stated[2]
    turn = side * pi / 4.0 * stated[0]
    for _ in range(4):
        pose = moved(pose, SIDE * left, SIDE * right, true[0])
        pose = moved(pose, -turn * left, turn * right, true[0])
    return pose


def farthest(true, stated):
    """The larger distance of both ends from the start (m)."""
    return max(hypot(*end_of_square(true, stated, side)[:2]) for side in (1.0, -1.0))


class Pose(Block):
    """The pose by the stated geometry."""

    counts = FromRobot("drive.left.encoder.counts")
    encoders = In(Encoders)
    odometry = Out(Odometry)

    def reset(self):
        self.last = None
        self.pose = 0.0, 0.0, 0.0

    def react(self, now, encoders):
        if encoders is None:
            return None
        last, self.last = self.last or encoders, encoders
        pitch = pi * DIAMETER / self.counts
        left, right = (encoders.left - last.left) * pitch, (encoders.right - last.right) * pitch
        self.pose = moved(self.pose, left, right, TRACK)
        time = max((encoders.time - last.time) / 1e9, 1e-9)
        speed, rate = (left + right) / 2.0 / time, (right - left) / TRACK / time
        return Odometry(encoders.time, *self.pose, speed, rate, (0.0,) * 6)


class Squares(Block):
    """A square to the left and one to the right, turning at each corner."""

    pose = In(Odometry)
    path = Out(Path)

    def reset(self):
        self.is_sent = False

    def react(self, now, pose):
        if pose is None or self.is_sent:
            return None
        self.is_sent = True
        corners = [(x, side * y, side * k * pi / 2.0) for side in (1, -1) for x, y, k in CORNERS]
        return Path(now, tuple(Goal(now, k, *corner) for k, corner in enumerate(corners, 1)))


class Ends(Block):
    """Where each square has really ended, as seen from where it began."""

    truth = In(Odometry)
    state = In(GoalState)
    left = Out(Odometry)
    right = Out(Odometry)

    def reset(self):
        self.start = None
        self.ends = []

    def react(self, now, truth, state):
        if truth is None:
            return None, None
        self.start = self.start or truth
        if state and state.state == "reached" and state.number == 4 * (len(self.ends) + 1):
            dx, dy = truth.x - self.start.x, truth.y - self.start.y
            c, s = cos(self.start.heading), sin(self.start.heading)
            turned = truth.heading - self.start.heading
            end = c * dx + s * dy, c * dy - s * dx, turned
            self.ends.append(Odometry(now, *end, 0.0, 0.0, (0.0,) * 6))
            self.start = truth
        return tuple(self.ends) if len(self.ends) == 2 else (None, None)


class Judge(Block):
    """With the new geometry both squares end at most half as far away."""

    true_track = FromRobot("drive.track")
    true_left = FromRobot("drive.left.wheel.diameter")
    true_right = FromRobot("drive.right.wheel.diameter")
    track = In(Float64)
    left = In(Float64)
    right = In(Float64)
    finding = Out(Text)

    def react(self, now, track, left, right):
        if track is None or left is None or right is None:
            return None
        found = track.data, left.data, right.data
        true = self.true_track, self.true_left, self.true_right
        if not min(found) > 0.0:
            return Text(now, "negative: " + ", ".join(f"{value:g} m" for value in found))
        before, after = farthest(true, NOMINAL), farthest(true, found)
        seen = f"{1000.0 * before:.0f} mm before, {1000.0 * after:.0f} mm with the new track "
        seen += f"{found[0]:.3f} m and wheels {found[1]:.4f} m (left) and {found[2]:.4f} m"
        mean = (found[1] + found[2]) / 2.0
        if not abs(mean - DIAMETER) <= 1e-5:
            return Text(now, f"mean: {1000.0 * mean:.2f} mm")
        if not after <= before:
            return Text(now, f"worse: {seen}")
        if after > before / 2.0:
            return Text(now, f"half: {seen}")
        return Text(now, "passed")
