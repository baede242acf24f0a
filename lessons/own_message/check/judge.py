"""Random angles, and whether the alarm distinguishes open from closed."""

from random import Random

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Bool, Float64, Text
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
    """Open from 0.2 rad on."""

    angle = In(Float64)
    open = In(Bool)
    finding = Out(Text)

    def reset(self):
        self.count = 0

    def react(self, now, angle, open):
        if angle is None:
            return None
        if open is None or open.time != angle.time:
            return Text(now, "silent: no message came from the alarm after an angle")
        if open.data != (angle.data >= 0.2):
            word = "open" if open.data else "closed"
            return Text(now, f"state: {word} at {angle.data:.2f} rad")
        self.count += 1
        return Text(now, "passed") if self.count >= 100 else None
