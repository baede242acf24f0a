from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.messages import Twist, Wheels


class WheelSpeeds(Block):
    """The speeds of both wheels for a velocity of the robot."""

    track = FromRobot("drive.track")  # m
    left_diameter = FromRobot("drive.left.wheel.diameter")  # m
    right_diameter = FromRobot("drive.right.wheel.diameter")  # m

    twist = In(Twist, help="Velocity: linear in m/s, angular in rad/s.")
    wheels = Out(Wheels, help="Speeds in rad/s.")

    def react(self, now, twist):
        if twist is None:
            return None
        left = 0.0
        right = 0.0
        return Wheels(twist.time, left, right)
