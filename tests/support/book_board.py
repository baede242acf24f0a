"""The device half of rosserial as the book's board behaves, written from the protocol's facts.

It shares no code with the host. In virtual time: `run(until)` lets it work, `take(data)` hands
it bytes with the time they arrive, and what it sends comes out with times, paced at 9600 baud. Its
motors turn wheels that count, so that ticks follow commands.
"""

import math
import os
import struct
import threading
import time
import tty
from collections.abc import Callable
from typing import Any

from tests.support.background import BackgroundDevice

BYTE = 1 / 960.0  # s
TYPES = {
    "i": ("std_msgs/Int32", "da5909fbe378aeaf85e547e830cc1bb7"),
    "f": ("std_msgs/Float32", "73fcbf46b49191e672908e50842a83d4"),
    "b": ("std_msgs/Bool", "8b94c1b53db61fb6aed406028ad6332a"),
}
PUBLISHERS = [(125, "left_ticks", "i"), (126, "right_ticks", "i"), (127, "obstacle_distance", "f")]
SUBSCRIBERS = [(100, "set_left_speed", "i"), (101, "set_right_speed", "i"), (102, "reset", "b")]
PERIOD = 0.0606  # s between two reports
FASTEST = 33.3  # counts a second at full PWM
DISTANCE_STEP = 0.15  # cm, one step of the converter at 20 cm
# Options of a run on it; unproven motors would drive slowly.
STOCK = ("--robot", "book_2wd_stock", "--set", "robot.drive.polarity=checked_by_hand")


def frame(topic: int, payload: bytes) -> bytes:
    size = len(payload)
    check = 255 - (size % 256 + size // 256) % 256
    total = 255 - (topic % 256 + topic // 256 + sum(payload)) % 256
    return bytes([255, 254, size % 256, size // 256, check, topic % 256, topic // 256]) + (
        payload + bytes([total])
    )


def text(words: str) -> bytes:
    return struct.pack("<I", len(words)) + words.encode()


class BookBoard:
    """A board, its two wheels and its half of the line."""

    def __init__(self, distance: float = 20.0, lag: float = 0.1) -> None:
        self.now = 0.0
        self.distance, self.lag = distance, lag
        self.is_step_up = False
        self.pwm = {"left": 0, "right": 0}
        self.speed = {"left": 0.0, "right": 0.0}  # counts a second, forward positive
        self.place = {"left": 0.3, "right": 0.6}
        self.commands: list[tuple[float, str, int]] = []  # (time, wheel, value) as accepted
        self.configured = False
        self.time_answered = 0.0
        self.next_report = self.next_sync = 0.0
        self.line_free = 0.0
        # (time when its last byte has arrived, bytes, kind)
        self.out: list[tuple[float, bytes, str]] = []
        self.inbox = bytearray()

    def restart(self) -> None:
        """The board loses its power for a moment: everything it knew is gone."""
        self.pwm = {"left": 0, "right": 0}
        self.place = {"left": 0.5, "right": 0.5}
        self.configured = False
        self.inbox.clear()

    def take(self, data: bytes) -> None:
        """Bytes from the host have arrived."""
        self.inbox += data
        while len(self.inbox) >= 8:
            if self.inbox[:2] != b"\xff\xfe":
                del self.inbox[0]
                continue
            size = self.inbox[2] + 256 * self.inbox[3]
            if self.inbox[4] != 255 - (self.inbox[2] + self.inbox[3]) % 256 or size > 512:
                del self.inbox[0]
                continue
            if len(self.inbox) < size + 8:
                return
            body = bytes(self.inbox[5 : size + 7])
            if self.inbox[size + 7] != 255 - sum(body) % 256:
                del self.inbox[0]
                continue
            del self.inbox[: size + 8]
            self.handle(body[0] + 256 * body[1], body[2:])

    def handle(self, topic: int, payload: bytes) -> None:
        if topic == 0:
            self.negotiate()
        elif topic == 10:
            self.time_answered = self.now
        elif topic in (100, 101) and len(payload) == 4:
            wheel = "left" if topic == 100 else "right"
            value = struct.unpack("<i", payload)[0]
            self.commands.append((self.now, wheel, value))
            self.pwm[wheel] = max(-255, min(255, value))

    def negotiate(self) -> None:
        self.send(frame(10, bytes(8)), "time")
        for kind, topics in ((0, PUBLISHERS), (1, SUBSCRIBERS)):
            for number, name, code in topics:
                about = struct.pack("<H", number) + text(name)
                about += text(TYPES[code][0]) + text(TYPES[code][1]) + struct.pack("<i", 512)
                self.send(frame(kind, about), "topic")
        self.configured = True
        self.time_answered = self.next_report = self.now
        self.next_sync = self.now + 2.5

    def send(self, data: bytes, kind: str) -> None:
        self.line_free = max(self.line_free, self.now) + len(data) * BYTE
        self.out.append((self.line_free, data, kind))

    def run(self, until: float) -> None:
        """Let time pass."""
        while self.now < until - 1e-12:
            step = min(0.005, until - self.now)
            self.turn(step)
            self.now += step
            if not self.configured:
                continue
            if self.now - self.time_answered > 11.0:
                self.configured = False
                continue
            if self.now >= self.next_sync:
                self.next_sync += 2.5
                self.send(frame(10, bytes(8)), "time")
            if self.now >= self.next_report and self.line_free <= self.now:
                self.next_report = max(self.next_report + PERIOD, self.now)
                self.report()

    def turn(self, step: float) -> None:
        fade = math.exp(-step / self.lag)
        for wheel, pwm in self.pwm.items():
            goal = 0.0 if abs(pwm) < 25 else pwm / 255 * FASTEST
            self.speed[wheel] = goal + (self.speed[wheel] - goal) * fade
            self.place[wheel] += self.speed[wheel] * step

    def count(self, wheel: str) -> int:
        return (math.floor(self.place[wheel]) + 32768) % 65536 - 32768

    def report(self) -> None:
        self.send(frame(125, struct.pack("<i", self.count("left"))), "ticks")
        self.send(frame(126, struct.pack("<i", self.count("right"))), "ticks")
        # The converter of the board steps to and fro by one; a constant voltage is a faulty sensor.
        self.is_step_up = not self.is_step_up
        distance = self.distance + DISTANCE_STEP * self.is_step_up
        self.send(frame(127, struct.pack("<f", distance)), "range")

    def arrived(self, now: float) -> list[tuple[float, bytes, str]]:
        """Everything whose last byte has arrived by `now`."""
        ready = [item for item in self.out if item[0] <= now]
        self.out = self.out[len(ready) :]
        return ready


class BookBoardPort(BackgroundDevice):
    """The device on a pseudo-terminal, in real time. `device` is its name for the host."""

    def __init__(self, device: BookBoard | None = None) -> None:
        self.board = device or BookBoard()
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.name = os.ttyname(slave)
        self.slave = slave  # kept open, so that a host may come and go
        os.set_blocking(self.master, False)
        self.cut = False
        self.changed = threading.Condition()
        self.begin()

    def live(self) -> None:
        began = time.monotonic()
        while not self.over.wait(0.002):
            with self.changed:
                self.board.run(time.monotonic() - began)
                try:
                    data = os.read(self.master, 4096)
                except BlockingIOError:
                    data = b""
                if not self.cut:
                    self.board.take(data)
                for _, sent, _ in self.board.arrived(self.board.now):
                    if not self.cut:
                        os.write(self.master, sent)
                self.changed.notify_all()

    def wait_for(self, holds: Callable[[Any], object], seconds: float) -> None:
        """Wait until `holds(board)`; fail when it has not come true in time."""
        with self.changed:
            assert self.changed.wait_for(lambda: holds(self.board), seconds), "it never came true"

    def let_go(self) -> None:
        os.close(self.master)
        os.close(self.slave)
