"""Who publishes on the inputs of a pipeline, and what happens when nothing comes any more.

One publisher at a time: it has the input until its last message is older than the input's timeout,
or until it has gone. Then the blocks get the neutral message, or none; and where the robot's motion
depends on the input, the robot is stopped until an operator resumes it. That is decided here, in
the engine, so that a program or server that hangs changes nothing. A publisher that comes back
never ends that stop.
"""

from __future__ import annotations

from collections.abc import Container, Hashable, Sequence

from diffbotctl.config.configuration import InputUse
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.engine.driver import Delivery
from diffbotctl.messages import Stop
from diffbotctl.time import NEVER, SECOND


class InputLease:
    """The publisher of one input: its key, None for none, its name, and when its message expires.

    Times are in ns.
    """

    def __init__(self, use: InputUse) -> None:
        self.use = use
        self.timeout = round(use.timeout * SECOND)
        self.publisher: Hashable | None = None
        self.who = ""
        self.deadline = NEVER
        self.cause = ""  # why it ends at `deadline`; empty: nothing came until then

    @property
    def end_cause(self) -> str:
        """Why it ends at `deadline`."""
        return self.cause or (
            f"{self.who} has published nothing on {self.use.wire} for {self.use.timeout:g} s"
        )


class InputLeases:
    """A driver that delivers neutral messages and stops; those who publish renew their leases."""

    def __init__(self, uses: Sequence[InputUse], operator: Operator) -> None:
        self.leases = {use.wire: InputLease(use) for use in uses}
        self.operator = operator
        self.neutral_due = any(use.neutral is not None for use in uses)

    def renew(self, now: int, wire: str, publisher: Hashable, who: str) -> str | None:
        """Note a message of `publisher` on `wire`, delivered at `now`.

        Returns the name of another publisher who has the input; the message is then refused.
        """
        lease = self.leases[wire]
        if lease.publisher not in (None, publisher):
            return lease.who
        if lease.publisher is None:
            self.operator.log(now, "info", "operator", f"{who} publishes {wire}")
        lease.publisher, lease.who = publisher, who
        lease.deadline = now + lease.timeout
        lease.cause = ""
        return None

    def release(self, wire: str, publisher: Hashable) -> None:
        """Note that `publisher` will publish nothing more on `wire` for now: that stops nothing."""
        lease = self.leases[wire]
        if lease.publisher == publisher:
            lease.publisher, lease.deadline = None, NEVER

    def end(self, now: int, publisher: Hashable, cause: str, wires: Container[str] = ()) -> None:
        """End the leases of a publisher that has gone, at the next instant.

        `wires` are its own: they end even if it has published nothing yet.
        """
        for wire, lease in self.leases.items():
            if lease.publisher == publisher or (lease.publisher is None and wire in wires):
                lease.publisher = publisher
                lease.deadline = min(lease.deadline, now + 1)
                lease.cause = cause

    def end_clients(self, now: int, cause: str) -> None:
        """End the leases of all clients of the control socket, whose keys are numbers."""
        for lease in self.leases.values():
            if isinstance(lease.publisher, int):
                self.end(now, lease.publisher, cause)

    def due(self) -> int:
        """When the next message expires."""
        if self.neutral_due:
            return 0
        return min((lease.deadline for lease in self.leases.values()), default=NEVER)

    def files(self) -> list[int]:
        """None: those who publish have files of their own."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """The neutral messages at the start; neutral messages and stops of what has expired."""
        deliveries: list[Delivery] = []
        for lease in self.leases.values():
            if now >= lease.deadline:
                deliveries += self._expire(now, lease)
            elif self.neutral_due:
                deliveries += self._neutral(now, lease)
        self.neutral_due = False
        return deliveries

    def close(self) -> None:
        """Nothing is open."""

    def _expire(self, now: int, lease: InputLease) -> list[Delivery]:
        lease.publisher, lease.deadline = None, NEVER
        deliveries = self._neutral(now, lease)
        # Also where another stop came before this one: it does not name the publisher.
        cause = lease.end_cause
        self.operator.log(now, "warning", "operator", f"{lease.use.wire} has expired: {cause}")
        if lease.use.feeds_motion:
            stop = Stop(now, "input_stale", cause, True)
            deliveries.append(Delivery("operator.halt", stop))
        return deliveries

    def _neutral(self, now: int, lease: InputLease) -> list[Delivery]:
        if lease.use.neutral is None:
            return []
        return [Delivery(lease.use.wire, lease.use.neutral._replace(time=now))]
