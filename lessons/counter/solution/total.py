from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Float64


class Total(Block):
    """The sum of all numbers so far."""

    number = In(Float64, help="Numbers.")
    total = Out(Float64, help="Their sum so far.")

    def reset(self):
        self.sum = 0.0

    def react(self, now, number):
        if number is None:
            return None
        self.sum += number.data
        return Float64(number.time, self.sum)
