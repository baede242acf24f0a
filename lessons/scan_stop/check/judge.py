"""How near the robot comes to what it drives at."""

from math import cos, hypot, inf, pi, sin

from diffbotctl.block import Block, Every, FromRobot, In, Out
from diffbotctl.messages import Odometry, Scan, Text, Twist
from diffbotctl.params import Param

REST = 1_500_000_000  # ns
FREE, NEAR = 0.10, 0.50  # m
SECOND = 1_000_000_000
FIRST_SCAN, TOO_NEAR, END = 2 * SECOND, 4 * SECOND, 6 * SECOND
LIMIT = 30 * SECOND  # 1.8 m take 9 s
LATE = SECOND // 2  # after a change, which the next scan shows


class Forward(Block):
    """Ask for 0.2 m/s, ten times a second."""

    tick = Every(0.1)
    twist = Out(Twist)

    def react(self, now, tick):
        return Twist(now, 0.2, 0.0)


class Judge(Block):
    """It stands 10 to 50 cm before the wall, or the post at the same x."""

    wall = Param(float, unit="m", default=1.0, help="Its x.")
    radius = Param(float, unit="m", default=0.0, help="Of a post; 0: a wall.")
    front = FromRobot("body.front")
    width = FromRobot("body.width")
    pose = In(Odometry)
    finding = Out(Text)

    def reset(self):
        self.last = None
        self.still_since = 0

    def react(self, now, pose):
        if pose is None:
            return None
        c, s = cos(pose.heading), abs(sin(pose.heading))
        gap = self.wall - self.radius - (pose.x + self.front * c + self.width / 2.0 * s)
        if gap < FREE:
            return Text(now, f"near: {100.0 * gap:.1f} cm before the {self._what()}")
        if self.last is None or hypot(pose.x - self.last.x, pose.y - self.last.y) > 0.002:
            self.last, self.still_since = pose, now
        if now - self.still_since < REST and now < LIMIT:
            return None
        if gap > NEAR:
            return Text(now, f"far: {100.0 * gap:.0f} cm before the {self._what()}")
        return Text(now, "passed")

    def _what(self):
        return "post" if self.radius else "wall"


class Scans(Block):
    """None at first; then free ones; then some with distances that are too near, as zeros."""

    bearing = Param(float, unit="rad", default=0.0, help="In which they are too near.")
    tick = Every(0.2)
    scan = Out(Scan)

    def react(self, now, tick):
        if now < FIRST_SCAN:
            return None
        distances = [inf] * 360
        if now >= TOO_NEAR:
            middle = round(180.0 * (self.bearing / pi + 1.0))
            distances[middle - 3 : middle + 4] = [0.0] * 7
        return Scan(now, -pi, pi / 180.0, tuple(distances))


class UnknownJudge(Block):
    """The robot drives only while it knows that the way is free, and always gets a velocity."""

    twist = In(Twist)
    safe = In(Twist)
    finding = Out(Text)

    def react(self, now, twist, safe):
        if twist is None or now % TOO_NEAR % FIRST_SCAN < LATE:
            return None
        if safe is None or safe.time != twist.time:
            return Text(now, "silent: nothing was published after a velocity")
        moves = safe.linear != 0.0
        if now < FIRST_SCAN and moves:
            return Text(now, "blind: before the first scan")
        if FIRST_SCAN < now < TOO_NEAR and not moves:
            return Text(now, "far: without anything in reach")
        if now > TOO_NEAR and moves:
            return Text(now, "zero: with distances of 0 ahead")
        return Text(now, "passed") if now > END - LATE else None
