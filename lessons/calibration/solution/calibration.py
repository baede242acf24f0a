from math import pi, sin

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Float64, Odometry

SIDE = 2.0  # m
TRACK = 0.6  # m, as it is stated
DIAMETER = 0.4  # m, of both wheels


class Calibration(Block):
    """The geometry that explains where the squares have ended."""

    left = In(Odometry, help="The end of a square to the left.")
    right = In(Odometry, help="The end of a square to the right.")
    track = Out(Float64, help="Track in m.")
    left_diameter = Out(Float64, help="In m.")
    right_diameter = Out(Float64, help="In m.")

    def react(self, now, left, right):
        if left is None or right is None:
            return None, None, None
        alpha = (left.x + right.x) / (-4.0 * SIDE)
        beta = (left.x - right.x) / (4.0 * SIDE)
        track = TRACK * (pi / 2.0) / (pi / 2.0 - alpha)
        ratio = 1.0
        if abs(beta) > 1e-9:
            radius = (SIDE / 2.0) / sin(beta / 2.0)
            ratio = (radius + track / 2.0) / (radius - track / 2.0)
        left_diameter = 2.0 * DIAMETER / (ratio + 1.0)
        return Float64(now, track), Float64(now, left_diameter), Float64(now, ratio * left_diameter)
