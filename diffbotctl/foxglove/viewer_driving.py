"""Driving by the velocities of one viewer: the rules of the ROS 2 bridge, over one connection.

A viewer drives from its first velocity that is not zero until its next zero. One that falls silent,
goes away or sends nonsense while it drives stops the robot; see `ros2.velocity_rules`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from diffbotctl.foxglove.protocol import Fields
from diffbotctl.ros2.velocity_rules import (
    DriveState,
    EngineOrder,
    Limits,
    VelocityRules,
    VelocitySource,
)


class ViewerDriving:
    """The velocities of the viewer `name`. Times are monotonic, in s.

    `send` sends a request to the engine, `report` gets a sentence for each stop.
    """

    def __init__(
        self, name: str, limits: Limits, send: Callable[..., None], report: Callable[[str], None]
    ) -> None:
        self.source = VelocitySource(frozenset({name}), name)
        self.rules = VelocityRules(limits)
        self.send = send
        self.report = report

    def velocity_received(self, now: float, linear: float, angular: float) -> None:
        """The viewer published a velocity (m/s, rad/s)."""
        self._carry_out(self.rules.velocity_received(now, linear, angular, self.source))

    def beat(self, now: float) -> None:
        """Repeat the velocity, or notice silence; to be called often."""
        self._carry_out(self.rules.time_passed(now))

    def ended(self) -> None:
        """The viewer is gone."""
        self._carry_out(self.rules.publishers_changed(()))

    def stop_ended(self) -> None:
        """Someone allowed motion again."""
        self.rules.stop_ended()

    def reply_received(self, reply: Fields) -> None:
        """The engine's reply to an order; a refusal needs a zero or `resume`."""
        if reply.get("ok") or reply.get("id") not in ("drive", "rearm"):
            return
        was_moving = self.rules.state is DriveState.MOVING
        self.rules.refused()
        if was_moving:
            self.report(f"velocity refused: {reply.get('cause', '')}; {reply.get('fix', '')}")

    def _carry_out(self, orders: Iterable[EngineOrder]) -> None:
        for order in orders:
            match order.method:
                case "drive":
                    self.send("drive", linear=order.linear, angular=order.angular)
                case "release" | "rearm":
                    self.send(order.method)
                case _:
                    self.send(order.method, reason=order.reason)
            if order.reason:
                self.report(f"robot stopped: {order.reason}")
