"""The types of std_msgs that hold one value, as rosserial sends them.

Numbers are little-endian, a Bool is one byte, a String its length (32 bits) and its bytes. The MD5
is that of the definition of the type (`int32 data`), by which both sides compare it.
"""

from __future__ import annotations

import struct
from hashlib import md5
from typing import Any, NamedTuple

from diffbotctl.messages import STD_MSGS, UInt64, fields

RosType = tuple[str, str]  # Name of a message type, and the MD5 of its definition.

FORMATS = {
    "Bool": "?",
    "Int8": "b",
    "Int16": "<h",
    "Int32": "<i",
    "Int64": "<q",
    "UInt8": "B",
    "UInt16": "<H",
    "UInt32": "<I",
    "UInt64": "<Q",
    "Float32": "<f",
    "Float64": "<d",
}


class ScalarCodec(NamedTuple):
    """A message class, its type in ROS, and how its value is packed; None: a text, or no value."""

    kind: type
    ros_type: RosType
    value: struct.Struct | None

    @property
    def size(self) -> int | None:
        """Bytes of payload; None where they differ from message to message."""
        if self.value is not None:
            return self.value.size
        return None if "text" in fields(self.kind) else 0

    def encode(self, message: Any) -> bytes:
        """The payload of a message. Raises ValueError if its value does not fit."""
        if self.value is None:
            return _text_bytes(message.text) if self.size is None else b""
        try:
            return self.value.pack(message.data)
        except (struct.error, OverflowError) as error:
            raise ValueError(f"{message.data} does not fit into {self.ros_type[0]}") from error

    def decode(self, now: int, payload: bytes) -> Any | None:
        """The message of a payload, stamped with `now`; None if it is damaged or too large."""
        if self.size is None:
            if len(payload) < 4 or struct.unpack_from("<I", payload)[0] != len(payload) - 4:
                return None
            return self.kind(now, payload[4:].decode("utf-8", "replace"))
        if len(payload) != self.size:
            return None
        if self.value is None:
            return self.kind(now)
        (value,) = self.value.unpack(payload)
        if self.kind is UInt64 and value >= 1 << 63:
            return None
        return self.kind(now, value)


def _text_bytes(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _codec(name: str, kind: type) -> ScalarCodec:
    definition = "" if name == "Empty" else f"{name.lower()} data"
    digest = md5(definition.encode(), usedforsecurity=False).hexdigest()
    value = struct.Struct(FORMATS[name]) if name in FORMATS else None
    return ScalarCodec(kind, (f"std_msgs/{name}", digest), value)


CODECS: dict[type, ScalarCodec] = {kind: _codec(name, kind) for name, kind in STD_MSGS.items()}
