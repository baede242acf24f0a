from math import sin

from diffbotctl.block import Block, Every, Out
from diffbotctl.messages import Float64


class Angles(Block):
    """A door that opens and closes."""

    tick = Every(0.1)
    angle = Out(Float64)

    def react(self, now, tick):
        return Float64(now, 0.3 + 0.3 * sin(now / 1e9))
