"""The writer of MCAP files: byte for byte what the writer of the mcap library writes."""

from io import BytesIO

import pytest
from mcap.writer import CompressionType, Writer

from diffbotctl.recording.mcap_writer import McapWriter

CHUNK_BYTES = 1000
METADATA = {"from": "driver", "kind": "Volts"}


def written_by_library(messages: list[tuple[int, int, bytes, int]]) -> bytes:
    """A file with these messages: channel, time, data, sequence."""
    file = BytesIO()
    writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    writer.start(library="diffbotctl")
    writer.add_metadata("run", {"epoch": "17", "name": "é"})
    for number, name in enumerate(("Volts", "Twist")):
        schema = writer.register_schema(name, "jsonschema", b"{}" * number)
        writer.register_channel(f"robot.{name}", "json", schema, METADATA)
    for place, (channel, time, data, sequence) in enumerate(messages):
        writer.add_message(channel, time, data, time, sequence)
        if place % 50 == 49:
            writer.flush()
            writer.add_attachment(time, time, "state", "application/octet-stream", data)
    writer.add_metadata("end", {})
    writer.finish()
    return file.getvalue()


def written(messages: list[tuple[int, int, bytes, int]]) -> bytes:
    """The same by our writer."""
    file = BytesIO()
    writer = McapWriter(file, "diffbotctl", CHUNK_BYTES)
    writer.add_metadata("run", {"epoch": "17", "name": "é"})
    for number, name in enumerate(("Volts", "Twist")):
        schema = writer.add_schema(name, "jsonschema", b"{}" * number)
        writer.add_channel(f"robot.{name}", "json", schema, METADATA)
    for place, message in enumerate(messages):
        writer.add_message(*message)
        if place % 50 == 49:
            writer.flush()
            writer.add_attachment(message[1], "state", "application/octet-stream", message[2])
    writer.add_metadata("end", {})
    writer.finish()
    return file.getvalue()


@pytest.mark.parametrize("number", [0, 1, 49, 50, 51, 400])
def test_bytes_are_those_of_the_library(number: int) -> None:
    messages = [
        (2 if place % 3 else 1, 1_000_000_000_000 + 37 * place, b"x" * (place % 90), place // 4)
        for place in range(number)
    ]
    assert written(messages) == written_by_library(messages)


def test_times_may_go_back() -> None:
    messages = [(1, time, b"data", 0) for time in (500, 300, 900, 200, 700)]
    assert written(messages) == written_by_library(messages)


def test_message_beyond_the_size_of_a_chunk() -> None:
    messages = [(1, 1, b"a", 0), (2, 2, b"b" * 5 * CHUNK_BYTES, 1), (1, 3, b"c", 2)]
    assert written(messages) == written_by_library(messages)
