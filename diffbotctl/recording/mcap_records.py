"""Reads the records of an MCAP file that may be cut, damaged or made to harm.

The parsers are those of the mcap library. Here every length is compared with what is there, and
every size has a limit, before memory is taken: a chunk of 16 kB may ask to be unpacked to 4 GB.
Places are bytes from the start of the file. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import IO, Any, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Message, Metadata, Schema

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # opcode and length of a record
RECORD_MAX_BYTES = 24 << 20
UNPACKED_MAX_BYTES = 16 << 20  # of a chunk; the writers in use make chunks of 256 kB to 8 MB
UNPACKED_RATIO_MAX = 200  # times the packed size; recordings of a standing robot reach 34
UNPACKED_FREE_BYTES = 1 << 12  # the ratio counts above this size
SKIP_BYTES = 1 << 16  # read at once of a record that is not needed
Parser = Callable[[ReadDataStream], Any]
PARSERS: dict[int, Parser] = {
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.CHUNK: Chunk.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
    Opcode.DATA_END: DataEnd.read,
    Opcode.FOOTER: Footer.read,
}


class CutError(ValueError):
    """The file ends before its end record; all before it has been read."""


class MalformedError(ValueError):
    """A record is complete but wrong. `place` is its first byte."""

    def __init__(self, place: int, cause: str) -> None:
        super().__init__(cause)
        self.place = place


class FileRecord(NamedTuple):
    """One record outside chunks. `content` is None for kinds that are not read."""

    place: int
    opcode: int
    content: bytes | None


def file_records(file: IO[bytes]) -> Iterator[FileRecord]:
    """The records of the open file, chunks in one piece, up to the footer.

    Raises CutError, or MalformedError after which nothing can be read.
    """
    size = os.fstat(file.fileno()).st_size
    magic = file.read(len(MAGIC))
    if magic != MAGIC:
        if MAGIC.startswith(magic):
            raise CutError("it ends in its first bytes")
        raise MalformedError(0, "the first bytes are not those of an MCAP file")
    checksum = zlib.crc32(magic)
    place = len(MAGIC)
    while True:
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            raise CutError(f"it ends at byte {place + len(head)}, without an end record")
        opcode, length = HEAD.unpack(head)
        if opcode == 0:
            raise CutError(f"only zeros follow byte {place}")
        if length > size - place - HEAD.size:
            raise CutError(f"the record at byte {place} is longer than the rest of the file")
        content = None
        before, checksum = checksum, zlib.crc32(head, checksum)
        if opcode in PARSERS or opcode == Opcode.MESSAGE:
            if length > RECORD_MAX_BYTES:
                raise MalformedError(place, f"a record has {length} bytes")
            content = file.read(length)
            checksum = zlib.crc32(content, checksum)
        else:
            checksum = _skip(file, length, checksum)
        record = FileRecord(place, opcode, content)
        if opcode == Opcode.DATA_END:
            _check_data(record, before)
        yield record
        if opcode == Opcode.FOOTER:
            return
        place += HEAD.size + length


def records_in(record: FileRecord) -> Iterator[Any]:
    """The schemas, channels, messages, attachments and metadata in one record of the file.

    A message carries no content of its own until it is asked for. Raises MalformedError.
    """
    if record.content is None or record.opcode in (Opcode.DATA_END, Opcode.FOOTER):
        return
    parsed = _parse(record.place, record.opcode, record.content)
    if not isinstance(parsed, Chunk):
        yield parsed
        return
    data = _unpack(record.place, parsed)
    at = 0
    while at < len(data):
        if at + HEAD.size > len(data):
            raise MalformedError(record.place, f"the chunk ends in a record, at its byte {at}")
        opcode, length = HEAD.unpack_from(data, at)
        at += HEAD.size
        if length > len(data) - at:
            cause = f"a record at byte {at - HEAD.size} of the chunk is longer than the chunk"
            raise MalformedError(record.place, cause)
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            yield _parse(record.place, opcode, data[at : at + length])
        at += length


def _parse(place: int, opcode: int, content: bytes) -> Any:
    stream = ReadDataStream(BytesIO(content))
    try:
        if opcode == Opcode.MESSAGE:
            return Message.read(stream, len(content))
        return PARSERS[opcode](stream)
    except Exception as error:  # the parsers raise anything where lengths or texts are wrong
        cause = f"a record of kind {opcode} cannot be read ({type(error).__name__})"
        raise MalformedError(place, cause) from error


def _unpack(place: int, chunk: Any) -> bytes:
    """The records of a chunk as bytes. Raises MalformedError."""
    size, packed = chunk.uncompressed_size, len(chunk.data)
    if size > UNPACKED_MAX_BYTES or size > max(UNPACKED_FREE_BYTES, UNPACKED_RATIO_MAX * packed):
        raise MalformedError(place, f"a chunk of {packed} bytes asks to be unpacked to {size}")
    if chunk.compression == "":
        data: bytes = chunk.data
    elif chunk.compression == "zstd":
        data = _unpack_zstd(place, chunk)
    else:
        cause = f"a chunk is packed with '{chunk.compression[:10]}', which is not supported"
        raise MalformedError(place, cause)
    if len(data) != size:
        raise MalformedError(place, f"a chunk unpacks to another size than its {size} bytes")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise MalformedError(place, "the checksum of a chunk is wrong")
    return data


def _unpack_zstd(place: int, chunk: Any) -> bytes:
    decompressor = zstandard.ZstdDecompressor(max_window_size=UNPACKED_MAX_BYTES)
    try:
        # The size in the packed data is not trusted: at most one byte more than promised is read.
        with decompressor.stream_reader(chunk.data) as reader:
            return bytes(reader.read(chunk.uncompressed_size + 1))
    except zstandard.ZstdError as error:
        raise MalformedError(place, "a chunk cannot be unpacked") from error


def _skip(file: IO[bytes], length: int, checksum: int) -> int:
    """Read over `length` bytes. Returns the checksum continued over them."""
    while length > 0 and (data := file.read(min(length, SKIP_BYTES))):
        checksum = zlib.crc32(data, checksum)
        length -= len(data)
    return checksum


def _check_data(record: FileRecord, checksum: int) -> None:
    """Compare the checksum of all records before the end of the data, where the writer made one."""
    stated = _parse(record.place, record.opcode, record.content or b"").data_section_crc
    if stated not in (0, checksum):
        raise MalformedError(record.place, "the checksum of the file is wrong")
