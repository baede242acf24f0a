"""Results are written into the robot file: one section changes, every other byte stays."""

import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as some

from diffbotctl.calibrate.result import Finding, Provenance, format_age, formatted_value
from diffbotctl.calibrate.robot_file import (
    plan_change,
    plan_value_change,
    replace_section,
    simulated_copy,
    undo,
    writable_copy,
    write_change,
)
from diffbotctl.cli.calibrate import calibrate as command
from diffbotctl.config.load import load_robot
from diffbotctl.config.lookup import original_of
from diffbotctl.errors import ConfigurationError, RunError, UsageError

SHIPPED = Path(__file__).parent.parent.parent / "robots" / "book_2wd.yaml"
ORIGIN = Provenance("geometry", "2026-05-01T09:30Z", 7.4, "4fd1")
TRACK = Finding("drive.track", 0.1263, 0.0002)
LAG = Finding("drive.left.motor.lag", 0.093, 0.002)
ENTRY = formatted_value(TRACK, ORIGIN)


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.yaml"
    shutil.copyfile(SHIPPED, path)
    return path


def test_an_entry_has_value_deviation_and_origin():
    assert ENTRY == (
        '{value: 0.1263 m, sd: 0.0002 m, date: "2026-05-01T09:30Z", method: geometry, '
        'volts: 7.4 V, recording: "4fd1"}'
    )
    unmeasured = formatted_value(
        Finding("drive.polarity", "calibrated"), Provenance("x", "", None, None)
    )
    assert unmeasured == '{value: calibrated, date: "", method: x, volts: not measured}'
    assert "sd" not in formatted_value(TRACK._replace(sd=0.0), ORIGIN)  # which files refuse


@pytest.mark.parametrize(
    "before, after",
    [
        # braces give way to spaces, so that the comment stays in its column
        (
            "a: 1\ncalibration: {}   # by hand\nb: 2\n",
            "a: 1\ncalibration:      # by hand\n  drive.track: {value: 1}\nb: 2\n",
        ),
        ("calibration: {}\n", "calibration:\n  drive.track: {value: 1}\n"),
        ("calibration:\n# the end\n", "calibration:\n  drive.track: {value: 1}\n# the end\n"),
        ("a: 1", "a: 1\ncalibration:\n  drive.track: {value: 1}\n"),
        (
            "a: 1\r\ncalibration: {}\r\nb: 2\r\n",
            "a: 1\r\ncalibration:\r\n  drive.track: {value: 1}\r\nb: 2\r\n",
        ),
        # an entry that is there is replaced, its comment stays
        (
            "calibration:\n  drive.track: {value: 3}  # why\n  c: {value: 4}\n",
            "calibration:\n  drive.track: {value: 1}  # why\n  c: {value: 4}\n",
        ),
        (
            "calibration:\n    c: {value: 4}  # indented so\n\nb: 2\n",
            "calibration:\n    c: {value: 4}  # indented so\n    drive.track: {value: 1}\n\nb: 2\n",
        ),
        (
            "calibration: {c: {value: 4}}\n",
            "calibration: {c: {value: 4}, drive.track: {value: 1}}\n",
        ),
    ],
)
def test_only_the_section_changes(before, after):
    assert replace_section(before, {"drive.track": "{value: 1}"}) == after


COMMENTS = some.lists(
    some.sampled_from(["# one", "", "x: {y: 1}  # two", "z:\n  - 1  # three"]),
    max_size=4,
    unique=True,
)


@given(
    COMMENTS,
    some.sampled_from(["calibration: {}", "calibration:", "calibration: {} # c"]),
    COMMENTS,
)
def test_every_other_line_survives(above, section, below):
    keys = [line.split(":")[0] for line in above if ":" in line]
    below = [line for line in below if line.split(":")[0] not in keys]
    text = "\n".join([*above, section, *below, ""])
    after = replace_section(text, {"drive.track": "{value: 1}", "c": "{value: 2}"})
    rest = [line for line in after.split("\n") if "value" not in line and "calibr" not in line]
    assert rest == "\n".join([*above, *below, ""]).split("\n")


def test_written_values_take_the_place_of_the_stated_ones(robot):
    write_change(plan_change(robot, [TRACK, LAG], ORIGIN))
    file = load_robot(str(robot))
    assert (file.robot.drive.track, file.nominal.drive.track) == (0.1263, 0.125)
    assert (file.robot.drive.left.motor.lag, file.robot.drive.right.motor.lag) == (0.093, 0.1)


def test_a_folder_in_which_nothing_can_be_written_is_reported(robot):
    (robot.parent / f".{robot.name}.trial.yaml").mkdir()  # also where the user may write anything
    with pytest.raises(UsageError, match="its folder cannot be written"):
        plan_change(robot, [TRACK], ORIGIN)


def test_undo_goes_back_step_by_step_to_the_very_bytes(robot):
    states = [robot.read_bytes()]
    for value in (0.1263, 0.1265):
        write_change(plan_change(robot, [TRACK._replace(value=value)], ORIGIN))
        states.append(robot.read_bytes())
    undo(robot)
    assert robot.read_bytes() == states[1]
    undo(robot)
    assert robot.read_bytes() == states[0] == SHIPPED.read_bytes()
    assert [each.name for each in robot.parent.iterdir()] == ["mine.yaml"]
    with pytest.raises(UsageError, match="no calibration was written"):
        undo(robot)


def test_undo_names_the_results_of_the_simulated_robot(robot):
    copy, is_new = simulated_copy(robot)
    with pytest.raises(UsageError, match=f"--robot .*{copy.name}"):
        undo(robot)
    assert is_new and original_of(copy) == robot
    robot.unlink()
    assert original_of(copy) == Path("mine")


def test_one_value_of_its_own_is_written_and_undone(robot):
    first = robot.read_text()
    plan = plan_value_change(robot, ("link", "baud"), "57600")
    assert "+link: {protocol: diffbot, uart: 1, baud: 57600}" in plan.difference()
    write_change(plan)
    assert robot.read_text() == first.replace("baud: 9600}", "baud: 57600}") != first
    undo(robot)
    assert robot.read_text() == first


def test_one_value_that_cannot_be_true_is_refused(robot):
    with pytest.raises(ConfigurationError):
        plan_value_change(robot, ("link", "baud"), "1234")


def test_a_file_that_was_edited_since_is_not_undone(robot):
    write_change(plan_change(robot, [TRACK], ORIGIN))
    edited = robot.read_bytes() + b"# mine\n"
    robot.write_bytes(edited)
    with pytest.raises(UsageError, match="changed since"):
        undo(robot)
    assert robot.read_bytes() == edited


def test_a_file_that_is_edited_meanwhile_is_not_written(robot):
    plan = plan_change(robot, [TRACK], ORIGIN)
    robot.write_bytes(robot.read_bytes() + b"# mine\n")
    with pytest.raises(RunError, match="meanwhile"):
        write_change(plan)
    assert robot.read_bytes().endswith(b"# mine\n")


@pytest.mark.parametrize(
    "finding, why",
    [
        (Finding("drive.track", 0.0625), "0.50 times the stated"),
        (Finding("drive.left.wheel.diameter", 0.059), "1.10 times as large as"),
        (Finding("drive.left.motor.lag", 1.4), "too long for a motor"),
        (Finding("drive.track", -0.1), "must be above"),
    ],
)
def test_what_cannot_be_true_is_refused_with_the_reason(robot, finding, why):
    with pytest.raises(ConfigurationError) as refused:
        plan_change(robot, [finding], ORIGIN)
    assert why in " ".join(str(refused.value).split())
    assert [each.name for each in robot.parent.iterdir()] == ["mine.yaml"]


def test_a_shipped_robot_is_copied_to_the_user_s_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mine, was_copied = writable_copy(load_robot("book_2wd").file)
    assert (mine, was_copied) == (Path("robots/book_2wd.yaml"), True)
    assert mine.read_bytes() == SHIPPED.read_bytes()
    assert writable_copy(load_robot("book_2wd").file) == (mine, False)


@pytest.mark.parametrize(
    "minutes, words",
    [(0, "just now"), (1, "1 minute"), (119, "1 hour"), (2880, "2 days"), (-9, "in the future")],
)
def test_age_in_words(minutes, words):
    now = datetime(2026, 5, 3, 0, 0, tzinfo=UTC).timestamp() + 60 * minutes
    age_text = format_age("2026-05-03T00:00Z", datetime.fromtimestamp(now, UTC))
    assert age_text.startswith(words)


def test_the_commands_show_and_undo(robot):
    write_change(plan_change(robot, [TRACK], ORIGIN))
    shown = CliRunner().invoke(command, ["show", "--robot", "./mine.yaml"]).output
    lines = shown.splitlines()
    assert lines[1].startswith("geometry, ") and "battery 7.4 V" in lines[1]
    assert lines[2:4] == ["               value     sd", "  drive.track  0.1263 m  0.0002 m"]
    assert "\n  drive.left.motor.lag        diffbotctl calibrate motors\n" in shown
    assert CliRunner().invoke(command, ["undo", "--robot", "./mine.yaml"]).exit_code == 0
    assert robot.read_bytes() == SHIPPED.read_bytes()
