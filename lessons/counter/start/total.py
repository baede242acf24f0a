from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Float64


class Total(Block):
    """The sum of all numbers so far."""

    number = In(Float64, help="Numbers.")
    total = Out(Float64, help="Their sum so far.")

    def reset(self):
        pass

    def react(self, now, number):
        if number is None:
            return None
        return Float64(number.time, number.data)
