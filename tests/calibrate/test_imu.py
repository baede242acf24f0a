"""The scale of a gyro by turns on the spot, and the other steps on a robot that has one."""

from math import cos, pi, radians, sin

import pytest

from diffbotctl.calibrate.imu_mounting import direction_of, refuse_faulty
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.runner import make_step, open_session, run_step
from diffbotctl.calibrate.steps.imu import (
    askew_report,
    measured_turn,
    no_axis_turns,
    refuse_wrong_axis,
)
from diffbotctl.config.load import load_robot
from diffbotctl.errors import RunError
from diffbotctl.messages import Encoders
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.time import SECOND
from tests.sampling import by_day
from tests.support.calibration_robots import SilentScreen

ROBOT = """\
format: 1
kind: robot
include: book_2wd
board: {{telemetry: 30 Hz}}
imu: {{type: {type}, axes: {axes}}}
drive: {{polarity: {polarity}}}
simulation: {{geometry: {{{geometry}}}, gyro: {{{gyro}}}, wiring: {{{wiring}}}, faults: [{faults}]}}
calibration: {{}}
"""
ANSWERS = """\
imu: {measure: protractor, noise: 1 deg}
geometry: {measure: tape, noise: 1 mm}
"""


@pytest.fixture
def opened(tmp_path):
    def open_one(port="sim", seed=1, **values):
        usual = {"type": "mpu6050", "axes": "z", "polarity": "checked_by_hand"}
        values = usual | {"geometry": "", "gyro": "", "wiring": "", "faults": ""} | values
        robot, answers = tmp_path / "robot.yaml", tmp_path / "answers.yaml"
        robot.write_text(ROBOT.format(**values))
        answers.write_text(ANSWERS)
        session, tools = open_session(load_robot(str(robot)), port, seed)
        return session, AnswersFile(answers, tools), tools

    return open_one


def rest(start, seconds, turn, rate):
    """Frames at 50 Hz from `start` (s), with a constant rate in rad/s."""
    return [
        Encoders(round((start + number / 50) * SECOND), 0, 0, turn=turn + rate * number / 50)
        for number in range(round(seconds * 50) + 1)
    ]


def test_a_turn_is_measured_without_the_mean_rate_of_both_rests():
    """10 rad in 8 s between the rests, in which biases of 0.01 and 0.03 rad/s add 0.16 rad."""
    before, after = rest(0.0, 2.0, 0.0, 0.01), rest(10.0, 2.0, 10.18, 0.03)
    assert measured_turn(before, after) == pytest.approx(10.18 - 0.02 - 0.16)


@pytest.mark.parametrize(
    ("port", "seed", "turns"), by_day(1, [("sim", 1, 10), ("sim", 4, 10), ("emulated", 1, 3)])
)
def test_turns_give_the_scale_to_0_3_percent(opened, port, seed, turns):
    session, prompter, tools = opened(port, seed)
    with session:
        step = make_step("imu", turns=turns)
        outcome = run_step(step, session, prompter, SilentScreen())
    (value,) = tools.compare(outcome.findings)
    assert value.field == "imu.scale"
    assert value.found == pytest.approx(value.true, rel=0.003)
    assert abs(value.true - 1.0) > 0.01  # there was something to find
    assert value.deviation is not None and abs(value.deviation) < 3.0
    assert session.file.robot.imu.scale == pytest.approx(value.found, rel=1e-5)


@pytest.mark.parametrize(
    ("port", "type", "stated", "true", "turns"),
    by_day(
        2,
        [
            ("sim", "mpu6050", "z", "-z", 4),  # upside down
            ("sim", "mpu6050", "z", "-x", 4),
            ("sim", "mpu6050", "-y", "z", 4),
            ("emulated", "mpu6050", "z", "-y", 3),
            ("emulated", "lsm6dso", "-x", "x", 3),
        ],
    ),
)
def test_a_wrong_axis_is_found_and_the_scale_with_it(opened, port, type, stated, true, turns):
    session, prompter, tools = opened(port, type=type, axes=stated, gyro=f"axes: {true}")
    with session:
        outcome = run_step(make_step("imu", turns=turns), session, prompter, SilentScreen())
    assert outcome.findings[0] == Finding("imu.axes", true)
    assert session.file.robot.imu.axes == true
    assert outcome.report[0] == f"axes of the IMU: {stated} before, {true} now"
    (scale,) = tools.compare(outcome.findings)
    assert scale.found == pytest.approx(scale.true, rel=0.005)


def test_without_lifts_proven_motors_show_the_sign(opened):
    session, prompter, _ = opened(gyro="axes: -z")
    with session:
        run_step(make_step("imu", turns=3, lift=False), session, prompter, SilentScreen())
    assert session.file.robot.imu.axes == "-z"


def test_the_right_axis_is_not_written_again(opened):
    session, prompter, _ = opened(axes="-x")
    with session:
        outcome = run_step(make_step("imu", turns=3), session, prompter, SilentScreen())
    assert [finding.field for finding in outcome.findings] == ["imu.scale"]
    assert outcome.report[0] == "axes of the IMU: -x, as stated"


@pytest.mark.parametrize("true", ["-x", "x", "-y", "y", "-z"])
def test_lifting_the_robot_shows_the_sign_without_proven_motors(opened, true):
    session, prompter, _ = opened(gyro=f"axes: {true}", polarity="unproven")
    with session:
        run_step(make_step("imu", turns=3), session, prompter, SilentScreen())
    assert session.file.robot.imu.axes == true


@pytest.mark.parametrize("polarity", ["unproven", "checked_by_hand"])
def test_motors_that_turn_the_robot_to_the_right_are_distinguished_from_the_imu(opened, polarity):
    wiring = "left: plain, right: reversed"  # the robot file has the opposite
    session, prompter, _ = opened(polarity=polarity, wiring=wiring)
    with session:
        with pytest.raises(RunError) as error:
            run_step(make_step("imu", turns=3), session, prompter, SilentScreen())
        session.stop_and_wait()
    (problem,) = error.value.problems
    assert "By the lifts the axis z printed on the IMU points up" in problem.cause
    assert "by the turn to the left it points down" in problem.cause
    assert "calibrate encoders" in problem.fix
    assert ("proven before" in problem.fix) == (polarity != "unproven")
    assert session.file.robot.imu.axes == "z"


# A lift by 25 degrees of a robot on which y is the vertical axis: the axes after it are z and x.
ANGLE = radians(25.0)


def lifts(yaw, sign):
    """Turns about z and x when the front and the left side are lifted; the IMU is turned by `yaw`
    about its axis y, which points up for sign 1, down for -1."""
    forward, left = (cos(yaw), -sin(yaw)), (sin(yaw), cos(yaw))
    if sign < 0:
        left = (-left[0], -left[1])
    return tuple(-ANGLE * part for part in left), tuple(ANGLE * part for part in forward)


@pytest.mark.parametrize("yaw", [radians(angle) for angle in range(0, 360, 45)])
def test_the_sign_does_not_depend_on_how_the_imu_is_turned_about_the_vertical(yaw):
    assert direction_of("y", *lifts(yaw, 1)) == "y"
    assert direction_of("y", *lifts(yaw, -1)) == "-y"


def test_two_lifts_of_the_same_side_show_nothing():
    front, _ = lifts(0.3, 1)
    with pytest.raises(RunError, match="nearly the same axis"):
        direction_of("y", front, front)


class HandsOfAnother:
    """Does with a simulated robot what is asked, but lifts no more than `most` rad."""

    def __init__(self, tools, most):
        self.tools, self.most = tools, most

    def lift(self, side, angle):
        self.tools.lift(side, min(angle, self.most))

    def __getattr__(self, name):
        return getattr(self.tools, name)


def test_a_robot_that_is_hardly_lifted_is_asked_for_again_and_refused(opened):
    session, prompter, tools = opened()
    prompter.tools = HandsOfAnother(tools, radians(3.0))
    screen = SilentScreen()
    with session:
        with pytest.raises(RunError, match="did not turn the gyro by 10 to 80 deg") as error:
            run_step(make_step("imu", turns=3), session, prompter, screen)
        assert "--no-lift" in error.value.problems[0].fix
        session.stop_and_wait()


def test_an_imu_that_is_mounted_askew_is_named():
    """At 20 degrees a gyro measures 0.94 of a turn; 3 % of that may be its own scale."""
    (line,) = askew_report(1.0 / cos(radians(20.0)))
    assert "94 % of each turn" in line and "askew by 15 deg" in line
    assert askew_report(1.03 / cos(radians(5.0))) == []


def test_without_lifts_a_sign_proves_nothing_while_motors_may_be_exchanged(opened):
    """The wheels may turn the robot to the right instead; the file keeps its axis."""
    session, prompter, _ = opened(gyro="axes: -z", polarity="unproven")
    with session:
        with pytest.raises(RunError, match="wrong sign") as error:
            run_step(make_step("imu", turns=3, lift=False), session, prompter, SilentScreen())
        assert "axes: -z" in error.value.problems[0].fix
        session.stop_and_wait()
    assert session.file.robot.imu.axes == "z"


def test_a_gyro_of_which_no_axis_turns_is_refused():
    problem = no_axis_turns(2 * pi).problems[0]
    assert "360 deg" in problem.cause and "less than 180 deg" in problem.cause


def test_a_robot_without_an_imu_does_not_move(opened):
    session, prompter, tools = opened(type="none")
    with session:
        outcome = run_step(make_step("imu"), session, prompter, SilentScreen())
    assert outcome.findings == [] and outcome.report == ["the robot file has no IMU"]
    assert tools.truth.travel == 0.0


def test_a_gyro_that_fails_in_the_turns_gives_no_scale_and_the_robot_stands(opened):
    session, prompter, _ = opened(faults="{fault: imu_stuck, at: 20 s}")
    with session:
        with pytest.raises(RunError) as error:
            run_step(make_step("imu"), session, prompter, SilentScreen())
        assert error.value.problems[0].code == "E-IMU-FAULT"
        session.stop_and_wait()
    assert session.stop_confirmed
    assert "imu.scale" not in session.findings and session.file.robot.imu.axes == "z"


def test_a_board_that_reports_no_turn_is_refused():
    with pytest.raises(RunError, match="reports no turn"):
        refuse_faulty([Encoders(0, 0, 0)])


@pytest.mark.parametrize(
    ("measured", "commanded", "axes", "fix"),
    [
        (-20 * pi, 20 * pi, "z", "axes: -z"),
        (20 * pi, -20 * pi, "-x", "axes: x"),
        (radians(30.0), 20 * pi, "y", "its wheels slip"),
    ],
)
def test_a_wrong_axis_is_named(measured, commanded, axes, fix):
    with pytest.raises(RunError) as error:
        refuse_wrong_axis(measured, commanded, axes)
    assert fix in error.value.problems[0].fix


def test_a_gyro_that_is_wrong_by_3_percent_has_the_right_axis():
    refuse_wrong_axis(-0.97 * 20 * pi, -20 * pi, "z")


@pytest.mark.nightly
def test_the_wheels_of_a_robot_with_an_imu_are_measured_by_the_wheels(opened):
    """The gyro would hide the arc that unequal wheels drive."""
    session, prompter, tools = opened(seed=3, geometry="diameter_spread: 0.005")
    with session:
        run_step(make_step("geometry", how="straight"), session, prompter, SilentScreen())
    drive, body = session.file.robot.drive, tools._plant.chassis
    ratio = drive.right.wheel.diameter / drive.left.wheel.diameter
    true = body.right_radius / body.left_radius
    assert ratio == pytest.approx(true, abs=0.0015)
    assert abs(true - 1.0) > 0.002
