"""Two hundred random velocities, and the speeds that they need."""

from random import Random

from diffbotctl.block import Block, Every, FromRobot, In, Out
from diffbotctl.messages import Text, Twist, Wheels
from diffbotctl.params import Param


class Twists(Block):
    """Random velocities."""

    seed = Param(int, default=1, help="Seed.")
    tick = Every(0.02)
    twist = Out(Twist)

    def reset(self):
        self.rng = Random(self.seed)

    def react(self, now, tick):
        return Twist(now, self.rng.uniform(-0.3, 0.3), self.rng.uniform(-1.5, 1.5))


class Judge(Block):
    """Speeds within a millionth."""

    track = FromRobot("drive.track")
    left_diameter = FromRobot("drive.left.wheel.diameter")
    right_diameter = FromRobot("drive.right.wheel.diameter")
    twist = In(Twist)
    wheels = In(Wheels)
    finding = Out(Text)

    def reset(self):
        self.count = 0

    def react(self, now, twist, wheels):
        if twist is None:
            return None
        if wheels is None or wheels.time != twist.time:
            return Text(now, "silent: no speeds came after a velocity")
        aside = twist.angular * self.track / 2.0
        left = 2.0 * (twist.linear - aside) / self.left_diameter
        right = 2.0 * (twist.linear + aside) / self.right_diameter
        if not _are_near((wheels.left, wheels.right), (left, right)):
            mirrored = (
                left + 4.0 * aside / self.left_diameter,
                right - 4.0 * aside / self.right_diameter,
            )
            kind = _kind((wheels.left, wheels.right), (left, right), mirrored)
            asked = f"v {twist.linear:.3f} m/s, w {twist.angular:.3f} rad/s"
            robot = f"track {self.track:.3f} m, diameters {self.left_diameter:.3f} m (left) "
            robot += f"and {self.right_diameter:.3f} m (right)"
            seen = f"left {wheels.left:.3f} and right {wheels.right:.3f} rad/s for {asked}, {robot}"
            return Text(now, f"{kind}: {seen}")
        self.count += 1
        return Text(now, "passed") if self.count == 200 else None


def _kind(found, right, mirrored):
    """What is wrong with a pair of speeds, as far as it shows; `mirrored`: for -w in place of w."""
    if _are_near(found, right[::-1]) or _are_near(found, mirrored):
        return "exchanged"
    if _are_near([2.0 * each for each in found], right):
        return "diameter"
    return "speeds"


def _are_near(found, right):
    return all(abs(a - b) < 1e-6 for a, b in zip(found, right, strict=True))
