"""Lines and requests of the control protocol: what is accepted, and how the rest is refused."""

import json
from math import isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.control_socket.dispatch import METHODS
from diffbotctl.control_socket.engine_channel import ResultCode, reply_to
from diffbotctl.control_socket.protocol import LINE_MAX_BYTES, LineBuffer, RefusalError, parse_line
from diffbotctl.control_socket.requests import (
    DriveRequest,
    GotoRequest,
    PublishRequest,
    ReadLogRequest,
    StopRequest,
    declared_fields,
    parse_hello,
    parse_request,
)

NUMBERS = [
    (method.request, name)
    for method in METHODS.values()
    for name, declaration in declared_fields(method.request).items()
    if declaration.kind is float
]


def lines_in(buffer):
    return iter(buffer.next, None)


@pytest.mark.parametrize("size", [1, 2, 7, 1000])
def test_lines_are_complete_however_they_were_cut(size):
    data = b'{"a": 1}\n\n{"b": 2}\nrest'
    lines, buffer = [], LineBuffer()
    for start in range(0, len(data), size):
        buffer.add(data[start : start + size])
        lines += lines_in(buffer)
    assert lines == [b'{"a": 1}', b"", b'{"b": 2}']
    assert buffer.rest == b"rest"


@given(st.lists(st.sampled_from([b"", b"\n", b"a", b"ab\n", b"\n\n", b"a\nb"])))
def test_lines_are_the_same_in_whatever_way_they_are_taken(pieces):
    one, other, taken = LineBuffer(), LineBuffer(), []
    for piece in pieces:
        taken += one.take(piece)
        other.add(piece)
    assert taken == list(lines_in(other)) and one.rest == other.rest


def test_a_line_of_the_greatest_length_is_taken_and_one_byte_more_is_refused():
    buffer = LineBuffer()
    assert len(buffer.take(b"x" * LINE_MAX_BYTES + b"\n")[0]) == LINE_MAX_BYTES
    with pytest.raises(RefusalError, match="more than"):
        buffer.take(b"x" * (LINE_MAX_BYTES + 1) + b"\n")


def test_a_line_of_the_greatest_length_passes_and_one_byte_more_is_refused():
    buffer = LineBuffer()
    buffer.add(b"x" * LINE_MAX_BYTES + b"\n")
    assert len(buffer.next()) == LINE_MAX_BYTES
    buffer.add(b"x" * (LINE_MAX_BYTES + 1))
    with pytest.raises(RefusalError, match="more than"):
        buffer.next()


@pytest.mark.parametrize(
    "line, words",
    [
        (b"", "not JSON"),
        (b"\x00\xff\xfe", "not JSON"),
        (b"[1, 2]", "not a JSON object"),
        (b"3", "not a JSON object"),
        (b'{"v": NaN}', "NaN is not a finite number"),
        (b'{"v": -Infinity}', "-Infinity is not a finite number"),
        (b'{"v": 1' + b"0" * 5000 + b"}", "not JSON"),  # beyond what int() reads
        (b'{"v": ' + b"[" * 60000, "nested too deeply"),
    ],
)
def test_a_line_that_is_no_object_is_refused(line, words):
    with pytest.raises(RefusalError, match=words):
        parse_line(line)


@pytest.mark.parametrize("value", ["1e999", "-1e999", "true", '"1"', "[1]", "1" + "0" * 400])
@pytest.mark.parametrize("request_class, name", NUMBERS)
def test_no_request_accepts_what_is_no_finite_number(request_class, name, value):
    """The engine does not check this again."""
    fields = {"x": 0.0, "y": 0.0} if request_class is GotoRequest else {}
    with pytest.raises(RefusalError, match="must be a finite number"):
        parse_request(request_class, {**fields, **parse_line(f'{{"{name}": {value}}}'.encode())})


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("request_class, name", NUMBERS)
def test_no_request_accepts_a_float_that_is_not_finite(request_class, name, value):
    fields = {"x": 0.0, "y": 0.0} if request_class is GotoRequest else {}
    with pytest.raises(RefusalError, match="must be a finite number"):
        parse_request(request_class, {**fields, name: value})


@pytest.mark.parametrize("value", [0, -3, 0.25, 1e308])
def test_finite_numbers_are_accepted(value):
    fields = parse_line(json.dumps({"linear": value}).encode())
    assert parse_request(DriveRequest, fields).linear == value
    assert isinstance(parse_request(DriveRequest, fields).linear, float)


def test_null_is_accepted_only_where_it_is_declared():
    assert parse_request(GotoRequest, {"x": 1, "y": 2, "heading": None}).heading is None
    with pytest.raises(RefusalError, match="must be a finite number"):
        parse_request(DriveRequest, {"linear": None})


def test_time_and_lease_of_drive_are_reserved_and_checked():
    request = parse_request(DriveRequest, {"time": 5, "lease": 0.3})
    assert (request.time, request.lease) == (5.0, 0.3)
    with pytest.raises(RefusalError, match="must be at least 0 s"):
        parse_request(DriveRequest, {"lease": -0.1})


@pytest.mark.parametrize(
    "request_class, fields, words",
    [
        (GotoRequest, {"x": 1}, "'y' must be a finite number .m.; it is missing"),
        (GotoRequest, {"x": 1001, "y": 0}, "'x' must be -1000 to 1000 m; it is 1001"),
        (StopRequest, {"reason": "a\x1b"}, "printable text"),
        (StopRequest, {"reason": "a" * 201}, "printable text"),
        (StopRequest, {"reason": None}, "printable text"),
        (PublishRequest, {"topic": "a", "message": [1]}, "must be an object"),
        (DriveRequest, {"take_over": 1}, "true or false"),
        (ReadLogRequest, {"level": "loud"}, "no level 'loud'"),
        (DriveRequest, {"speeed": 1}, "no field 'speeed'"),
    ],
)
def test_a_wrong_field_is_refused(request_class, fields, words):
    with pytest.raises(RefusalError, match=words):
        parse_request(request_class, fields)


@pytest.mark.parametrize(
    "hello, words",
    [
        ({"hello": 3}, "protocol 3 is not supported"),
        ({"hello": 1}, "protocol 1 is not supported"),
        ({"hello": 0}, "is not supported"),
        ({"hello": 10**30}, "is not supported"),
        ({"hello": True}, "must be a hello"),
        ({"hello": "1"}, "must be a hello"),
        ({"method": "stop"}, "must be a hello"),
        ({"hello": 2, "name": "a\nb"}, "printable text"),
        ({"hello": 2, "name": 5}, "printable text"),
    ],
)
def test_another_hello_is_refused(hello, words):
    with pytest.raises(RefusalError, match=words):
        parse_hello(parse_line(json.dumps(hello).encode()))


def test_a_client_without_a_name_has_one():
    assert parse_hello({"hello": 2, "name": "a"}) == "a"
    assert parse_hello({"hello": 2}) == "client"


@pytest.mark.parametrize("code", ResultCode)
def test_every_result_has_a_reply(code):
    reply = reply_to(code, "a detail")
    assert reply["ok"] == (code is ResultCode.DONE)
    assert reply["ok"] or reply["error"].startswith("E-")


@given(st.binary(max_size=400))
def test_any_bytes_end_in_objects_or_refusals(data):
    buffer = LineBuffer()
    buffer.add(data + b"\n")
    for line in lines_in(buffer):
        try:
            assert isinstance(parse_line(line), dict)
        except RefusalError as refusal:
            assert refusal.code in ("E-PROTOCOL", "E-REQUEST") and refusal.cause


@given(
    st.dictionaries(st.sampled_from(["linear", "angular", "x", "time"]), st.floats() | st.none())
)
def test_a_drive_request_holds_finite_numbers_or_is_refused(fields):
    try:
        request = parse_request(DriveRequest, fields)
    except RefusalError:
        return
    assert isfinite(request.linear) and isfinite(request.angular)
