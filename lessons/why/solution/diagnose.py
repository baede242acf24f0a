from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Stop, Text


class Diagnose(Block):
    """What to look at when the robot has stopped."""

    stop = In(Stop, help="What holds the robot.")
    part = Out(Text, help="left wheel, right wheel, distance sensor or obstacle.")

    def react(self, now, stop):
        if stop is None or not stop.code:
            return None
        self.log.info(f"{stop.code}: {stop.cause}")
        if stop.code.startswith("range"):
            return Text(now, "distance sensor")
        if stop.code.startswith("wheel"):
            return Text(now, "left wheel" if "left" in stop.cause else "right wheel")
        return Text(now, "obstacle")
