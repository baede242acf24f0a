"""The systemd unit is one that systemd takes, whatever the folder is called."""

import shutil
import subprocess

import pytest

from diffbotctl.cli import run, service
from diffbotctl.errors import UsageError
from tests.command_result import invoke

pytestmark = pytest.mark.usefixtures("empty_folder")


def unit(*words):
    return invoke(service.service, *words)[1]


def verified(text, folder):
    """What systemd has to say of a unit; nothing is good. It knows no exit code for a warning."""
    path = folder / "robot.service"
    path.write_text(text)
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True
    )
    return [line for line in done.stderr.splitlines() if "robot.service" in line]


@pytest.fixture(params=["plain", "a folder's 50% and $HOME"])
def folder(request, tmp_path, monkeypatch):
    made = tmp_path / request.param
    (made / "robots").mkdir(parents=True)
    monkeypatch.chdir(made)
    return made


def test_systemd_finds_nothing_to_say(folder, tmp_path):
    text = "format: 1\nkind: robot\ninclude: book_2wd\n"
    (folder / "robots" / "mine.yaml").write_text(text.replace("book_2wd", "book_2wd_counts"))
    made = unit("--user", "root", "--port", "/dev/ttyACM0")
    assert f"WorkingDirectory={str(folder).replace('%', '%%')}\n" in made
    assert "robots/mine.yaml" in made
    if shutil.which("systemd-analyze"):
        assert verified(made, tmp_path) == []
        assert verified(made.replace("KillMode=mixed", "KillMode=most"), tmp_path)  # it can fail


def test_the_command_line_is_one_that_run_takes():
    text = unit().replace("\\\n", " ")
    line = next(line for line in text.splitlines() if line.startswith("ExecStart="))
    words = line.split(" run ")[1].split()
    with run.run.make_context("run", words) as context:
        assert context.params["pipeline"] == "standby"
        assert context.params["stay"] is True


def test_only_paths_make_a_line_longer_than_80_columns():
    lines = unit("--port", "/dev/serial/by-id/usb-Arduino_Mega").splitlines()
    paths = ("ExecStart=", "WorkingDirectory=")
    assert [line for line in lines if len(line) > 80 and not line.startswith(paths)] == []


def test_a_pipeline_that_would_drive_off_at_each_start_is_refused():
    with pytest.raises(UsageError) as raised:
        unit("goal")
    assert raised.value.problems[0].code == "E-SERVICE-GOALS"


def test_a_robot_on_standby_stands():
    from diffbotctl.config.load import load
    from diffbotctl.runs.options import RunOptions
    from diffbotctl.runs.run import Run

    result = Run(load("standby"), RunOptions(fast=True, duration=3.0, stay=True)).go()
    assert (result.ending.code, result.goals, result.path) == (0, 0, 0.0)
