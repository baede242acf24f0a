"""Calibration over real pseudo-terminals and in real time, as with a robot on the bench."""

import shutil
from pathlib import Path

import pytest

from diffbotctl.config.load import load_robot
from tests import virtual_board as board

SHIPPED = Path(__file__).parent.parent.parent / "robots" / "book_2wd.yaml"


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(SHIPPED.parent.parent))
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.yaml"
    shutil.copyfile(SHIPPED, path)
    answers = "encoders.wheel: [left forward, right forward]\nencoders.proof: both forward\n"
    (tmp_path / "answers.yaml").write_text(answers)
    return path


def test_wires_are_proven_over_the_radio(robot):
    with board.board() as virtual:
        code, said = board.diffbotctl(
            "calibrate", "encoders", "--robot", robot, "--port", virtual.radio,
            "--answers", "answers.yaml", "--rolls", 0, "--yes",
        )  # fmt: skip
        assert code == 0, said
        assert "SIMULATED" not in said and "as the robot file states" in said
        board.wait_until(lambda: max(virtual.board.duty) == 0.0)
    assert load_robot(str(robot)).robot.drive.polarity == "calibrated"


def test_a_killed_calibration_leaves_a_board_that_stops_by_itself(robot):
    with board.board() as virtual:
        process = board.start(
            "calibrate", "motors", "--robot", robot, "--port", virtual.radio,
            "--answers", "answers.yaml", "--yes",
        )  # fmt: skip
        board.wait_until(lambda: board.moving(virtual))
        process.kill()
        process.wait()
        board.wait_until(lambda: max(virtual.board.duty) == 0.0)
