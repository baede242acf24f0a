"""The IMU on all screens: the same words, from one message."""

import json

import pytest
from rich.console import Console

from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.messages import Imu
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.ui.dash.facts import facts_panel
from diffbotctl.ui.live_view import facts_table
from diffbotctl.web.engine_feed import RunPicture
from tests.support.running import PlainClient, cli, running

STUCK = "the rate that the IMU measures does not change"
ROBOT = """\
format: 1
kind: robot
include: book_2wd
board: {telemetry: 30 Hz}
imu: {type: mpu6050}
drive: {polarity: checked_by_hand}
simulation: {faults: [{fault: imu_stuck, at: 3 s}]}
"""


def texts(table, width=60):
    console = Console(width=width, color_system=None)
    with console.capture() as capture:
        console.print(table)
    return capture.get()


def newest_state(client):
    last = client.request("describe_topic", topic="/imu")["last"]
    return last and last["state"]


@pytest.mark.parametrize(
    ("imu", "text"),
    [
        (Imu(1, "zeroing"), "not used yet: it is zeroed while the robot stands still"),
        (Imu(1, "failed", cause=STUCK), f"FAULT: {STUCK}"),
        (  # 0.5 rad/s, a bias of 0.02 and 0.0001 rad/s
            Imu(1, "working", 0.5, 0.02, 0.0001, True),
            "+28.6 deg/s, scale calibrated, bias 1.146 +- 0.006 deg/s",
        ),
        (
            Imu(1, "working", -0.5, -0.02, 0.0001),
            "-28.6 deg/s, scale not calibrated, bias -1.146 +- 0.006 deg/s",
        ),
    ],
)
def test_every_screen_has_the_same_words(imu, text):
    assert imu_text(imu) == text
    picture = RunPicture()
    picture.view.snapshot = snapshot = RunSnapshot(1, {"odometry.imu": imu}, 0, 0)
    assert ["imu", text, imu.state != "working"] in map(list, picture.whole()["facts"])
    assert f"imu {text}" in texts(facts_table(snapshot), 100)
    for width in (80, 34):  # a line that is too long goes on in the next one
        panel = texts(facts_panel(picture.view, width, 40), width)
        assert text.replace(", bias", " bias") in " ".join(panel.replace("imu", " ").split())


def test_an_imu_that_fails_is_reported_by_every_command(tmp_path):
    robot = tmp_path / "robot.yaml"
    robot.write_text(ROBOT)
    with running(tmp_path, "goal", "--robot", str(robot), "--stay", "--goal", "0 0"):
        client = PlainClient(tmp_path)
        client.until(lambda _: newest_state(client) == "failed")
        for words in (["why", "--all"], ["doctor"], ["dash", "--once"]):
            _, out, complaint = cli(tmp_path, *words)
            assert f"FAULT: {STUCK}" in " ".join(out.split()), out + complaint
        code, out, complaint = cli(tmp_path, "topic", "echo", "odometry.imu", "--once", "--json")
        assert code == 0, complaint
    assert json.loads(out)["cause"] == STUCK
