"""Frames of two USB lidars: bytes in, whole turns out.

LDS-01 (HLS-LFCD2): 230400 baud. `b` starts it, `e` stops it. Each turn is sent as 60 packets of 42
bytes: 0xFA, 0xA0 to 0xDB, speed (2 bytes), six readings of 6 bytes (intensity, distance in mm,
reserved; the low byte first), and the checksum twice: 0xFF minus the sum of the 40 bytes before.
Public descriptions of the sum differ, so only its repetition is checked, with the order of packets.

RPLIDAR A1: 115200 baud. A5 20 starts it, A5 25 stops it. The answer begins with the descriptor
A5 5A 05 00 00 40 81; then each sample has 5 bytes: quality with the start bit S and its complement,
angle in 1/64 degree with the check bit 1, distance in 1/4 mm; the low byte first.

Both count their angles clockwise from the front, seen from above, and send 0 where they measured
nothing. A turn with a missing part is dropped, because an obstacle in that part would vanish.
"""

from __future__ import annotations

from math import inf
from typing import Protocol

RAYS = 360
LDS_PACKET_BYTES = 42
LDS_PACKETS = 60
LDS_SYNC, LDS_FIRST_INDEX = 0xFA, 0xA0
RPLIDAR_DESCRIPTOR = bytes.fromhex("a55a0500004081")
RPLIDAR_SAMPLE_BYTES = 5
RPLIDAR_GAP_MAX = 10  # rays without a sample; at 2000 samples a second one comes for each ray

Distances = tuple[float, ...]


class LidarParser(Protocol):
    """Collects bytes into turns."""

    damaged: int

    def receive(self, data: bytes) -> list[Distances]:
        """The whole turns that `data` completes: RAYS distances in m, from the front
        counter-clockwise; inf where nothing was measured."""


class LdsParser:
    """Parser of the LDS-01. `damaged` counts turns that were dropped."""

    def __init__(self) -> None:
        self.buffer = bytearray()
        self.turn: list[float] = []
        self.damaged = 0

    def receive(self, data: bytes) -> list[Distances]:
        """As LidarParser.receive."""
        self.buffer += data
        turns: list[Distances] = []
        while (start := self.buffer.find(LDS_SYNC)) >= 0:
            del self.buffer[:start]
            if len(self.buffer) < LDS_PACKET_BYTES:
                break
            packet = bytes(self.buffer[:LDS_PACKET_BYTES])
            if not _is_lds_packet(packet):
                del self.buffer[0]
                continue
            del self.buffer[:LDS_PACKET_BYTES]
            if self._add(packet):
                turns.append(counter_clockwise(self.turn))
                self.turn = []
        else:
            self.buffer.clear()  # without a sync byte no packet begins here
        return turns

    def _add(self, packet: bytes) -> bool:
        """Add a packet; True when it completes a turn."""
        number = packet[1] - LDS_FIRST_INDEX
        if number * 6 != len(self.turn):  # one is missing
            self.damaged += bool(self.turn)
            self.turn = []
            if number:
                return False
        for at in range(4, 40, 6):
            millimetres = packet[at + 2] | packet[at + 3] << 8
            self.turn.append(millimetres / 1000.0 if millimetres else inf)
        return number == LDS_PACKETS - 1


def _is_lds_packet(packet: bytes) -> bool:
    is_index = LDS_FIRST_INDEX <= packet[1] < LDS_FIRST_INDEX + LDS_PACKETS
    return is_index and packet[40] == packet[41]


class RplidarParser:
    """Parser of the RPLIDAR A1. `damaged` counts turns that were dropped."""

    def __init__(self) -> None:
        self.buffer = bytearray()
        self.is_scanning = False  # the descriptor has come
        self.turn = _Turn()
        self.has_begun = False  # whether the present turn was seen from its start
        self.damaged = 0

    def receive(self, data: bytes) -> list[Distances]:
        """As LidarParser.receive."""
        self.buffer += data
        if not self.is_scanning and not self._find_descriptor():
            return []
        turns: list[Distances] = []
        at = 0
        while len(self.buffer) - at >= RPLIDAR_SAMPLE_BYTES:
            first, angle_low = self.buffer[at], self.buffer[at + 1]
            if (first & 1) == (first >> 1 & 1) or not angle_low & 1:
                at += 1
                self.turn.is_damaged = True
                continue
            if first & 1:
                self._finish(turns)
            angle = (angle_low >> 1 | self.buffer[at + 2] << 7) / 64.0
            quarters = self.buffer[at + 3] | self.buffer[at + 4] << 8
            self.turn.add(angle, quarters / 4000.0 if quarters else inf)
            at += RPLIDAR_SAMPLE_BYTES
        del self.buffer[:at]
        return turns

    def _find_descriptor(self) -> bool:
        start = self.buffer.find(RPLIDAR_DESCRIPTOR)
        if start < 0:
            del self.buffer[: -len(RPLIDAR_DESCRIPTOR)]
            return False
        del self.buffer[: start + len(RPLIDAR_DESCRIPTOR)]
        self.is_scanning = True
        return True

    def _finish(self, turns: list[Distances]) -> None:
        """A new turn begins; the one before is complete."""
        if self.has_begun:
            if self.turn.is_whole():
                turns.append(counter_clockwise(self.turn.rays))
            else:
                self.damaged += 1
        self.turn, self.has_begun = _Turn(), True


class _Turn:
    """One turn of the RPLIDAR: the nearest distance for each degree, clockwise."""

    def __init__(self) -> None:
        self.rays = [inf] * RAYS
        self.last_ray = 0
        self.is_damaged = False

    def add(self, degrees: float, distance: float) -> None:
        ray = round(degrees) % RAYS
        step = (ray - self.last_ray) % RAYS
        if RPLIDAR_GAP_MAX < step < RAYS // 2:  # a step back by a ray or two is jitter
            self.is_damaged = True
        if step < RAYS // 2:
            self.last_ray = ray
        self.rays[ray] = min(self.rays[ray], distance)

    def is_whole(self) -> bool:
        return not self.is_damaged and -self.last_ray % RAYS <= RPLIDAR_GAP_MAX


def counter_clockwise(rays: list[float]) -> Distances:
    """Distances in the order of REP-103, from those of a turn clockwise."""
    return (rays[0], *reversed(rays[1:]))
