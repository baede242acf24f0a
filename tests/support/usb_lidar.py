"""A lidar at a pseudo-terminal: sends turns as its manual describes, at its own baud rate."""

from __future__ import annotations

import fcntl
import os
import select
import struct
import threading
import tty
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import atan, degrees

from diffbotctl.geometry.lidars import LIDARS

DEGREES = 360
TURN_PERIOD_S = 0.18  # 5.5 turns a second
SCAN_DESCRIPTOR = bytes.fromhex("a5 5a 05 00 00 40 81")
HEALTH_DESCRIPTOR = bytes.fromhex("a5 5a 03 00 00 00 06")
TERMIOS2, TCGETS2 = struct.Struct("4I B 19s 2I"), 0x802C542A


def lds01_turn(distances: Sequence[float]) -> bytes:
    """One turn of the LDS-01: `distances` in m, clockwise by degree; 0 where nothing was seen."""
    packets = []
    for number in range(60):
        packet = struct.pack("<BBH", 0xFA, 0xA0 + number, 3000)
        for distance in distances[6 * number : 6 * number + 6]:
            packet += struct.pack("<HHH", 200, round(1000 * distance), 0)
        checksum = (0xFF - sum(packet)) & 0xFF
        packets.append(packet + bytes([checksum, checksum]))
    return b"".join(packets)


def ldrobot_turn(distances: Sequence[float], samples: int = 36 * 12, speed: int = 3600) -> bytes:
    """One turn of LD06, LD19 or LDS-02, as `lds01_turn`; `speed` in degrees a second."""
    packets = []
    for first in range(0, samples, 12):
        angles = [DEGREES * (first + number) / samples for number in range(12)]
        packet = struct.pack("<BBHH", 0x54, 0x2C, speed, round(100 * angles[0]))
        for angle in angles:
            packet += struct.pack("<HB", round(1000 * distances[int(angle)]), 228)
        packet += struct.pack("<HH", round(100 * angles[-1]), 6714)
        packets.append(packet + bytes([crc8(packet)]))
    return b"".join(packets)


def crc8(data: bytes) -> int:
    """CRC-8 with the polynomial 0x4D, bit by bit."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x4D if crc & 0x80 else 0)) & 0xFF
    return crc


def rplidar_turn(distances: Sequence[float]) -> bytes:
    """One turn of the RPLIDAR A1 or C1, as `lds01_turn`."""
    samples = []
    for degree, distance in enumerate(distances):
        is_first = degree == 0
        angle = 64 * degree
        quality = 15 << 2 | (not is_first) << 1 | is_first
        samples.append(
            struct.pack(
                "<BBBH", quality, (angle & 0x7F) << 1 | 1, angle >> 7, round(4000 * distance)
            )
        )
    return b"".join(samples)


def ydlidar_turn(distances: Sequence[float], samples: int = 480) -> bytes:
    """One turn of the YDLIDAR X2 or X4, as `lds01_turn`: a packet of one sample, then of 40 each.

    The angle of a sample is that of its object less the correction of the manual.
    """
    packets = [ydlidar_packet(1, [0.0], [0])]
    for first in range(0, samples, 40):
        angles = [DEGREES * (first + number) / samples for number in range(40)]
        # The direction in which the object is seen; the laser is beside the axis.
        seen = [
            distances[round(angle + shift(distances[int(angle)])) % DEGREES] for angle in angles
        ]
        packets.append(ydlidar_packet(0, angles, [round(4000 * distance) for distance in seen]))
    return b"".join(packets)


def shift(distance: float) -> float:
    """Degrees by which the object is farther clockwise than the angle of its sample."""
    far = 1000 * distance
    return degrees(atan(21.8 * (155.3 - far) / (155.3 * far))) if far else 0.0


def ydlidar_packet(kind: int, angles: Sequence[float], quarters: Sequence[int]) -> bytes:
    """One packet; `angles` in degrees, `quarters` in 1/4 mm."""
    first, last = (round(64 * angle) << 1 | 1 for angle in (angles[0], angles[-1]))
    words = [0x55AA, len(quarters) << 8 | kind, first, last]
    checksum = 0
    for word in (*words, *quarters):
        checksum ^= word
    return struct.pack(f"<5H{len(quarters)}H", *words, checksum, *quarters)


def lds02_turn(distances: Sequence[float]) -> bytes:
    """One turn of the LDS-02."""
    return ldrobot_turn(distances, samples=38 * 12, speed=1800)


PROTOCOL_TURNS = {
    "lds01": lds01_turn,
    "lds02": lds02_turn,
    "ldrobot": ldrobot_turn,
    "rplidar": rplidar_turn,
    "ydlidar": ydlidar_turn,
}


def turn_of(model: str, distances: Sequence[float]) -> bytes:
    """One turn of a model, as `lds01_turn`."""
    return PROTOCOL_TURNS[LIDARS[model].protocol](distances)


class UsbLidar:
    """Sends `distances` turn after turn, once it was started where it needs that.

    `device` is its port. `distances` may be a function, which is called for each turn. `health`:
    status and error code of its answer. `power_up`: what it sends first of all.
    """

    def __init__(
        self,
        model: str,
        distances: Sequence[float] | Callable[[], Sequence[float]] = (2.0,) * DEGREES,
        health: tuple[int, int] = (0, 0),
        power_up: bytes = b"",
    ) -> None:
        self.facts = LIDARS[model]
        self.model, self.distances, self.health = model, distances, health
        self.power_up = power_up
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        self.slave = slave  # open until somebody else has opened it
        self.is_silent = threading.Event()
        self.over = threading.Event()
        self.requests = b""
        self.logged: list[tuple[int, str, str]] = []  # by a driver without an engine
        self.is_started = not self.facts.start
        self.periods = 0
        """of a turn, that have passed for it"""
        self.damage: Callable[[bytes], bytes] | None = None  # a function of the bytes of a turn
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def unplug(self) -> None:
        """End it, and hang up."""
        self.over.set()
        self.thread.join()
        os.close(self.slave)
        os.close(self.master)

    def baud(self) -> int:
        """The rate at which the host listens."""
        settings = TERMIOS2.unpack(fcntl.ioctl(self.master, TCGETS2, bytes(TERMIOS2.size)))
        return int(settings[-1])

    def _run(self) -> None:
        self._send(self.power_up)
        while not self.over.wait(TURN_PERIOD_S):
            self.periods += 1
            self._answer()
            if self.is_started and not self.is_silent.is_set():
                seen = self.distances() if callable(self.distances) else self.distances
                turn = turn_of(self.model, seen)
                self._send(self.damage(turn) if self.damage else turn)

    def _answer(self) -> None:
        if not select.select([self.master], [], [], 0)[0]:
            return
        data = os.read(self.master, 1000)
        if self.baud() != self.facts.baud:
            return  # it understands nothing
        self.requests += data
        request = {name: bytes.fromhex(getattr(self.facts, name)) for name in ("health", "start")}
        if request["health"] and request["health"] in data:
            status, code = self.health
            self._send(HEALTH_DESCRIPTOR + struct.pack("<BH", status, code))
        if request["start"] and request["start"] in data and self.health[0] < 2:
            self.is_started = True
            self._send(SCAN_DESCRIPTOR if self.facts.protocol in ("rplidar", "ydlidar") else b"")

    def _send(self, data: bytes) -> None:
        baud = self.baud()
        if baud != self.facts.baud:
            data = at_other_rate(data, self.facts.baud, baud)
        # What is left when the host changes its rate is lost there.
        while data and not self.over.is_set() and self.baud() == baud:
            if select.select([], [self.master], [], TURN_PERIOD_S)[1]:
                with suppress(OSError):
                    data = data[os.write(self.master, data[:512]) :]


def at_other_rate(data: bytes, sent: int, read: int) -> bytes:
    """The bytes that a receiver at `read` baud finds in those sent at `sent` baud.

    Each is a start bit, eight bits from the lowest on, and a stop bit; the line rests high.
    """
    line = [bit for byte in data for bit in (0, *(byte >> n & 1 for n in range(8)), 1)]
    found, at, ratio = bytearray(), 0.0, sent / read
    while (start := int(at)) < len(line):
        if line[start]:
            at += 0.25
            continue
        bits = [line[min(int(start + (n + 1.5) * ratio), len(line) - 1)] for n in range(8)]
        found.append(sum(bit << n for n, bit in enumerate(bits)))
        at = start + 9.5 * ratio
    return bytes(found)
