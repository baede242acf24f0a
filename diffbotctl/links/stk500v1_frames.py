"""Messages of the stock bootloaders of Uno and Nano: STK500 version 1, after Atmel's note AVR061.

Optiboot (Uno, new Nano) runs at 115200 baud, ATmegaBOOT (old Nano) at 57600. Sans-IO.
"""

from __future__ import annotations

OPTIBOOT_BAUD, ATMEGABOOT_BAUD = 115200, 57600
SYNC, LEAVE, LOAD_ADDRESS, PROGRAM, READ, SIGNATURE = 0x30, 0x51, 0x55, 0x64, 0x74, 0x75
END_OF_COMMAND = 0x20
IN_SYNC, OK = 0x14, 0x10
FLASH = ord("F")


def message(body: bytes) -> bytes:
    return body + bytes([END_OF_COMMAND])


def reply(data: bytes = b"") -> bytes:
    """Bytes of a reply with `data`."""
    return bytes([IN_SYNC]) + data + bytes([OK])


def read_reply(received: bytes, size: int) -> bytes | None:
    """The `size` bytes of data of the first whole reply in `received`; None while there is none.

    The protocol has no checksum: a reply is known by its first and its last byte.
    """
    for start in range(len(received) - size - 1):
        if received[start] == IN_SYNC and received[start + 1 + size] == OK:
            return received[start + 1 : start + 1 + size]
    return None
