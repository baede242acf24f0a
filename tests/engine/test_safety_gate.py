"""The last gate: what leaves, what holds the robot, and how it lets go."""

from math import inf, nan, pi

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.engine.safety_gate import Gate
from diffbotctl.log import WARNING, Log
from diffbotctl.messages import Encoders, Link, Resume, Stop, Wheels
from diffbotctl.time import MILLISECOND as MS

RATED = 100 * 2 * pi / 60  # rad/s: 100 rpm
SIDE = load_robot("book_2wd").robot.drive.left


def gate():
    return Gate(
        left_side=SIDE,
        right_side=SIDE,
        track=0.125,
        speed=0.3,
        turn_rate=4.0,
        command_delay=0.015,
        command_jitter=0.0,
        telemetry=40.0,
        protocol="diffbot",
    )


class Held:
    """Feeds a gate as the engine does: each input holds its last message."""

    def __init__(self):
        self.gate = gate()
        self.inputs = dict.fromkeys(
            ["command", "encoders", "link", "board", "operator", "waiting", "resume"]
        )

    def at(self, now, **new):
        self.inputs.update(new)
        return self.gate.react(now, *self.inputs.values())


def started():
    held = Held()
    held.at(1, encoders=Encoders(1, 0, 0))
    return held


def test_only_zero_passes_before_the_first_telemetry():
    wheels, stop = Held().at(5, command=Wheels(5, 3.0, 3.0))
    assert wheels == Wheels(5, 0.0, 0.0) and stop is None


def test_a_valid_command_passes_unchanged():
    command = Wheels(2, 3.0, -3.0)
    assert started().at(2, command=command) == (command, None)


@pytest.mark.parametrize(
    "left, right, words",
    [
        (nan, 1.0, "not a number"),
        (1.0, inf, "not a number"),
        (RATED * 1.001, 0.0, "left wheel is above"),
        (0.0, -RATED * 1.001, "right wheel is above"),
        (9.5, 9.5, "m/s is above"),  # 9.5 rad/s on 32.5 mm is 0.309 m/s
        (-7.8, 7.8, "turn limit"),  # 2 x 7.8 x 32.5 mm over 125 mm is 4.06 rad/s
    ],
)
def test_a_command_beyond_the_limits_stops_and_latches(left, right, words):
    held = started()
    wheels, stop = held.at(2, command=Wheels(2, left, right))
    assert wheels == Wheels(2, 0.0, 0.0)
    assert stop.code == "gate_limit" and stop.latched and words in stop.cause
    wheels, _ = held.at(3, command=Wheels(3, 1.0, 1.0))
    assert wheels == Wheels(3, 0.0, 0.0)  # a sound command does not end a latched stop


def test_limits_themselves_may_be_used():
    rim = 0.3 / 0.0325  # rad/s at the speed limit
    command = Wheels(2, rim, rim)
    assert started().at(2, command=command)[0] is command


def test_resume_ends_a_latched_stop():
    held = started()
    held.at(2, command=Wheels(2, nan, 0.0))
    _, stop = held.at(3, command=Wheels(3, 1.0, 1.0), resume=Resume(3))
    assert stop.code == ""
    assert held.at(4, command=Wheels(4, 1.0, 1.0))[0] == Wheels(4, 1.0, 1.0)


def test_resume_without_telemetry_ends_nothing():
    held = started()
    held.at(2, command=Wheels(2, nan, 0.0))
    _, stop = held.at(300 * MS, command=Wheels(300 * MS, 1.0, 1.0), encoders=None, resume=Resume(3))
    assert stop is None and held.gate.active_stop.code == "gate_limit"
    held.at(400 * MS, encoders=Encoders(400 * MS, 0, 0))
    assert held.gate.active_stop.code == "gate_limit"  # that `resume` is not kept for later


def test_stale_telemetry_stops_at_once_and_ends_by_itself():
    held = started()
    held.at(2, command=Wheels(2, 1.0, 1.0))
    wheels, stop = held.at(300 * MS, encoders=None)
    assert wheels == Wheels(300 * MS, 0.0, 0.0)
    assert stop.code == "telemetry_stale" and not stop.latched
    _, stop = held.at(400 * MS, encoders=Encoders(400 * MS, 0, 0))
    assert stop.code == ""


def test_telemetry_that_arrives_later_and_later_stops():
    held = started()
    for time in range(25, 2000, 25):
        measured = Encoders(time * MS - 7 * time * MS // 10, 0, 0)  # a line with 0.3 of the rate
        wheels, stop = held.at(time * MS, command=Wheels(time * MS, 1.0, 1.0), encoders=measured)
        if stop is not None:
            break
    assert stop.code == "telemetry_stale" and "0.5 s late" in stop.cause and not stop.latched
    assert wheels == Wheels(time * MS, 0.0, 0.0)
    _, stop = held.at((time + 25) * MS, encoders=Encoders((time + 20) * MS, 0, 0))
    assert stop.code == ""


def test_a_second_of_silence_latches_when_the_board_is_back():
    held = started()
    held.at(300 * MS, encoders=None)
    _, stop = held.at(1500 * MS, encoders=Encoders(1500 * MS, 0, 0))
    assert stop.code == "reconnect" and stop.latched


def test_a_restarted_board_latches():
    _, stop = started().at(20 * MS, encoders=Encoders(20 * MS, 0, 0, boot=1))
    assert stop.code == "board_restart" and stop.latched


def test_a_lost_link_latches_and_states_the_cause():
    wheels, stop = started().at(20 * MS, link=Link(20 * MS, "lost", cause="cable out"))
    assert wheels == Wheels(20 * MS, 0.0, 0.0)
    assert stop.code == "link_lost" and stop.latched and "cable out" in stop.cause


def test_blocks_that_fall_silent_in_motion_latch():
    held = started()
    held.at(2, command=Wheels(2, 1.0, 1.0))
    wheels, stop = held.at(400 * MS, command=None, encoders=Encoders(390 * MS, 1, 1))
    assert wheels == Wheels(400 * MS, 0.0, 0.0) and stop.code == "command_stale"


def test_blocks_that_fall_silent_at_rest_do_not():
    held = started()
    held.at(2, command=Wheels(2, 0.0, 0.0))
    assert held.at(400 * MS, command=None)[1] is None


def test_a_person_stops_it():
    _, stop = started().at(9, operator=Stop(9, "operator", "stop was asked for", True))
    assert stop.code == "operator" and stop.latched


def turned(held, begin, rates, seconds, command):
    """Frames every 25 ms with wheels at `rates` (counts/s); the stop that comes, and its time."""
    for frame in range(1, round(seconds * 40)):
        now = begin + frame * 25 * MS
        counts = [round(rate * frame / 40) for rate in rates]
        wheels = Wheels(now, command, command)
        _, stop = held.at(now, encoders=Encoders(now, *counts), command=wheels)
        if stop is not None and stop.code:
            return stop, frame / 40
    return None, seconds


@pytest.mark.parametrize(("rates", "side"), [((9, 33), "right"), ((-33, 9), "left")])
def test_a_wheel_faster_than_commanded_stops_and_is_named(rates, side):
    stop, seconds = turned(started(), 2, rates, 6.0, 3.0)
    assert stop.code == "wheel_runaway" and stop.latched
    assert stop.cause.startswith(f"the {side} wheel turns at 10.")
    assert seconds < 3.5


@pytest.mark.parametrize("delay", [100, 300, 450])
def test_frames_that_arrive_at_once_after_a_standing_delay_are_no_fast_wheel(delay):
    """The link delays each frame by `delay` ms until 2 s; then it delivers all that it holds."""
    held = started()
    for frame in range(1, 160):
        measured = frame * 25
        arrival = max(measured, min(measured + delay, 2000) + frame % 2)
        count = round(9.0 * measured / 1000 * SIDE.encoder.counts / (2 * pi))
        encoders = Encoders(measured * MS, count, count)
        _, stop = held.at(arrival * MS, encoders=encoders, command=Wheels(arrival * MS, 9.0, 9.0))
        assert stop is None, stop


def test_a_robot_pushed_by_hand_is_reported_and_not_stopped():
    held, lines = started(), []
    held.gate.log = Log("gate", lines, WARNING)
    assert turned(held, 2, (20, 25), 3.0, 0.0) == (None, 3.0)
    assert [level for level, _, _ in lines] == [WARNING, WARNING]
    assert "wheel turns although it was at rest" in lines[0][2]


def test_a_source_that_starts_holds_the_robot_until_it_has_begun():
    held = started()
    wait = Stop(2, "source_starting", "source lidar starts", False)
    _, stop = held.at(2, waiting=wait)
    assert stop.code == "source_starting"
    for now in range(3, 9):  # telemetry, resume and other stops do not end it
        wheels, _ = held.at(
            now,
            encoders=Encoders(now, 0, 0),
            command=Wheels(now, 3.0, 3.0),
            resume=Resume(now) if now == 5 else None,
            operator=Stop(now, "operator_stop", "by hand", True) if now == 7 else None,
        )
        assert wheels == Wheels(now, 0.0, 0.0)
    _, stop = held.at(9, waiting=Stop(9, "", "", False))
    assert held.gate.active_stop.code == "operator_stop"
    held.at(10, resume=Resume(10))
    assert held.at(11, command=Wheels(11, 3.0, 3.0))[0] == Wheels(11, 3.0, 3.0)
