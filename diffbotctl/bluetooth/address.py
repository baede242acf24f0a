"""Bluetooth addresses, and ports that are named by them: `bluetooth:98:D3:31:FC:12:34`."""

from __future__ import annotations

import re
from typing import NamedTuple

from diffbotctl.errors import Problem, UsageError

BLUETOOTH = "bluetooth:"
PORT = re.compile(r"((?:[0-9A-F]{2}:){5}[0-9A-F]{2})(?:/(\d{1,2}))?\Z")
SERIAL_CHANNEL = 1  # the one channel of an HC-05, for its serial port profile
CHANNELS = range(1, 31)  # of RFCOMM: five bits, of which 0 and 31 are reserved


class Module(NamedTuple):
    """A Bluetooth module and the RFCOMM channel of its serial port."""

    address: str  # six pairs of capital hexadecimal digits
    channel: int = SERIAL_CHANNEL

    def __str__(self) -> str:
        channel = "" if self.channel == SERIAL_CHANNEL else f"/{self.channel}"
        return f"{BLUETOOTH}{self.address}{channel}"


def module(text: str) -> Module:
    """The module of an address, with or without `bluetooth:` in front. Raises UsageError."""
    words = text.strip().removeprefix(BLUETOOTH).upper().replace("-", ":")
    found = PORT.match(words)
    if found is None:
        raise _wrong(text, f"'{text}' is no Bluetooth address")
    channel = SERIAL_CHANNEL if found[2] is None else int(found[2])
    if channel not in CHANNELS:
        raise _wrong(text, f"there is no channel {channel}: 1 to 30")
    return Module(found[1], channel)


def _wrong(text: str, cause: str) -> UsageError:
    fix = "write bluetooth:98:D3:31:FC:12:34; `diffbotctl bluetooth scan` lists those in reach"
    return UsageError(Problem("E-BLUETOOTH-ADDRESS", f"port {text}", cause, fix))
