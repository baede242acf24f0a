"""Names in a file may be of any length: what is printed about them is short."""

import json

import pytest
from click.testing import CliRunner
from mcap.writer import CompressionType, Writer

from diffbotctl.cli.main import program
from diffbotctl.printable import shortened

LONG = "x" * 100_000


@pytest.fixture(params=["viewer", LONG])
def recording(request, tmp_path):
    """A recording with twenty topics whose names, and types, have 100 kB."""
    path = tmp_path / "long.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(library="diffbotctl")
        writer.add_metadata("run", {"epoch": "0"})
        schema = writer.register_schema("Text", "jsonschema", b"{}")
        for number in range(20):
            metadata = {"from": request.param, "kind": LONG}
            channel = writer.register_channel(f"{number}{LONG}", "json", schema, metadata)
            writer.add_message(channel, 0, json.dumps({"time": 0}).encode(), 0)
        writer.finish()
    return path


def test_bag_info_shortens_them(recording):
    done = CliRunner().invoke(program, ["bag", "info", str(recording)])
    assert done.exit_code == 0, done.output
    assert max(map(len, done.output.splitlines())) < 300
    assert done.output.count("...") >= 20


@pytest.mark.parametrize("length", [10, 11, 60])
def test_a_shortened_text_has_its_begin_and_its_end(length):
    text = shortened("abc" + "x" * 100 + "xyz", length)
    assert len(text) == length and text.startswith("abc") and text.endswith("xyz")
    assert shortened("x" * length, length) == "x" * length
