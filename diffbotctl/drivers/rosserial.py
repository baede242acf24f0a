"""Driver of Arduino sketches that use rosserial, with topics of their own."""

from __future__ import annotations

import time
from typing import Any

from diffbotctl.device import DeviceDriver, DeviceError, Reading
from diffbotctl.drivers.serial_port import SerialPortDevice
from diffbotctl.errors import RunError
from diffbotctl.links.rosserial_sketch import SketchBoard
from diffbotctl.messages import STD_MSGS
from diffbotctl.params import Param


class Rosserial(DeviceDriver):
    """Exchange messages with an Arduino sketch that uses rosserial.

    `out` names topics that the sketch publishes, each with its type; `in` topics that it subscribes
    to, each with the wire that is sent there. Types are String, Bool, Int8 to Int64, UInt8 to
    UInt64, Float32, Float64 and Empty of std_msgs. They are compared with what the sketch declares.
    `/front/led` and `frontLed` are `front_led` here. What is published while the board is not
    ready, or lost, is not sent later.

    sources:
      board:
        driver: rosserial
        timeout: 2 s
        with: {device: /dev/ttyACM0, baud: 57600}
        out: {chatter: String}
        in: {servo: one.angle}
    """

    open_kinds = tuple(STD_MSGS.values())
    is_on_demand = True  # many sketches publish only what changes; the link has its own limit
    poll_period = 0.02

    device = Param(str, help="Path of the serial port, best one in /dev/serial/by-id.")
    baud = Param(
        int,
        default=57600,
        choices=(9600, 19200, 38400, 57600, 115200),
        help="Baud rate of the sketch; 57600 unless it sets another one.",
    )

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self.port: SerialPortDevice | None = None
        self.board: SketchBoard | None = None
        self.unsent = b""

    def open(self) -> int:
        """Open the port, which resets most boards; `read` asks the sketch for its topics."""
        try:
            self.port = SerialPortDevice(self.device, self.baud)
        except RunError as error:
            problem = error.problems[0]
            raise DeviceError(problem.cause, problem.fix) from error
        self.board, self.unsent = None, b""
        return self.port.fd

    def read(self, now: int) -> list[Reading]:
        """The messages that have come; answers and waiting messages are sent."""
        assert self.port is not None
        if self.board is None:
            self.board = SketchBoard(self.outputs, self.inputs, self.baud)
            self.board.opened(now)
        was_ready = self.board.is_ready
        messages = self.board.receive(now, self.port.read(), time.time_ns())
        if self.board.is_ready and not was_ready:
            self.log.info("the sketch has named its topics")
        for level, text in self.board.log:
            getattr(self.log, level)(f"the sketch: {text}")
        self.board.log.clear()
        failure = self.board.failure(now)
        if failure is not None:
            raise DeviceError(failure.cause, failure.fix, is_final=failure.is_final)
        self._flush(now)
        return [Reading(name, message) for name, message in messages]

    def write(self, now: int, port: str, message: Any) -> None:
        if self.board is None:
            return
        try:
            self.board.publish(port, message)
        except ValueError as error:
            self.log.warning(f"{port} was not sent: {error}")
        self._flush(now)

    def close(self) -> None:
        self.board = None
        if self.port is not None:
            self.port.close()
            self.port = None

    def _flush(self, now: int) -> None:
        assert self.port is not None and self.board is not None
        while True:
            self.unsent = self.unsent or self.board.send(now)
            if not self.unsent:
                return
            accepted = self.port.write(self.unsent)
            self.unsent = self.unsent[accepted:]
            if self.unsent:
                return  # the port is full
