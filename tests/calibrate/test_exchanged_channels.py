"""`calibrate encoders` with a two-channel encoder whose wires A and B are exchanged."""

from pathlib import Path

import pytest

import diffbotctl.testing
from diffbotctl.config.load import load_robot
from diffbotctl.testing.running import cli
from diffbotctl.testing.virtual_board import ENCODER_ANSWERS

HALL = Path(diffbotctl.testing.__file__).with_name("mega_hall.yaml")


@pytest.mark.parametrize("port", ["sim", "emulated"])
def test_exchanged_channels_are_found_and_written(tmp_path, port):
    robot, answers = tmp_path / "my.yaml", tmp_path / "answers.yaml"
    robot.write_text(
        f"format: 1\nkind: robot\ninclude: {HALL}\n"
        "simulation: {wiring: {left_encoder: exchanged}}\n"
    )
    answers.write_text(ENCODER_ANSWERS)
    words = ["calibrate", "encoders", "--robot", str(robot), "--port", port, "--rolls", "0"]
    code, said, complaints = cli(tmp_path, *words, "--answers", str(answers), "--yes", cwd=tmp_path)
    assert code == 0, said + complaints
    assert "left encoder: channels A and B exchanged: it counted down going forward" in said
    encoders = load_robot(str(robot)).robot.drive
    assert (encoders.left.encoder.reversed, encoders.right.encoder.reversed) == (True, False)
