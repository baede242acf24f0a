"""Intel hex files: reading, writing, errors."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.drivers.board_ports import BadImageError
from diffbotctl.emulator.program import IMAGE
from diffbotctl.flash.intel_hex import (
    FLASH_BYTES_MAX,
    MONITOR_CALL,
    PAGE_BYTES,
    read_hex,
    write_hex,
)


@given(st.binary(min_size=1, max_size=2000).filter(lambda data: MONITOR_CALL not in data))
def test_what_is_written_can_be_read(data):
    image = read_hex(write_hex(data))
    assert image[: len(data)] == data
    assert len(image) % PAGE_BYTES == 0
    assert set(image[len(data) :]) <= {0xFF}


def test_beyond_64_kib():
    data = bytes(range(1, 251)) * 300
    assert read_hex(write_hex(data))[: len(data)] == data


def test_the_shipped_image():
    image = read_hex(IMAGE.read_text())
    assert MONITOR_CALL not in image
    assert len(image) < FLASH_BYTES_MAX


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "cut short"),
        (":00000001FF", "no program"),
        ("hello", "not a line"),
        (":0100000000FE", "damaged"),  # the checksum of 01 00 00 00 00 is FF
        (":0100000000FF", "cut short"),
        (":0100000000FF\n:0100100000EF\n:00000001FF", "gap"),
        (":0100000000FF\n:0100000000FF\n:00000001FF", "overlap"),
        (":00000001FF\n:0100000000FF", "after the end"),
        (":0200000400FF", "not a line"),
        (write_hex(b"abc!!!def"), "!!!"),
        (write_hex(bytes(FLASH_BYTES_MAX + 1)), "do not fit"),
    ],
)
def test_what_is_refused(text, words):
    with pytest.raises(BadImageError, match=words):
        read_hex(text)


@given(st.text(alphabet=":0123456789ABCDEF\n x", max_size=200))
def test_noise_gives_an_image_or_a_reason(text):
    try:
        assert read_hex(text)
    except BadImageError as error:
        assert error.problems[0].fix
