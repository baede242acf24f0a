"""A virtual board that answers on two pseudo-terminals, with the robot's plant behind its pins."""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.emulator.emulated_robot import (
    STEP,
    emulated_board,
    gyro_address,
    motor_pins,
    sonar_pins,
)
from diffbotctl.emulator.process import Emulator, Firmware
from diffbotctl.emulator.program import CHIPS, bootloader
from diffbotctl.emulator.virtual_boot_drive import VirtualBootDrive
from diffbotctl.plant.world import World
from diffbotctl.processes.real_time import prefer
from diffbotctl.time import SECOND

CATCH_UP_MAX = 200_000_000  # ns; a machine that lost more time than this does not make it up
POLL_PERIOD_S = 0.0005  # half a step of the board
TURNING_SPEED_MIN = 0.3  # rad/s, an eighth of the slowest motion that is commanded
REPORT_DELAY = 60_000_000  # ns; a shorter motion is not reported
Image = Path | Firmware | None
# The motion of a wheel, and of both.
STANDS = "stands"
BOTH_WHEELS = {
    STANDS: "stand",
    "turns forward": "turn forward",
    "turns backward": "turn backward",
}


class WheelReport:
    """Text reports of which wheels turn, and in which direction."""

    def __init__(self) -> None:
        self._reported = self._current = (STANDS, STANDS)
        self._since = 0

    def update(self, now: int, speeds: Sequence[float]) -> str | None:
        """The new motion in words, None if it has not changed since the last report.

        `speeds` (rad/s) are those of the left and the right wheel at `now` (ns).
        """
        left, right = (_motion(speed) for speed in speeds)
        if (left, right) != self._current:
            self._current, self._since = (left, right), now
        if self._current == self._reported or now - self._since < REPORT_DELAY:
            return None
        self._reported = self._current
        if left == right:
            return f"both wheels {BOTH_WHEELS[left]}"
        motions = zip(SIDES, self._reported, strict=True)
        return ", ".join(f"the {side} wheel {motion}" for side, motion in motions)


def _motion(speed: float) -> str:
    if abs(speed) < TURNING_SPEED_MIN:
        return STANDS
    return "turns forward" if speed > 0.0 else "turns backward"


class VirtualBoard:
    """A board paced to real time. `usb` names its USB port, `radio` the UART of a radio, if any.

    The names are links in a new folder, named as Linux names such ports on a real machine, since
    the name distinguishes USB from Bluetooth.
    """

    def __init__(self, robot: Robot, seed: int, world: World | None, image: Image) -> None:
        """`image`: the program on it besides the stock bootloader, if any.

        Raises EmulatorError: what to install.
        """
        settings = board_settings(robot)
        pins, board = motor_pins(settings, robot.drive.left.motor.driver), settings.board
        emulator = Emulator(
            pins,
            board=board,
            image=image,
            boot=bootloader(board) if board in CHIPS else None,
            pty=True,
            sonars=sonar_pins(settings),
            gyro=gyro_address(settings),
        )
        self.board = emulated_board(robot, seed, world, emulator)
        assert emulator.ports is not None
        self.folder = Path(mkdtemp(prefix="diffbot-"))
        self.usb = self.folder / "ttyACM0"
        self.radio = self.folder / "rfcomm0" if len(emulator.ports) > 1 else None
        for link, port in zip(self.links(), emulator.ports, strict=True):
            link.symlink_to(port)
        self._boot_drive: VirtualBootDrive | None = None
        self.lost = 0.0  # s for which the machine was too slow, and which the board skipped

    def links(self) -> list[Path]:
        return [link for link in (self.usb, self.radio) if link is not None]

    def serve(self, stop: int, report: Callable[[str], None]) -> None:
        """Keep pace with real time until the file `stop` becomes readable.

        `report` is called with a line for each change of the wheels' motion.
        """
        prefer()
        wheel_report, wheels = WheelReport(), self.board.plant.wheels
        start = time.monotonic_ns() - self.board.now
        while not select.select([stop], [], [], POLL_PERIOD_S)[0]:
            behind = time.monotonic_ns() - start - self.board.now
            if behind > CATCH_UP_MAX:
                self.lost += behind * 1e-9
                start += behind
            self._exchange_program(report)
            # On a machine that is too slow this ends nevertheless: `behind` is not measured again.
            for _ in range(min(behind, CATCH_UP_MAX) // STEP):
                self.board.advance(self.board.now + STEP)
                self.board.received.clear()
                line = wheel_report.update(self.board.now, [wheel.speed for wheel in wheels])
                if line is not None:
                    report(f"{self.board.now / SECOND:7.1f} s  {line}")

    def _exchange_program(self, report: Callable[[str], None]) -> None:
        """The boot drive of a Pico in BOOTSEL, beside its ports; USB has no serial port then."""
        if self._boot_drive is None:
            if self.board.in_bootsel:
                self.usb.unlink(missing_ok=True)
                self._boot_drive = VirtualBootDrive(self.folder)
                report(f"BOOTSEL: the boot drive is {self._boot_drive.folder}")
            return
        image = self._boot_drive.program()
        if image is not None:
            self.board.emulator.program(image)
            self.board.in_bootsel = False
            self._boot_drive.close()
            self._boot_drive = None
            self._link_usb()
            report("the program has started")

    def _link_usb(self) -> None:
        assert self.board.emulator.ports is not None
        self.usb.symlink_to(self.board.emulator.ports[0])

    def close(self) -> None:
        """End the emulator; its ports vanish."""
        self.board.emulator.close()
        if self._boot_drive is not None:
            self._boot_drive.close()
        for link in self.links():
            link.unlink(missing_ok=True)
        self.folder.rmdir()


@contextmanager
def virtual_board(
    robot: Robot, seed: int, world: World | None = None, image: Image = "ours"
) -> Iterator[VirtualBoard]:
    """A VirtualBoard that is closed at the end. Raises EmulatorError."""
    board = VirtualBoard(robot, seed, world, image)
    try:
        yield board
    finally:
        board.close()
