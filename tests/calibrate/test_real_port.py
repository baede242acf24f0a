"""Calibration over real pseudo-terminals and in real time, as with a robot on the bench."""

import csv
import shutil
from itertools import pairwise
from pathlib import Path

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.config.lookup import simulated_copy_of
from tests.support import virtual_board as board
from tests.support.command_process import command_line
from tests.support.terminal import Terminal

SHIPPED = Path(__file__).parent.parent.parent / "robots" / "book_2wd.yaml"

TYPED = (
    ("turns of each wheel", ""),
    ("The left motor is driven now", ""),
    ("Which wheel turned", "left forward"),
    ("The right motor is driven now", ""),
    ("Which wheel turned", "right forward"),
    ("both at once", ""),
    ("Both motors are driven forward now", ""),
    ("Which wheels turned", "both forward"),
    ("Write this?", "y"),
)
NOTICES = ("turns of each wheel", "both at once")  # text of a motion, above its question
SLOWLY_ANSWERED = ("turns of each wheel", "Which wheel turned", "Write this?")


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(SHIPPED.parent.parent))
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.yaml"
    shutil.copyfile(SHIPPED, path)
    (tmp_path / "answers.yaml").write_text(f"{board.ENCODER_ANSWERS}motors.motion: yes\n")
    return path


def test_wires_are_proven_over_the_radio(robot):
    with board.board() as virtual:
        code, output = board.diffbotctl(
            "calibrate",
            "encoders",
            "--robot",
            robot,
            "--port",
            virtual.radio,
            "--answers",
            "answers.yaml",
            "--rolls",
            0,
            "--yes",
        )
        assert code == 0, output
        assert ": SIMULATED" in output and "match the robot file" in output
        board.wait_until(lambda: max(virtual.board.duty) == 0.0)
    assert load_robot(str(simulated_copy_of(robot))).robot.drive.polarity == "calibrated"
    # What whoever has no robot before their eyes is asked for.
    assert [line.split(" s  ")[1] for line in virtual.seen if "turn" in line] == [
        "the left wheel turns forward, the right wheel stands",
        "the left wheel stands, the right wheel turns forward",
        "both wheels turn forward",
    ]


def test_a_question_at_a_terminal_has_no_time_limit(robot):
    with board.board() as virtual:
        words = command_line(
            "calibrate", "encoders", "--rolls", 0, "--robot", robot, "--port", virtual.usb
        )
        with Terminal(words, columns=160) as terminal:
            for question, answer in TYPED:
                shown = (question, "or type no" if question in NOTICES else "")
                terminal.until(lambda text, shown=shown: all(each in text for each in shown), shown)
                if question in SLOWLY_ANSWERED:
                    terminal.look(1.5)  # longer than any link is silent on its own
                terminal.screen.reset()
                terminal.type(f"{answer}\r")
            assert terminal.ended() == 0, terminal.text
    assert load_robot(str(simulated_copy_of(robot))).robot.drive.polarity == "calibrated"
    # Frames that queued up meanwhile would have times that are wrong by the board's 2.1 s.
    (recording,) = Path("recordings").glob("encoders-*.csv")
    with recording.open() as lines:
        times = [float(row["time"]) for row in csv.DictReader(lines)]
    assert len(times) > 100 and all(a < b for a, b in pairwise(times))


@pytest.mark.parametrize("answer", ["no\r", "\x03"])
def test_leaving_a_question_after_a_while_confirms_the_stop(robot, answer):
    with board.board() as virtual:
        words = command_line("calibrate", "motors", "--robot", robot, "--port", virtual.usb)
        with Terminal(words) as terminal:
            terminal.until(lambda text: "Press Enter to start" in text)
            terminal.look(1.5)  # the link is silent for as long
            terminal.type(answer)
            assert terminal.ended() in (1, 130)
            assert "NOT CONFIRMED" not in terminal.text


def test_an_interrupt_reports_that_the_robot_stands_still(robot):
    words = command_line("calibrate", "distance", "--robot", robot, "--port", "sim")
    with Terminal(words) as terminal:
        terminal.until(lambda text: "Any key stops the robot" in text)
        terminal.type("\x03")
        assert terminal.ended() == 130
        assert "Interrupted: the robot is stopped" in terminal.text


def test_a_killed_calibration_leaves_a_board_that_stops_by_itself(robot):
    with board.board() as virtual:
        process = board.start(
            "calibrate",
            "motors",
            "--robot",
            robot,
            "--port",
            virtual.radio,
            "--answers",
            "answers.yaml",
            "--yes",
        )
        board.wait_until(lambda: board.moving(virtual))
        process.kill()
        process.wait()
        board.wait_until(lambda: max(virtual.board.duty) == 0.0)
