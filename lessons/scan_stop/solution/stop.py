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
        if twist.linear > 0.0 and (scan is None or self.is_blocked(scan)):
            return Twist(twist.time, 0.0, 0.0)
        return twist

    def is_blocked(self, scan):
        """Whether something stands in a strip of 24 cm, less than 35 cm ahead."""
        for number, distance in enumerate(scan.distances):
            bearing = scan.start + number * scan.step
            ahead, aside = distance * cos(bearing), distance * sin(bearing)
            if cos(bearing) > 0.0 and ahead < 0.35 and abs(aside) < 0.12:
                return True
        return False
