from diffbotctl.block import Block, Every, Out
from diffbotctl.messages import Float64


class Numbers(Block):
    """Count: 1, 2, 3, twice a second."""

    tick = Every(0.5)
    number = Out(Float64)

    def reset(self):
        self.count = 0

    def react(self, now, tick):
        self.count += 1
        return Float64(now, float(self.count))
