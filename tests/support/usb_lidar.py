"""A USB lidar at a pseudo-terminal: sends turns as an LDS-01 or an RPLIDAR A1 does."""

from __future__ import annotations

import os
import select
import struct
import threading
import tty
from collections.abc import Callable, Sequence
from contextlib import suppress

from diffbotctl.links.lidar_frames import (
    LDS_FIRST_INDEX,
    LDS_PACKETS,
    LDS_SYNC,
    RAYS,
    RPLIDAR_DESCRIPTOR,
)

TURN_PERIOD_S = 0.18  # 5.5 turns a second
START = {"lds01": b"b", "rplidar_a1": b"\xa5\x20"}


def lds_turn(distances: Sequence[float]) -> bytes:
    """One turn of the LDS-01: `distances` in m, clockwise by degree; 0 where nothing was seen."""
    packets = []
    for number in range(LDS_PACKETS):
        packet = struct.pack("<BBH", LDS_SYNC, LDS_FIRST_INDEX + number, 3000)
        for distance in distances[6 * number : 6 * number + 6]:
            packet += struct.pack("<HHH", 200, round(1000 * distance), 0)
        checksum = (0xFF - sum(packet)) & 0xFF
        packets.append(packet + bytes([checksum, checksum]))
    return b"".join(packets)


def rplidar_turn(distances: Sequence[float]) -> bytes:
    """One turn of the RPLIDAR A1, as `lds_turn`."""
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


TURNS = {"lds01": lds_turn, "rplidar_a1": rplidar_turn}


class UsbLidar:
    """Sends `distances` turn after turn once it was started; `device` is its port.

    `distances` may be a function, which is called for each turn.
    """

    def __init__(
        self, model: str, distances: Sequence[float] | Callable[[], Sequence[float]] = (2.0,) * RAYS
    ) -> None:
        self.model, self.distances = model, distances
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        self.slave = slave  # open until somebody else has opened it
        self.is_silent = threading.Event()
        self.over = threading.Event()
        self.requests = b""
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def unplug(self) -> None:
        """End it, and hang up."""
        self.over.set()
        self.thread.join()
        os.close(self.slave)
        os.close(self.master)

    def _run(self) -> None:
        is_started = False
        while not self.over.wait(TURN_PERIOD_S):
            if select.select([self.master], [], [], 0)[0]:
                self.requests += os.read(self.master, 100)
            if not is_started and START[self.model] in self.requests:
                is_started = True
                self._send(RPLIDAR_DESCRIPTOR if self.model == "rplidar_a1" else b"")
            if is_started and not self.is_silent.is_set():
                seen = self.distances() if callable(self.distances) else self.distances
                self._send(TURNS[self.model](seen))

    def _send(self, data: bytes) -> None:
        while data and not self.over.is_set():
            if select.select([], [self.master], [], TURN_PERIOD_S)[1]:
                with suppress(OSError):
                    data = data[os.write(self.master, data[:512]) :]
