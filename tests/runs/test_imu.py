"""A robot with an IMU, simulated and emulated: its heading, and goals with a gyro that fails."""

from itertools import pairwise
from math import degrees, hypot, sqrt

import pytest

from diffbotctl.config.load import check, load
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.estimation.gyro_turn import BIAS_MAX, BIAS_SD_MAX
from diffbotctl.links import link_protocol
from diffbotctl.links.diffbot_codec import WIRE_BYTES
from diffbotctl.links.diffbot_frames import InertialFrame
from diffbotctl.messages import Goal, GoalState
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import NEVER, SECOND
from tests.sampling import each_once

ROBOT = """\
format: 1
kind: robot
include: {include}
board: {{telemetry: 29 Hz}}
imu: {{type: {type}, axes: {axes}}}
drive: {{polarity: checked_by_hand}}
simulation:
  gyro: {{scale_spread: 0, tilt: 0 rad, axes: {true}}}
  faults: [{fault}]
calibration: {{imu.scale: {{value: 1.0, sd: 0.003}}}}
"""
UNO = "tests/support/uno.yaml"
GOAL = Goal(0, 1, 0.6, 0.3, 1.0)
FAULTS = ("silent", "bus_held", "stuck")


class RunWithPoses(Run):
    """A run that keeps the poses of its odometry, and the states of its IMU."""

    def _sinks(self):
        self.poses, self.imus = [], []
        sinks = super()._sinks()
        sinks["odometry.odometry"].append(lambda now, pose: self.poses.append(pose))
        sinks["odometry.imu"].append(lambda now, imu: self.imus.append(imu))
        return sinks


@pytest.fixture
def drive(tmp_path, request):
    def go(
        port,
        *,
        fault="plain",
        start=0.0,
        include="book_2wd",
        axes="z",
        seed=1,
        type="mpu6050",
        true="none",
        goal=GOAL,
    ):
        file = tmp_path / "robot.yaml"
        if include == UNO:
            include = str(request.config.rootpath / UNO)
        fault = "" if fault == "plain" else f"{{fault: imu_{fault}, at: {start} s}}"
        values = {"include": include, "axes": axes, "fault": fault, "type": type}
        values["true"] = true
        file.write_text(ROBOT.format(**values))
        options = RunOptions(port=port, goals=(goal,), seed=seed, fast=True, duration=60 * SECOND)
        run = RunWithPoses(load("goal", str(file)), options, tell=lambda _: None)
        return run, run.go()

    return go


@pytest.mark.parametrize(
    ("port", "include", "axes", "type"),
    [
        ("sim", "book_2wd", "z", "mpu6050"),
        ("emulated", "book_2wd", "-x", "mpu9250"),
        ("emulated", UNO, "z", "lsm6ds3"),
        pytest.param("emulated", "book_2wd", "z", "mpu6050", marks=pytest.mark.nightly),
        pytest.param("emulated", "book_2wd", "-y", "lsm6dso", marks=pytest.mark.nightly),
        pytest.param("emulated", UNO, "z", "mpu6050", marks=pytest.mark.nightly),
    ],
)
def test_the_heading_is_the_gyro_s(drive, port, include, axes, type):
    """Known, and true, to a fifth of what 20 slots give: their sd is 3 deg."""
    run, result = drive(port, include=include, axes=axes, type=type)
    assert result.ending.code == 0, result.ending.cause
    pose, true = run.poses[-1], result.truth.pose
    assert sqrt(pose.covariance[5]) < 0.012
    assert abs(degrees(pose.heading - true.heading)) < 0.6
    assert hypot(pose.x - true.x, pose.y - true.y) < 0.02


def test_nothing_moves_before_the_bias_was_measured(drive):
    run, _ = drive("sim")
    assert run.poses[0].time > SECOND
    assert run.poses[0][1:4] == (0.0, 0.0, 0.0)


def test_the_state_of_the_imu_has_its_rate_and_its_bias(drive):
    """The rates add up to the turn; the bias has the sd that odometry requires at first."""
    run, result = drive("sim")
    states = [imu.state for imu in run.imus]
    first = states.index("working")
    assert states == ["zeroing"] * first + ["working"] * (len(states) - first)
    assert {imu.rate for imu in run.imus[:first]} == {0.0}
    turn = sum(imu.rate * (imu.time - before.time) / SECOND for before, imu in pairwise(run.imus))
    assert turn == pytest.approx(result.truth.pose.heading, abs=0.02)
    last = run.imus[-1]
    assert 0.0 < run.imus[first].bias_sd <= BIAS_SD_MAX and abs(last.bias) < BIAS_MAX
    assert last.calibrated and last.cause == ""


@each_once(port=["sim", "emulated"], fault=FAULTS)
def test_a_gyro_that_is_dead_at_the_start_is_refused_before_any_motion(drive, port, fault):
    _, result = drive(port, fault=fault)
    assert result.ending.code == 1
    assert result.failure is not None and result.failure.problems[0].code == "E-IMU-FAULT"
    assert result.truth.travel == 0.0
    assert result.ending.stopped


@pytest.mark.parametrize(
    ("port", "include", "fault"),
    [
        *(("sim", "book_2wd", fault) for fault in FAULTS),
        ("emulated", UNO, "silent"),
        *(
            pytest.param("emulated", "book_2wd", fault, marks=pytest.mark.nightly)
            for fault in FAULTS
        ),
    ],
)
def test_a_gyro_that_fails_under_way_leaves_no_goal_sure(drive, port, include, fault):
    """The covariance widens within half a second of the failure, and the goal is unsure."""
    run, result = drive(port, include=include, fault=fault, start=3.0)
    assert result.ending.code == 3, result.ending.cause
    assert "IMU" in result.ending.cause
    assert [imu.state for imu in run.imus[-2:]] == ["failed"] * 2
    assert run.imus[-1].cause in result.ending.cause
    widened = next(pose.time for pose in run.poses if pose.warning)
    assert widened - 3 * SECOND <= SECOND // 2
    at_once = next(pose for pose in run.poses if pose.time == widened)
    assert sqrt(at_once.covariance[5]) >= 0.05
    assert result.ending.stopped


@each_once(
    port=["sim", "emulated"],
    type=["mpu6050", "lsm6dso"],
    mounted=[("z", "-z"), ("-z", "z"), ("z", "x"), ("z", "-y"), ("x", "-x")],
)
def test_an_imu_that_is_mounted_wrongly_is_refused_before_any_motion(drive, port, type, mounted):
    axes, true = mounted
    _, result = drive(port, type=type, axes=axes, true=true)
    assert result.ending.code == 1
    assert result.failure is not None
    (problem,) = result.failure.problems
    assert problem.code == "E-IMU-FAULT"
    assert "upside down" in problem.cause and "calibrate imu" in problem.fix
    assert result.truth.travel == 0.0
    assert result.ending.stopped


def test_between_two_goals_the_robot_rests():
    operator = Operator([GOAL, GOAL], lambda code, cause: None, rest=SECOND)
    assert [each.message.number for each in operator.deliver(1)] == [1]
    operator.on_goal_state(5 * SECOND, GoalState(0, 1, "reached", 0.0, 0.0))
    assert operator.due() == 6 * SECOND
    assert operator.deliver(6 * SECOND - 1) == []
    assert [each.message.number for each in operator.deliver(6 * SECOND)] == [2]
    assert operator.due() == NEVER


def test_a_goal_that_is_withdrawn_during_the_rest_is_not_sent():
    operator = Operator([GOAL, GOAL], lambda code, cause: None, rest=SECOND)
    operator.deliver(1)
    operator.on_goal_state(5 * SECOND, GoalState(0, 1, "reached", 0.0, 0.0))
    operator.pause(5 * SECOND + 1)
    assert [each.message.number for each in operator.deliver(6 * SECOND)] == [0]
    operator.resume(7 * SECOND)
    assert [each.message for each in operator.deliver(7 * SECOND)][-1].number == 2


def test_a_frame_has_the_length_that_the_check_counts():
    assert link_protocol.frame_bytes("diffbot", False, True) == WIRE_BYTES[InertialFrame]


def test_an_imu_and_two_distance_sensors_have_29_hz_at_9600_baud(tmp_path):
    """The check computes what fits, and 29 Hz do."""
    file = tmp_path / "robot.yaml"
    sensors = "sensors: {side: {type: hc_sr04, trigger: 24, echo: 50, at: {heading: 90 deg}}}\n"
    values = {"include": "book_2wd", "axes": "z", "fault": "", "true": "none"}
    text = ROBOT.format(type="mpu6050", **values) + sensors
    file.write_text(text)
    assert not [problem for problem in check(str(file)) if "LINK" in problem.code]
    file.write_text(text.replace("29 Hz", "40 Hz"))
    (problem,) = (problem for problem in check(str(file)) if "LINK" in problem.code)
    assert "set telemetry to at most 29 Hz" in problem.fix
