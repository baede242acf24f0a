"""Writes an MCAP file in chunks, with indexes: the same bytes as the writer of the mcap library.

That library packs each message in eight steps, which took more than half of the time of a recording
process. The rare records are packed by the library here too. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from typing import IO, Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from diffbotctl.recording.mcap_records import MAGIC

MESSAGE_OPCODE = int(Opcode.MESSAGE)
MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log and publish time
MESSAGE_FIELDS_BYTES = MESSAGE.size - 9  # of the record's length, before the data
INDEX = struct.Struct("<BQHI")  # opcode, length, channel, length of the entries
INDEX_FIELDS_BYTES = INDEX.size - 9
ENTRY_BYTES = 16  # time and place of one message
FOOTER_BYTES = 20
COMPRESSION = "zstd"


class McapWriter:
    """Writes to `file` from its start. All methods may raise OSError."""

    def __init__(self, file: IO[bytes], library: str, chunk_bytes: int) -> None:
        """`library`: name of the program; a chunk is written when it exceeds `chunk_bytes`."""
        self._file, self._chunk_bytes = file, chunk_bytes
        self._chunk = bytearray()
        # By channel, of the messages in the chunk: time and place, time and place, ...
        self._entries: dict[int, list[int]] = {}
        self._schemas: list[Any] = []
        self._channels: list[Any] = []
        self._counts: dict[int, int] = {}  # messages in the chunks before, by channel
        self._begin = self._end = 0  # ns, of all messages in the chunks before
        self._chunk_indexes: list[Any] = []
        self._attachment_indexes: list[Any] = []
        self._metadata_indexes: list[Any] = []
        file.write(MAGIC + _packed(Header("", library)))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        number = len(self._schemas) + 1
        self._schemas.append(Schema(id=number, data=data, encoding=encoding, name=name))
        self._add_to_chunk(_packed(self._schemas[-1]))
        return number

    def add_channel(
        self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]
    ) -> int:
        number = len(self._channels) + 1
        channel = Channel(
            id=number,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema,
            metadata=dict(metadata),
        )
        self._channels.append(channel)
        self._add_to_chunk(_packed(channel))
        return number

    def add_message(self, channel: int, time: int, data: bytes, sequence: int) -> None:
        """Add a message of `time` (ns since 1970)."""
        chunk = self._chunk
        entries = self._entries.get(channel)
        if entries is None:
            entries = self._entries[channel] = []
        entries += (time, len(chunk))
        length = MESSAGE_FIELDS_BYTES + len(data)
        chunk += MESSAGE.pack(MESSAGE_OPCODE, length, channel, sequence, time, time)
        chunk += data
        if len(chunk) > self._chunk_bytes:
            self._end_chunk()

    def add_attachment(self, time: int, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment of `time` (ns since 1970)."""
        attachment = Attachment(
            create_time=time, log_time=time, name=name, media_type=media_type, data=data
        )
        offset, length = self._write(_packed(attachment))
        self._attachment_indexes.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                create_time=time,
                log_time=time,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        offset, length = self._write(_packed(Metadata(name=name, metadata=dict(values))))
        self._metadata_indexes.append(MetadataIndex(offset=offset, length=length, name=name))

    def flush(self) -> None:
        """Write what was added so far, as a chunk that a reader can open."""
        self._end_chunk()
        self._file.flush()

    def finish(self) -> None:
        """Write the indexes and the end of the file."""
        self._end_chunk()
        self._write(_packed(DataEnd(0)))
        start = self._file.tell()
        groups = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.ATTACHMENT_INDEX, self._attachment_indexes),
            (Opcode.METADATA_INDEX, self._metadata_indexes),
        )
        summary = bytearray()
        offsets = bytearray()
        for opcode, records in groups:
            group = b"".join(map(_packed, records))
            offsets += _packed(
                SummaryOffset(
                    group_opcode=opcode,
                    group_start=start + len(summary),
                    group_length=len(group),
                )
            )
            summary += group
        offsets_start = start + len(summary)
        summary += offsets
        head = struct.pack("<BQQQ", Opcode.FOOTER, FOOTER_BYTES, start, offsets_start)
        checksum = zlib.crc32(head, zlib.crc32(summary))
        footer = Footer(
            summary_start=start, summary_offset_start=offsets_start, summary_crc=checksum
        )
        self._write(bytes(summary) + _packed(footer) + MAGIC)

    def _write(self, data: bytes) -> tuple[int, int]:
        """Write records. Returns their place in the file and their length."""
        place = self._file.tell()
        self._file.write(data)
        return place, len(data)

    def _add_to_chunk(self, record: bytes) -> None:
        self._chunk += record
        if len(self._chunk) > self._chunk_bytes:
            self._end_chunk()

    def _end_chunk(self) -> None:
        """Write the chunk and the index of its messages; nothing when it has no message."""
        if not self._entries:
            return
        begin = min(min(entries[::2]) for entries in self._entries.values())
        end = max(max(entries[::2]) for entries in self._entries.values())
        data = bytes(self._chunk)
        packed = zstandard.compress(data)
        chunk = Chunk(
            compression=COMPRESSION,
            data=packed,
            message_start_time=begin,
            message_end_time=end,
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        start, length = self._write(_packed(chunk))
        offsets, index_length = self._write_indexes()
        self._chunk_indexes.append(
            ChunkIndex(
                message_start_time=begin,
                message_end_time=end,
                chunk_start_offset=start,
                chunk_length=length,
                message_index_offsets=offsets,
                message_index_length=index_length,
                compression=COMPRESSION,
                compressed_size=len(packed),
                uncompressed_size=len(data),
            )
        )
        self._begin = min(self._begin, begin) if self._counts else begin
        self._end = max(self._end, end)
        for channel, entries in self._entries.items():
            self._counts[channel] = self._counts.get(channel, 0) + len(entries) // 2
        self._entries.clear()
        self._chunk.clear()

    def _write_indexes(self) -> tuple[dict[int, int], int]:
        """Write the index of each channel. Returns their places by channel, and their length."""
        start = self._file.tell()
        offsets: dict[int, int] = {}
        indexes = bytearray()
        for channel, entries in self._entries.items():
            offsets[channel] = start + len(indexes)
            length = len(entries) // 2 * ENTRY_BYTES
            indexes += INDEX.pack(
                Opcode.MESSAGE_INDEX, INDEX_FIELDS_BYTES + length, channel, length
            )
            indexes += struct.pack(f"<{len(entries)}Q", *entries)
        self._write(bytes(indexes))
        return offsets, len(indexes)

    def _statistics(self) -> Any:
        return Statistics(
            attachment_count=len(self._attachment_indexes),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunk_indexes),
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata_indexes),
            message_start_time=self._begin,
            message_end_time=self._end,
            schema_count=len(self._schemas),
        )


def _packed(record: Any) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())
