"""Frames decoded from clean, damaged and random streams."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.links.rosserial_frames import (
    PAYLOAD_BYTES_MAX,
    RosserialDecoder,
    RosserialFrame,
    encode,
)

TICKS = RosserialFrame(125, bytes.fromhex("2a000000"))
TICKS_BYTES = "fffe0400fb7d002a00000058"  # 255 - (0x7d + 0x2a) = 0x58
frames = st.lists(
    st.builds(
        RosserialFrame,
        st.integers(0, 300),
        # Without ff no frame can start within a payload, so the stream has one decoding only.
        st.lists(st.integers(0, 254), max_size=40).map(bytes),
    ),
    max_size=8,
)
# No ff in it, so it cannot start a frame, and no frame can start in it.
junk = st.lists(st.integers(0, 254), max_size=20).map(bytes)


@pytest.mark.parametrize(
    ("topic", "payload", "expected"),
    [
        (0, b"", "fffe0000ff0000ff"),  # the request for the topics, as documented
        (11, b"", "fffe0000ff0b00f4"),  # tx stop, likewise
        (*TICKS, TICKS_BYTES),
    ],
)
def test_bytes_of_a_frame(topic, payload, expected):
    assert encode(topic, payload).hex() == expected


@pytest.mark.parametrize(
    ("before", "damaged"),
    [
        ("", 0),
        ("00 11 22", 3),
        ("ff", 1),
        ("ff ff", 2),
        ("ff fe", 2),
        ("ff fe 04 00 fb 7d 00", 7),  # a frame cut after its header
        ("ff fe 30 75 5a", 5),  # length 30000, sum right: 0x30 + 0x75 = 0xa5
        ("ff fe ff ff 01", 5),  # length -1
        ("ff fe f4 01 0a", 5),  # length 500, sum right: includes all three frames
        ("ff fe 0a 00 f5 7d 00", 7),  # length 10: ends within the first frame
    ],
)
def test_three_frames_follow_at_once_after(before, damaged):
    decoder = RosserialDecoder()
    assert decoder.feed(bytes.fromhex(before + TICKS_BYTES * 3)) == [TICKS] * 3
    assert (decoder.frames, decoder.damaged) == (3, damaged)


def test_largest_payload_passes_and_one_more_byte_is_refused_at_its_header():
    assert RosserialDecoder().feed(encode(7, bytes(PAYLOAD_BYTES_MAX))) == [
        RosserialFrame(7, bytes(PAYLOAD_BYTES_MAX))
    ]
    decoder = RosserialDecoder()
    decoder.feed(encode(7, bytes(PAYLOAD_BYTES_MAX + 1))[:5])
    assert decoder.damaged == 5


def test_implausible_topic_is_not_waited_for():
    decoder = RosserialDecoder(lambda topic, length: topic == 125 and length == 4)
    assert decoder.feed(bytes.fromhex("fffe2000df7e00" + TICKS_BYTES)) == [TICKS]
    assert decoder.feed(encode(126, b"1234")) == []


@pytest.mark.parametrize("position", range(12))
@pytest.mark.parametrize("bit", range(8))
def test_one_flipped_bit_loses_that_frame_alone(position, bit):
    stream = bytearray(bytes.fromhex(TICKS_BYTES * 3))
    stream[12 + position] ^= 1 << bit
    assert RosserialDecoder().feed(bytes(stream)) == [TICKS, TICKS]


@given(st.lists(st.tuples(junk, frames), max_size=4))
def test_every_intact_frame_comes_through_junk(parts):
    stream, sent = b"", []
    for rubbish, some in parts:
        stream += rubbish + b"".join(encode(*frame) for frame in some)
        sent += some
    decoder = RosserialDecoder()
    assert [f for f in decoder.feed(stream) if f in sent] == sent


@given(
    st.lists(
        st.sampled_from(
            [b"\xff", b"\xfe", b"\x00", b"\x04\x00\xfb", b"}\x00", bytes.fromhex(TICKS_BYTES)]
        ),
        max_size=30,
    ),
    st.data(),
)
def test_how_the_bytes_are_cut_makes_no_difference(parts, data):
    stream = b"".join(parts)
    whole, cut, single = RosserialDecoder(), RosserialDecoder(), RosserialDecoder()
    expected = whole.feed(stream)
    at = data.draw(st.integers(0, len(stream)))
    assert cut.feed(stream[:at]) + cut.feed(stream[at:]) == expected
    assert [f for i in range(len(stream)) for f in single.feed(stream[i : i + 1])] == expected
    assert whole.damaged == cut.damaged == single.damaged


@given(st.binary(max_size=400))
def test_every_byte_of_a_random_stream_is_counted(stream):
    decoder = RosserialDecoder()
    found = decoder.feed(stream)
    assert 0 <= decoder.damaged <= len(stream)
    assert len(found) == decoder.frames
