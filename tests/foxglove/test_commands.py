"""Frames of the protocol, and what viewers publish, worked out by hand."""

import json
from math import isnan, pi, sqrt

import pytest

from diffbotctl.client.velocity_driver import VelocityDriver
from diffbotctl.client.velocity_rules import Limits, VelocityRules, VelocitySource
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.foxglove import commands, protocol
from diffbotctl.foxglove.commands import Command
from diffbotctl.foxglove.parameters import connection_graph, parameter_rows, parameter_values
from diffbotctl.foxglove.protocol import ClientMessage, FrameError, ServiceCall
from tests.support.foxglove_viewer import twist

BOTH = frozenset(Command)
VIEWER = VelocitySource(frozenset({"viewer 1"}), "viewer 1")


def test_frames_of_the_server_byte_by_byte():
    data = protocol.message_data(7, 0x0102030405060708, b"{}")
    assert data == bytes([1, 7, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1]) + b"{}"
    response = protocol.service_response(ServiceCall(2, 3, b""), b"{}")
    assert response == bytes([3, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0]) + b"json{}"
    assert protocol.asset_response(5, b"<x/>") == bytes([4, 5, 0, 0, 0, 0, 0, 0, 0, 0]) + b"<x/>"
    missing = protocol.asset_response(5, None)
    assert missing[5] == 1 and missing[6] == len(missing) - 10


def test_frames_of_a_viewer():
    assert protocol.parse_binary(b"\x01\x09\x00\x00\x00{}") == ClientMessage(9, b"{}")
    call = b"\x02" + bytes([1, 0, 0, 0, 2, 0, 0, 0, 4, 0, 0, 0]) + b"json{}"
    assert protocol.parse_binary(call) == ServiceCall(1, 2, b"{}")
    assert protocol.parse_operation('{"op": "subscribe", "a": 1}') == ("subscribe", {"a": 1})


@pytest.mark.parametrize(
    "frame",
    [b"", b"\x01\x00", b"\x02\x00\x00", b"\x09" * 20, b"\x02" + bytes(8) + b"\xff\xff\xff\xff"],
)
def test_binary_frames_that_are_none(frame):
    with pytest.raises(FrameError):
        protocol.parse_binary(frame)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"op": 3}', "[" * 100_000, "nonsense"])
def test_text_frames_that_are_none(text):
    with pytest.raises(FrameError):
        protocol.parse_operation(text)


@pytest.mark.parametrize("values", [None, {}, ["a"], [-1], [1 << 32], [True], [1.0]])
def test_lists_of_numbers_that_are_none(values):
    with pytest.raises(FrameError):
        protocol.numbers({"channelIds": values}, "channelIds")


@pytest.mark.parametrize("values", [None, [1], [{}], [{"id": "1"}]])
def test_rows_without_their_identifiers(values):
    with pytest.raises(FrameError):
        protocol.rows({"channels": values}, "channels", ("id",))


def pose(x, y, heading_z, heading_w):
    turn = {"x": 0.0, "y": 0.0, "z": heading_z, "w": heading_w}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turn}


@pytest.mark.parametrize("topic", ["goal_pose", "/goal_pose"])
@pytest.mark.parametrize(
    "around",
    [
        lambda pose: {"header": {"frame_id": "odom", "stamp": {"sec": 1}}, "pose": pose},
        lambda pose: {"timestamp": {"sec": 1, "nsec": 0}, "frame_id": "odom", "pose": pose},
    ],
)
def test_a_goal_of_both_message_types(topic, around):
    assert commands.command_of(topic, "json", BOTH) is Command.GOAL
    fields = commands.goal(json.dumps(around(pose(1.0, 0.5, sqrt(0.5), sqrt(0.5)))).encode())
    assert (fields["x"], fields["y"]) == (1.0, 0.5)
    assert fields["heading"] == pytest.approx(pi / 2)


@pytest.mark.parametrize(
    "message",
    [
        [],
        {},
        {"pose": None},
        {"pose": {"position": {"x": 1.0}, "orientation": {}}},
        {"frame_id": "base_link", "pose": pose(1.0, 0.0, 0.0, 1.0)},
        {"pose": pose("1", 0.0, 0.0, 1.0)},
        {"pose": pose(1.0, 0.0, 0.0, 0.0)},
        {"pose": pose(10**400, 0.0, 0.0, 1.0)},
    ],
)
def test_goals_that_are_none(message):
    with pytest.raises(RefusalError):
        commands.goal(json.dumps(message).encode())


def test_a_velocity_has_its_two_axes():
    assert commands.velocity(json.dumps(twist(0.1, -0.5)).encode()) == (0.1, -0.5)
    linear, _ = commands.velocity(b'{"linear": {"x": "fast"}, "angular": {}}')
    assert isnan(linear)  # the rules stop the robot for it
    for data in (b"", b"[]", b"{}", b'{"linear": 1, "angular": 2}'):
        with pytest.raises(RefusalError):
            commands.velocity(data)


@pytest.mark.parametrize(
    "topic, encoding, allowed",
    [
        ("cmd_vel", "json", frozenset()),
        ("cmd_vel", "json", frozenset({Command.GOAL})),
        ("goal_pose", "json", frozenset({Command.VELOCITY})),
        ("goal_pose", "cdr", BOTH),
        ("robot.encoders", "json", BOTH),
        ("//cmd_vel", "json", BOTH),
    ],
)
def test_what_is_not_allowed_is_not_published(topic, encoding, allowed):
    with pytest.raises(RefusalError):
        commands.command_of(topic, encoding, allowed)


def test_without_permission_there_is_only_stop():
    assert [each.name for each in commands.services(frozenset())] == ["stop"]
    assert [each.name for each in commands.services(BOTH)] == ["stop", "resume"]


@pytest.fixture
def sent():
    return []


@pytest.fixture
def driving(sent):
    def send(method, **fields):
        sent.append((method, fields))

    return VelocityDriver(VelocityRules(Limits(0.5, 2.0)), send, lambda text: None)


def beats(driving, start, end):
    """Beats of the server between two times, 50 ms apart; the time of each."""
    steps = round((end - start) / 0.05)
    for step in range(1, steps + 1):
        driving.beat(start + 0.05 * step)
        yield start + 0.05 * step


def test_a_viewer_that_falls_silent_is_lost_within_350_ms(driving, sent):
    driving.velocity_received(10.0, 0.1, 0.0, VIEWER)
    lost = next(now for now in beats(driving, 10.0, 11.0) if sent[-1][0] == "operator_lost")
    assert lost == pytest.approx(10.3, abs=0.051)
    driving.velocity_received(11.0, 0.1, 0.0, VIEWER)  # latched: it drives no more
    driving.beat(11.05)
    assert [method for method, _ in sent].count("operator_lost") == 1
    assert sent[-1][0] == "operator_lost"


def test_a_zero_releases_and_silence_after_it_is_no_fault(driving, sent):
    driving.velocity_received(10.0, 0.1, 0.2, VIEWER)
    driving.velocity_received(10.05, 0.0, 0.0, VIEWER)
    assert list(beats(driving, 10.05, 12.0))
    assert sent == [("drive", {"linear": 0.1, "angular": 0.2}), ("release", {})]


def test_a_viewer_that_goes_while_it_drives_is_lost_at_once(driving, sent):
    driving.publishers_changed(frozenset())
    assert not sent  # it did not drive
    driving.velocity_received(10.0, 0.1, 0.0, VIEWER)
    driving.publishers_changed(frozenset())
    assert sent[-1][0] == "operator_lost" and "viewer 1" in sent[-1][1]["reason"]


def test_a_velocity_that_is_no_number_stops(driving, sent):
    driving.velocity_received(10.0, float("nan"), 0.0, VIEWER)
    assert [method for method, _ in sent] == ["stop"]


def test_a_refused_velocity_needs_a_zero_first(driving, sent):
    driving.velocity_received(10.0, 0.1, 0.0, VIEWER)
    driving.reply_received({"id": "drive", "ok": False, "cause": "the robot is stopped"})
    driving.velocity_received(10.1, 0.1, 0.0, VIEWER)
    assert [method for method, _ in sent] == ["drive"]
    driving.velocity_received(10.2, 0.0, 0.0, VIEWER)
    driving.velocity_received(10.3, 0.1, 0.0, VIEWER)
    assert [method for method, _ in sent] == ["drive", "drive"]


def test_parameters_have_their_values_and_types():
    reply = {
        "parameters": [
            {"parameter": "guard.margin", "value": 0.05},
            {"parameter": "mux.order", "value": "hand"},
            {"parameter": "guard.none", "value": None},
        ]
    }
    values = parameter_values(reply)
    assert parameter_rows(values, []) == [
        {"name": "guard.margin", "value": 0.05, "type": "float64"},
        {"name": "mux.order", "value": "hand"},
    ]
    assert parameter_rows(values, ["mux.order", "unknown"]) == [
        {"name": "mux.order", "value": "hand"}
    ]


def test_the_graph_names_publishers_subscribers_and_services():
    wires = [
        {"topic": "robot.encoders", "to": "odometry", "port": "encoders"},
        {"topic": "robot.encoders", "to": "wheel_speed", "port": "encoders"},
    ]
    graph = connection_graph(["robot.encoders"], wires, ["stop"])
    assert graph["publishedTopics"] == [{"name": "robot.encoders", "publisherIds": ["robot"]}]
    assert graph["subscribedTopics"] == [
        {"name": "robot.encoders", "subscriberIds": ["odometry", "wheel_speed"]}
    ]
    assert graph["advertisedServices"] == [{"name": "stop", "providerIds": ["diffbotctl"]}]
