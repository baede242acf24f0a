"""Random angles, and what the alarm makes of them."""

from random import Random

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Float64, Text
from diffbotctl.params import Param


class Angles(Block):
    """Random angles of a door, of which half are the limit."""

    seed = Param(int, default=1, help="Seed.")
    tick = Every(0.05)
    angle = Out(Float64)

    def reset(self):
        self.rng = Random(self.seed)

    def react(self, now, tick):
        return Float64(now, self.rng.choice((0.2, self.rng.uniform(0.0, 0.5))))


class Judge(Block):
    """The angle from 0.2 rad on, else 0."""

    angle = In(Float64)
    opening = In(Float64)
    finding = Out(Text)

    def reset(self):
        self.count = 0

    def react(self, now, angle, opening):
        if angle is None:
            return None
        if opening is None or opening.time != angle.time:
            return Text(now, "silent: no message came from the alarm after an angle")
        if opening.data != (angle.data if angle.data >= 0.2 else 0.0):
            return Text(now, f"state: {opening.data:.2f} when the door was at {angle.data:.2f} rad")
        self.count += 1
        return Text(now, "passed") if self.count >= 100 else None
