"""Command selection: a person's velocity goes before the pipeline's own."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist
from diffbotctl.params import Param


class CommandMux(Block):
    """Pass the person's command while one is fresh, else the autonomous one.

    It only selects. That a goal waits for `resume` after a person took over is the operator's
    doing: the follower then simply has no goal.

    blocks:
      mux: {block: command_mux, in: {teleop: operator.twist, autonomous: follower.twist}}
    """

    held_for = Param(
        float,
        unit="s",
        default=0.4,
        minimum=0.05,
        maximum=2.0,
        help="A person's command counts for so long. Keys repeat each 30 ms, joysticks each 100.",
    )

    teleop = In(Twist, fresh_for="held_for", optional=True, help="A person's command.")
    autonomous = In(Twist, optional=True, help="The pipeline's own command.")
    twist = Out(Twist, help="The command that counts.")

    def reset(self) -> None:
        self.was_driven = False

    def react(self, now: int, teleop: Twist | None, autonomous: Twist | None) -> Twist | None:
        was_driven, self.was_driven = self.was_driven, teleop is not None
        if was_driven != self.was_driven:
            self.log.debug("the pipeline's own command counts" if was_driven else "a person drives")
        if teleop is not None:
            return teleop._replace(time=now)
        if was_driven:
            # The old autonomous command was meant for another place: stand until a new one comes.
            return Twist(now, 0.0, 0.0)
        if autonomous is None:
            return None
        return autonomous
