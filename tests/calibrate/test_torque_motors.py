"""`calibrate motors` on simulated motors whose law is not that of the fit: by their torque."""

from random import Random

import pytest

from diffbotctl.calibrate.runner import make_step, open_session, run_step
from diffbotctl.config.load import load_robot
from diffbotctl.prompts.answers_file import AnswersFile
from tests.support.calibration_robots import SilentScreen
from tests.support.trials.calibrated_values import robot_text

SDS_MAX = 3.5  # of 19 values


@pytest.mark.parametrize(
    ("pulses", "has_advice"),
    [
        ("inputs", False),  # an L298N that takes 1.4 V and shorts the motors between the pulses
        ("enable", True),  # nothing brakes these motors at 3 cm/s between two pulses
    ],
)
def test_values_are_within_their_standard_deviations(tmp_path, pulses, has_advice):
    robot, answers = tmp_path / "robot.yaml", tmp_path / "answers.yaml"
    robot.write_text(robot_text(Random("calibrated values 1001"), "torque", pulses))
    answers.write_text("{}\n")
    session, tools = open_session(load_robot(str(robot)), "sim", 1001)
    with session:
        outcome = run_step(
            make_step("motors"), session, AnswersFile(answers, tools), SilentScreen()
        )
        values = tools.compare(session.findings.values())
    assert not outcome.faults  # the calibration goes on
    assert any("Does the gear need oil" in line for line in outcome.report) == has_advice
    wrong = [value for value in values if value.sd and abs(value.deviation) > SDS_MAX]
    assert not wrong
    found = {value.field for value in values}
    assert {f"drive.left.motor.{name}" for name in ("rated", "lag", "friction")} <= found
