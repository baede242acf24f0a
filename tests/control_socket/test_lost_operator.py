"""Whoever drives and is lost: killed, frozen, cut off. And watchers, who change nothing."""

import os
import signal
import subprocess

import pytest

from diffbotctl.messages import Stop, Twist, Wheels
from diffbotctl.recording.reader import RecordingReader
from tests.support.command_process import start_on_terminal
from tests.support.running import PlainClient, cli, command, moves, running, stands

LIMIT = 500_000_000  # ns within which the wheels are commanded to zero


def drives(status):
    wheels = status["gate.wheels"]
    is_backwards = wheels["left"] < 0 and wheels["right"] < 0  # the goal lies ahead
    return is_backwards and status["operator.goal"]["number"] == 0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP, signal.SIGHUP])
def test_a_lost_driver_stops_the_robot_and_the_goal_waits(tmp_path, number):
    path = tmp_path / "lost.mcap"
    line, environment = command(tmp_path, "drive", "--v", "-0.15", "--for", "60s")
    with running(tmp_path, "goal", "--stay", "--goal", "30 0", "--record", str(path)) as process:
        watcher = PlainClient(tmp_path)
        watcher.until(moves)
        driver = subprocess.Popen(line, env=environment)
        watcher.until(drives)
        driver.send_signal(number)
        held = watcher.until(lambda status: status["held"])["held"]
        assert held["code"] == "operator_lost"
        assert f"process {driver.pid}" in held["cause"] and "was driving" in held["cause"]
        watcher.until(stands)
        assert watcher.request("status")["operator.goal"]["number"] == 0
        driver.kill()
        driver.wait()
        assert cli(tmp_path, "resume")[0] == 0
        assert watcher.until(moves)["operator.goal"]["x"] == 30.0
        process.terminate()
        process.wait(timeout=60)
    words = [item for item in RecordingReader(path).messages() if item.wire != "robot.encoders"]
    lost = next(i.time for i in words if isinstance(i.message, Stop) and i.message.code)
    last = max(
        i.time
        for i in words
        if isinstance(i.message, Twist) and i.time < lost and i.wire == "operator.twist"
    )
    zero = next(i.time for i in words if i.wire == "gate.wheels" and i.time >= lost)
    after = [i.message for i in words if i.wire == "gate.wheels" and i.time == zero]
    assert isinstance(after[0], Wheels) and (after[0].left, after[0].right) == (0.0, 0.0)
    assert zero - last <= LIMIT


def test_a_watcher_that_is_killed_or_frozen_changes_nothing(tmp_path):
    line, environment = command(tmp_path, "topic", "echo", "*", "--json")
    with running(tmp_path, "goal", "--stay", "--goal", "30 0"):
        client = PlainClient(tmp_path)
        watchers = [
            subprocess.Popen(line, env=environment, stdout=subprocess.PIPE) for _ in range(3)
        ]
        for watcher in watchers:
            watcher.stdout.readline()  # it watches
        client.until(moves)
        watchers[0].kill()
        watchers[1].send_signal(signal.SIGSTOP)
        watchers[2].send_signal(signal.SIGHUP)
        began = client.request("status")["time"]
        status = client.until(lambda status: status["time"] > began + LIMIT)
        assert status["held"] is None and moves(status)
        for watcher in watchers:
            watcher.kill()
            watcher.communicate()


def test_a_driver_behind_a_closed_terminal_is_lost(tmp_path):
    line, environment = command(tmp_path, "drive", "--v", "-0.15", "--for", "60s")
    with running(tmp_path, "goal", "--stay", "--goal", "30 0"):
        client = PlainClient(tmp_path)
        client.until(moves)
        ours, theirs = os.openpty()
        driver = start_on_terminal(line, theirs, environment)
        os.close(theirs)
        client.until(drives)
        os.close(ours)  # the terminal closes: the kernel sends SIGHUP
        held = client.until(lambda status: status["held"])["held"]
        assert held["code"] == "operator_lost"
        driver.wait(timeout=60)
