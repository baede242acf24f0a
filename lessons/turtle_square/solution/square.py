from math import cos, sin

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Goal, Odometry, Path
from diffbotctl.params import Param


class Square(Block):
    """A square from where the turtle is."""

    side = Param(float, unit="m", default=2.0, minimum=0.5, maximum=4.0, help="Side.")

    pose = In(Odometry, help="Where the turtle is.")
    path = Out(Path, help="The corners.")

    def reset(self):
        self.is_sent = False

    def react(self, now, pose):
        if pose is None or self.is_sent:
            return None
        self.is_sent = True
        forward = self.side * cos(pose.heading), self.side * sin(pose.heading)
        left = -forward[1], forward[0]
        corners = [
            (pose.x + forward[0], pose.y + forward[1]),
            (pose.x + forward[0] + left[0], pose.y + forward[1] + left[1]),
            (pose.x + left[0], pose.y + left[1]),
            (pose.x, pose.y),
        ]
        goals = [Goal(now, number, x, y) for number, (x, y) in enumerate(corners, 1)]
        return Path(now, tuple(goals))
