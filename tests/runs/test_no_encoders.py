"""Motors without encoders: driven by hand, simulated and on the emulated board; never a goal."""

from math import hypot, sqrt

import pytest

from diffbotctl.config.load import check, load, load_robot
from diffbotctl.emulator.emulated_robot import EmulatedRobotDriver, emulated_board
from diffbotctl.engine.driver import Delivery
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.messages import Duty, Encoders, Odometry, Twist, Wheels
from diffbotctl.render.harness import harness
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND, SECOND
from tests.sampling import each_once
from tests.support.virtual_board import diffbotctl, flat

PERIOD = 50 * MILLISECOND
KIT = """\
format: 1
kind: robot
include: book_2wd
drive:
  encoder: none
  polarity: checked_by_hand
  left: {{encoder: none}}
  right: {{encoder: none}}
{more}
"""


@pytest.fixture
def kit(tmp_path):
    file = tmp_path / "kit.yaml"
    file.write_text(KIT.format(more=""))
    return file


class TimedDrive(Run):
    """A run in which a person holds the forward key for three seconds."""

    def hold(self, linear, angular):
        self.velocity, self.sent_at = (linear, angular), -PERIOD
        self.engine.idle = self._send
        self.poses = []

    def _sinks(self):
        sinks = super()._sinks()
        sinks["odometry.odometry"].append(lambda now, pose: self.poses.append(pose))
        return sinks

    def _send(self):
        now = self.engine.last_instant
        if now - self.sent_at >= PERIOD and now < 3 * SECOND:
            self.sent_at = now
            self.operator.outbox.append(Delivery("operator.twist", Twist(now, *self.velocity)))
            self.operator.outbox_due = now + 1


@each_once(seed=range(10), velocity=[(0.2, 0.0), (-0.15, 0.0), (0.15, 1.0), (0.0, 2.0)])
def test_a_drive_by_hand_is_reported_with_a_wide_covariance(kit, velocity, seed):
    options = RunOptions(seed=seed, fast=True, duration=5.0, stay=True)
    run = TimedDrive(load("teleop", str(kit), ["world.walls=[]", "world.obstacles=[]"]), options)
    run.hold(*velocity)
    result = run.go()
    reported, true = run.poses[-1], result.truth.pose
    assert isinstance(reported, Odometry) and "no encoder" in reported.warning
    xx, _, _, yy, _, hh = reported.covariance
    if velocity[0] and not velocity[1]:
        assert abs(true.x) > 0.25 and sqrt(xx) > 0.1 * abs(reported.x)
        assert abs(true.x - reported.x) < 3.5 * sqrt(xx)
    assert abs(true.heading - reported.heading) < 3.5 * sqrt(hh)
    assert hypot(true.x - reported.x, true.y - reported.y) < 4.0 * sqrt(xx + yy) + 0.02


def test_the_real_firmware_drives_by_duty_and_notices_no_stall(kit):
    """Three seconds at 60 %: with an encoder that shows nothing the board would stop after one."""
    robot = load_robot(str(kit)).robot
    board = emulated_board(robot, 1)
    try:
        driver = EmulatedRobotDriver(board, DiffbotHost(board.settings))
        frames_seen = driven(driver, Duty(0, 0.6, 0.6), 3 * SECOND)
        assert board.plant.truth().travel > 0.3
        assert {(frame.left, frame.right) for frame in frames_seen} == {(0, 0)}
        driver.stop(board.now)
        driver.deliver(board.now + SECOND)
        assert driver.stopped and board.duty == [0.0, 0.0]
    finally:
        board.emulator.close()


def test_the_real_firmware_keeps_the_motors_off_for_a_speed(kit):
    """A speed loop without an encoder would end at full duty."""
    board = emulated_board(load_robot(str(kit)).robot, 1)
    try:
        driver = EmulatedRobotDriver(board, DiffbotHost(board.settings))
        driven(driver, Wheels(0, 5.0, 5.0), 2 * SECOND)
        assert board.plant.truth().travel == 0.0
    finally:
        board.emulator.close()


def driven(driver, command, duration):
    """Repeat `command` for `duration` from the first frame on; returns the encoder messages."""
    seen, start = [], None
    for now in range(0, 5 * SECOND + duration, 25 * MILLISECOND):
        delivered = driver.deliver(now)
        seen += [each.message for each in delivered if isinstance(each.message, Encoders)]
        if start is None and seen:
            start = now
        if start is not None:
            if now > start + duration:
                return seen
            driver.command(now, command._replace(time=now))
    raise AssertionError("the board did not come up")


@pytest.mark.parametrize("port", ["sim", "emulated"])
def test_a_goal_is_refused_with_the_reason(kit, port):
    code, output = diffbotctl("run", "goal", "--robot", kit, "--port", port, "--quiet")
    assert code == 2, output
    assert "E-ENCODER-NONE" in output and "'follower' cannot reach a goal" in flat(output), output


def test_the_check_prints_what_works(kit):
    (problem,) = check("teleop", str(kit), ())
    assert problem.code == "W-ENCODER-NONE" and "driving by hand and for a time" in problem.fix


def test_calibration_is_refused(kit):
    code, output = diffbotctl("calibrate", "motors", "--robot", kit, "--port", "sim", "--dry-run")
    assert code == 2 and "E-ENCODER-NONE" in output, output


def test_no_encoder_is_drawn_or_sent(kit):
    robot = load_robot(str(kit)).robot
    assert not [part for part in harness(robot).parts if "encoder" in part]
    board = emulated_board(robot, 1)
    board.emulator.close()
    assert board.settings.frame().left_encoder == frames.PIN_NONE


def test_the_book_s_firmware_needs_encoders(tmp_path):
    file = tmp_path / "kit.yaml"
    file.write_text(KIT.format(more="link: {protocol: rosserial}"))
    assert "E-ENCODER-NONE" in {problem.code for problem in check("teleop", str(file), ())}
