"""A real run and its control socket: stop, resume, goto, and who may speak."""

import os
import signal
import stat

import pytest

from diffbotctl.replay.replay import replay
from diffbotctl.testing.running import PlainClient, moves, running, stands


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    with running(folder, "goal", "--stay", "--goal", "0.1 0"):
        yield folder


def test_the_greeting_says_version_and_engine_and_others_may_not_open_the_socket(run):
    client = PlainClient(run)
    assert client.greeting["hello"] == 1 and client.greeting["engine"] == "test"
    folder = run / "diffbotctl"
    assert stat.S_IMODE((folder / "test.socket").stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert client.ask("status")["ok"]
    client.close()
    log = (folder / "test.log").read_text()
    assert f'"uid": {os.getuid()}' in log and f'"pid": {os.getpid()}' in log


def test_stop_holds_the_robot_until_resume(run):
    client = PlainClient(run)
    assert client.ask("goto", x=1.5, y=0.0)["ok"]
    client.until(moves)
    assert client.ask("stop", why="a cat")["ok"]
    held = client.until(lambda status: status["held"])["held"]
    assert held["code"] == "operator_stop" and held["latched"] and "a cat" in held["cause"]
    client.until(stands)
    text = client.ask("why")["text"]
    assert "operator_stop" in text and "a cat" in text and "diffbotctl resume" in text
    assert client.ask("drive", linear=0.1)["error"] == "E-HELD"
    assert client.ask("resume")["ok"]
    assert client.until(moves)["held"] is None  # the goal goes on
    client.ask("stop")
    client.ask("goto", x=0.0, y=0.0)
    client.ask("resume")


def test_driving_goes_before_the_goal_which_then_waits_for_resume(run):
    client, other = PlainClient(run), PlainClient(run)
    client.ask("goto", x=1.0, y=0.5)
    assert client.ask("drive", linear=-0.1, angular=0.0)["ok"]
    assert other.ask("drive", linear=0.1)["error"] == "E-BUSY"
    assert other.ask("resume")["error"] == "E-BUSY"
    while not client.ask("status")["gate.wheels"]["left"] < 0:
        assert client.ask("drive", linear=-0.1)["ok"]
    assert other.ask("drive", linear=0.05, take_over=True)["ok"]
    assert client.ask("release")["error"] == "E-REQUEST"
    assert other.ask("release")["ok"]
    assert client.until(stands)["held"] is None
    assert client.ask("status")["operator.goal"]["number"] == 0
    client.ask("resume")
    assert client.until(moves)["operator.goal"]["x"] == 1.0
    client.close()
    other.close()


def test_commands_are_inputs_of_the_recording_and_replay_is_the_same(tmp_path):
    path = tmp_path / "commanded.mcap"
    with running(tmp_path, "goal", "--stay", "--goal", "1 0", "--record", str(path)) as process:
        client = PlainClient(tmp_path)
        client.until(moves)
        client.ask("stop")
        client.until(stands)
        client.ask("goto", x=0.4, y=0.2, heading=0.5)
        client.ask("resume")
        client.until(moves)
        client.ask("drive", linear=0.1, angular=0.5)
        client.ask("release")
        client.ask("resume")
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=20) == 130
    again = replay(path, check=True)
    assert again.difference is None and again.compared > 300
