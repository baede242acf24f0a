"""Random numbers for two blocks of the same class, and their sums."""

from random import Random

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Float64, Text
from diffbotctl.params import Param


class Numbers(Block):
    """Random numbers, sometimes one of them alone."""

    seed = Param(int, default=1, help="Seed.")
    tick = Every(0.05)
    first = Out(Float64)
    second = Out(Float64)

    def reset(self):
        self.rng = Random(self.seed)

    def react(self, now, tick):
        number = Float64(now, float(self.rng.randrange(-50, 50)))
        if self.rng.random() < 0.7:
            return number, None
        return number, Float64(now, float(self.rng.randrange(-50, 50)))


class Judge(Block):
    """Each sum is that of its own numbers since `reset`, which is called twice."""

    first = In(Float64)
    second = In(Float64)
    first_total = In(Float64)
    second_total = In(Float64)
    finding = Out(Text)
    resets = 0

    def reset(self):
        self.resets += 1
        self.sums = [0.0, 0.0]
        self.count = 0

    def react(self, now, first, second, first_total, second_total):
        for k, (number, total) in enumerate(((first, first_total), (second, second_total))):
            if number is None or number.time != now:
                continue
            self.sums[k] += number.data
            if total is None or total.time != number.time:
                return Text(now, "silent: no sum came after a number")
            if not abs(total.data - self.sums[k]) <= 1e-6:
                seen = f"{total.data:g} after numbers whose sum is {self.sums[k]:g}"
                first_run = "shared" if k else "sum"
                return Text(now, f"{first_run if self.resets == 1 else 'again'}: {seen}")
        self.count += 1
        return Text(now, "passed") if self.count >= 100 else None
