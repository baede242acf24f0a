"""The protocol's declaration: generated files, frame sizes, checksum, codec."""

import importlib.util
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import (
    WIRE_BYTES,
    WIRE_BYTES_MAX,
    FrameDecoder,
    checksum,
    decode,
    encode,
    encode_payload,
    pack,
)
from tests.support import firmware_parts
from tests.support.trials import frame_damage

FIRMWARE = Path(__file__).parents[2] / "firmware"
spec = importlib.util.spec_from_file_location("generate", FIRMWARE / "generate.py")
generate = importlib.util.module_from_spec(spec)
spec.loader.exec_module(generate)
PROTOCOL = generate.load()


@pytest.mark.parametrize(
    ("path", "made"),
    [(generate.HEADER, generate.header), (generate.MODULE, generate.module)],
    ids=["C header", "Python module"],
)
def test_generated_files_are_up_to_date(path, made):
    assert path.read_text() == made(PROTOCOL), "run `python firmware/generate.py`"


def test_frames_keep_within_the_wire_budget():
    """At 9600 baud the Mega's divider gives 9615, so 961 bytes a second."""
    assert WIRE_BYTES[frames.CommandFrame] <= 10  # 10.4 ms on the wire
    assert WIRE_BYTES[frames.StopFrame] < WIRE_BYTES[frames.CommandFrame]
    # One status frame follows four state frames, where the line has room for it.
    state, counts, status = (
        WIRE_BYTES[frame] for frame in (frames.StateFrame, frames.CountsFrame, frames.StatusFrame)
    )
    assert 38 * (state + status / 4) <= 920
    assert 48 * (counts + status / 4) <= 961


def test_checksum_is_that_of_flexray():
    """Bit by bit, as in the standard: shift left, subtract the polynomial on carry."""
    check = 0xFEDCBA
    for byte in b"123456789":
        for bit in range(7, -1, -1):
            carry = (check >> 23 & 1) ^ (byte >> bit & 1)
            check = check << 1 & 0xFFFFFF
            if carry:
                check ^= 0x5D6DCB
    assert checksum(b"123456789") == check


def test_five_flipped_bits_are_always_detected():
    """No code word of weight below six up to our longest frame.

    The polynomial has an even number of terms, so it is divisible by x + 1 and detects all odd
    weights. Weight two or four in n bits would mean that two pairs of positions have equal
    syndromes.
    """
    polynomial = frames.CHECK_POLYNOMIAL
    assert (polynomial.bit_count() + 1) % 2 == 0
    longest = 8 * (max(WIRE_BYTES.values()) - 2)
    syndromes, value = [], 1
    for _ in range(longest):
        syndromes.append(value)
        value <<= 1
        if value & 0x1000000:
            value ^= 0x1000000 | polynomial
    pairs = [a ^ b for i, a in enumerate(syndromes) for b in syndromes[:i]]
    assert 0 not in pairs
    assert len(set(pairs)) == len(pairs)


def any_frame():
    def of(kind):
        declared = PROTOCOL["frames"][kind.__name__.removesuffix("Frame").lower()]
        values = []
        for _, width, _, many in generate.fields(declared):
            low, high = (
                (-(1 << -width - 1), (1 << -width - 1) - 1) if width < 0 else (0, (1 << width) - 1)
            )
            one = st.integers(low, high)
            values.append(st.tuples(*[one] * many) if many > 1 else one)
        return st.tuples(*values).map(lambda got: kind(*got))

    return st.sampled_from(sorted(WIRE_BYTES, key=lambda kind: kind.__name__)).flatmap(of)


@given(any_frame())
def test_frames_are_decoded_as_encoded(frame):
    wire = encode(frame)
    assert len(wire) == WIRE_BYTES[type(frame)]
    assert b"\0" not in wire[:-1]
    assert FrameDecoder().feed(wire) == [frame]


@given(any_frame(), st.data())
def test_bytes_may_come_in_any_pieces(frame, data):
    stream = encode(frame) * 3
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    decoder = FrameDecoder()
    got = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        got += decoder.feed(stream[start:end])
    assert got == [frame] * 3
    assert decoder.damaged == 0


@given(st.binary(max_size=200))
def test_noise_raises_no_error(noise):
    decoder = FrameDecoder()
    decoder.feed(noise)
    stop = frames.StopFrame(3)
    # A delimiter ends a frame that the noise started.
    assert decoder.feed(b"\0" + encode(stop))[-1] == stop


def test_bytes_without_delimiters_take_no_memory():
    decoder = FrameDecoder()
    for _ in range(100):
        decoder.feed(b"\x55" * 10_000)
    assert len(decoder._rest) <= WIRE_BYTES_MAX
    stop = frames.StopFrame(3)
    assert decoder.feed(b"\0" + encode(stop)) == [stop]


@settings(deadline=None, max_examples=40)  # each starts a process, the first one the compiler
@given(any_frame())
def test_the_board_reads_what_the_host_writes(frame):
    lines = firmware_parts.run("codec", lines=[encode(frame).hex()])
    assert lines == [f"frame {pack(frame).hex()}"]


@pytest.mark.parametrize(
    "wire",
    [
        "00",  # only a delimiter: idle line, no frame
        "0100",  # a code byte alone: an empty frame
        "ff00",  # a code that points beyond the frame
        "01" * 40 + "00",  # zeros in a row
        "02" * 60 + "00",  # longer than any frame
    ],
)
def test_malformed_frames_are_refused_on_both_sides(wire):
    assert FrameDecoder().feed(bytes.fromhex(wire)) == []
    assert not any(line.startswith("frame") for line in firmware_parts.run("codec", lines=[wire]))


@given(any_frame(), st.binary(min_size=1, max_size=40))
def test_a_longer_frame_is_read_and_its_end_ignored(frame, more):
    assert FrameDecoder().feed(encode_payload(pack(frame) + more)) == [frame]


@settings(deadline=None, max_examples=20)
@given(any_frame(), st.binary(min_size=1, max_size=40))
def test_the_board_reads_longer_frames(frame, more):
    lines = firmware_parts.run("codec", lines=[encode_payload(pack(frame) + more).hex()])
    assert lines == [f"frame {(pack(frame) + more).hex()}"]


@given(any_frame(), st.data())
def test_a_shorter_frame_is_refused(frame, data):
    payload = pack(frame)
    size = data.draw(st.integers(0, len(payload) - 1))
    assert FrameDecoder().feed(encode_payload(payload[:size])) == []


def test_the_hello_of_version_2_is_read():
    """Boot 3, firmware 0.2.0, Mega 2560, line reset, stopped, UART 1, its settings."""
    payload = bytes([0x3B, 2, 0, 2, 0, 1, 0x12, 1, 0x78, 0x56, 0x34, 0x12, 96, 58])
    (hello,) = FrameDecoder().feed(encode_payload(payload + bytes([0x7F, 0x1F, 7, 7])))
    assert hello == frames.HelloFrame(3, 2, 0, 2, 0, 1, 2, 1, 1, 0x12345678, 96, 58, 0x07071F7F)


def test_a_type_that_does_not_exist_is_refused():
    body = bytes([0x0E, 1, 2, 3])
    data = body + checksum(body).to_bytes(3, "little")
    assert decode(bytes([len(data) + 1]) + data) is None


@pytest.mark.parametrize("seed", [1, 2])
def test_damaged_frames_are_refused_and_the_next_is_read(seed):
    for row in (*frame_damage.to_board(seed, 200_000), *frame_damage.to_host(seed, 5_000)):
        assert row.met, row
