"""Whether the part that is named is the faulty one."""

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Stop, Text
from diffbotctl.params import Param


class Judge(Block):
    """The answer to the first stop."""

    answer = Param(str, default="obstacle", help="What is right.")
    stop = In(Stop)
    part = In(Text)
    finding = Out(Text)

    def react(self, now, stop, part):
        if stop is None or not stop.code:
            return None
        if part is None:
            return Text(now, f"silent: the robot stopped ({stop.code}), and no part was named")
        if part.text.strip().lower() != self.answer:
            return Text(now, f"part: '{part.text}' for the stop {stop.code}: {stop.cause}")
        return Text(now, "passed")
