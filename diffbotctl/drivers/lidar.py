"""Driver of two USB lidars, LDS-01 and RPLIDAR A1."""

from __future__ import annotations

import fcntl
import struct
import termios
from contextlib import suppress
from math import pi
from typing import Literal, NamedTuple

from diffbotctl.block import Out
from diffbotctl.device import DeviceDriver, DeviceError, Reading
from diffbotctl.drivers.serial_port import SerialPortDevice
from diffbotctl.errors import RunError
from diffbotctl.links.lidar_frames import RAYS, LdsParser, LidarParser, RplidarParser
from diffbotctl.messages import Scan
from diffbotctl.params import Choice, Param
from diffbotctl.time import MILLISECOND, SECOND

LidarModel = Literal["lds01", "rplidar_a1"]
START_DELAY = 20 * MILLISECOND  # the RPLIDAR wants 1 ms between two requests
START_PERIOD = SECOND  # between two requests to start, until a turn has come


class LidarCommands(NamedTuple):
    """How to speak to a model."""

    baud: int
    start: bytes
    stop: bytes
    parser: type[LdsParser] | type[RplidarParser]


MODELS: dict[LidarModel, LidarCommands] = {
    "lds01": LidarCommands(230400, b"b", b"e", LdsParser),
    "rplidar_a1": LidarCommands(115200, b"\xa5\x20", b"\xa5\x25", RplidarParser),
}


class Lidar(DeviceDriver):
    """Read the scans of a USB lidar: LDS-01 or RPLIDAR A1.

    A turn with damaged or missing parts is dropped. These devices report an object that is
    too near to be measured (LDS-01: 12 cm, RPLIDAR A1: 15 cm) as free space: mount them where the
    robot itself keeps that distance. A scan is stamped when its turn is complete.

    sources:
      lidar: {driver: lidar, with: {device: /dev/ttyUSB1, model: rplidar_a1}}
    """

    device = Param(str, help="Path of the serial port, best one in /dev/serial/by-id.")
    model: LidarModel = Choice(LidarModel, help="Model of the lidar.")

    scan = Out(Scan, help="One whole turn, 5 to 6 times a second.")

    poll_period = 0.02  # the first request, and its repetition
    start_timeout = 12.0  # s; from cold, the motor needs up to 8 s to its speed

    def __init__(self, **values: object) -> None:
        super().__init__(**values)
        self.commands = MODELS[self.model]
        self.port: SerialPortDevice | None = None
        self.parser: LidarParser = self.commands.parser()
        self.reported = 0
        self.request_due: int | None = None
        self.has_turned = False

    def open(self) -> int:
        """Open the port and stop what the device did before; `read` starts it."""
        try:
            self.port = SerialPortDevice(self.device, self.commands.baud)
        except RunError as error:
            problem = error.problems[0]
            raise DeviceError(problem.cause, problem.fix) from error
        self.parser, self.reported = self.commands.parser(), 0
        self.request_due, self.has_turned = None, False
        self._set_motor(True)
        self.port.write(self.commands.stop)
        return self.port.fd

    def read(self, now: int) -> list[Reading]:
        """The turns that were completed."""
        assert self.port is not None
        if self.request_due is None:
            self.request_due = now + START_DELAY
        elif not self.has_turned and now >= self.request_due:
            self.port.write(self.commands.start)
            self.request_due = now + START_PERIOD
        turns = self.parser.receive(self.port.read())
        if self.parser.damaged > self.reported:
            self.log.warning(f"{self.parser.damaged - self.reported} damaged turns were dropped")
            self.reported = self.parser.damaged
        self.has_turned = self.has_turned or bool(turns)
        return [Reading("scan", Scan(now, 0.0, 2 * pi / RAYS, turn)) for turn in turns[-1:]]

    def close(self) -> None:
        """Stop the motor and close the port."""
        if self.port is None:
            return
        with suppress(OSError):
            self.port.write(self.commands.stop)
            self._set_motor(False)
        self.port.close()
        self.port = None

    def _set_motor(self, runs: bool) -> None:
        """The adapter of the RPLIDAR drives its motor while DTR is low."""
        assert self.port is not None
        request = termios.TIOCMBIC if runs else termios.TIOCMBIS
        with suppress(OSError):  # a pseudo-terminal has no such line
            fcntl.ioctl(self.port.fd, request, struct.pack("I", termios.TIOCM_DTR))
