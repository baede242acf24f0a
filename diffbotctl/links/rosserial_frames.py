"""Frames of rosserial, protocol version 2: bytes in any pieces to frames, and frames to bytes.

ff fe | length, u16 | 255 - (sum of both length bytes) | topic, u16 | payload | 255 - (sum of topic
and payload bytes). Both checks are sums modulo 256. Numbers are little endian.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

SYNC = b"\xff\xfe"
HEAD = struct.Struct("<2sHBH")  # sync, length, its check, topic
BUFFER = 512  # bytes a Mega's library keeps for a message: no frame can be longer


class Frame(NamedTuple):
    """One message of one topic."""

    topic: int
    payload: bytes


def encode(topic: int, payload: bytes) -> bytes:
    """The bytes of one frame. Raises ValueError for a payload that no board could hold."""
    if len(payload) > BUFFER:
        raise ValueError(f"a payload of {len(payload)} bytes is above the buffer of {BUFFER}")
    length = struct.pack("<H", len(payload))
    body = struct.pack("<H", topic) + payload
    return SYNC + length + bytes([_check(length)]) + body + bytes([_check(body)])


def _check(data: bytes) -> int:
    return 255 - sum(data) % 256


class Decoder:
    """Takes bytes as they come; the frames that come out do not depend on how they were split.

    After a false sync the search goes on at the very next byte. A frame that has not ended yet may
    be a false one too: sound frames found behind its head are delivered at once. `lengths` gives
    the payload length of topics that are known to have only one; other heads are false.
    """

    def __init__(self) -> None:
        self.buffer = bytearray()
        self.lengths: dict[int, int] = {}
        self.damaged = 0  # bytes thrown away

    def feed(self, data: bytes) -> list[Frame]:
        """Take `data`; return the frames that are complete now."""
        self.buffer += data
        frames: list[Frame] = []
        start = 0  # where the search begins
        while True:
            at = self.buffer.find(SYNC[0], start)
            if at < 0:
                break
            found = self._frame_at(at)
            if found is None:
                start = at + 1
                continue
            frame, end = found
            frames.append(frame)
            self.damaged += at
            del self.buffer[:end]
            start = 0
        self._forget()
        return frames

    def _frame_at(self, at: int) -> tuple[Frame, int] | None:
        """The sound and complete frame that begins at `at`, and where it ends."""
        if not self._may_begin(at) or len(self.buffer) - at < HEAD.size:
            return None
        _, length, _, topic = HEAD.unpack_from(self.buffer, at)
        end = at + HEAD.size + length + 1
        if end > len(self.buffer):
            return None
        body = bytes(self.buffer[at + HEAD.size - 2 : end - 1])
        if _check(body) != self.buffer[end - 1]:
            return None
        return Frame(topic, body[2:]), end

    def _may_begin(self, at: int) -> bool:
        """True when a frame may begin at `at`, as far as its bytes have come."""
        head = self.buffer[at : at + HEAD.size]
        if head[:2] != SYNC[: len(head[:2])]:
            return False
        if len(head) < 5:
            return True
        length = head[2] + 256 * head[3]
        if head[4] != _check(bytes(head[2:4])) or length > BUFFER:
            return False
        if len(head) < HEAD.size:
            return True
        return self.lengths.get(head[5] + 256 * head[6], length) == length

    def _forget(self) -> None:
        """Drop the bytes before the first place where an unfinished frame may begin."""
        at = 0
        while at < len(self.buffer) and not self._unfinished(at):
            at += 1
        self.damaged += at
        del self.buffer[:at]

    def _unfinished(self, at: int) -> bool:
        if not self._may_begin(at):
            return False
        if len(self.buffer) - at < HEAD.size:
            return True
        _, length, _, _ = HEAD.unpack_from(self.buffer, at)
        return at + HEAD.size + int(length) + 1 > len(self.buffer)
