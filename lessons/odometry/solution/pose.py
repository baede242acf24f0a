from math import cos, pi, sin

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.messages import Encoders, Odometry


class Pose(Block):
    """The pose of the robot from the counts of its wheels."""

    track = FromRobot("drive.track")  # m
    diameter = FromRobot("drive.left.wheel.diameter")  # m, of both wheels
    counts = FromRobot("drive.left.encoder.counts")  # of a turn of the wheel

    encoders = In(Encoders, help="Counts of both wheels: left, right.")
    odometry = Out(Odometry, help="Pose: x, y in m, heading in rad.")

    def reset(self):
        self.last = None  # the message before
        self.x = self.y = self.heading = 0.0

    def react(self, now, encoders):
        if encoders is None:
            return None
        if self.last is not None:
            pitch = pi * self.diameter / self.counts
            left = (encoders.left - self.last.left) * pitch
            right = (encoders.right - self.last.right) * pitch
            forward, turn = (left + right) / 2.0, (right - left) / self.track
            self.x += forward * cos(self.heading + turn / 2.0)
            self.y += forward * sin(self.heading + turn / 2.0)
            self.heading += turn
        self.last = encoders
        return Odometry(encoders.time, self.x, self.y, self.heading, 0.0, 0.0, (0.0,) * 6)
