"""A real run and its control socket: stop, resume, goto, and access."""

import os
import signal
import stat

import pytest

from diffbotctl.replay.replay import replay
from tests.support.running import PlainClient, moves, running, stands


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    with running(folder, "goal", "--stay", "--goal", "0.1 0"):
        yield folder


def test_the_greeting_states_version_and_engine_and_others_may_not_open_the_socket(run):
    client = PlainClient(run)
    assert client.greeting["hello"] == 2 and client.greeting["engine"] == "test"
    folder = run / "diffbotctl"
    assert stat.S_IMODE((folder / "test.socket").stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert client.request("status")["ok"]
    client.close()
    log = (folder / "test.log").read_text()
    assert f'"uid": {os.getuid()}' in log and f'"pid": {os.getpid()}' in log


def test_stop_holds_the_robot_until_resume(run):
    client = PlainClient(run)
    assert client.request("goto", x=1.5, y=0.0)["ok"]
    client.until(moves)
    assert client.request("stop", reason="a cat")["ok"]
    held = client.until(lambda status: status["held"])["held"]
    assert held["code"] == "operator_stop" and held["latched"] and "a cat" in held["cause"]
    client.until(stands)
    text = client.request("explain_stop")["text"]
    assert "operator_stop" in text and "a cat" in text and "diffbotctl resume" in text
    refusal = client.request("drive", linear=0.1)
    assert refusal["error"] == "E-HELD" and "operator_stop" in refusal["cause"]
    assert "a cat" in refusal["cause"]
    assert client.request("resume")["ok"]
    assert client.until(moves)["held"] is None  # the goal continues
    client.request("stop")
    client.request("goto", x=0.0, y=0.0)
    client.request("resume")


def test_manual_driving_has_priority_and_the_goal_waits_for_resume(run):
    client, other = PlainClient(run), PlainClient(run)
    client.request("goto", x=1.0, y=0.5)
    assert client.request("drive", linear=-0.1, angular=0.0)["ok"]
    assert other.request("drive", linear=0.1)["error"] == "E-BUSY"
    assert other.request("resume")["error"] == "E-BUSY"
    while not client.request("status")["gate.wheels"]["left"] < 0:
        assert client.request("drive", linear=-0.1)["ok"]
    assert other.request("drive", linear=0.05, take_over=True)["ok"]
    assert client.request("release")["error"] == "E-REQUEST"
    assert other.request("release")["ok"]
    assert client.until(stands)["held"] is None
    assert client.request("status")["operator.goal"]["number"] == 0
    client.request("resume")
    assert client.until(moves)["operator.goal"]["x"] == 1.0
    client.close()
    other.close()


def test_commands_are_inputs_of_the_recording_and_replay_is_the_same(tmp_path):
    path = tmp_path / "commanded.mcap"
    with running(tmp_path, "goal", "--stay", "--goal", "1 0", "--record", str(path)) as process:
        client = PlainClient(tmp_path)
        client.until(moves)
        client.request("stop")
        client.until(stands)
        client.request("goto", x=0.4, y=0.2, heading=0.5)
        client.request("resume")
        client.until(moves)
        client.request("drive", linear=0.1, angular=0.5)
        client.request("release")
        client.request("resume")
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=60) == 130
    again = replay(path, check=True)
    assert again.difference is None and again.compared > 300
