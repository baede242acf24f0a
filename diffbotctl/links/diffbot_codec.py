"""Frames of `diffbot` on the wire: COBS(payload + 24-bit checksum) and a zero byte."""

from __future__ import annotations

from cobs import cobs  # type: ignore[import-untyped,unused-ignore]

from diffbotctl.links.diffbot_frames import CHECK_POLYNOMIAL, CHECK_START, OF_TYPE, WIRE, Frame

CHECK_BYTES = 3
LONGEST = max(WIRE.values())  # bytes of a frame on the wire
DELIMITER = b"\0"


def _entry(index: int) -> int:
    check = index << 16
    for _ in range(8):
        check = check << 1 ^ (CHECK_POLYNOMIAL if check & 0x800000 else 0)
    return check & 0xFFFFFF


_TABLE = tuple(_entry(index) for index in range(256))


def checksum(payload: bytes) -> int:
    """The 24-bit checksum of a payload."""
    check = CHECK_START
    for byte in payload:
        check = (check << 8 & 0xFFFFFF) ^ _TABLE[check >> 16 ^ byte]
    return check


def encode(frame: Frame) -> bytes:
    """A frame as it goes over the wire."""
    payload = frame.pack()
    stuffed: bytes = cobs.encode(payload + checksum(payload).to_bytes(CHECK_BYTES, "big"))
    return stuffed + DELIMITER


class FrameDecoder:
    """Bytes in, frames out. `received` and `damaged` count whole and refused frames."""

    def __init__(self) -> None:
        self._rest = b""
        self.received = 0
        self.damaged = 0

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that `data` completes, in order."""
        *pieces, rest = (self._rest + data).split(DELIMITER)
        if len(rest) > LONGEST:  # a frame that long is damaged already; its tail will be, too
            rest = rest[:1] * LONGEST
        self._rest = rest
        frames = []
        for piece in pieces:
            if not piece:
                continue
            frame = decode(piece)
            if frame is None:
                self.damaged += 1
            else:
                self.received += 1
                frames.append(frame)
        return frames


def decode(piece: bytes) -> Frame | None:
    """The frame between two delimiters, or None when anything about it is wrong."""
    if len(piece) >= LONGEST:
        return None
    try:
        data: bytes = cobs.decode(piece)
    except cobs.DecodeError:
        return None
    payload = data[:-CHECK_BYTES]
    if not payload or checksum(payload) != int.from_bytes(data[-CHECK_BYTES:], "big"):
        return None
    kind = OF_TYPE.get(payload[0] & 0xF)
    return None if kind is None else kind.unpack(payload)
