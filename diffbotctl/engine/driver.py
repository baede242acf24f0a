"""What the loop asks of a driver, the kind of block that touches the world."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from diffbotctl.messages import Duty, Message, Wheels


class Delivery(NamedTuple):
    """A message for the source wire `wire`, such as `robot.encoders`."""

    wire: str
    message: Message


class Driver(Protocol):
    """Delivers messages at logical times of its own, or when one of its files can be read."""

    def due(self) -> int:
        """The next logical time at which it wants to be called; NEVER when only files matter."""

    def files(self) -> list[int]:
        """File descriptors whose readiness it waits for."""

    def deliver(self, now: int) -> list[Delivery]:
        """What has arrived by `now`, in order. Called at `due` and when a file is ready."""

    def close(self) -> None:
        """Let go of ports and files. Called once, after the stop."""


class RobotDriver(Driver, Protocol):
    """The driver behind the node `robot`."""

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """Send a command; it replaces one that still waits."""

    def stop(self, now: int) -> None:
        """Discard what waits and stop the motors; repeated by the driver until it is confirmed."""

    @property
    def stopped(self) -> bool:
        """True when the board has shown that it stands still since the last `stop`."""
