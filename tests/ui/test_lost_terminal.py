"""Who drives through a terminal and is lost: killed, frozen, cut off, behind a real ssh."""

import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from diffbotctl.recording.mcap_file import RecordingReader
from tests.control_socket.running import Plain, command, moves, running, stands
from tests.terminal import PATIENCE, Terminal

LIMIT = 1_000_000_000  # ns to wheels commanded to zero; `make prove` holds it to half of that
SSH = [
    "-o",
    "StrictHostKeyChecking=no",
    "-o",
    "UserKnownHostsFile=/dev/null",
    "-o",
    "LogLevel=ERROR",
]
REPEAT = 0.03  # s between two repeats of a key that is held


@contextmanager
def ssh_server(folder, *words):
    """An ssh server that gives `diffbotctl words` to whoever connects: the client's command."""
    line, environment = command(folder, *words)
    place = folder / "port"
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.ssh_server", str(place), *line], env=environment
    )
    try:
        deadline = time.monotonic() + PATIENCE
        while not place.exists():
            assert server.poll() is None and time.monotonic() < deadline, "no ssh server"
        yield ["ssh", "-tt", *SSH, "-p", place.read_text(), "127.0.0.1"]
    finally:
        server.kill()
        server.wait()


def drive(terminal, watcher, mode):
    """Hold or press the key for forward until the robot drives."""
    if mode == "latched":
        terminal.until(lambda text: "ms" in text.split("terminal ")[-1][:7], "the first answer")
        terminal.type("i")
        terminal.until(lambda text: "DRIVING" in text, "driving")
    status = watcher.ask("status")
    while not (moves(status) and status["operator.goal"]["number"] == 0):
        if mode == "hold":
            terminal.type("i")
        terminal.look(REPEAT)
        status = watcher.ask("status")


def lose(terminal, how):
    """Lose the person; the logical time is that of the last word before."""
    if how == "SIGKILL":
        terminal.process.kill()
    elif how == "SIGSTOP":
        terminal.process.send_signal(signal.SIGSTOP)
    elif how == "closed":
        terminal.hang_up()


def last_motion(path, start, end):
    """The last time between two at which a wheel was commanded to turn."""
    return max(
        (
            item.time
            for item in RecordingReader(path).messages()
            if item.wire == "gate.wheels"
            and start <= item.time <= end
            and tuple(item.message)[1:] != (0.0, 0.0)
        ),
        default=start,
    )


@pytest.mark.parametrize("mode", ["hold", "latched"])
@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP", "closed"])
@pytest.mark.parametrize("way", ["here", "ssh"])
def test_the_robot_stands_and_the_goal_waits(tmp_path, mode, how, way):
    path = tmp_path / "lost.mcap"
    words = ["teleop", "--mode", mode]
    with running(tmp_path, "goal", "--stay", "--goal", "3 0", "--record", str(path)) as process:
        watcher = Plain(tmp_path)
        watcher.until(moves)
        line, environment = command(tmp_path, *words)
        with (
            ssh_server(tmp_path, *words) as ssh,
            Terminal(ssh if way == "ssh" else line, environment) as terminal,
        ):
            terminal.until(lambda text: "pose" in text, "the first picture")
            drive(terminal, watcher, mode)
            lost_at = watcher.ask("status")["time"]
            lose(terminal, how)
            held = watcher.until(lambda status: status["held"])["held"]
            assert held["code"] == "operator_lost"
            assert "teleop" in held["cause"] and "was driving" in held["cause"]
            stood = watcher.until(stands)
            assert stood["operator.goal"]["number"] == 0
            terminal.process.send_signal(signal.SIGCONT)
            if how == "closed" and way == "here":
                terminal.process.wait(timeout=PATIENCE)  # nothing is left behind a closed window
        assert watcher.ask("resume")["ok"]
        assert watcher.until(moves)["operator.goal"]["x"] == 3.0
        process.terminate()
        process.wait(timeout=PATIENCE)
    assert last_motion(path, lost_at, stood["time"]) - lost_at <= LIMIT
