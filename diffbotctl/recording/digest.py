"""The digest of a run, by which two runs are compared without recordings."""

from __future__ import annotations

from hashlib import sha256
from typing import Any

from diffbotctl.recording.json_codec import message_encoder


class RunDigest:
    """A hash over every message of a run, with its wire and time.

    Two runs are equal exactly when their digests are.
    """

    def __init__(self, wires: dict[str, type]) -> None:
        self.encoders = [(wire.encode(), message_encoder(kind)) for wire, kind in wires.items()]
        self.hash = sha256()
        self.messages = 0

    def record(self, instant: tuple[Any, ...]) -> None:
        """Add one instant: (time, message or None for each wire)."""
        time = b" %d " % instant[0]
        for (wire, encode), message in zip(self.encoders, instant[1:], strict=True):
            if message is not None:
                self.hash.update(wire + time + encode(message))
                self.messages += 1

    def text(self) -> str:
        """The digest so far, in hexadecimal."""
        return self.hash.hexdigest()
