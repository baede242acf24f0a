"""Keys and the time in, velocities out; and the requests to the engine."""

import pytest

from diffbotctl.ui.teleop.deadman import (
    FIRST_REPLY_TIMEOUT_S,
    QUERY_PERIOD_S,
    REPLY_TIMEOUT_S,
    STALL_MIN_S,
    TeleopDeadman,
    multiplexer_name,
)
from diffbotctl.ui.teleop.keyboard import (
    KEY_HOLD_TIMEOUT_S,
    SPEED_DOWN_FACTOR,
    SPEED_UP_FACTOR,
    KeyboardVelocity,
)

LIMITS = (0.3, 4.0)  # one begins with half: 0.15 m/s and 2 rad/s
F, T = 0.15, 2.0


@pytest.mark.parametrize(
    ("keys", "key", "linear", "angular"),
    [
        ("twist", "i", F, 0),
        ("twist", ",", -F, 0),
        ("twist", "j", 0, T),
        ("twist", "l", 0, -T),
        ("twist", "u", F, T),
        ("twist", "o", F, -T),
        ("twist", "m", -F, -T),
        ("twist", ".", -F, T),  # as teleop_twist_keyboard has them
        ("turtle", "w", F, 0),
        ("turtle", "x", -F, 0),
        ("turtle", "a", 0, T),
        ("turtle", "d", 0, -T),
        ("twist", "up", F, 0),
        ("twist", "down", -F, 0),
        ("turtle", "left", 0, T),
        ("turtle", "right", 0, -T),
    ],
)
def test_each_key_drives_as_in_ros(keys, key, linear, angular):
    keyboard = KeyboardVelocity(LIMITS, keys)
    assert keyboard.press(key, 0.0)
    assert keyboard.velocity(0.0) == (linear, angular)


@pytest.mark.parametrize("key", ["k", "space"])
def test_a_stop_key_releases(key):
    keyboard = KeyboardVelocity(LIMITS)
    keyboard.press("i", 0.0)
    assert keyboard.press(key, 0.1)
    assert keyboard.velocity(0.1) is None


@pytest.mark.parametrize(
    ("key", "speed", "turn"),
    [
        ("q", SPEED_UP_FACTOR, SPEED_UP_FACTOR),
        ("z", SPEED_DOWN_FACTOR, SPEED_DOWN_FACTOR),
        ("w", SPEED_UP_FACTOR, 1),
        ("x", SPEED_DOWN_FACTOR, 1),
        ("e", 1, SPEED_UP_FACTOR),
        ("c", 1, SPEED_DOWN_FACTOR),
    ],
)
def test_speed_keys_change_the_speed_of_a_press(key, speed, turn):
    keyboard = KeyboardVelocity(LIMITS)
    keyboard.press("i", 0.0)
    keyboard.press(key, 0.0)
    assert (keyboard.speed, keyboard.turn_rate) == pytest.approx((F * speed, T * turn))
    assert keyboard.velocity(0.0) == pytest.approx((F * speed, 0.0))  # also of what is held


def test_speeds_stay_within_the_robots_limits():
    keyboard = KeyboardVelocity(LIMITS)
    for _ in range(100):
        keyboard.press("q", 0.0)
    assert (keyboard.speed, keyboard.turn_rate) == LIMITS
    for _ in range(100):
        keyboard.press("z", 0.0)
    assert (keyboard.speed, keyboard.turn_rate) == pytest.approx(
        (0.05 * LIMITS[0], 0.05 * LIMITS[1])
    )


def test_without_a_robot_speed_keys_change_nothing():
    keyboard = KeyboardVelocity((0.0, 0.0))
    assert keyboard.press("q", 0.0)
    assert (keyboard.speed, keyboard.turn_rate) == (0.0, 0.0)


def test_a_held_key_is_valid_until_its_repeats_end():
    keyboard = KeyboardVelocity(LIMITS)
    for repeat in range(10):
        keyboard.press("i", repeat * 0.1)
        assert keyboard.velocity(repeat * 0.1) == (F, 0)
    assert keyboard.velocity(0.9 + KEY_HOLD_TIMEOUT_S - 0.01) == (F, 0)
    assert keyboard.velocity(0.9 + KEY_HOLD_TIMEOUT_S) is None
    assert not keyboard.has_gap


def test_a_late_first_repeat_is_reported():
    keyboard = KeyboardVelocity(LIMITS)
    keyboard.press("i", 0.0)
    assert keyboard.velocity(KEY_HOLD_TIMEOUT_S + 0.1) is None
    keyboard.press("i", 0.66)  # the slowest first repeat that keyboards are set to
    assert keyboard.has_gap
    keyboard.press("i", 0.69)
    assert not keyboard.has_gap


def test_latched_a_press_stays_until_another_key():
    keyboard = KeyboardVelocity(LIMITS, mode="latched")
    keyboard.press("i", 0.0)
    assert keyboard.velocity(1000.0) == (F, 0)
    keyboard.press("k", 1000.0)
    assert keyboard.velocity(1000.0) is None


def test_latched_turtle_keys_add_steps_and_ten_up_and_ten_down_are_zero():
    keyboard = KeyboardVelocity(LIMITS, "turtle", "latched")
    for _ in range(12):  # ten steps are the limit
        keyboard.press("w", 0.0)
    assert keyboard.velocity(0.0) == pytest.approx((0.3, 0.0))
    for _ in range(10):
        keyboard.press("x", 0.0)
    keyboard.press("a", 0.0)
    assert keyboard.velocity(0.0) == pytest.approx((0.0, 0.4))


def test_a_change_of_mode_or_keys_releases():
    keyboard = KeyboardVelocity(LIMITS)
    keyboard.press("i", 0.0)
    keyboard.configure(mode="latched")
    assert keyboard.velocity(0.0) is None
    assert not keyboard.press("b", 0.0)  # means nothing to the keyboard


@pytest.mark.parametrize(
    ("environment", "name"), [({}, ""), ({"TMUX": "/tmp/x"}, "tmux"), ({"STY": "1.x"}, "screen")]
)
def test_a_multiplexer_is_recognised(environment, name):
    assert multiplexer_name(environment) == name


class Line:
    """Records the requests, and counts the queries to the terminal."""

    def __init__(self, mode="hold", answers=True):
        self.now, self.sent, self.questions = 0.0, [], 0
        self.keyboard = KeyboardVelocity(LIMITS, mode=mode)
        self.deadman = TeleopDeadman(self.keyboard, self.say, self.question, 0.0)
        self.answers = answers
        self.run(0.2)

    def say(self, do, **fields):
        self.sent.append((do, fields))

    def question(self):
        self.questions += 1

    def run(self, seconds, step=0.05):
        """Beat for `seconds`; the terminal answers at once while `answers`."""
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now += step
            asked = self.questions
            self.deadman.beat(self.now)
            if self.answers and self.questions > asked:
                self.deadman.on_reply(self.now)

    def verbs(self):
        return [do for do, _ in self.sent]


def test_a_released_key_stops_at_once_and_releases_when_the_terminal_answers():
    line = Line()
    line.keyboard.press("i", line.now)
    line.run(0.8)
    drives = [fields["linear"] for do, fields in line.sent if do == "drive"]
    assert drives[0] == F and line.verbs()[-1] == "release"
    assert not line.deadman.is_driving and not line.deadman.lost_cause


@pytest.mark.parametrize("mode", ["hold", "latched"])
def test_a_terminal_that_does_not_answer_while_driving_is_lost(mode):
    line = Line(mode)
    line.keyboard.press("i", line.now)
    line.run(0.1)
    line.answers = False
    line.run(QUERY_PERIOD_S + REPLY_TIMEOUT_S + 0.1)
    assert line.verbs()[-1] == "operator_lost" and line.deadman.lost_cause
    line.run(1.0)
    assert line.verbs().count("operator_lost") == 1  # and nothing is sent afterwards
    assert line.verbs()[-1] == "operator_lost"


def test_a_terminal_that_is_lost_with_the_key_released_is_reported():
    line = Line()
    line.keyboard.press("i", line.now)
    line.run(KEY_HOLD_TIMEOUT_S - 0.05)
    line.answers = False
    line.run(0.6)
    assert "release" not in line.verbs() and line.verbs()[-1] == "operator_lost"


def test_without_answers_keys_drive_only_while_held():
    held = Line(answers=False)
    held.run(FIRST_REPLY_TIMEOUT_S)
    held.keyboard.press("i", held.now)
    held.run(0.8)
    assert held.verbs()[0] == "drive" and held.verbs()[-1] == "release"
    kept = Line("latched", answers=False)
    kept.run(FIRST_REPLY_TIMEOUT_S)
    kept.keyboard.press("i", kept.now)
    kept.run(0.2)
    assert kept.deadman.is_unproven and not kept.sent


def test_a_stalled_process_does_not_lose_the_terminal():
    line = Line("latched")
    line.keyboard.press("i", line.now)
    line.run(0.1)
    line.answers = False
    line.run(0.05)
    line.now += 10 * STALL_MIN_S  # the process stood still
    line.answers = True
    line.deadman.beat(line.now)
    line.deadman.on_reply(line.now)
    line.run(0.3)
    assert "operator_lost" not in line.verbs()
