"""A virtual board that answers on two pseudo-terminals, with the robot's plant behind its pins.

What an eye sees of a robot's wheels: which turn, and which way.
"""

from __future__ import annotations

import select
import time
from collections.abc import Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

from diffbotctl.config.robot import SIDES
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.emulator.emulated_robot import STEP, emulated_board, motor_pins
from diffbotctl.emulator.process import IMAGE, Emulator, bootloader
from diffbotctl.time import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from diffbotctl.config.robot import Robot
    from diffbotctl.plant.world import World

FARTHEST_BEHIND = 200_000_000  # ns; a machine that lost more time than this does not make it up
REST = 0.0005  # s of sleep between two looks at the clock, half a step


class VirtualBoard:
    """A board paced to real time. `usb` and `radio` name its ports: UART0 and UART1.

    The names are links in a new folder, called as Linux calls such ports on a real machine, since
    the name says over what a port leads.
    """

    def __init__(self, robot: Robot, seed: int, world: World | None, image: Path | None) -> None:
        """`image`: the program on it besides the stock bootloader, if any.

        Raises EmulatorError: what to install.
        """
        pins = motor_pins(board_settings(robot))
        emulator = Emulator(pins, image=image, boot=bootloader(), pty=True)
        self.board = emulated_board(robot, seed, world, emulator)
        assert emulator.ports is not None
        self.folder = Path(mkdtemp(prefix="diffbot-"))
        self.usb, self.radio = self.folder / "ttyACM0", self.folder / "rfcomm0"
        for link, port in zip((self.usb, self.radio), emulator.ports, strict=True):
            link.symlink_to(port)
        self.lost = 0.0  # s that the machine was too slow for, and which the board has not lived

    def serve(self, stop: int, tell: Callable[[str], None]) -> None:
        """Keep pace with real time until the file `stop` becomes readable.

        `tell` is called with what an eye would see of the wheels, whenever that changes.
        """
        seen, wheels = WheelReport(), self.board.plant.wheels
        begun = time.monotonic_ns() - self.board.now
        while not select.select([stop], [], [], REST)[0]:
            behind = time.monotonic_ns() - begun - self.board.now
            if behind > FARTHEST_BEHIND:
                self.lost += behind * 1e-9
                begun += behind
            while behind >= STEP:
                self.board.advance(self.board.now + STEP)
                self.board.received.clear()
                new = seen.look(self.board.now, [wheel.speed for wheel in wheels])
                if new is not None:
                    tell(f"{self.board.now / SECOND:7.1f} s  {new}")
                behind = time.monotonic_ns() - begun - self.board.now

    def close(self) -> None:
        """End the emulator; its ports vanish."""
        self.board.emulator.close()
        for link in (self.usb, self.radio):
            link.unlink(missing_ok=True)
        self.folder.rmdir()


@contextmanager
def virtual_board(
    robot: Robot, seed: int, world: World | None = None, image: Path | None = IMAGE
) -> Iterator[VirtualBoard]:
    """A VirtualBoard that is closed at the end. Raises EmulatorError."""
    board = VirtualBoard(robot, seed, world, image)
    try:
        yield board
    finally:
        board.close()


TURNS = 0.3  # rad/s, an eighth of what the slowest motion asks; slower, a wheel seems to stand
BOTH = {
    "stands": "stand",
    "turns forward": "turn forward",
    "turns backward": "turn backward",
}
LASTS = 60_000_000  # ns; what is over sooner is not seen


class WheelReport:
    """Tells when what is seen has changed."""

    def __init__(self) -> None:
        self.seen = self.coming = ("stands", "stands")
        self.since = 0

    def look(self, now: int, speeds: Sequence[float]) -> str | None:
        """At `now` (ns) the left and the right wheel turn at `speeds` (rad/s): words for what is
        new since they were last told, if anything is."""
        left, right = (_way(speed) for speed in speeds)
        if (left, right) != self.coming:
            self.coming, self.since = (left, right), now
        if self.coming == self.seen or now - self.since < LASTS:
            return None
        self.seen = self.coming
        if left == right:
            return f"both wheels {BOTH[left]}"
        ways = zip(SIDES, self.seen, strict=True)
        return ", ".join(f"the {side} wheel {way}" for side, way in ways)


def _way(speed: float) -> str:
    if abs(speed) < TURNS:
        return "stands"
    return "turns forward" if speed > 0.0 else "turns backward"
