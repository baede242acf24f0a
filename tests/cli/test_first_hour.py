"""What a person types in the first hour, and what is printed then."""

import re
from pathlib import Path

import pytest

from diffbotctl.cli.main import program
from diffbotctl.cli.new import kits
from diffbotctl.cli.topic import _field_texts
from diffbotctl.config.load import check
from diffbotctl.errors import UserError
from diffbotctl.links.board_search import wrong_version
from diffbotctl.links.diffbot_frames import VERSION
from diffbotctl.messages import Link, Odometry
from diffbotctl.recording.json_codec import plain
from tests.command_result import invoke
from tests.support.running import cli, running

ROOT = Path(__file__).parents[2]

PIPELINE = "format: 1\nkind: pipeline\nblocks:\n  a: {block: %s}\n"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "goal.mcap"
    invoke(program, "run", "goal", "--fast", "--quiet", "--record", path)
    return path


def test_a_replay_prints_what_the_run_came_to(recording):
    code, shown = invoke(program, "replay", recording)
    assert not code
    assert re.search(r"(?m)^goals reached +1$", shown) and re.search(r"(?m)^stops +0$", shown)
    assert re.search(r"(?m)^path +1\.1\d\d m$", shown), shown


def test_a_plot_without_fields_draws_the_speeds(recording, tmp_path):
    code, shown = invoke(program, "bag", "plot", "--ascii", recording)
    assert not code and "odometry.odometry.linear [m/s]" in shown
    assert "odometry.odometry.angular [rad/s]" in shown and shown.count("'") > 20
    hello = tmp_path / "hello.mcap"
    invoke(program, "run", "hello", "--fast", "--for", "1s", "--quiet", "--record", hello)
    with pytest.raises(Exception, match="has no odometry: name what to plot"):
        invoke(program, "bag", "plot", hello)


def test_check_alone_checks_the_files_of_the_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, shown = invoke(program, "check")
    assert not code and "book_2wd: no errors" in shown and "goal: no errors" in shown
    for folder, text in (("robots", "robot\ninclude: book_2wd"), ("pipelines", "pipeline")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.yaml").write_text(f"format: 1\nkind: {text}\n")
    (tmp_path / "pipelines" / "other.yaml").write_text(PIPELINE % "talkr")
    code, shown = invoke(program, "check")
    assert code == 2 and "robots/mine.yaml: no errors" in shown
    assert "pipelines/other.yaml: 1 error" in shown and "book_2wd:" not in shown


@pytest.mark.parametrize(
    ("typed", "board"),
    [
        ("Arduino Uno", "uno"),
        ("arduino mega 2560", "mega2560"),
        ("Arduino Nano", "nano"),
        ("Raspberry Pi Pico", "pico"),
    ],
)
def test_the_common_name_of_a_board_leads_to_its_type(tmp_path, typed, board):
    path = tmp_path / "robot.yaml"
    path.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\nboard: {{type: {typed}}}\n")
    with pytest.raises(UserError) as error:
        invoke(program, "show", path)
    assert f"did you mean {board}?" in str(error.value)


def test_an_unknown_block_may_be_of_a_package_that_is_not_installed(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(PIPELINE % "my_package.blocks:Follower")
    (problem,) = check(str(path), None, ())
    assert problem.code == "E-BLOCK-UNKNOWN" and "`pip install -e FOLDER`" in problem.fix


def test_numbers_have_units_and_an_empty_text_is_shown():
    odometry = Odometry(0, 1.0, 0.5, 0.25, 0.1, -0.2, (0.0,) * 6)
    units = {"x": "m", "heading": "rad", "linear": "m/s", "covariance": "m, rad", "cause": ""}
    texts = [text for _, text in _field_texts(plain(odometry), units)]
    assert {"x 1 m", "heading 0.25 rad", "linear 0.1 m/s", 'warning ""'} <= set(texts)
    assert "covariance [0, 0, 0, 0, 0, 0]" in texts
    link = Link(0, "up", 5, 0, 0)
    assert ("received", "received 5") in _field_texts(plain(link), {"received": "count"})


@pytest.mark.parametrize(
    ("version", "age", "command"),
    [(VERSION - 1, "older", "flash firmware"), (VERSION + 1, "newer", "install the newer")],
)
def test_a_board_of_another_version_is_older_or_newer_and_what_to_do(version, age, command):
    refusal = wrong_version(version)
    assert f"firmware is {age}: " in refusal.cause and command in refusal.fix


def test_a_new_pipeline_fits_the_kits_and_the_fix_of_a_wrong_sensor_works(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    invoke(program, "new", "pipeline", "mine")
    path = tmp_path / "pipelines" / "mine.yaml"
    for kit in kits():
        invoke(program, "new", "robot", "--kit", kit)
        assert not [each for each in check(str(path), kit, ()) if each.severity == "error"], kit
    text = path.read_text()
    path.write_text(text.replace("    needs: Volts\n", ""))
    (problem,) = check(str(path), "ros_car", ())  # an HC-SR04
    assert problem.code == "E-WIRE-TYPE"
    assert problem.fix == (
        "remove 'range', and write robot.front in place of range.range, or give 'range' "
        "`needs: Volts`"
    )
    path.write_text(text.replace("    needs: Volts\n", "", 1))  # that of `range` alone is missing
    assert [each.code for each in check(str(path), "ros_car", ())] == ["E-WIRE-TYPE"]
    removed = re.sub(r"  range:\n(    .*\n)+", "", text).replace("range.range", "robot.front")
    path.write_text(removed)
    assert not check(str(path), "ros_car", ())


def test_the_pipeline_that_the_pages_name_first_is_driven_by_hand_and_takes_goals(tmp_path):
    for page in ("dashboard.md", "web.md"):
        first = re.search(r"diffbotctl (run .*)", (ROOT / "docs" / page).read_text())
        assert first is not None and first[1].startswith("run standby --")
    with running(tmp_path, "standby", "--stay"):
        assert cli(tmp_path, "drive", "--v", "0.1", "--for", "200ms")[0] == 0
        assert cli(tmp_path, "goto", "0.1", "0")[0] == 0
    with running(tmp_path, "teleop"):
        code, _, complaint = cli(tmp_path, "goto", "0.1", "0")
        assert code == 1 and "`diffbotctl run standby`" in complaint
