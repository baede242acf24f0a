"""Frames of the rosserial wire protocol, version 2: written, and found again in a damaged stream.

A frame is ff fe, the payload's length (16 bits, little endian), 255 less the sum of those two
bytes, the topic's number (16 bits, little endian), the payload, and 255 less the sum of topic and
payload, all sums modulo 256.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import Enum, auto
from typing import NamedTuple

SYNC, VERSION = 0xFF, 0xFE  # the second byte tells protocol 2 (since rosserial 0.5) from others
HEADER_BYTES = 7  # bytes before the payload
OVERHEAD_BYTES = HEADER_BYTES + 1  # and the sum behind it
PAYLOAD_BYTES_MAX = 512  # the client library's buffer on a Mega, the largest it has


class CandidateState(Enum):
    """What is known of bytes that may be a frame."""

    FALSE = auto()
    OPEN = auto()  # more bytes are needed
    COMPLETE = auto()


class RosserialFrame(NamedTuple):
    """One frame whose sums were right."""

    topic: int
    payload: bytes


def encode(topic: int, payload: bytes = b"") -> bytes:
    """The bytes of one frame. Raises struct.error when topic or length exceed 16 bits."""
    length = struct.pack("<H", len(payload))
    body = struct.pack("<H", topic) + payload
    return bytes((SYNC, VERSION)) + length + _check(length) + body + _check(body)


def _check(data: bytes) -> bytes:
    return bytes((255 - sum(data) % 256,))


def any_length(topic: int, length: int) -> bool:
    """A rule for `Decoder` while nothing is known of the topics."""
    return length <= PAYLOAD_BYTES_MAX


class RosserialDecoder:
    """Finds frames in bytes as they come; how the bytes are cut into pieces makes no difference.

    Every ff may start a frame, and all such candidates are followed side by side. So a false header
    never holds back the intact frames that its length claims to contain; when one of them is
    complete, the candidates that began before it were false. `plausible(topic, length)` says
    whether a payload of that length may belong to that topic; what it denies is not waited for.
    """

    def __init__(self, plausible: Callable[[int, int], bool] = any_length) -> None:
        self.plausible = plausible
        self.frames = 0
        self._taken = 0  # bytes that belonged to delivered frames
        self._seen = 0
        self._covered = 0  # position in the stream behind the last delivered frame
        self._buffer = bytearray()  # from the oldest candidate on
        self._starts: list[int] = []  # of the candidates, in the buffer, oldest first

    @property
    def damaged(self) -> int:
        """Bytes thrown away so far: in no intact frame, and in none that may yet become one."""
        waiting = self._seen - max(self._covered, self._seen - len(self._buffer))
        return self._seen - self._taken - waiting

    def clear(self) -> None:
        """Give up what is half read, as after the port was opened again."""
        self._buffer.clear()
        self._starts.clear()

    def feed(self, data: bytes) -> list[RosserialFrame]:
        """Take more bytes of the stream; return the frames that they complete."""
        frames: list[RosserialFrame] = []
        place, end = 0, len(data)
        while place < end:
            size = 0 if self._starts else self._whole(data, place)
            if size:
                self._seen += size
                self._taken += size
                self._covered = self._seen
                self.frames += 1
                body = data[place + 5 : place + size - 1]
                frames.append(RosserialFrame(body[0] | body[1] << 8, body[2:]))
                place += size
                continue
            byte = data[place]
            place += 1
            self._seen += 1
            if byte == SYNC:
                self._starts.append(len(self._buffer))
            elif not self._starts:
                continue
            self._buffer.append(byte)
            frame = self._advance()
            if frame is not None:
                frames.append(frame)
        return frames

    def _whole(self, data: bytes, start: int) -> int:
        """Size of the intact frame that lies in `data` from `start` on, if nothing in it may start
        another; 0 when each byte has to be looked at. Most frames come so, and this costs a fifth.
        """
        if start + OVERHEAD_BYTES > len(data) or data[start] != SYNC or data[start + 1] != VERSION:
            return 0
        length = data[start + 2] | data[start + 3] << 8
        end = start + OVERHEAD_BYTES + length
        if length > PAYLOAD_BYTES_MAX or end > len(data):
            return 0
        if (data[start + 2] + data[start + 3] + data[start + 4]) % 256 != 255:
            return 0
        if data.find(SYNC, start + 1, end) >= 0 or sum(data[start + 5 : end]) % 256 != 255:
            return 0
        topic = data[start + 5] | data[start + 6] << 8
        return OVERHEAD_BYTES + length if self.plausible(topic, length) else 0

    def _advance(self) -> RosserialFrame | None:
        """Let every candidate judge the newest byte; return the frame that it completes."""
        frame = None
        alive: list[int] = []
        for start in self._starts:
            verdict = self._judge(start)
            if verdict is CandidateState.COMPLETE:
                frame = self._deliver(start)
                alive.clear()
            elif verdict is CandidateState.OPEN:
                alive.append(start)
        self._starts = alive
        self._forget()
        return frame

    def _judge(self, start: int) -> CandidateState:
        buffer = self._buffer
        have = len(buffer) - start
        if have < HEADER_BYTES:
            may_fit = have in (1, 3, 6) or self._header_fits(start, have)
            return CandidateState.OPEN if may_fit else CandidateState.FALSE
        length = buffer[start + 2] | buffer[start + 3] << 8
        if have == HEADER_BYTES:
            topic = buffer[start + 5] | buffer[start + 6] << 8
            return CandidateState.OPEN if self.plausible(topic, length) else CandidateState.FALSE
        if have < OVERHEAD_BYTES + length:
            return CandidateState.OPEN
        return (
            CandidateState.COMPLETE
            if sum(buffer[start + 5 :]) % 256 == 255
            else CandidateState.FALSE
        )

    def _header_fits(self, start: int, have: int) -> bool:
        buffer = self._buffer
        if have == 2:
            return buffer[start + 1] == VERSION
        if have == 4:  # a length of -1 reads as 65535 here
            return buffer[start + 2] | buffer[start + 3] << 8 <= PAYLOAD_BYTES_MAX
        return (buffer[start + 2] + buffer[start + 3] + buffer[start + 4]) % 256 == 255

    def _deliver(self, start: int) -> RosserialFrame:
        begin = self._seen - len(self._buffer) + start
        self._taken += self._seen - max(begin, self._covered)
        self._covered = self._seen
        self.frames += 1
        body = self._buffer[start + 5 : -1]
        return RosserialFrame(body[0] | body[1] << 8, bytes(body[2:]))

    def _forget(self) -> None:
        """Drop what lies before the oldest candidate."""
        if not self._starts:
            self._buffer.clear()
        elif self._starts[0]:
            first = self._starts[0]
            del self._buffer[:first]
            self._starts = [start - first for start in self._starts]
