"""`calibrate encoders` with two channels: exchanged wires, and the slots of fine discs."""

from pathlib import Path

import pytest

import tests.support
from diffbotctl.calibrate.encoder_fit import count_slots
from diffbotctl.config.load import load_robot
from diffbotctl.config.lookup import simulated_copy_of
from tests.sampling import by_day
from tests.support.running import cli
from tests.support.virtual_board import ENCODER_ANSWERS

ROBOTS = Path(tests.support.__file__).parent


@pytest.mark.parametrize(
    ("kind", "port"),
    by_day(
        2,
        [
            ("mega_hall", "emulated"),
            ("pico_hall", "sim"),
            ("mega_hall", "sim"),
            ("pico_hall", "emulated"),
        ],
    ),
)
def test_exchanged_channels_are_found_and_written(tmp_path, kind, port):
    robot, answers = tmp_path / "my.yaml", tmp_path / "answers.yaml"
    robot.write_text(
        f"format: 1\nkind: robot\ninclude: {ROBOTS / kind}.yaml\n"
        "simulation: {wiring: {left_encoder: exchanged}}\n"
    )
    answers.write_text(ENCODER_ANSWERS)
    words = ["calibrate", "encoders", "--robot", str(robot), "--port", port, "--rolls", "0"]
    code, output, complaints = cli(
        tmp_path, *words, "--answers", str(answers), "--yes", cwd=tmp_path
    )
    assert code == 0, output + complaints
    assert "left encoder: channels A and B exchanged: it counted down going forward" in output
    encoders = load_robot(str(simulated_copy_of(robot))).robot.drive
    assert (encoders.left.encoder.reversed, encoders.right.encoder.reversed) == (True, False)


def test_a_wheel_turned_by_hand_shows_the_slots_where_four_counts_are_one(tmp_path):
    """The robot file states 1,320, and the discs have 1,100."""
    robot, answers = tmp_path / "my.yaml", tmp_path / "answers.yaml"
    robot.write_text(
        f"format: 1\nkind: robot\ninclude: {ROBOTS}/pico_hall.yaml\n"
        "simulation: {encoder: {slots: 1100}, wiring: {left: reversed, right: plain}}\n"
    )
    answers.write_text(ENCODER_ANSWERS)
    words = ["calibrate", "encoders", "--robot", str(robot), "--port", "sim", "--rolls", "2"]
    code, output, complaints = cli(
        tmp_path, *words, "--answers", str(answers), "--yes", cwd=tmp_path
    )
    assert code == 0, output + complaints
    encoder = load_robot(str(simulated_copy_of(robot))).robot.drive.left.encoder
    assert encoder.slots == pytest.approx(1100, abs=1)  # a hand ends some slots beside the mark
    assert encoder.counts == 4 * encoder.slots


def test_rolls_of_a_fine_disc_that_end_beside_the_mark_confirm_its_slots():
    """Ten turns of 1,320 slots are 13,200; a hand is some slots off, and differs by more than 2."""
    robot = load_robot(str(ROBOTS / "mega_hall.yaml")).robot
    rolls = {"left": [13_190, 13_207, 13_203], "right": [13_195, 13_200, 13_211]}
    result = count_slots(rolls, 10, robot)
    assert ({found.value for found in result.findings}, result.faults) == ({1320}, [])
    (left, right) = result.report
    assert "1320 slots" in left and "1320 slots" in right and "instead" not in left + right
