"""The interface between the loop and the drivers, which do the I/O."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from diffbotctl.messages import Duty, Message, Wheels


class Delivery(NamedTuple):
    """A message for the source wire `wire`, such as `robot.encoders`."""

    wire: str
    message: Message


class Driver(Protocol):
    """Delivers messages at logical times that it chooses, or when one of its files is readable."""

    def due(self) -> int:
        """The next logical time at which to call `deliver`; NEVER if only files matter."""

    def files(self) -> list[int]:
        """File descriptors to wait for."""

    def deliver(self, now: int) -> list[Delivery]:
        """The messages that arrived by `now`, in order. Called at `due` or when a file is ready."""

    def close(self) -> None:
        """Release ports and files. Called once, after the robot was stopped."""


class RobotDriver(Driver, Protocol):
    """The driver behind the node `robot`."""

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Send a command; it replaces one that was not sent yet."""

    def stop(self, now: int) -> None:
        """Discard unsent commands and stop the motors; repeated until the board confirms it."""

    @property
    def stopped(self) -> bool:
        """True when the board has confirmed standstill since the last `stop`."""
