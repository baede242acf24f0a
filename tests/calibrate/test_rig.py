"""A robot under calibration is stopped by whatever goes wrong."""

import os
import select
import shutil
from math import hypot, pi
from pathlib import Path

import pytest

from diffbotctl.calibrate import autonomous_drive
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.runner import open_session, run_step
from diffbotctl.calibrate.step import Message, MotionNotice, Outcome
from diffbotctl.config.load import load_robot
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.errors import ConfigurationError, RunError
from diffbotctl.messages import Duty, Wheels
from diffbotctl.time import SECOND

SHIPPED = Path(__file__).parent.parent.parent / "robots" / "book_2wd.yaml"
FORWARD = Duty(0, 0.5, 0.5)


class Pipe:
    """Keys that come through a pipe, as a terminal's would."""

    def __init__(self):
        self.file, self.end = os.pipe()

    @property
    def cause(self):
        return "a key was pressed" if select.select([self.file], [], [], 0)[0] else None


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "mine.yaml"
    shutil.copyfile(SHIPPED, path)
    return load_robot(str(path))


@pytest.fixture
def session(robot):
    one, truths = open_session(robot, "sim", seed=1)
    one.connect()
    yield one, truths
    one.close()


def stands(one, truths):
    one.stop_and_wait()
    return truths.truth.left_speed == truths.truth.right_speed == 0.0


def test_a_command_holds_as_long_as_it_is_held_and_then_the_board_stops_by_itself(session):
    one, truths = session
    received = one.run_for(FORWARD, 1.0)
    assert len(received.encoders) == pytest.approx(40, abs=2) and truths.truth.left_speed > 3.0
    one.listen(2.0)  # without a stop the dead-man acts, after 300 ms
    assert truths.truth.left_speed == 0.0


class Wall(VirtualClock):
    """A clock that goes on while a person thinks."""

    passed = 0

    def wait(self, until, files):
        now, ready = super().wait(until, files)
        return max(now, self.passed), ready


def test_a_long_wait_for_an_answer_does_not_shorten_the_next_motion(session):
    one, truths = session
    one.clock = Wall()
    one.clock.passed = one.now + 100 * SECOND
    received = one.run_for(FORWARD, 1.0)
    assert len(received.encoders) == pytest.approx(40, abs=2) and truths.truth.left_speed > 3.0


def test_counts_are_current_after_a_wheel_was_turned_during_a_question(session):
    one, _ = session
    before = one.latest_frame()
    one.driver.robot.turn_by_hand(0, 6 * pi, 2 * pi)  # three turns in three seconds
    one.clock = Wall()
    one.clock.passed = one.now + 10 * SECOND
    assert one.latest_frame().left - before.left == pytest.approx(60, abs=1)  # 20 slots a turn


def test_a_key_stops_it(robot):
    keys = Pipe()
    one, truths = open_session(robot, "sim", seed=1, key=keys)
    one.connect()
    one.run_for(FORWARD, 1.0)
    os.write(keys.end, b" ")
    with pytest.raises(RunError, match="a key was pressed"):
        one.run_for(FORWARD, 60.0)
    one.key = None
    assert stands(one, truths)
    one.close()
    assert one.stop_confirmed


def test_a_key_stops_an_autonomous_drive(robot):
    keys = Pipe()
    one, truths = open_session(robot, "sim", seed=1, key=keys)
    one.connect()
    os.write(keys.end, b"q")
    with pytest.raises(RunError, match="a key was pressed"):
        autonomous_drive.drive_to(one, [(1.0, 0.0, None)], 2.0)
    assert truths.truth.pose.x < 0.5
    one.key = None
    assert stands(one, truths)


def test_nothing_turns_further_than_was_announced(session):
    one, truths = session
    one.limit_turns(2.0)
    with pytest.raises(RunError, match="more than the announced 2 turns"):
        one.run_for(FORWARD, 60.0)
    assert stands(one, truths)
    assert truths.truth.left_angle / 6.2832 < 2.6  # it rolls out a little


def test_an_autonomous_drive_ends_at_its_distance_limit(session):
    one, truths = session
    with pytest.raises(RunError, match=r"further than the announced 0\.5 m"):
        autonomous_drive.drive_to(one, [(2.0, 0.0, None)], 0.5)
    assert truths.truth.pose.x < 0.6 and stands(one, truths)


GEOMETRY = """calibration:
  drive.track: {value: 125 mm, sd: 2 mm, method: geometry, volts: not measured}
  drive.left.wheel.diameter: {value: 65 mm, sd: 0.3 mm, method: geometry, volts: not measured}
  drive.right.wheel.diameter: {value: 65 mm, sd: 0.3 mm, method: geometry, volts: not measured}
"""


def test_an_autonomous_drive_goes_on_from_a_waypoint_with_an_uncertain_position(robot):
    text = robot.file.read_text().split("calibration: {}")[0] + GEOMETRY
    robot.file.write_text(text)
    one, truths = open_session(load_robot(str(robot.file)), "sim", seed=1)
    one.connect()
    # Counted slots of 10 mm do not give a heading that is good enough for 10 mm after 2 m.
    style = autonomous_drive.DriveStyle(tolerance=0.01, method="count")
    end = autonomous_drive.drive_to(one, [(2.0, 0.0, None), (2.0, 0.5, None)], 3.0, style)
    assert hypot(end.x - 2.0, end.y - 0.5) < 0.02 and stands(one, truths)
    one.close()


def test_a_cable_that_is_pulled_ends_the_movement_and_the_board_stops_by_itself(robot):
    one, truths = open_session(robot, "emulated", seed=1)
    try:
        one.connect()
        one.run_for(FORWARD, 1.0)
        one.driver.radio = 10**6 * SECOND  # is it connected any more, in either direction
        with pytest.raises(RunError, match="no frames from the board for half a second"):
            one.run_for(FORWARD, 10.0)
        one.driver.board.advance(one.now + 2 * SECOND)
        assert truths.truth.left_speed == truths.truth.right_speed == 0.0
        one.close()
        assert not one.stop_confirmed
    finally:
        one.driver.close()


def test_findings_are_sent_to_the_board_and_accumulate(session):
    one, _ = session
    one.try_findings([Finding("drive.left.motor.loop.static", 0.2)])
    one.try_findings([Finding("drive.right.motor.loop.static", 0.3)])
    drive = one.file.robot.drive
    assert (drive.left.motor.loop.static, drive.right.motor.loop.static) == (0.2, 0.3)
    assert one.file.nominal.drive.left.motor.loop.static == 0.1
    assert "0.2" not in one.file.file.read_text()  # nothing is written yet
    assert [gains.static for gains in one.driver.robot.parameters.gains] == [0.2, 0.3]


def test_what_is_not_plausible_is_not_tried(session):
    one, _ = session
    with pytest.raises(ConfigurationError, match="times the stated"):
        one.try_findings([Finding("drive.track", 0.25)])


def test_an_unproven_robot_drives_slowly(session):
    one, _ = session
    fastest = []
    note = one.on_frame
    one.on_frame = lambda now, frame: (note(now, frame), fastest.append(frame.left_command))
    autonomous_drive.drive_to(one, [(0.4, 0.0, None)], 1.0, autonomous_drive.DEFAULT_STYLE)
    # 0.1 m/s with a radius of 32.5 mm, and a little for steering
    assert 2.0 < max(fastest) < 3.5


class Breaking:
    """A step that fails while the robot moves."""

    name, title, lifted = "breaking", "", True

    def run(self, one):
        one.connect()
        yield MotionNotice("breaking", "moves", 100.0)
        one.run_for(Wheels(0, 5.0, 5.0), 1.0)
        yield Message("and now?")
        return Outcome("breaking", [])


class Silent:
    """An prompter and screen that fails when it is spoken to."""

    def confirm_motion(self, notice):
        pass

    def say(self, text):
        if text == "and now?":
            raise KeyboardInterrupt


def test_a_step_that_is_interrupted_leaves_a_robot_at_rest(session):
    one, truths = session
    with pytest.raises(KeyboardInterrupt):
        run_step(Breaking(), one, Silent(), Silent())
    assert stands(one, truths)


def test_the_emulated_board_takes_duty_and_reports_when_it_took_hold(robot):
    one, truths = open_session(robot, "emulated", seed=1)
    try:
        one.connect()
        received = one.run_for(Duty(0, 0.5, -0.5), 1.0).encoders[-1]
        assert received.command_kind == "duty" and received.command_time is not None
        assert (received.left_command, received.right_command) == pytest.approx(
            (0.5, -0.5), abs=1e-3
        )
        assert truths.truth.left_speed > 3.0 and truths.truth.right_speed < -3.0
        assert stands(one, truths)
    finally:
        one.close()
        assert one.stop_confirmed
