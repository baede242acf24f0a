"""Lag and dead time of a board with the book's firmware, which reports neither."""

import pytest

from diffbotctl.calibrate import motor_experiments, motor_fit
from diffbotctl.calibrate.motor_lag import SAME_LAG, fit_lags
from diffbotctl.calibrate.runner import open_session, run_step
from diffbotctl.calibrate.steps.motors import MotorStep
from diffbotctl.config.load import load_robot
from diffbotctl.messages import Encoders
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.time import MILLISECOND as MS
from tests.sampling import by_day
from tests.support.calibration_robots import SilentScreen

SLOTS, SHARES = {"left": 20, "right": 20}, {"left": SAME_LAG, "right": SAME_LAG}


def ended(running):
    """What a generator returns."""
    try:
        while True:
            next(running)
    except StopIteration as end:
        return end.value


def stock(seed, delay):
    """A session of the stock robot; its commands take `delay` ms, which its file does not state."""
    made, truths = open_session(load_robot("book_2wd_stock"), "sim", seed)
    board = truths._plant.board
    board.model = board.model._replace(command_delay=delay * MS)
    made.connect()
    return made, truths._plant


@pytest.mark.nightly
@pytest.mark.parametrize("seed, delay", by_day(1, [(1, 100), (2, 30), (3, 180)]))
def test_a_delay_is_distinguished_from_the_motors_lag(seed, delay):
    made, plant = stock(seed, delay)
    fitted = fit_lags(ended(motor_experiments.record_steps(made)), SLOTS, SHARES, 0.012)["left"]
    lag = sum(motor.lag for motor in plant.motors) / 2
    # Each wheel takes each of 24 commands up to 25 ms early or late: 2 ms of their mean.
    assert fitted.lag + fitted.dead_time == pytest.approx(lag + delay / 1000, abs=0.01)
    assert fitted.dead_time == pytest.approx(delay / 1000, abs=3.5 * fitted.split_sd)
    assert 0.002 < fitted.split_sd < 0.008


def test_the_step_writes_it_for_the_blocks_that_look_ahead(tmp_path):
    made, _ = stock(4, 60)
    answers = tmp_path / "answers.yaml"
    answers.write_text("motors.motion: yes")
    outcome = run_step(MotorStep(), made, AnswersFile(answers, None), SilentScreen())
    fitted = {each.field: each for each in outcome.findings}
    delay = fitted["link.command_delay"]
    assert delay.value == pytest.approx(0.06, abs=3.5 * delay.sd)
    assert made.file.robot.link.command_delay == pytest.approx(delay.value)
    assert fitted["drive.left.motor.lag"].value == fitted["drive.right.motor.lag"].value


def test_wheels_at_rest_are_not_enough():
    frames = [Encoders(60 * MS * number, 5, 5, None, None) for number in range(40)]
    steps = [motor_fit.StepResponse(frames, 1.0, up) for up in (True, False)] * 2
    with pytest.raises(ValueError, match="did not increase with the duty"):
        fit_lags(steps, SLOTS, SHARES, 0.012)
