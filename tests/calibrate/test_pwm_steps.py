"""Motors behind the 8-bit PWM of a board that runs the real firmware."""

import pytest

from diffbotctl.calibrate.motor_curve import FittedMotor
from diffbotctl.calibrate.motor_experiments import DUTY_LEVELS
from diffbotctl.calibrate.runner import make_step, open_session, run_step
from diffbotctl.config.load import load_robot
from diffbotctl.prompts.answers_file import AnswersFile
from tests.support.calibration_robots import SilentScreen


def test_every_duty_is_a_whole_step():
    assert [duty * 255 for duty in DUTY_LEVELS] == pytest.approx([77, 115, 153, 191, 230])


def test_an_error_of_all_duties_moves_friction_and_speed():
    """Friction 0.1 and 9 rad/s: 10 rad/s for the whole duty, so 0.001 of it are 0.01 rad/s."""
    curve = FittedMotor(0.1, 9.0, 0.0, 0.0).with_duty_sd(0.001)
    assert (curve.static_sd, curve.rated_sd) == pytest.approx((0.001, 0.01))


@pytest.mark.nightly
def test_the_friction_of_an_emulated_robot_is_true_to_less_than_a_step(tmp_path):
    answers = tmp_path / "answers.yaml"
    answers.write_text("{}\n")
    session, tools = open_session(load_robot("book_2wd"), "emulated", 0)
    with session:
        run_step(make_step("motors"), session, AnswersFile(answers, tools), SilentScreen())
    values = {each.field: each for each in tools.compare(session.findings.values())}
    for side in ("left", "right"):
        friction = values[f"drive.{side}.motor.friction"]
        assert friction.found == pytest.approx(friction.true, abs=0.0005)
        assert friction.sd > 0.001
        assert abs(values[f"drive.{side}.motor.rated"].deviation) < 3.0
