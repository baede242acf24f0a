"""How far the robot has driven, and whether it stands."""

from math import cos, hypot, sin

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Odometry, Text, Twist

SECOND = 1_000_000_000
LIMIT = 30 * SECOND  # a metre at 0.05 m/s takes 20 s
REST = 2 * SECOND


class Judge(Block):
    """One metre within 20 mm, then at rest and with a command of zero."""

    pose = In(Odometry)
    twist = In(Twist, trigger=False)
    finding = Out(Text)

    def reset(self):
        self.start = self.last = None
        self.still_since = 0

    def react(self, now, pose, twist):
        if pose is None:
            return None
        if self.last is None:
            self.start = self.last = pose
        if hypot(pose.x - self.last.x, pose.y - self.last.y) > 0.0005:
            self.last, self.still_since = pose, now
        dx, dy = pose.x - self.start.x, pose.y - self.start.y
        driven = dx * cos(self.start.heading) + dy * sin(self.start.heading)
        seen = f"{driven:.3f} m ahead of its start, x {self.start.x:.2f} m, y {self.start.y:.2f} m"
        if hypot(dx, dy) > 1.5:
            return Text(now, f"far: {seen}, and drives on")
        if now > LIMIT:
            return Text(now, f"rest: {seen}, and does not stand")
        if now - self.still_since < REST or now < 3 * SECOND:
            return None
        if twist is None:
            return Text(now, "nothing: the block published nothing")
        commands_motion = twist.linear or twist.angular
        if commands_motion and now - twist.time > SECOND:
            return Text(now, f"silent: {seen}")
        if commands_motion or abs(driven - 1.0) > 0.020:
            return Text(now, f"distance: {seen}")
        return Text(now, "passed")
