"""Samples and packets of lidars: what the decoders of all protocols have in common.

A lidar counts its angles clockwise, seen from above, and sends 0 where it measured nothing. A turn
with a missing part is dropped, because an obstacle in that part would vanish.
"""

from __future__ import annotations

from math import inf
from typing import ClassVar, Protocol

# Degrees between two samples; a larger step means that some are lost. The largest of a whole turn
# is 1.8: an RPLIDAR A1, 2000 samples a second at 10 turns a second.
STEP_MAX = 3.0
SURE_PACKETS = 3  # valid by chance is one sequence of bytes in 16 million, or fewer
SCAN_ANSWER = bytes.fromhex("a55a0500004081")
HEALTH_ANSWER = bytes.fromhex("a55a0300000006")  # then the status, and two bytes of error code

Distances = tuple[float, ...]


class TurnCollector:
    """Collects samples into whole turns of `rays` equally spaced rays.

    `damaged` counts turns that were dropped. The turn during which the first sample came counts
    only if it was seen from its start.
    """

    def __init__(self, rays: int) -> None:
        self.rays = rays
        self.damaged = 0
        self.turns: list[Distances] = []  # until they are taken
        self.angle: float | None = None  # degrees, of the last sample
        self.position = 0.0  # degrees of the present turn that have passed; a jump may go below 0
        self.is_whole = False
        self.bins: list[float | None] = [None] * rays

    def add(self, angle: float, distance: float, bearing: float) -> None:
        """A sample taken at `angle` (degrees); the object is `distance` (m) away at `bearing`.

        The two differ where the laser is not on the axis. A distance of 0: nothing measured.
        """
        if self.angle is None:
            self.is_whole = angle <= STEP_MAX
            self.position = angle
        else:
            step = (angle - self.angle + 180.0) % 360.0 - 180.0
            if not -STEP_MAX <= step <= STEP_MAX:
                self.lose()
            self.position += step
            if self.position >= 360.0:
                self._finish()
        self.angle = angle
        ray = round(bearing * self.rays / 360.0) % self.rays
        nearest, distance = self.bins[ray], distance or inf
        self.bins[ray] = distance if nearest is None else min(nearest, distance)

    def lose(self) -> None:
        """Note that a part of the present turn is missing."""
        self.damaged += self.is_whole
        self.is_whole = False

    def take(self) -> list[Distances]:
        """The turns that are complete, from the zero angle clockwise; inf: nothing measured."""
        turns, self.turns = self.turns, []
        return turns

    def _finish(self) -> None:
        if self.is_whole:
            self.turns.append(_without_gaps(self.bins))
        self.position -= 360.0
        self.is_whole = self.position <= STEP_MAX
        self.bins = [None] * self.rays


def _without_gaps(bins: list[float | None]) -> Distances:
    """The distances; a ray without a sample gets the nearer one of its neighbours'."""
    count = len(bins)
    for ray in [ray for ray, distance in enumerate(bins) if distance is None]:
        after = ray
        while (following := bins[after % count]) is None:
            after += 1
        before = bins[ray - 1]  # filled already, or the last ray of the turn
        bins[ray] = following if before is None else min(before, following)
    return tuple(distance if distance is not None else inf for distance in bins)


class LidarDecoder(Protocol):
    """Bytes of a lidar in, whole turns out."""

    turns: TurnCollector
    packets: int  # valid ones so far
    period: float | None
    """s; time of a turn by the lidar's own measurement; None: it does not send that"""

    def receive(self, data: bytes) -> list[Distances]:
        """The turns that `data` completes, as TurnCollector.take."""


class PacketDecoder:
    """Base of decoders of packets that begin with `sync` and have a checksum."""

    sync: ClassVar[bytes]
    header: ClassVar[int]  # bytes from which the size of a packet is known

    def __init__(self, rays: int) -> None:
        self.turns = TurnCollector(rays)
        self.packets = 0
        self.period: float | None = None
        self.buffer = bytearray()

    def receive(self, data: bytes) -> list[Distances]:
        self.buffer += data
        while True:
            start = self.buffer.find(self.sync)
            if start < 0:
                del self.buffer[: 1 - len(self.sync) or None]
                break
            del self.buffer[:start]
            if len(self.buffer) < self.header or len(self.buffer) < self.size_of(self.buffer):
                break
            packet = bytes(self.buffer[: self.size_of(self.buffer)])
            if not self.is_valid(packet):
                del self.buffer[0]
                continue
            del self.buffer[: len(packet)]
            self.packets += 1
            self.add(packet)
        return self.turns.take()

    def size_of(self, start: bytes | bytearray) -> int:
        """Bytes of the packet that begins with `start`."""
        raise NotImplementedError

    def is_valid(self, packet: bytes) -> bool:
        """Whether checksum and fields of a packet fit."""
        raise NotImplementedError

    def add(self, packet: bytes) -> None:
        raise NotImplementedError


class LidarAnswers:
    """Finds the answers to requests of RPLIDAR and YDLIDAR among what else they send."""

    def __init__(self) -> None:
        self.has_started = False  # it has answered the request to start
        self.status: int | None = None  # of its health: 0 good, 1 warning, 2 fault
        self.code = 0
        self.tail = b""

    def receive(self, data: bytes) -> None:
        """Search `data`, which follows that of the last call."""
        data = self.tail + data
        self.has_started = self.has_started or SCAN_ANSWER in data
        health = data.find(HEALTH_ANSWER) + len(HEALTH_ANSWER)
        if health >= len(HEALTH_ANSWER) and len(data) >= health + 3:
            self.status = data[health]
            self.code = int.from_bytes(data[health + 1 : health + 3], "little")
        self.tail = data[-len(HEALTH_ANSWER) - 2 :]
