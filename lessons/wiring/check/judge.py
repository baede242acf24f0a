"""Whether a robot with this wiring reaches its goal, and has all its parts."""

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.messages import GoalState, Text, Volts

TRACK = 0.14  # m, of the robot in parts.yaml


class Judge(Block):
    """It reaches its goal with two encoders on a board of the right kind."""

    board = FromRobot("board.type")
    track = FromRobot("drive.track")
    left_pin = FromRobot("drive.left.encoder.pin")
    right_pin = FromRobot("drive.right.encoder.pin")
    volts = In(Volts, trigger=False)
    state = In(GoalState)
    finding = Out(Text)

    def react(self, now, volts, state):
        if self.board != "mega2560":
            return Text(now, f"board: the board is {self.board}")
        if self.track != TRACK:
            seen = f"the track is {1000.0 * self.track:.0f} mm in place of {1000.0 * TRACK:.0f} mm"
            return Text(now, f"robot: {seen}")
        if self.left_pin is None or self.right_pin is None:
            return Text(now, "encoder: an encoder has no pin")
        if volts is None or state is None or state.state not in ("reached", "reached_unsure"):
            return None
        return Text(now, "passed")
