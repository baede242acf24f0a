from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Float64
from diffbotctl.params import Param


class Scale(Block):
    """Multiply each number by a factor."""

    factor = Param(float, default=2.0, minimum=0.0, maximum=10.0, live=True, help="The factor.")

    number = In(Float64, help="Numbers.")
    scaled = Out(Float64, help="The same numbers, multiplied.")

    def react(self, now, number):
        if number is None:
            return None
        return Float64(number.time, self.factor * number.data)
