"""The path as a person walks it: at a prompt, in an empty folder, with an emulated board."""

import json
import os
import shlex
from pathlib import Path

import pytest

from diffbotctl.cli.new import kits
from diffbotctl.config.load import load_robot
from diffbotctl.emulator.program import IMAGE
from tests.support.command_process import command_line
from tests.support.terminal import Terminal
from tests.support.virtual_board import START_ANSWERS, board, diffbotctl, flat

ROOT = Path(__file__).parents[2]
BOOK = "kit: book_2wd\n"
BASH_START = shlex.join(command_line("start"))
KITS = kits()
UNO_PARTS = ("--board", "uno", "--driver", "tb6612")
UNO_ANSWERS = "kit: other\nboard: uno\ndriver: tb6612\nencoders: one-channel\n"


class Person:
    """Somebody in an empty folder."""

    def __init__(self, folder):
        self.folder = folder
        self.environment = os.environ | {
            "PYTHONPATH": str(ROOT),
            "XDG_RUNTIME_DIR": str(folder),  # no other engine than that of this person
            "XDG_STATE_HOME": str(folder / "state"),
            "XDG_CACHE_HOME": str(folder / "cache"),
        }

    def types(self, *words, answers=None):
        """Run a command; exit code and output."""
        if answers is not None:
            (self.folder / "answers.yaml").write_text(answers)
            words = (*words, "--answers", "answers.yaml")
        return diffbotctl(*words, cwd=self.folder, env=self.environment)

    def done(self):
        """The chapters on record."""
        record = json.loads((self.folder / "state/diffbotctl/start.json").read_text())
        return record[str(self.folder)]["done"]

    def robot(self):
        return load_robot(str(self.folder / "robots/my_robot.simulated.yaml")).robot


@pytest.fixture
def person(tmp_path):
    return Person(tmp_path)


def test_without_a_board_it_comes_to_a_robot_file_and_prints_the_next_step(person):
    code, output = person.types("start")
    assert code == 2 and "there is no terminal to ask at" in output
    assert person.done() == ["simulated"] and not (person.folder / "robots").exists()
    (person.folder / "state/diffbotctl/start.json").unlink()
    code, output = person.types("start", answers=BOOK)
    assert code == 1 and "E-NO-BOARD" in output
    assert "SIMULATED" in output and "1 of 1 reached" in output
    assert max(map(len, output.splitlines())) <= 80
    code, output = person.types("start")  # all that is asked so far has been answered
    assert code == 0, output
    assert "next: the board is searched" in output
    assert "No board is connected" in output
    assert max(map(len, output.splitlines())) <= 80
    assert person.done() == ["simulated", "robot"]
    code, output = person.types("start", "--status")
    assert "done   2 of 8" in output and "next   3 of 8" in output
    (person.folder / "robots/my_robot.yaml").unlink()
    code, output = person.types("start", "--status")
    assert "done   1 of 8" in output and "next   2 of 8" in output


def test_a_blank_board_comes_to_a_goal_and_each_drive_is_asked_for(person):
    with board(image=None) as virtual:
        ports = ("--port", virtual.usb, "--radio", virtual.radio)
        code, output = person.types("start", *ports, answers=START_ANSWERS)
        assert code == 0, output
        assert output.count("1 of 1 reached") == 3, output  # simulated, metre, goal
        # Before the firmware and before the pulses; then before each of both drives.
        assert output.count("Are the wheels off the ground? yes") == 2
        asked = flat(output)
        assert asked.count("1.5 m free ahead of it and 0.5 m on either side? yes") == 1
        assert asked.count("1 m to the left and 0.5 m to the right? yes") == 1
        assert "written and verified" in output
        truth = virtual.board.plant.truth()
        assert truth.left_speed == truth.right_speed == 0.0
        # A metre, and the straight way to the goal: 1.12 m. It is not lifted, so the turning of its
        # wheels before has moved it too, and where it stands shows little.
        assert truth.travel > 2.0
        code, output = person.types("start", *ports)  # no one answers, and no one is asked
        assert (code, output.count("done ")) == (0, 8)
    assert person.robot().drive.polarity == "calibrated"
    assert "# checked_by_hand when" in (person.folder / "robots/my_robot.yaml").read_text()


def test_a_board_that_is_ready_is_not_flashed_and_visits_end_where_the_robot_or_the_person_does(
    person,
):
    later = START_ANSWERS.replace("metre: yes", "metre: no")
    with board(image=IMAGE) as virtual:
        words = ("start", "--port", virtual.usb, "--radio", virtual.radio)
        code, output = person.types(*words, answers=f"{BOOK}lifted: no\n")
        assert code == 0, output
        assert "already has the diffbotctl firmware" in output
        assert "`diffbotctl start` continues here" in output
        assert person.done() == ["simulated", "robot", "board", "firmware"]
        code, output = person.types(*words)
        assert code == 2 and "there is no terminal to ask at" in output
        still = later.replace("[left forward,", "[none, none,")
        code, output = person.types(*words, answers=still)
        assert code == 1 and "E-CALIBRATE-ROBOT" in output
        assert person.done()[-1] == "firmware"
        assert person.robot().drive.polarity == "unproven"
        backward = later.replace("[left forward,", "[left backward,")
        code, output = person.types(*words, answers=backward)
        assert code == 0, output
        assert "5 of 8  Wheels and" in output and "2 of 8  Your robot file\n" not in output
    drive = person.robot().drive
    assert (drive.left.motor.reversed, drive.polarity) == (False, "calibrated")  # it was true


@pytest.fixture
def uno(person):
    """The file of a robot with an Uno and a TB6612."""
    person.types("new", "robot", "wired", *UNO_PARTS)
    return (person.folder / "robots" / "wired.yaml").rename(person.folder / "wired.yaml")


def test_the_parts_of_a_robot_are_asked_for(person, uno):
    code, output = person.types("start", answers=UNO_ANSWERS)
    assert code == 1 and "E-NO-BOARD" in output, output
    assert person.done() == ["simulated", "robot"]
    robot = load_robot(str(person.folder / "robots/my_robot.yaml")).robot
    motor = robot.drive.left.motor
    assert (motor.driver, robot.board.type) == ("tb6612", "uno")
    assert repr(motor) == repr(load_robot(str(uno)).robot.drive.left.motor)


@pytest.mark.nightly
def test_the_board_of_these_parts_is_flashed(person, uno):
    with board(image=None, robot=uno) as virtual:
        answers = f"{UNO_ANSWERS}lifted: [yes, no]\n"
        code, output = person.types("start", "--port", virtual.usb, answers=answers)
        assert code == 0 and "written and verified" in output, output
    assert person.done() == ["simulated", "robot", "board", "firmware"]


@pytest.mark.nightly
def test_a_board_that_is_another_one_than_was_answered_is_named(person, uno):
    with board(image=None, robot=uno) as virtual:
        answers = f"{UNO_ANSWERS.replace('uno', 'mega2560')}lifted: yes\n"
        code, output = person.types("start", "--port", virtual.usb, answers=answers)
        assert code == 1 and "E-FLASH-SIGNATURE" in output
        assert "delete robots/my_robot.yaml and start again" in flat(output)


def test_at_a_prompt_it_can_be_left_with_a_key_and_goes_on(person):
    person.types("start", answers=BOOK)  # as far as it comes without a board
    with board(image=IMAGE) as virtual:
        line = shlex.join([*command_line("start"), "--port", str(virtual.usb)])
        shell = ["bash", "-c", f"cd {shlex.quote(str(person.folder))} && exec {line}"]
        with Terminal(shell, person.environment, columns=100, lines=50) as terminal:
            terminal.until(lambda text: "Are the wheels off the ground?" in text)
            terminal.type("\x03")
            assert terminal.ended() == 130
            assert "Left here. `diffbotctl start` goes on from this point." in terminal.text
        assert person.done()[-1] == "firmware"
        with Terminal(shell, person.environment, columns=100, lines=50) as terminal:
            terminal.until(lambda text: "Are the wheels off the ground?" in text)
            terminal.type("perhaps\n")  # is asked again
            terminal.until(lambda text: "Invalid: 'perhaps' is not valid; answer yes or no" in text)
            terminal.type("y\n")  # as much of a word as makes it unique
            terminal.until(lambda text: "Press Enter to start" in text)
            terminal.type("no\n")  # to what would move
            assert terminal.ended() == 1
        assert person.done()[-1] == "firmware"


def test_choices_are_numbered_and_what_was_typed_during_a_run_answers_none(person):
    shell = ["bash", "-c", f"cd {shlex.quote(str(person.folder))} && exec {BASH_START}"]
    with Terminal(shell, person.environment, lines=50) as terminal:
        terminal.until(lambda text: "driving" in text, "the simulated robot")
        terminal.type("\n" * 3)
        text = terminal.until(lambda text: "(number or name)" in text, "the kits")
        assert "1 book_2wd  " in text and "Invalid" not in text
        terminal.type(f"{len(KITS) + 1}\n")
        terminal.until(lambda text: "Which board?" in text, "another robot than the kits")
        terminal.type("\n" * 5)
        terminal.until(lambda text: "`diffbotctl start` asks again" in text, "the end")
        assert terminal.ended() == 1 and "E-START-ANSWER" in terminal.text
        assert "Invalid: an answer is required" in terminal.text


def test_a_robot_with_the_book_s_firmware_is_left_as_it_is(person):
    (person.folder / "robots").mkdir()
    text = "format: 1\nkind: robot\ninclude: book_2wd_stock\n"
    (person.folder / "robots" / "old.yaml").write_text(text)
    with board(image=IMAGE) as virtual:
        code, output = person.types("start", "--port", virtual.usb, answers=START_ANSWERS)
    assert code == 0, output
    assert "the board keeps the firmware of the book" in output
    assert person.done() == ["simulated", "robot", "board"]


def test_nothing_is_written_into_the_folder_of_diffbotctl(person):
    before = {path: path.read_bytes() for path in (ROOT / "robots").iterdir()}
    person.folder = ROOT
    code, output = person.types("start")
    assert code == 2 and "change to a folder of your own" in " ".join(output.split())
    assert {path: path.read_bytes() for path in (ROOT / "robots").iterdir()} == before


def test_a_robot_of_one_s_own_is_taken_without_a_question(person):
    person.types("new", "robot", "crawler")
    code, output = person.types("start")
    assert code == 0, output
    assert "robots/crawler.yaml describes your robot" in output
    assert not (person.folder / "robots/my_robot.yaml").exists()


def test_a_shipped_robot_is_copied_and_known_again_by_its_name(person):
    code, output = person.types("start", "--robot", "book_2wd_counts")
    assert code == 0, output
    assert (person.folder / "robots/book_2wd_counts.yaml").is_file()
    for name in ("book_2wd_counts", "./robots/book_2wd_counts.yaml"):
        code, output = person.types("start", "--robot", name, "--status")
        assert "done   2 of 8" in output
    code, output = person.types("start", "--robot", "book_2wd", "--status")
    assert "next   2 of 8" in output  # another robot: only the simulated goal counts
    code, output = person.types("start", "--robot", "bok_2wd")
    assert code == 2 and "did you mean book_2wd" in output
