"""Results of a simulated robot never reach a real one."""

import os
from pathlib import Path

import pytest
from click.testing import CliRunner

from diffbotctl.calibrate.log_reader import is_simulated
from diffbotctl.cli.main import program
from diffbotctl.config.load import load_robot
from diffbotctl.config.lookup import find_robot
from diffbotctl.drivers.robot_ports import is_simulated_port, mark_emulated
from diffbotctl.drivers.serial_robot import open_serial_robot
from diffbotctl.errors import ConfigurationError

ANSWERS = "encoders.wheel: {measure: eye}\nencoders.proof: {measure: eye}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the robot `mine`, and its simulated one calibrated."""
    monkeypatch.chdir(tmp_path)
    Path("robots").mkdir()
    Path("robots/mine.yaml").write_text("format: 1\nkind: robot\ninclude: book_2wd\n")
    Path("answers.yaml").write_text(ANSWERS)
    done = calibrate("--robot", "mine")
    assert done.exit_code == 0, done.output
    return tmp_path


@pytest.fixture
def port():
    """The device of a serial line that is not that of an emulated board."""
    ends = os.openpty()
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


def diffbotctl(*words):
    return CliRunner().invoke(program, words, standalone_mode=False)


def calibrate(*words):
    common = ("--port", "sim", "--answers", "answers.yaml", "--yes")
    return diffbotctl("calibrate", "encoders", "--rolls", "0", *common, *words)


def test_the_robot_s_own_file_stays_as_it_is(folder):
    assert Path("robots/mine.yaml").read_text() == "format: 1\nkind: robot\ninclude: book_2wd\n"
    assert load_robot("mine").robot.drive.polarity == "unproven"
    simulated = load_robot("mine.simulated").robot
    assert simulated.drive.polarity == "calibrated"
    assert simulated.calibration["drive.polarity"].simulated
    shown = diffbotctl("calibrate", "show", "--robot", "mine.simulated").output
    assert "encoders (SIMULATED robot)" in shown
    assert find_robot(None) == Path("robots/mine.yaml")  # still the only one


def test_a_shipped_robot_gets_a_file_for_simulated_results_in_robots(folder):
    assert calibrate("--robot", "book_2wd_counts").exit_code == 0
    assert load_robot("book_2wd_counts.simulated").robot.drive.polarity == "calibrated"
    assert not Path("robots/book_2wd_counts.yaml").exists()


def test_what_changes_in_the_robot_s_file_counts_for_its_simulated_one(folder):
    changed = "format: 1\nkind: robot\ninclude: book_2wd\ndrive: {track: 131 mm}\n"
    Path("robots/mine.yaml").write_text(changed)
    assert load_robot("mine.simulated").robot.drive.track == 0.131


COMMANDS = (
    "run goal --port {port}",
    "calibrate motors --yes --port {port}",
    "flash firmware --yes --port {port}",
    "blink --port {port}",
    "bluetooth test {port}",
)


@pytest.mark.parametrize("way", ["named", "renamed", "included"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_real_port_refuses_them_and_names_file_field_and_fix(folder, port, way, command):
    file = Path("robots/mine.simulated.yaml")
    if way == "renamed":
        file = file.rename("robots/other.yaml")
    elif way == "included":
        file = Path("robots/other.yaml")
        file.write_text("format: 1\nkind: robot\ninclude: mine.simulated\n")
    done = diffbotctl(*command.format(port=port).split(), "--robot", str(file))
    assert isinstance(done.exception, ConfigurationError), done.output
    (error,) = [each for each in done.exception.problems if each.severity == "error"]
    assert error.code == "E-CALIBRATION-SIMULATED"
    written_in = "other" if way == "renamed" else "mine.simulated"
    assert error.file == f"robots/{written_in}.yaml" and error.line
    assert "drive.polarity" in error.cause
    assert ("delete the entries" if way == "renamed" else "--robot robots/mine.yaml") in error.fix
    assert diffbotctl("check", "--real", str(file)).return_value == 2


def test_the_driver_of_a_real_port_refuses_them_too(folder, port):
    robot = load_robot("mine.simulated").robot
    with pytest.raises(ConfigurationError, match="E-CALIBRATION-SIMULATED"):
        open_serial_robot(robot, port, print)


def test_a_result_of_the_robot_itself_replaces_an_included_one_as_a_whole(folder):
    """Parts of two results would be a third one: of the first the mark would remain."""
    entry = '  drive.polarity: {value: calibrated, date: "2026-01-01T00:00Z", method: encoders}\n'
    text = f"format: 1\nkind: robot\ninclude: mine.simulated\ncalibration:\n{entry}"
    Path("robots/both.yaml").write_text(text)
    merged = load_robot("both", refuse_simulated=True).robot
    assert not merged.calibration["drive.polarity"].simulated


def test_the_device_of_an_emulated_board_is_that_of_a_simulated_robot(port):
    assert is_simulated_port("sim") and is_simulated_port("emulated")
    assert not is_simulated_port(port)
    assert not is_simulated_port("/dev/null") and not is_simulated_port("bluetooth:98:D3:31:F5:6A")
    mark_emulated(port)
    assert is_simulated_port(port)


def test_a_fit_to_recordings_of_a_simulated_robot_is_marked(folder):
    (table,) = Path("recordings").glob("encoders-*.csv")  # what the calibration of one has left
    assert is_simulated(table)
    ends = ["recording,x,y,heading_deg"]
    for number, (x, y, heading) in enumerate(DRIVES):
        name = f"d{number}"
        words = ("run", "goal", "--robot", "mine", "--fast", "--quiet", "--seed", "1")
        goal = f"{x} {y} {heading}deg"
        clear = ("--set", "world.walls=[]", "--goal", goal, "--record", f"{name}.mcap")
        assert diffbotctl(*words, *clear).return_value in (0, 3)
        ends.append(f"{name},{x},{y},{heading}")
    Path("ends.csv").write_text("\n".join(ends) + "\n")
    files = [f"d{number}.mcap" for number in range(len(DRIVES))]
    words = ("--robot", "mine", "--ends", "ends.csv", "--yes")
    done = diffbotctl("calibrate", "from-log", *files, *words)
    assert done.exit_code == 0, done.output + str(done.exception)
    assert not load_robot("mine").robot.calibration
    assert load_robot("mine.simulated").robot.calibration["drive.track"].simulated


DRIVES = [(1, 0, 0), (1, 0.5, 90), (1, -0.5, -90), (1.5, 0.3, 170), (1.5, -0.3, -170), (0.8, 0, 90)]
