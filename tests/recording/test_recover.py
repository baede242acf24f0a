"""Cut and damaged recordings, mended: every message of every chunk that is whole comes back."""

import struct
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from diffbotctl.errors import RunError
from diffbotctl.messages import Twist, Volts
from diffbotctl.recording.reader import RecordingReader, recording_info
from diffbotctl.recording.recover import recover
from diffbotctl.recording.writer import RecordingHeader, RecordingWriter

WIRES = {"robot.front": Volts, "mux.twist": Twist}
ABOUT = {"epoch": "1000", "version": "1", "files": "{}", "sets": "[]", "port": "sim"}
A_SECOND = 50  # instants between two flushes


def written(seconds):
    """The bytes of an unfinished recording, flushed each second of the run."""
    with tempfile.NamedTemporaryFile() as file:
        recording = RecordingWriter(file, RecordingHeader(WIRES, 1, ABOUT))
        for second in range(seconds):
            for place in range(A_SECOND):
                now = (second * A_SECOND + place) * 20_000_000
                recording.write((now, Volts(now, place / 7), Twist(now, 0.1, second / 3)))
            recording.flush()
        return Path(file.name).read_bytes()


def chunks(data):
    """(begin, end) of each chunk: after the magic, records are an opcode, a length, a body."""
    place, places = 8, []
    while place + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, place)
        if opcode == CHUNK:
            places.append((place, place + 9 + length))
        place += 9 + length
    return places


CHUNK = 0x06  # the opcode in the MCAP specification
WHOLE = written(6)
CHUNKS = chunks(WHOLE)
A_CHUNK = 2 * A_SECOND  # messages


def recover_data(data, folder):
    source, target = folder / "cut.mcap", folder / "mended.mcap"
    source.write_bytes(data)
    target.unlink(missing_ok=True)
    result = recover(source, target)
    with target.open("rb") as file:  # the reader that refuses unfinished files
        read_back = [(m.log_time, c.topic, m.data) for _, c, m in make_reader(file).iter_messages()]
    return result, read_back


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cut")


@settings(max_examples=40, deadline=None)
@given(st.integers(CHUNKS[0][0], len(WHOLE)))
def test_a_file_cut_anywhere_gives_back_every_whole_chunk(folder, length):
    result, read_back = recover_data(WHOLE[:length], folder)
    assert result.messages == len(read_back) == A_CHUNK * sum(end <= length for _, end in CHUNKS)
    assert result.cut is not None
    original = list(RecordingReader(folder / "cut.mcap").records())
    assert read_back == [(m.log_time, c.topic, m.data) for c, m in original]


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(CHUNKS[1:]), st.floats(0.2, 1.0, exclude_max=True))
def test_a_damaged_chunk_costs_only_itself(folder, chunk, share):
    # Not so the first one: it also holds the topics' names and types.
    begin, end = chunk
    data = bytearray(WHOLE)
    data[begin + int((end - begin) * share)] ^= 0x55  # behind the chunk's own head
    result, read_back = recover_data(bytes(data), folder)
    assert result.damaged == 1
    assert len(read_back) == A_CHUNK * (len(CHUNKS) - 1)


def test_a_whole_recording_stays_what_it_was(goal, tmp_path):
    result = recover(goal, tmp_path / "again.mcap")
    assert (result.damaged, result.cut) == (0, None)
    before, after = RecordingReader(goal), RecordingReader(tmp_path / "again.mcap")
    texts = [[(i.time, i.wire, i.data) for i in each.messages()] for each in (before, after)]
    assert texts[0] == texts[1]
    assert (before.end, before.about) == (after.end, after.about)


@pytest.mark.parametrize("data", [b"", b"no recording at all", WHOLE[:8], WHOLE[:40]])
def test_no_file_is_left_when_the_source_is_not_a_recording(tmp_path, data):
    source = tmp_path / "bad.mcap"
    source.write_bytes(data)
    with pytest.raises(RunError, match="beginning of a recording"):
        recover(source, tmp_path / "out.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.mcap"]


def test_a_recovered_file_is_marked_as_recovered(folder):
    recover_data(WHOLE[: CHUNKS[2][1] + 10], folder)
    read_back = recording_info(folder / "mended.mcap")
    assert read_back.recovered is not None and not read_back.complete
    assert [(topic.name, topic.messages) for topic in read_back.topics] == [
        ("robot.front", 3 * A_SECOND),
        ("mux.twist", 3 * A_SECOND),
    ]
