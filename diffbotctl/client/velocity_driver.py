"""Driving by velocities of other programs: carries out the rules, with or without a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from math import inf

from diffbotctl.client.velocity_rules import DriveState, EngineOrder, VelocityRules, VelocitySource
from diffbotctl.control_socket.protocol import Fields
from diffbotctl.errors import RunError


class VelocityDriver:
    """The rules, their clock, and the requests to the engine. Times are monotonic, in s.

    A velocity is sent from the thread in which it arrives, so nothing is between its publisher and
    the socket. `send` sends a request, its method first, without waiting; `report` gets a sentence
    for each stop. `beat` is to be called often, or `start` once.
    """

    def __init__(
        self, rules: VelocityRules, send: Callable[..., None], report: Callable[[str], None]
    ) -> None:
        self.rules, self.send, self.report = rules, send, report
        self.changed = threading.Condition()
        self.wakes_at = inf  # monotonic time until which the thread waits

    def start(self) -> None:
        """Start a thread that repeats velocities and notices silence; it ends with the process."""
        threading.Thread(target=self._follow_time, daemon=True).start()

    def beat(self, now: float) -> None:
        """Repeat the velocity, or notice silence."""
        with self.changed:
            self._carry_out(self.rules.time_passed(now))

    def velocity_received(
        self, now: float, linear: float, angular: float, source: VelocitySource
    ) -> None:
        """A velocity was published (m/s, rad/s)."""
        with self.changed:
            self._carry_out(self.rules.velocity_received(now, linear, angular, source))
            if self.rules.deadline() < self.wakes_at:
                self.changed.notify()

    def publishers_changed(self, publishers: frozenset[str]) -> None:
        """Publishers have come or gone; `publishers` are those that are alive."""
        with self.changed:
            self._carry_out(self.rules.publishers_changed(publishers))

    def publishers_named(self, publishers: frozenset[str], names: str) -> None:
        """The nodes of the publishers are known, which may be later than their first velocity."""
        with self.changed:
            self.rules.publishers_named(publishers, names)

    @property
    def is_moving(self) -> bool:
        return self.rules.state is DriveState.MOVING

    def stop_ended(self) -> None:
        """Someone allowed motion again."""
        with self.changed:
            self.rules.stop_ended()

    def reply_received(self, reply: Fields) -> None:
        """The engine's reply to an order; a refusal needs a zero or `resume`."""
        if reply.get("ok") or reply.get("id") not in ("drive", "rearm"):
            return
        with self.changed:
            was_moving = self.is_moving
            self.rules.refused()
        if was_moving:
            self.report(f"velocity refused: {reply.get('cause', '')}; {reply.get('fix', '')}")

    def _follow_time(self) -> None:
        with self.changed:
            while True:
                self.wakes_at = self.rules.deadline()
                is_idle = self.wakes_at == inf
                self.changed.wait(None if is_idle else max(self.wakes_at - time.monotonic(), 0.0))
                self._carry_out(self.rules.time_passed(time.monotonic()))

    def _carry_out(self, orders: list[EngineOrder]) -> None:
        for order in orders:
            try:
                self.send(order.method, **order.fields())
            except RunError as error:
                self.report(f"the engine does not answer: {error}")
            if order.reason:
                self.report(f"robot stopped: {order.reason}")
