"""`diffbotctl calibrate`, as a user runs it: from an answers file, and by hand at a terminal."""

import os
import pty
import re
import select
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from diffbotctl.calibrate.runner import STEPS
from diffbotctl.cli.calibrate import calibrate as command
from diffbotctl.config.load import load_robot
from diffbotctl.config.lookup import simulated_copy_of
from diffbotctl.errors import RunError
from tests.sampling import by_day
from tests.support.calibration_robots import ANSWERS
from tests.support.command_process import command_line

ROOT = Path(__file__).parent.parent.parent
LONGEST = 60  # s
DONE = ("encoders", "motors")


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.yaml"
    shutil.copyfile(ROOT / "robots" / "book_2wd.yaml", path)
    (tmp_path / "answers.yaml").write_text(ANSWERS)
    return path


def calibrate(*words):
    return CliRunner().invoke(command, [*map(str, words)])


@pytest.mark.nightly
def test_the_whole_chain_from_a_file_and_back(robot):
    before = robot.read_bytes()
    done = calibrate("--robot", robot, "--port", "sim", "--answers", "answers.yaml", "--yes")
    assert done.exit_code == 0, done.output
    assert "SIMULATED" in done.output
    assert robot.read_bytes() == before
    copy = simulated_copy_of(robot)
    found = load_robot(str(copy)).robot
    assert found.drive.polarity == "calibrated"
    assert set(found.calibration) >= {
        "drive.left.motor.lag",
        "drive.left.motor.loop.speed",
        "drive.left.wheel.diameter",
        "drive.track",
        "sensors.front.curve.a",
    }
    entry = found.calibration["drive.track"]
    assert entry.method == "umbmark" and entry.volts == "not measured" and entry.sd
    assert all(each.simulated for each in found.calibration.values())
    recording = next(Path("recordings").glob("geometry-*.csv"))
    assert recording.read_text().startswith("time,right,left")
    assert next(Path("recordings").glob("*.svg")).read_text().startswith("<svg")
    for _ in range(5):  # all steps but battery, which no pin measures
        assert calibrate("undo", "--robot", copy).exit_code == 0
    assert not load_robot(str(copy)).robot.calibration


def test_a_fault_that_only_a_hand_mends_ends_the_chain(robot):
    text = robot.read_text().replace("right: plain}", "right: dead}")
    robot.write_text(text)
    done = calibrate("--robot", robot, "--port", "sim", "--answers", "answers.yaml", "--yes")
    assert isinstance(done.exception, RunError)
    assert "right motor dead" in str(done.exception)
    assert "Step 2" not in done.output
    assert robot.read_text() == text


def test_a_dry_run_writes_nothing_and_steps_are_skipped(robot):
    before = robot.read_bytes()
    words = ("--robot", robot, "--port", "sim", "--answers", "answers.yaml", "--dry-run", "--yes")
    done = calibrate(*words, "--skip", "motors", "--skip", "distance", "--skip", "geometry")
    assert done.exit_code == 0, done.output
    assert "match the robot file" in done.output and robot.read_bytes() == before


@pytest.mark.nightly
def test_exchanged_directions_are_refused(robot):
    # Places as a true track 3 % too large gives them: clockwise (-2 L alpha, -2 L alpha),
    # counter-clockwise (-2 L alpha, +2 L alpha), each typed for the other direction.
    text = robot.read_text().replace("slip: 0.5 mm", "slip: 0 mm")
    robot.write_text(text + "\n")
    # The odometry ends the first square 40 mm in front and to the left, the second one opposite.
    clockwise, counter = ["-54", "-134"], ["134", "54"]
    lines = [
        "geometry.forward: [-54, -134, -54, -134]",
        f"geometry.left: [{', '.join(counter + clockwise)}]",
    ]
    Path("swapped.yaml").write_text("\n".join(lines) + "\n")
    done = calibrate(
        "geometry",
        "--robot",
        robot,
        "--port",
        "sim",
        "--answers",
        "swapped.yaml",
        "--runs",
        2,
        "--dry-run",
    )
    assert "explain the ends of both directions" in str(done.exception)


def test_ways_to_a_geometry_refuse_options_of_others(robot):
    done = calibrate("geometry", "--how", "spin", "--rounds", 2, "--port", "sim")
    assert done.exit_code == 2 and "--how spin has no such option" in done.output


def test_an_option_before_the_steps_name_is_not_lost_silently(robot):
    done = calibrate("--dry-run", "encoders", "--port", "sim")
    assert done.exit_code == 2 and "--dry-run has no effect before 'encoders'" in done.output


class Terminal:
    """A person at a terminal: reads the output, types."""

    def __init__(self, *words):
        self.end, other = pty.openpty()
        self.process = subprocess.Popen(
            command_line("calibrate", *words),
            stdin=other,
            stdout=other,
            stderr=other,
            close_fds=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), "TERM": "dumb"},
        )
        os.close(other)
        self.printed = ""

    def wait_for(self, text):
        """Read until `text` has been printed since the last time."""
        until = time.monotonic() + LONGEST
        while text not in self.printed:
            assert time.monotonic() < until, self.printed
            if not select.select([self.end], [], [], 0.2)[0]:
                continue
            try:
                self.printed += os.read(self.end, 4096).decode()
            except OSError:
                pytest.fail(f"it ended: {self.printed}")
        before, _, self.printed = self.printed.partition(text)
        return before

    def type(self, text):
        os.write(self.end, f"{text}\n".encode())

    def close(self):
        self.process.wait(LONGEST)
        os.close(self.end)
        return self.process.returncode


def test_nonsense_at_the_terminal_is_asked_again_with_the_reason(robot):
    person = Terminal(
        "distance", "--robot", robot, "--port", "sim", "--repeats", 1, "--metres", 0.3, "--dry-run"
    )
    person.wait_for("Press Enter to start")
    person.type("")
    person.wait_for("Press Enter when you are ready")
    person.type("")
    for typed, reason in (
        ("far", "is not a number with a unit"),
        ("-300", "is not between 195 mm and 405 mm"),
        ("300 kg", "kg is a mass, but a length is required"),
    ):
        person.wait_for("distance from the mark to the tyre?")
        person.type(typed)
        person.wait_for(reason)
    person.wait_for("distance from the mark to the tyre?")
    person.type("303")
    person.wait_for("times as far as odometry reports")
    assert person.close() == 0


def test_the_answer_no_moves_nothing(robot):
    person = Terminal("motors", "--robot", robot, "--port", "sim", "--dry-run")
    person.wait_for("Press Enter to start")
    person.type("no")
    person.wait_for("the motion was refused")
    assert person.close() == 1


@pytest.mark.parametrize(
    "typed", by_day(3, ["wait, stop", "yes please", "0", "start", "\x1b[A", "nein"])
)
def test_nothing_but_enter_or_y_starts_a_motor(robot, typed):
    person = Terminal("motors", "--robot", robot, "--port", "sim", "--dry-run")
    person.wait_for("Press Enter to start")
    person.type(typed)
    person.wait_for("Nothing moves: only Enter or y continues")
    person.wait_for("Press Enter to start")  # it has asked again, and waits
    person.type("no")
    person.wait_for("the motion was refused")
    assert person.close() == 1


def test_at_the_mark_too_other_words_start_no_motor(robot):
    person = Terminal("distance", "--robot", robot, "--port", "sim", "--repeats", 1, "--dry-run")
    person.wait_for("Press Enter to start")
    person.type("Y")
    person.wait_for("Press Enter when you are ready")
    person.type("wait, stop")
    person.wait_for("Nothing moves")
    person.wait_for("Press Enter when you are ready")
    person.type("stop")
    person.wait_for("the motion was refused")
    assert person.close() == 1
    assert not list(Path("recordings").glob("*.csv"))


def test_answers_that_fit_no_question_are_reported_before_the_robot_drives(robot):
    Path("few.yaml").write_text("distance.reading: [998, 999]\ndistance.repeats: 3\n")
    done = calibrate(
        "distance", "--robot", robot, "--port", "sim", "--answers", "few.yaml", "--yes"
    )
    causes = [problem.cause for problem in done.exception.problems]
    assert causes[0].startswith("distance.repeats: no question has this name")
    assert causes[1] == "distance.reading: it will be asked 5 times, but has 2 answers"
    assert "The robot drives" not in done.output
    assert not list(Path("recordings").glob("*.csv"))


def test_a_folder_that_keeps_nothing_is_reported_before_anything_moves(robot):
    Path("recordings").write_text("no folder")
    done = calibrate(
        "distance", "--robot", robot, "--port", "sim", "--answers", "answers.yaml", "--yes"
    )
    assert "E-CALIBRATE-WRITE" in str(done.exception) and done.output == ""


def test_an_answer_that_the_counts_contradict_is_asked_again(robot):
    person = Terminal("encoders", "--robot", robot, "--port", "sim", "--rolls", 0, "--dry-run")
    person.wait_for("Press Enter to start")
    person.type("")
    person.wait_for("The left motor is driven now")
    person.wait_for("Press Enter when you are ready")
    person.type("")
    person.wait_for("[left forward]")
    person.type("none")
    person.wait_for("The encoders counted edges, so a wheel turned. Look again")
    person.wait_for("The left motor is driven now")
    person.wait_for("Press Enter when you are ready")
    person.type("")
    person.wait_for("[left forward]")
    person.type("")
    person.wait_for("The right motor is driven now")
    person.wait_for("Press Enter when you are ready")
    person.type("")
    person.wait_for("[right forward]")
    person.type("left forward")
    person.wait_for("With the other motor another encoder counted")
    person.wait_for("Press Enter when you are ready")
    person.type("no")
    assert person.close() == 1


def press_enter(*words, until):
    """Walk through a command at a terminal by pressing Enter at each prompt."""
    person = Terminal(*words)
    screen, answered, deadline = "", "", time.monotonic() + 4 * LONGEST
    while until not in screen:
        assert time.monotonic() < deadline, screen[-2000:]
        if not select.select([person.end], [], [], 0.2)[0]:
            continue
        try:
            new = os.read(person.end, 4096).decode()
        except OSError:
            break
        screen += new
        if screen.endswith(": ") and screen != answered:  # every prompt ends so
            answered = screen
            person.type("")
    assert person.close() == 0, screen[-2000:]
    return screen.replace("\r\n", "\n")


def test_a_simulated_robot_is_calibrated_by_pressing_enter(robot):
    text = robot.read_text().replace("diameter_spread: 0}", "diameter_spread: 0.02}")
    robot.write_text(text)
    skipped = ("--skip", "motors", "--skip", "geometry", "--skip", "battery")
    screen = press_enter("--robot", robot, "--port", "sim", *skipped, until="the truth\n")
    assert "SIMULATED: the eye sees: left forward" in screen
    assert re.search(
        r"SIMULATED: the tape reads 9\d\d\.\d mm|SIMULATED: the tape reads 10\d\d", screen
    )
    assert re.search(
        r"SIMULATED: the ruler reads 24\.\d+|SIMULATED: the ruler reads 25\.\d+", screen
    )
    calibration = load_robot(str(simulated_copy_of(robot))).robot.calibration
    assert {"drive.polarity", "drive.left.wheel.diameter", "sensors.front.curve.a"} <= {
        *calibration
    }


def test_a_restart_goes_on_with_the_first_step_that_is_not_done(robot):
    skipped = [word for name in STEPS if name not in DONE for word in ("--skip", name)]
    words = ("--robot", robot, "--port", "sim", "--answers", "answers.yaml", "--yes", *skipped)
    assert calibrate(*words).exit_code == 0
    person = Terminal("--robot", robot, "--port", "sim", "--fast")
    person.wait_for("Calibrated already: encoders, motors.")
    person.wait_for("Go on with step 3, distance?")
    person.type("")
    assert "Step 1" not in person.wait_for("Step 3 of 7: distance")
    person.wait_for("The robot drives 1 m straight ahead")
    assert "Press Enter" not in person.wait_for("Write this?")  # --fast
    person.process.terminate()
    person.close()


def test_a_robot_waits_for_each_consent_also_with_fast(robot):
    end, other = pty.openpty()
    done = subprocess.run(
        command_line("calibrate", "motors", "--robot", robot, "--port", os.ttyname(end), "--fast"),
        stdin=other,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    os.close(end)
    os.close(other)
    assert done.returncode == 2 and "--fast is for --port sim" in done.stdout


def test_the_truth_stands_beside_what_was_found(robot):
    screen = press_enter(
        *("distance", "--robot", robot, "--port", "sim", "--repeats", 2, "--dry-run"),
        until="left.wheel.diameter",
    )
    assert "found" in screen and "truth" in screen and "in sd" in screen
