"""How to stop a rosserial board whose host has died or does not run. Sans-IO.

The process that does it knows nothing of the run: it gets a StopOrder while all is well. The bytes
that the host wrote last may have been cut anywhere, so the board may be waiting for the rest of a
frame, and would take the first stop for that rest: `filler` brings its parser back to the start.
"""

from __future__ import annotations

import struct
from typing import NamedTuple, Self

from diffbotctl.links.rosserial_frames import (
    HEADER_BYTES,
    PAYLOAD_BYTES_MAX,
    SYNC,
    VERSION,
    RosserialDecoder,
)
from diffbotctl.time import MILLISECOND

STANDSTILL_TIME = 500 * MILLISECOND  # without a new count, while both wheels' ticks arrive
WRITTEN_BYTES_MAX = 64  # of the bytes that were written last; the kernel holds no more unsent ones
TICKS = struct.Struct("<i")
ORDER = struct.Struct("<HH")


class StopOrder(NamedTuple):
    """What stops one board: frames with zero for both wheels, and its topics of the counts."""

    frames: bytes
    left_ticks: int
    right_ticks: int

    def pack(self) -> bytes:
        return ORDER.pack(self.left_ticks, self.right_ticks) + self.frames

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """The order of these bytes. Raises struct.error when they are too few."""
        return cls(data[ORDER.size :], *ORDER.unpack_from(data))


class BoardParser:
    """The parser of the board's client library: it follows one frame candidate, never two.

    It has no timeout here, as in versions of the library before 0.7.
    """

    def __init__(self) -> None:
        self.bytes = bytearray()  # of the frame under way

    def copy(self) -> BoardParser:
        """A parser in the same state."""
        other = BoardParser()
        other.bytes[:] = self.bytes
        return other

    def feed(self, data: bytes) -> int:
        """Take bytes; returns the number of frames that were accepted."""
        return sum(self._take(byte) for byte in data)

    @property
    def is_waiting(self) -> bool:
        """True when the next byte starts a frame or is discarded."""
        return not self.bytes

    def _take(self, byte: int) -> bool:
        frame = self.bytes
        frame.append(byte)
        size = len(frame)
        length = frame[2] | frame[3] << 8 if size > 3 else 0
        is_false = (
            (size == 1 and byte != SYNC)
            or (size == 2 and byte != VERSION)
            or (size == 5 and sum(frame[2:5]) % 256 != 255)
            or (size == 5 and length > PAYLOAD_BYTES_MAX)
        )
        is_whole = size > HEADER_BYTES and size == HEADER_BYTES + length + 1
        accepted = is_whole and sum(frame[5:]) % 256 == 255
        if is_false or is_whole:
            frame.clear()
        return accepted


def filler(written: bytes) -> bytes:
    """Bytes after which the board waits for a frame, wherever `written` was cut off.

    They complete no frame of it: its sum of 8 bits could pass by chance, with a wrong value. If
    every filler would do that for some cut, zeros.
    """
    parser, cuts = BoardParser(), [BoardParser()]
    for place in range(len(written)):
        parser.feed(written[place : place + 1])
        cuts.append(parser.copy())
    cuts = [cut for cut in cuts if not cut.is_waiting]
    if not cuts:
        return b""
    length = max(_missing(cut) for cut in cuts)
    for value in range(SYNC):
        data = bytes((value,)) * length
        if not any(_spoils(cut, data) for cut in cuts):
            return data
    return bytes(length)


def _missing(cut: BoardParser) -> int:
    """Bytes until the frame of this cut is complete, at least until its header is."""
    have = cut.bytes
    length = have[2] | have[3] << 8 if len(have) > 4 else 0
    return HEADER_BYTES + length + 1 - len(have)


def _spoils(cut: BoardParser, data: bytes) -> bool:
    parser = cut.copy()
    return parser.feed(data) > 0 or not parser.is_waiting


class StandstillDetector:
    """Detects in a board's telemetry that both wheels stand."""

    def __init__(self, order: StopOrder) -> None:
        self.decoder = RosserialDecoder()
        self.counts: dict[int, int | None] = {order.left_ticks: None, order.right_ticks: None}
        self.moved_at = 0  # when a count was new, or the first one of both arrived
        self.arrived_at = 0  # of the newest counts

    def receive(self, now: int, data: bytes) -> None:
        """Take bytes from the board at `now` (ns)."""
        for topic, payload in self.decoder.feed(data):
            if topic not in self.counts or len(payload) != TICKS.size:
                continue
            (count,) = TICKS.unpack(payload)
            self.arrived_at = now
            if self.counts[topic] != count:
                self.counts[topic], self.moved_at = count, now

    @property
    def stands(self) -> bool:
        """True when the newest counts of both wheels are equal to those STANDSTILL_TIME before."""
        is_known = None not in self.counts.values()
        return is_known and self.arrived_at - self.moved_at >= STANDSTILL_TIME
