"""Packets of lidars with a checksum: LDS-01, LDS-02, LD06 and LD19, YDLIDAR X2 and X4.

LDS-01 (HLS-LFCD2): 60 packets a turn of 42 bytes: FA, A0 to DB, speed in 0.1 rpm (2 bytes), six
readings of 6 bytes (intensity, distance in mm, reserved), and twice the checksum: FF minus the sum
of the 40 bytes before.

LDROBOT (LD06, LD19; the LDS-02 alike): packets of 47 bytes: 54 2C, speed in degrees a second, angle
of the first sample in 0.01 degrees, twelve samples (distance in mm, confidence), angle of the last
one, time in ms, CRC-8 with the polynomial 4D.

YDLIDAR: AA 55, type (bit 0: a turn begins; the rest: turns a second times 10, or 0), number of
samples, angle of the first and of the last one (in 1/64 degree, shifted by the check bit 1), the
exclusive or of all other pairs of bytes, and the samples: distances in 1/4 mm.

In all of them the low byte comes first.
"""

from __future__ import annotations

import struct
from math import atan, atan2, degrees, hypot

from diffbotctl.links.lidar_turns import PacketDecoder

LDS01_PACKETS, LDS01_FIRST_INDEX = 60, 0xA0
LDROBOT_SAMPLES = 12
CRC_POLYNOMIAL = 0x4D


class Lds01Decoder(PacketDecoder):
    """Decoder of the LDS-01."""

    sync, header = b"\xfa", 2

    def size_of(self, start: bytes | bytearray) -> int:
        return 42

    def is_valid(self, packet: bytes) -> bool:
        checksum = 0xFF - (sum(packet[:40]) & 0xFF)
        is_index = LDS01_FIRST_INDEX <= packet[1] < LDS01_FIRST_INDEX + LDS01_PACKETS
        return is_index and packet[40] == packet[41] == checksum

    def add(self, packet: bytes) -> None:
        speed = packet[2] | packet[3] << 8
        self.period = 600.0 / speed if speed else None
        first = 6 * (packet[1] - LDS01_FIRST_INDEX)
        for number in range(6):
            at = 6 + 6 * number
            millimetres = packet[at] | packet[at + 1] << 8
            self.turns.add(first + number, millimetres / 1000.0, first + number)


class LdrobotDecoder(PacketDecoder):
    """Decoder of LD06 and LD19."""

    sync, header = b"\x54\x2c", 2

    def size_of(self, start: bytes | bytearray) -> int:
        return 47

    def is_valid(self, packet: bytes) -> bool:
        return crc8(packet) == 0

    def add(self, packet: bytes) -> None:
        speed, first = struct.unpack_from("<HH", packet, 2)
        (last,) = struct.unpack_from("<H", packet, 42)
        self.period = 360.0 / speed if speed else None
        step = (last - first) % 36_000 / (LDROBOT_SAMPLES - 1)
        for number in range(LDROBOT_SAMPLES):
            millimetres, confidence = struct.unpack_from("<HB", packet, 6 + 3 * number)
            self.add_sample((first + number * step) / 100.0 % 360.0, millimetres * bool(confidence))

    def add_sample(self, angle: float, millimetres: int) -> None:
        """Add one sample taken at `angle` (degrees)."""
        self.turns.add(angle, millimetres / 1000.0, angle)


class Lds02Decoder(LdrobotDecoder):
    """Decoder of the LDS-02, whose laser looks past the axis, as its maker's driver states."""

    slope, ahead, aside = 0.11923, 5.9, -20.14  # of the laser's line; mm

    def add_sample(self, angle: float, millimetres: int) -> None:
        x, y = millimetres + self.ahead, millimetres * self.slope + self.aside
        if millimetres:
            self.turns.add(angle, hypot(x, y) / 1000.0, angle - degrees(atan2(y, x)))
        else:
            self.turns.add(angle, 0.0, angle)


class YdlidarDecoder(PacketDecoder):
    """Decoder of YDLIDAR X2 and X4, whose laser is beside the axis."""

    sync, header = b"\xaa\x55", 10
    offset, focus = 21.8, 155.3  # mm; of the correction of angles in the development manuals

    def size_of(self, start: bytes | bytearray) -> int:
        """A packet has any number of samples."""
        return 10 + 2 * start[3]

    def is_valid(self, packet: bytes) -> bool:
        if not packet[3] or not packet[4] & packet[6] & 1:
            return False
        checksum = 0
        for word in struct.unpack(f"<{len(packet) // 2}H", packet):
            checksum ^= word
        return checksum == 0

    def add(self, packet: bytes) -> None:
        kind, count, first, last = struct.unpack_from("<BBHH", packet, 2)
        if kind & 1:
            self.period = 10.0 / (kind >> 1) if kind >> 1 else None
        start = (first >> 1) / 64.0
        span = ((last >> 1) / 64.0 - start) % 360.0
        step = span / (count - 1) if count > 1 and span < 180.0 else 0.0
        for number, quarters in enumerate(struct.unpack_from(f"<{count}H", packet, 10)):
            angle = (start + number * step) % 360.0
            millimetres = quarters / 4.0
            shift = 0.0
            if quarters:
                tangent = self.offset * (self.focus - millimetres) / (self.focus * millimetres)
                shift = degrees(atan(tangent))
            self.turns.add(angle, millimetres / 1000.0, angle + shift)


def crc8(data: bytes) -> int:
    """CRC-8 of LDROBOT; 0 for a packet with its own CRC."""
    crc = 0
    for byte in data:
        crc = _CRC_TABLE[crc ^ byte]
    return crc


def _crc_of(byte: int) -> int:
    for _ in range(8):
        byte = byte << 1 ^ (CRC_POLYNOMIAL | 0x100 if byte & 0x80 else 0)
    return byte


_CRC_TABLE = bytes(map(_crc_of, range(256)))
