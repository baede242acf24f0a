"""Wheels of two-channel encoders that do not turn as they are driven, and healthy ones."""

from math import exp, pi

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.engine.wheel_direction import Part, Subject, WheelDirections
from diffbotctl.messages import Encoders
from diffbotctl.time import SECOND

PINS_B = [f"robot.drive.{side}.encoder.pin_b={pin}" for side, pin in (("left", 22), ("right", 23))]
FRAME = SECOND // 40
ONE_CHANNEL = load_robot("book_2wd").robot.drive.left
SIDE = load_robot("book_2wd", ["robot.drive.encoder.channels=2", *PINS_B]).robot.drive.left
RADIUS, TRACK = 0.5 * SIDE.wheel.diameter, 0.125
PITCH = 2 * pi / SIDE.encoder.counts


class Motion:
    """Frames of a robot whose wheels turn at given speeds (rad/s)."""

    def __init__(self, side=SIDE):
        self.directions = WheelDirections(side, side, TRACK)
        self.time, self.angles, self.turn = 0, [0.0, 0.0], 0.0
        self.frame((0.0, 0.0))

    def frame(self, command, turn=None):
        self.time += FRAME
        left, right = (int(angle // PITCH) for angle in self.angles)
        frame = Encoders(self.time, left, right, None, None, *command, turn=turn)
        return self.directions.update(frame)

    def go(self, seconds, command, speeds, yaw=None):
        """The fault, if any; `speeds` counted by the encoders, `yaw` (rad/s) measured."""
        for _ in range(round(seconds * SECOND / FRAME)):
            for side in (0, 1):
                self.angles[side] += speeds[side] * FRAME / SECOND
            self.turn += (yaw or 0.0) * FRAME / SECOND
            fault = self.frame(command, None if yaw is None else self.turn)
            if fault is not None:
                return fault
        return None


@pytest.mark.parametrize(
    ("command", "counted", "subject"),
    [
        ((4, 4), (-4, 4), Subject.LEFT_WHEEL),
        ((-4, 4), (-4, -4), Subject.RIGHT_WHEEL),
        ((0, 4), (0, -4), Subject.RIGHT_WHEEL),
        ((4, 4), (-4, -4), Subject.BOTH_WHEELS),
        ((-4, 4), (4, -4), Subject.BOTH_OR_EXCHANGED),
        ((0, 4), (4, 0), Subject.EXCHANGED),
        ((2, 4), (8, 0), Subject.EXCHANGED),
    ],
)
def test_the_wheel_is_found_within_a_second_of_its_first_motion(command, counted, subject):
    fault = Motion().go(1.0, command, counted)
    assert fault is not None and fault.subject is subject and fault.part is Part.UNKNOWN


def test_wheels_that_drove_straight_and_turn_the_other_way_are_exchanged():
    motion = Motion()
    assert motion.go(1.0, (4, 4), (4, 4)) is None
    assert motion.go(0.5, (0, 0), (0, 0)) is None
    assert motion.go(1.0, (-4, 4), (4, -4)).subject is Subject.EXCHANGED


@pytest.mark.parametrize("part", [Part.MOTOR, Part.ENCODER])
@pytest.mark.parametrize(
    ("command", "counted"), [((4, 4), (-4, 4)), ((-4, 4), (-4, -4)), ((-4, 4), (4, -4))]
)
def test_a_gyro_distinguishes_motors_from_encoders(command, counted, part):
    """With wrong encoders the wheels turn as they are driven."""
    left, right = counted if part is Part.MOTOR else command
    bias = 0.05  # rad/s
    fault = Motion().go(1.0, command, counted, (right - left) * RADIUS / TRACK + bias)
    assert fault.part is part


def test_a_wheel_that_has_turned_with_its_command_may_be_pushed_back():
    motion = Motion()
    assert motion.go(1.0, (4, 4), (3.5, 4.2)) is None
    assert motion.go(3.0, (4, 4), (-3, -6)) is None  # as on a steep slope
    motion.directions.restart()
    assert motion.go(1.0, (4, 4), (-3, 4)) is not None


def test_a_wheel_that_is_held_or_blocked_or_trembles_is_not_reversed():
    motion = Motion()
    for _ in range(40):
        assert motion.go(0.1, (4, 4), (0, -1.0)) is None
        assert motion.go(0.1, (4, 4), (0, 1.0)) is None


@pytest.mark.parametrize("lag", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("period", [0.1, 0.25, 0.6])
def test_inertia_is_no_fault(lag, period):
    """The command changes its direction each `period` (s), and the wheels follow it later."""
    motion, speeds = Motion(), [0.0, 0.0]
    for number in range(30):
        sign = 1 if number % 2 else -1
        for command in ((sign * 6.0, sign * 6.0), (-sign * 6.0, sign * 6.0))[: 1 + number % 2]:
            for _ in range(max(round(period * SECOND / FRAME), 1)):
                step = 1 - exp(-FRAME / SECOND / lag)
                for side in (0, 1):
                    speeds[side] += (command[side] - speeds[side]) * step
                assert motion.go(FRAME / SECOND, command, speeds) is None


def test_a_robot_that_is_pushed_or_rolls_without_a_command_is_not_judged():
    motion = Motion()
    assert motion.go(2.0, (0, 0), (-5, 5)) is None
    for number in range(20):  # rolls on when the first command comes
        speed = -5 * exp(-number * 0.025 / 0.3)
        assert motion.go(0.025, (4, 4), (speed, speed)) is None


@pytest.mark.parametrize(
    ("direction", "share", "subject"),
    [
        (1, 2.0, Subject.LEFT_WHEEL),
        (1, -2.0, Subject.RIGHT_WHEEL),
        (-1, 2.0, Subject.RIGHT_WHEEL),
        (1, 1.0, None),  # one wheel slips or stands, though it counts
        (1, 0.1, None),
    ],
)
def test_one_channel_and_a_gyro_show_a_motor_that_turns_a_straight_motion(
    direction, share, subject
):
    speed = direction * 5.0
    yaw = share * abs(speed) * RADIUS / TRACK
    fault = Motion(ONE_CHANNEL).go(1.0, (speed, speed), (speed, speed), yaw)
    assert (fault and fault.subject) is subject
    assert fault is None or fault.part is Part.MOTOR


def test_one_channel_robots_that_have_driven_straight_may_be_turned_by_hand():
    motion = Motion(ONE_CHANNEL)
    assert motion.go(1.0, (5, 5), (5, 5), 0.0) is None
    assert motion.go(2.0, (5, 5), (5, 5), 2 * 5 * RADIUS / TRACK) is None


def test_one_channel_counts_a_coasting_wheel_with_the_wrong_sign():
    """From a turn on the spot straight into a straight motion."""
    motion, right = Motion(ONE_CHANNEL), -8.0
    assert motion.go(1.0, (8, -8), (8, -8), -16.0 * RADIUS / TRACK) is None
    for _ in range(40):
        right += (8.0 - right) * 0.08
        assert motion.go(0.025, (8, 8), (8, abs(right)), (right - 8.0) * RADIUS / TRACK) is None


def test_permission_to_move_in_motion_does_not_mistake_inertia():
    motion = Motion()
    assert motion.go(1.0, (6, 6), (6, 6)) is None
    motion.directions.restart()
    for number in range(30):
        speed = 12 * exp(-number * 0.025 / 0.4) - 6
        assert motion.go(0.025, (-6, -6), (speed, speed)) is None
