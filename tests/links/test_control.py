"""The control protocol's lines: what is taken, and how the rest is refused."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.control_socket.protocol import (
    LONGEST_LINE,
    LineBuffer,
    RefusalError,
    check_hello,
    encode_lines,
    parse_request,
)


@pytest.mark.parametrize("size", [1, 2, 7, 1000])
def test_lines_come_whole_however_they_were_cut(size):
    data = b'{"a": 1}\n\n{"b": 2}\nrest'
    found, cutter = [], LineBuffer()
    for start in range(0, len(data), size):
        cutter.add(data[start : start + size])
        found += encode_lines(cutter)
    assert found == [b'{"a": 1}', b"", b'{"b": 2}']
    assert cutter.rest == b"rest"


def test_a_line_of_the_longest_length_passes_and_one_byte_more_is_refused():
    cutter = LineBuffer()
    cutter.add(b"x" * LONGEST_LINE + b"\n")
    assert len(cutter.next()) == LONGEST_LINE
    cutter.add(b"x" * (LONGEST_LINE + 1))
    with pytest.raises(RefusalError, match="more than"):
        cutter.next()


@pytest.mark.parametrize(
    "line, words",
    [
        (b"", "no JSON"),
        (b"\x00\xff\xfe", "no JSON"),
        (b"[1, 2]", "no JSON object"),
        (b"3", "no JSON object"),
        (b'{"v": NaN}', "NaN is no number"),
        (b'{"v": -Infinity}', "-Infinity is no number"),
        (b'{"v": 1' + b"0" * 5000 + b"}", "no JSON"),  # beyond what int() reads
        (b'{"v": ' + b"[" * 60000, "nested too deeply"),
    ],
)
def test_what_is_no_request_is_refused(line, words):
    with pytest.raises(RefusalError, match=words):
        parse_request(line)


@pytest.mark.parametrize(
    "value", ["1e999", "-1e999", "true", '"1"', "null", "[1]", "1" + "0" * 400]
)
def test_what_is_no_finite_number_is_refused(value):
    with pytest.raises(RefusalError, match="must be a finite number"):
        parse_request(b'{"v": %s}' % value.encode()).number_of("v", "m/s")


@pytest.mark.parametrize("value", [0, -3, 0.25, 1e308])
def test_finite_numbers_are_taken(value):
    assert parse_request(json.dumps({"v": value}).encode()).number_of("v", "m/s") == value


@pytest.mark.parametrize(
    "hello, words",
    [
        ({"hello": 2}, "protocol 2 is not spoken"),
        ({"hello": 10**30}, "is not spoken"),
        ({"hello": True}, "must be a hello"),
        ({"hello": "1"}, "must be a hello"),
        ({"do": "stop"}, "must be a hello"),
        ({"hello": 1, "name": "a\nb"}, "printable text"),
        ({"hello": 1, "name": 5}, "printable text"),
    ],
)
def test_another_hello_is_refused(hello, words):
    with pytest.raises(RefusalError, match=words):
        check_hello(parse_request(json.dumps(hello).encode()))


def test_a_misspelt_field_is_refused():
    with pytest.raises(RefusalError, match="no field 'speeed'"):
        parse_request(b'{"do": "drive", "speeed": 1}').only("linear", "angular")


@given(st.binary(max_size=400))
def test_any_bytes_end_in_requests_or_refusals(data):
    cutter = LineBuffer()
    cutter.add(data + b"\n")
    for line in encode_lines(cutter):
        try:
            assert isinstance(parse_request(line).fields, dict)
        except RefusalError as refusal:
            assert refusal.code in ("E-PROTOCOL", "E-REQUEST") and refusal.cause
