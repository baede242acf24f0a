"""Messages of the Mega's stock bootloader: STK500 version 2, after Atmel's note AVR068. Sans-IO."""

from __future__ import annotations

BAUD = 115200
SIGN_ON, LEAVE = 0x01, 0x11
BOOTLOADER_NAME = b"AVRISP_2"  # part of its reply to a sign-on
BODY_BYTES_MAX = 512
START, TOKEN = 0x1B, 0x0E
HEADER_BYTES, PARITY_BYTES = 5, 1


def message(sequence: int, body: bytes) -> bytes:
    """Bytes of a command or a reply on the wire."""
    header = bytes([START, sequence & 0xFF, *len(body).to_bytes(2, "big"), TOKEN])
    return header + body + bytes([parity(header + body)])


def parity(data: bytes) -> int:
    """Exclusive-or of all bytes; 0 over a whole message."""
    value = 0
    for byte in data:
        value ^= byte
    return value


class ReplyParser:
    """Decodes replies; skips other bytes."""

    def __init__(self) -> None:
        self._data = b""

    def feed(self, data: bytes, sequence: int) -> bytes | None:
        """Body of the reply with this sequence number, None until it is complete."""
        self._data += data
        while (start := self._data.find(START)) >= 0:
            self._data = self._data[start:]
            if len(self._data) < HEADER_BYTES:
                return None
            size = int.from_bytes(self._data[2:4], "big")
            end = HEADER_BYTES + size + PARITY_BYTES
            header_fits = self._data[4] == TOKEN and self._data[1] == sequence & 0xFF
            if header_fits and size <= BODY_BYTES_MAX:
                if len(self._data) < end:
                    return None
                if parity(self._data[:end]) == 0:
                    body = self._data[HEADER_BYTES : end - PARITY_BYTES]
                    self._data = self._data[end:]
                    return body
            self._data = self._data[1:]
        self._data = b""
        return None
