"""Random numbers for a program, and the sums that it publishes a little later."""

from random import Random

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Float64, Text
from diffbotctl.params import Param

COUNT = 30
START = 1.0  # s, in which the program starts


class Numbers(Block):
    """Random halves, ten times a second."""

    seed = Param(int, default=1, help="Seed.")
    tick = Every(0.1)
    number = Out(Float64)

    def reset(self):
        self.rng = Random(self.seed)

    def react(self, now, tick):
        return Float64(now, self.rng.randrange(1, 200) / 2.0)


class Judge(Block):
    """The difference of two sums is the number between them."""

    number = In(Float64)
    total = In(Float64)
    finding = Out(Text)

    def reset(self):
        self.numbers = []
        self.totals = []
        self.last = None

    def react(self, now, number, total):
        if number is not None and (not self.numbers or number.time != self.numbers[-1].time):
            self.numbers.append(number)
        if total is None or total is self.last:
            if len(self.numbers) > 10 * COUNT:
                return Text(
                    now,
                    f"silent: there were {len(self.totals)} sums of {len(self.numbers)} numbers",
                )
            return None
        self.last = total
        self.totals.append(total.data)
        if len(self.totals) < COUNT:
            return None
        return Text(now, self._compared())

    def _compared(self):
        """Each sum is that of the numbers from the first one that the program has got."""
        data = [number.data for number in self.numbers]
        for first in range(len(data)):
            sums, total = [], 0.0
            for value in data[first:]:
                total += value
                sums.append(total)
            if sums[: len(self.totals)] == self.totals:
                return "passed"
        return "sum: " + ", ".join(f"{total:g}" for total in self.totals[:4])
