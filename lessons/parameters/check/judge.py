"""Numbers, and whether the block multiplies them by the factor in force."""

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Float64, Text
from diffbotctl.params import Param


class Numbers(Block):
    """Count: 1, 2, 3, ten times a second."""

    tick = Every(0.1)
    number = Out(Float64)

    def reset(self):
        self.count = 0

    def react(self, now, tick):
        self.count += 1
        return Float64(now, float(self.count))


class Judge(Block):
    """Each number is multiplied by the factor that was set last, which it gets, too."""

    factor = Param(float, default=2.0, live=True, help="In force.")
    number = In(Float64)
    scaled = In(Float64)
    finding = Out(Text)

    def reset(self):
        self.count = 0

    def react(self, now, number, scaled):
        if number is None:
            return None
        self.count += 1
        if scaled is None or scaled.time != number.time:
            return Text(now, "silent: no number came from scale")
        if not abs(scaled.data - self.factor * number.data) <= 1e-6:
            seen = f"{scaled.data:g} for {number.data:g} with the factor {self.factor:g}"
            return Text(now, f"factor: {seen}")
        return Text(now, "passed") if self.count >= 60 else None
