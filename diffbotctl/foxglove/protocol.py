"""Frames of Foxglove's WebSocket protocol: JSON operations, and binary frames in little endian.

Specification: docs/spec.md of the repository foxglove/ws-protocol. `foxglove.sdk.v1`, which
newer viewers ask for, has the same frames.
"""

from __future__ import annotations

import json
import struct
from typing import Any, NamedTuple

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
ENCODING, SCHEMA_ENCODING = "json", "jsonschema"
MESSAGE_DATA, SERVICE_RESPONSE, ASSET_RESPONSE = 1, 3, 4  # first byte of the server's frames
CLIENT_MESSAGE, SERVICE_CALL = 1, 2  # first byte of a viewer's frames
INFO, WARNING, ERROR = 0, 1, 2  # levels of a status
ASSET_FOUND, ASSET_MISSING = 0, 1
MESSAGE_HEAD = struct.Struct("<BIQ")  # opcode, subscription, time in ns
SERVICE_HEAD = struct.Struct("<BIII")  # opcode, service, call, length of the encoding's name
ASSET_HEAD = struct.Struct("<BIBI")  # opcode, request, status, length of the error text
CLIENT_HEAD = struct.Struct("<BI")  # opcode, channel

Fields = dict[str, Any]


class FrameError(ValueError):
    """A viewer sent something that the protocol does not have."""


class ClientMessage(NamedTuple):
    """A message that a viewer publishes on a channel of its own."""

    channel: int
    data: bytes


class ServiceCall(NamedTuple):
    """A call of a service."""

    service: int
    call: int
    data: bytes


def operation(name: str, /, **fields: object) -> str:
    return json.dumps({"op": name, **fields}, separators=(",", ":"), allow_nan=False)


def status(level: int, message: str) -> str:
    """A line in the viewer's list of problems."""
    return operation("status", level=level, message=message)


def message_data(subscription: int, time: int, data: bytes) -> bytes:
    """A message of a channel; `time` is in ns since 1970."""
    return MESSAGE_HEAD.pack(MESSAGE_DATA, subscription, time) + data


def service_response(call: ServiceCall, data: bytes) -> bytes:
    encoding = ENCODING.encode()
    head = SERVICE_HEAD.pack(SERVICE_RESPONSE, call.service, call.call, len(encoding))
    return head + encoding + data


def asset_response(request: int, data: bytes | None) -> bytes:
    """A file that a viewer asked for; None when there is no such file."""
    if data is None:
        text = b"there is no such file; there are robot.urdf and layout.json"
        return ASSET_HEAD.pack(ASSET_RESPONSE, request, ASSET_MISSING, len(text)) + text
    return ASSET_HEAD.pack(ASSET_RESPONSE, request, ASSET_FOUND, 0) + data


def parse_binary(frame: bytes) -> ClientMessage | ServiceCall:
    """A binary frame of a viewer. Raises FrameError."""
    opcode = frame[0] if frame else None
    if opcode == CLIENT_MESSAGE and len(frame) >= CLIENT_HEAD.size:
        return ClientMessage(CLIENT_HEAD.unpack_from(frame)[1], frame[CLIENT_HEAD.size :])
    if opcode == SERVICE_CALL and len(frame) >= SERVICE_HEAD.size:
        _, service, call, length = SERVICE_HEAD.unpack_from(frame)
        start = SERVICE_HEAD.size + length
        if start <= len(frame):
            return ServiceCall(service, call, frame[start:])
    raise FrameError("a binary frame is cut short or of an unknown kind")


def parse_operation(text: str) -> tuple[str, Fields]:
    """Name and fields of a viewer's JSON operation. Raises FrameError."""
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict) or not isinstance(fields.get("op"), str):
        raise FrameError("a text frame is no operation of the protocol")
    return fields.pop("op"), fields


def numbers(fields: Fields, name: str) -> list[int]:
    """A list of identifiers. Raises FrameError."""
    values = fields.get(name)
    if not isinstance(values, list) or not all(_is_identifier(value) for value in values):
        raise FrameError(f"{name} is no list of numbers")
    return values


def texts(fields: Fields, name: str) -> list[str]:
    """A list of texts. Raises FrameError."""
    values = fields.get(name)
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise FrameError(f"{name} is no list of texts")
    return values


def rows(fields: Fields, name: str, identifiers: tuple[str, ...]) -> list[Fields]:
    """A list of objects, in each of which `identifiers` are numbers. Raises FrameError."""
    values = fields.get(name)
    if not isinstance(values, list) or not all(
        isinstance(row, dict) and all(_is_identifier(row.get(each)) for each in identifiers)
        for row in values
    ):
        raise FrameError(f"{name} is no list of objects with {', '.join(identifiers) or 'fields'}")
    return values


def _is_identifier(value: object) -> bool:
    return type(value) is int and 0 <= value < 1 << 32
