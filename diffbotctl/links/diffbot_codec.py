"""Frames of the protocol `diffbot` on the wire: COBS(payload + 24-bit checksum), zero byte."""

from __future__ import annotations

from typing import NamedTuple

from cobs import cobs  # type: ignore[import-untyped,unused-ignore]

from diffbotctl.links.diffbot_frames import (
    CHECK_BYTES,
    CHECK_POLYNOMIAL,
    CHECK_START,
    OF_TYPE,
    RECEIVE_MOST,
    TYPE_BITS,
    Frame,
)

DELIMITER = b"\0"


class _Layout(NamedTuple):
    number: int  # of the frame type
    values: tuple[tuple[int, int, int], ...]  # shift, mask, sign bit (0: unsigned)
    repeated: int  # values of the last field, a tuple; 0 when it is no tuple
    size: int  # bytes of payload


def _layout(number: int, kind: type[Frame]) -> _Layout:
    values = []
    shift, repeated = TYPE_BITS, 0
    for annotation in kind.__annotations__.values():
        width, repeated = (*annotation.__metadata__, 0)[:2]
        bits = abs(width)
        for _ in range(repeated or 1):
            values.append((shift, (1 << bits) - 1, 1 << bits - 1 if width < 0 else 0))
            shift += bits
    return _Layout(number, tuple(values), repeated, shift // 8)


_LAYOUTS = {kind: _layout(number, kind) for number, kind in OF_TYPE.items()}
WIRE_BYTES = {kind: layout.size + CHECK_BYTES + 2 for kind, layout in _LAYOUTS.items()}
"""length of a frame on the wire: payload, checksum, one byte of COBS, delimiter"""
WIRE_BYTES_MAX = RECEIVE_MOST + CHECK_BYTES + 2


def pack(frame: Frame) -> bytes:
    """Payload of a frame: type, then the fields, from the lowest bit of the first byte up."""
    layout = _LAYOUTS[type(frame)]
    values: list[int] = []
    for field in frame:
        values += field if isinstance(field, tuple) else (field,)
    bits = layout.number
    for (shift, mask, _), value in zip(layout.values, values, strict=True):
        bits |= (value & mask) << shift
    return bits.to_bytes(layout.size, "little")


def unpack(payload: bytes) -> Frame | None:
    """Frame of a payload; None when its type is unknown or it is too short for its type.

    A longer frame comes from a later firmware: the rest is ignored.
    """
    kind = OF_TYPE.get(payload[0] & (1 << TYPE_BITS) - 1)
    if kind is None:
        return None
    _, layout, repeated, size = _LAYOUTS[kind]
    if len(payload) < size:
        return None
    bits = int.from_bytes(payload, "little")
    values = [(bits >> shift & mask ^ sign) - sign for shift, mask, sign in layout]
    if repeated:
        return kind._make((*values[:-repeated], tuple(values[-repeated:])))
    return kind._make(values)


def _entry(index: int) -> int:
    check = index << 16
    for _ in range(8):
        check = check << 1 ^ (CHECK_POLYNOMIAL if check & 0x800000 else 0)
    return check & 0xFFFFFF


_TABLE = tuple(_entry(index) for index in range(256))


def checksum(payload: bytes) -> int:
    """24-bit checksum of a payload."""
    check = CHECK_START
    for byte in payload:
        check = (check << 8 & 0xFFFFFF) ^ _TABLE[check >> 16 ^ byte]
    return check


def encode(frame: Frame) -> bytes:
    return encode_payload(pack(frame))


def encode_payload(payload: bytes) -> bytes:
    """Bytes of a payload on the wire: with checksum, stuffed, delimited."""
    stuffed: bytes = cobs.encode(payload + checksum(payload).to_bytes(CHECK_BYTES, "big"))
    return stuffed + DELIMITER


class FrameDecoder:
    """Decodes frames from bytes. `received` counts valid frames, `damaged` discarded ones."""

    def __init__(self) -> None:
        self._rest = b""
        self.received = 0
        self.damaged = 0

    def feed(self, data: bytes) -> list[Frame]:
        """Frames that `data` completes, in order."""
        *pieces, rest = (self._rest + data).split(DELIMITER)
        if len(rest) > WIRE_BYTES_MAX:
            rest = rest[:1] * WIRE_BYTES_MAX  # too long for a frame; keep it invalid, but short
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
    """Frame of the bytes between two delimiters; None when they are no valid frame."""
    if len(piece) >= WIRE_BYTES_MAX:
        return None
    try:
        data: bytes = cobs.decode(piece)
    except cobs.DecodeError:
        return None
    payload = data[:-CHECK_BYTES]
    if not payload or checksum(payload) != int.from_bytes(data[-CHECK_BYTES:], "big"):
        return None
    return unpack(payload)
