from math import cos, sin

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Scan, Twist


class ScanStop(Block):
    """Stop before what the scanner sees."""

    twist = In(Twist, help="The velocity that is asked for.")
    scan = In(Scan, trigger=False, help="What the scanner sees.")
    safe = Out(Twist, help="The velocity that the robot gets.")

    def react(self, now, twist, scan):
        if twist is None:
            return None
        return twist
