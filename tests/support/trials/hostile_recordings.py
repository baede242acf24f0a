"""Damaged and hostile recordings, made from a good one: bit flips, cuts, lying lengths, chunks that
unpack to gigabytes, wrong metadata, wrong messages.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator
from functools import cache
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any

import zstandard
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from diffbotctl.recording import mcap_records
from tests.support.trials.hostile_yaml import ESCAPE, odd_value

LYING_LENGTHS = (0, 1, 2**16, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)


def hostile_recordings(rng: Random, good: Path, count: int) -> Iterator[tuple[str, bytes]]:
    """`count` names of a damage, with the damaged file."""
    data = good.read_bytes()
    records = read_all(good)
    makers = (_flipped, _flipped, _cut, _joined, _lying)
    for _ in range(count):
        if rng.random() < 0.5:
            make = rng.choice(makers)
            yield make.__name__.strip("_"), make(rng, data)
        else:
            yield "rewritten", rewritten(rng, records)


def read_all(path: Path) -> list[Any]:
    """All records of a good recording."""
    with path.open("rb") as file:
        return [
            record
            for whole in mcap_records.file_records(file)
            for record in mcap_records.records_in(whole)
        ]


def _flipped(rng: Random, data: bytes) -> bytes:
    damaged = bytearray(data)
    begin = rng.randrange(len(data))
    for _ in range(rng.choice((1, 1, 3, 30))):
        at = rng.choice((begin, rng.randrange(len(data)), rng.randrange(min(400, len(data)))))
        damaged[at] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def _cut(rng: Random, data: bytes) -> bytes:
    end = rng.randrange(len(data))
    return data[:end] + rng.choice((b"", b"\0" * 100, b"\xff" * 9, data[:50]))


def _joined(rng: Random, data: bytes) -> bytes:
    begin, end = sorted((rng.randrange(len(data)), rng.randrange(len(data))))
    return data[:begin] + data[end:] + rng.choice((b"", data))


def _lying(rng: Random, data: bytes) -> bytes:
    """The length of one record outside chunks is replaced."""
    places, at = [], len(mcap_records.MAGIC)
    while at + 9 <= len(data) - len(mcap_records.MAGIC):
        places.append(at)
        at += 9 + int(struct.unpack_from("<Q", data, at + 1)[0])
    at = rng.choice(places)
    length = struct.pack("<Q", rng.choice(LYING_LENGTHS))
    return data[: at + 1] + length + data[at + 9 :]


def rewritten(rng: Random, records: list[Any]) -> bytes:
    """The records as a well-formed file, some of them with hostile content."""
    file = BytesIO()
    writer: Any = Writer(file, compression=rng.choice((CompressionType.ZSTD, CompressionType.NONE)))
    writer.start(library=rng.choice(("diffbotctl", ESCAPE)))
    share = rng.choice((0.0, 0.001, 0.1))
    is_odd_metadata = rng.random() < 0.5
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    for record in records:
        match record:
            case Metadata():
                values = dict(record.metadata)
                if is_odd_metadata:
                    _change_metadata(rng, values)
                writer.add_metadata(record.name, values)
            case Attachment():
                writer.add_attachment(
                    record.create_time,
                    record.log_time,
                    record.name,
                    "",
                    _odd_bytes(rng, record.data),
                )
            case Schema() if record.id not in schemas:
                schemas[record.id] = writer.register_schema(
                    record.name, record.encoding, record.data
                )
            case Channel() if record.id not in channels:
                topic, metadata = record.topic, dict(record.metadata)
                if rng.random() < 0.02:
                    topic = rng.choice((ESCAPE, "", "x" * 10_000, "robot.link", "a\nb"))
                if rng.random() < 0.02:
                    metadata[rng.choice(("kind", "from"))] = str(odd_value(rng))[:500]
                channels[record.id] = writer.register_channel(
                    topic, record.message_encoding, schemas[record.schema_id], metadata
                )
            case Message():
                data, time = record.data, record.log_time
                if rng.random() < share:
                    data = _odd_message(rng, data)
                if rng.random() < share / 10:
                    time = rng.choice((0, 2**64 - 1, time - 10**9, time + 10**18))
                channel = channels.get(record.channel_id, 999)
                writer.add_message(channel, time, data, time, record.sequence)
    writer.finish()
    return file.getvalue()


def _change_metadata(rng: Random, values: dict[str, str]) -> None:
    name = rng.choice(list(values))
    kind = rng.randrange(4)
    if kind == 0:
        del values[name]
    elif kind == 1:
        values[name] = str(odd_value(rng))
    else:
        values[name] = rng.choice(
            (
                "",
                ESCAPE,
                "[" * 100_000,
                "{}",
                "[]",
                "null",
                "9" * 5000,
                '{"../../x": "y"}',
                "nan",
                "-1",
            )
        )


def _odd_message(rng: Random, data: bytes) -> bytes:
    if rng.random() < 0.2:
        return rng.choice(
            (b"", b"{}", b"[]", b"null", b"\xff", b"[" * 100_000, b"9" * 5000, b'"x"')
        )
    try:
        fields = json.loads(data)
        fields[rng.choice(list(fields))] = odd_value(rng)
        return json.dumps(fields).encode("utf-8", "replace")
    except (ValueError, TypeError, IndexError):
        return data[: rng.randrange(len(data) + 1)]


def _odd_bytes(rng: Random, data: bytes) -> bytes:
    return rng.choice(
        (data, b"", b"\x80\x05.", data[: len(data) // 2], b"cos\nsystem\n(S'id'\ntR.")
    )


@cache
def bombs(good: Path) -> dict[str, bytes]:
    """Small files that ask for much memory or time."""
    data = good.read_bytes()
    zeros = zstandard.ZstdCompressor(level=1).compress(bytes(1 << 28))
    silent = zstandard.ZstdCompressor(level=1, write_content_size=False).compress(bytes(1 << 28))
    message = b"\x05" + struct.pack("<Q", 24) + struct.pack("<HIQQ", 1, 0, 0, 0) + b"{}"
    many = message * ((15 << 20) // len(message))
    packed = zstandard.ZstdCompressor(level=3).compress(many)
    head = data[: data.index(b"\x06", 9)]
    whole = data[:-37]  # without footer and magic
    return {
        "256 MB of zeros": whole + _chunk(zeros, 1 << 28),
        "256 MB of zeros that claim 100 bytes": whole + _chunk(zeros, 100),
        "256 MB of zeros without a size": whole + _chunk(silent, 1 << 20),
        "2^63 bytes": whole + _chunk(zeros, 1 << 63),
        "15 MB of messages, 40 times": whole + _chunk(packed, len(many), zlib.crc32(many)) * 40,
        "unknown packing": whole + _chunk(b"x" * 100, 100, kind="brotli"),
        "a long name of the packing": whole + _chunk(b"x", 1, kind="z" * 100_000),
        "nothing but a head": head,
        "a sparse gigabyte": head,
    }


def _chunk(packed: bytes, size: int, checksum: int = 0, kind: str = "zstd") -> bytes:
    name = kind.encode()
    content = struct.pack("<QQQI", 0, 0, size, checksum) + struct.pack("<I", len(name)) + name
    content += struct.pack("<Q", len(packed)) + packed
    return b"\x06" + struct.pack("<Q", len(content)) + content
