"""Command selection: a manual velocity command overrides the autonomous one."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist
from diffbotctl.params import Param


class CommandMux(Block):
    """Pass the manual command while it is fresh, else the autonomous one.

    It only selects. After manual driving the node `operator` withdraws the goal until `resume`.

    blocks:
      mux: {block: command_mux, in: {teleop: operator.twist, autonomous: follower.twist}}
    """

    held_for = Param(
        float,
        unit="s",
        default=0.4,
        minimum=0.05,
        maximum=2.0,
        help="Validity of a manual command. Keys repeat every 30 ms, joysticks every 100 ms.",
    )

    teleop = In(Twist, fresh_for="held_for", optional=True, help="The manual command.")
    autonomous = In(Twist, optional=True, help="The command of the pipeline.")
    twist = Out(Twist, help="The selected command.")

    def reset(self) -> None:
        self.was_driven = False

    def react(self, now: int, teleop: Twist | None, autonomous: Twist | None) -> Twist | None:
        was_driven, self.was_driven = self.was_driven, teleop is not None
        if was_driven != self.was_driven:
            self.log.debug("autonomous driving" if was_driven else "manual driving")
        if teleop is not None:
            return teleop._replace(time=now)
        if was_driven:
            # The last autonomous command was for another pose: stop until a new one arrives.
            return Twist(now, 0.0, 0.0)
        if autonomous is None:
            return None
        return autonomous
