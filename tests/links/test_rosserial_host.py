"""The host against an independent implementation of the board, in simulated time."""

import struct
from math import isnan

import pytest

from diffbotctl.links import diffbot_codec
from diffbotctl.links.diffbot_codec import FrameDecoder
from diffbotctl.links.diffbot_frames import AskFrame, HelloFrame
from diffbotctl.links.rosserial_frames import encode
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.links.rosserial_topics import TopicNames
from diffbotctl.messages import Duty, Text, Volts, Wheels
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND
from tests.support.rosserial_device import PUBLISHERS, RATED, SUBSCRIBERS, RosserialDevice
from tests.support.rosserial_session import RosserialSession, pair_in
from tests.support.trials.rosserial import RECORDINGS, recorded, rows


def forward(now):
    return Duty(now, 0.6, 0.4)


@pytest.fixture
def driving():
    """A session after three seconds of driving a gentle curve."""
    session = RosserialSession(RosserialDevice(1)).run(3 * SECOND, forward)
    assert session.host.state == "up"
    return session


@pytest.mark.parametrize("path", [path for path in RECORDINGS if path.exists()], ids=str)
def test_recorded_session_is_decoded_at_once_and_byte_by_byte(path):
    rows_of_proof = list(recorded(path))
    assert len(rows_of_proof) == 3 and all(row.met for row in rows_of_proof), rows_of_proof


@pytest.mark.nightly
def test_sample_of_the_proof():
    rows_of_proof = list(rows(seed=7, starts=6))
    assert [row for row in rows_of_proof if not row.met] == []


def test_commands_reach_both_wheels_as_pwm(driving):
    # 0.6 and 0.4 of 255
    assert driving.device.commands["set_left_speed"][-1][1] == 153
    assert driving.device.commands["set_right_speed"][-1][1] == 102


@pytest.mark.parametrize(
    ("duty", "pwm"),
    [(1.0, 255), (-1.0, -255), (3.0, 255), (0.0, 0), (float("nan"), 0), (float("inf"), 0)],
)
def test_pwm_stays_within_255(driving, duty, pwm):
    driving.run(driving.now + 300 * MS, lambda now: Duty(now, duty, -0.5))
    assert pair_in(driving.written[-1][1]) == (pwm, -128)


def test_unchanged_pair_is_repeated_20_times_a_second(driving):
    begin = driving.now
    driving.run(begin + SECOND)
    pairs = [time for time, data in driving.written if time > begin and pair_in(data)]
    assert 18 <= len(pairs) <= 21


def test_newest_command_replaces_the_waiting_one(driving):
    host, now = driving.host, driving.now
    host.command(now, Duty(now, 0.1, 0.1))
    host.command(now, Duty(now, 1.0, 1.0))
    begin = len(driving.written)
    driving.run(now + 200 * MS)
    sent = [values for _, data in driving.written[begin:] if (values := pair_in(data))]
    assert set(sent) == {(255, 255)}


def test_line_is_never_overloaded(driving):
    driving.run(driving.now + 5 * SECOND, lambda now: Duty(now, now % 997 / 1000, 0.2))
    free = 0
    for time, data in driving.written:
        assert time >= free
        free = time + len(data) * 10 * SECOND // 9600


def test_rad_per_s_is_refused(driving):
    with pytest.raises(TypeError):
        driving.host.command(driving.now, Wheels(0, 1.0, 1.0))


def test_command_in_force_is_the_one_sent_100_ms_ago():
    session = RosserialSession(RosserialDevice(1)).run(3 * SECOND)
    begin = session.now
    session.host.command(begin, Duty(begin, 1.0, 1.0))
    session.run(begin + SECOND)
    sent = next(time for time, data in session.written if pair_in(data) == (255, 255))
    for message in session.encoders:
        expected = 1.0 if message.time >= sent + 100 * MS else 0.0
        assert (message.left_command, message.right_command) == (expected, expected)
        assert message.command_kind == "duty"
    assert session.encoders[-1].command_time == sent + 100 * MS


def test_stop_is_repeated_and_confirmed_by_constant_counts(driving):
    begin = driving.now
    driving.host.stop(begin)
    assert not driving.host.stopped
    driving.run(begin + 200 * MS)
    assert not driving.host.stopped  # the motors' lag is 0.1 s, and 0.3 s of standstill are needed
    driving.run(begin + 2 * SECOND)
    assert driving.host.stopped
    last = [values for time, data in driving.written if time > begin and (values := pair_in(data))]
    assert set(last) == {(0, 0)} and len(last) > 30
    driving.host.command(driving.now, Duty(0, 0.5, 0.5))
    assert not driving.host.stopped


def test_stop_is_not_confirmed_without_ticks(driving):
    driving.device.dead = True
    driving.host.stop(driving.now)
    driving.run(driving.now + 3 * SECOND)
    assert not driving.host.stopped


def test_cut_wire_goes_stale_and_comes_back_at_rest_in_the_same_boot(driving):
    driving.device.dead = True
    driving.run(driving.now + 5 * SECOND)
    assert driving.host.state == "stale"
    assert "no ticks" in driving.links[-1].cause
    driving.device.dead = False
    back = driving.now
    driving.run(back + 2 * SECOND)
    assert driving.host.state == "up" and driving.host.boot == 0
    assert driving.worst_error() <= 3
    late = [v for time, data in driving.written if time > back and (v := pair_in(data))]
    assert set(late) == {(0, 0)}  # the command from before the cut is not resumed


def test_restart_of_the_board_changes_boot_and_makes_no_jump(driving):
    before = driving.encoders[-1]
    driving.device.restart(driving.now)
    driving.run(driving.now + 5 * SECOND)
    after = [message for message in driving.encoders if message.boot == 1]
    assert driving.host.state == "up" and driving.host.boot == 1
    assert before.left > 30 and abs(after[0].left) <= 2
    assert driving.links[-1].restarts == 1
    assert driving.worst_error() <= 3


def test_counts_wrap_at_sixteen_bits():
    session = RosserialSession(RosserialDevice(1))
    session.device.counts = [32750.0, -32750.0]
    session.run(5 * SECOND, lambda now: Duty(now, 1.0, -1.0))
    last = session.encoders[-1]
    assert last.left > 32800 and last.right < -32800 and session.host.boot == 0
    assert session.worst_error() <= 3


@pytest.mark.parametrize(
    ("centimetres", "volts"),
    [
        (10.0, 1.3),
        (4.0, 3.25),
        (0.0, None),
        (float("inf"), None),
        (float("nan"), None),
        (-3.0, None),
        (1e-20, None),
    ],
)
def test_distance_is_converted_to_volts(driving, centimetres, volts):
    received = driving.host.receive(driving.now, encode(127, struct.pack("<f", centimetres)))
    (rows_of_proof,) = [message for port, message in received if port == "front"]
    assert isinstance(rows_of_proof, Volts)
    assert isnan(rows_of_proof.volts) if volts is None else abs(rows_of_proof.volts - volts) < 1e-6


def test_log_is_shown_without_control_characters(driving):
    text = b"low \x1b[31mbattery\n"
    payload = b"\x02" + struct.pack("<I", len(text)) + text
    received = driving.host.receive(driving.now, encode(7, payload))
    assert ("text", Text(driving.now, "board, warning: low  [31mbattery")) in received


def test_parameter_request_gets_an_empty_reply(driving):
    driving.device.write(driving.now, 6, struct.pack("<I", 5) + b"~gain")
    driving.run(driving.now + 300 * MS)
    assert [payload for _, payload in driving.device.replies] == [bytes(12)]


def test_time_is_answered_within_a_tenth_of_a_second(driving):
    driving.run(12 * SECOND, forward)
    # The first request is part of the answer about topics, during which the board reads nothing.
    for arrived, reported in driving.device.time_answers[2:]:
        assert 0 <= arrived - reported <= 100 * MS
    assert len(driving.device.time_answers) >= 8


def test_wrong_type_in_the_sketch_is_reported():
    wrong = (("set_left_speed", "Int16"), *SUBSCRIBERS[1:])
    session = RosserialSession(RosserialDevice(1, subscribers=wrong)).run(3 * SECOND)
    assert session.host.state == "negotiating"
    assert "declares set_left_speed as std_msgs/Int16" in session.links[-1].cause
    assert session.host.stop_frame() == b""
    assert not any(pair_in(data) for _, data in session.written)


class DiffbotBoard:
    """Answers as a board with the firmware of diffbotctl that nothing drives: only when asked."""

    def __init__(self):
        self.decoder, self.waiting = FrameDecoder(), b""

    def receive(self, now, data):
        if any(isinstance(frame, AskFrame) for frame in self.decoder.feed(data)):
            self.waiting += diffbot_codec.encode(HelloFrame(*[0] * len(HelloFrame._fields)))

    def advance(self, now):
        data, self.waiting = self.waiting, b""
        return data


def test_the_firmware_of_diffbotctl_is_recognised():
    host = RosserialSession(DiffbotBoard()).run(4 * SECOND).host
    assert host.refusal.code == "E-BOARD-DIFFBOT" and "--robot book_2wd" in host.refusal.fix


def test_a_silent_board_and_the_books_are_not_taken_for_it(driving):
    assert driving.run(10 * SECOND).host.refusal is None
    deaf = RosserialSession(RosserialDevice(1, publishers=(), subscribers=())).run(10 * SECOND)
    assert deaf.host.refusal is None


def test_other_names_and_slashes():
    publishers = (("/wheel_l", "Int32"), PUBLISHERS[1], PUBLISHERS[2])
    session = RosserialSession(
        RosserialDevice(1, publishers=publishers),
        RosserialHost(RATED, names=TopicNames(left_ticks="wheel_l")),
    ).run(2 * SECOND)
    assert "wheel_l" in session.host.topics.numbers


def test_stop_frame_is_a_pair_of_zeros_when_the_topics_are_known(driving):
    assert RosserialHost(RATED).stop_frame() == b""
    zero = bytes(4)
    assert driving.host.stop_frame() == encode(100, zero) + encode(101, zero)
    driving.host.opened(driving.now)
    assert driving.host.stop_frame() == b""


def test_closed_port_is_reported_with_its_cause(driving):
    ((port, link),) = driving.host.closed(driving.now, "Input/output error")
    assert (port, link.state, link.cause) == ("link", "lost", "Input/output error")
    assert driving.host.due() > 1000 * SECOND


def test_due_always_advances(driving):
    for _ in range(2000):
        now = max(driving.now, driving.host.due())
        driving.host.on_time(now)
        driving.host.send(now)
        assert driving.host.due() > now
        driving.now = now
