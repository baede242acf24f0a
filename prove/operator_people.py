"""Lost drivers, lost watchers, invalid requests, other users: on a paced simulation."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from tests.support.command_process import start_on_terminal
from tests.support.running import PlainClient, command, moves, running, stands
from tests.support.trials.row import Row

STOP_TIME_MAX_S = 0.5  # from the loss to the zero command of the wheels
DRIVE_TIME_MAX_S = 1.0  # before the loss
RUN = ("goal", "--stay", "--goal", "9 0")
KNOCK = """
import os, socket, sys
os.setgroups([]); os.setgid(65534); os.setuid(65534)
try: socket.socket(socket.AF_UNIX).connect(sys.argv[1])
except PermissionError: sys.exit(7)
"""
Loss = Callable[[subprocess.Popen[str], int], None]


def kill(process: subprocess.Popen[str], terminal: int) -> None:
    """SIGKILL."""
    process.kill()


def freeze(process: subprocess.Popen[str], terminal: int) -> None:
    """SIGSTOP: it keeps its connection open and sends nothing more."""
    process.send_signal(signal.SIGSTOP)


def hang_up(process: subprocess.Popen[str], terminal: int) -> None:
    """Close its terminal."""
    os.close(terminal)


LOSSES: dict[str, Loss] = {"killed": kill, "frozen": freeze, "its terminal closed": hang_up}


def rows(seed: int, trials: int, lines: int) -> Iterator[Row]:
    """All rows: `trials` of each way to lose the driver, `lines` invalid requests."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running(folder, *RUN):
            for what, lose in LOSSES.items():
                yield lost(folder, what, lose, trials, rng)
            yield watchers(folder, trials)
            yield nonsense(folder, lines, rng)
            yield stranger(folder)


def lost(folder: Path, what: str, lose: Loss, trials: int, rng: Random) -> Row:
    """Drive and lose the driver at a random time: the wheels stop, and the goal waits."""
    times, good = [], 0
    for _ in range(trials):
        client = PlainClient(folder)
        client.until(moves)
        driver, terminal = drive(folder)
        client.until(is_driven)
        time.sleep(rng.uniform(0.0, DRIVE_TIME_MAX_S))
        began = time.monotonic()
        lose(driver, terminal)
        client.until(stands)
        times.append(time.monotonic() - began)
        status = client.until(lambda status: status["held"])
        named = f"process {driver.pid}" in status["held"]["cause"]
        good += (
            status["held"]["code"] == "operator_lost"
            and named
            and status["operator.goal"]["number"] == 0
            and times[-1] <= STOP_TIME_MAX_S
        )
        driver.kill()
        driver.wait()
        client.request("resume")
        client.close()
    return Row(
        f"driver {what}: zero within, cause names it, goal waits",
        f"{good} of {trials}, {max(times) * 1e3:.0f} ms",
        f"all, {STOP_TIME_MAX_S * 1e3:.0f} ms",
        good == trials,
    )


def is_later(time_ns: float, status: dict[str, Any]) -> bool:
    """Whether the time of the run is past `time_ns`."""
    is_past: bool = status["time"] > time_ns
    return is_past


def is_driven(status: dict[str, Any]) -> bool:
    """Whether the goal is cancelled and the wheels follow the driver, backwards."""
    wheels = status["gate.wheels"]
    is_backwards: bool = wheels["left"] < 0 and wheels["right"] < 0
    return is_backwards and status["operator.goal"]["number"] == 0


def drive(folder: Path) -> tuple[subprocess.Popen[str], int]:
    """Start `diffbotctl drive` backwards on its own terminal; returns it and the master end."""
    words, environment = command(folder, "drive", "--v", "-0.15", "--for", "60s")
    master, slave = pty.openpty()
    process = start_on_terminal(words, slave, environment)
    os.close(slave)
    return process, master


def watchers(folder: Path, trials: int) -> Row:
    """Kill and freeze watchers while the robot drives to a goal."""
    words, environment = command(folder, "topic", "echo", "*", "--json")
    client, good = PlainClient(folder), 0
    for trial in range(trials):
        client.until(moves)
        watcher = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE)
        assert watcher.stdout is not None
        watcher.stdout.readline()
        watcher.send_signal(signal.SIGKILL if trial % 2 else signal.SIGSTOP)
        began = client.request("status")["time"]
        client.until(partial(is_later, began + STOP_TIME_MAX_S * 1e9))
        good += is_undisturbed(client, began)
        watcher.kill()
        watcher.communicate()
    client.until(moves)
    client.close()
    return Row.counted("a watcher killed or frozen changes nothing", good, trials)


def is_undisturbed(client: PlainClient, since: int) -> bool:
    """Whether there is no stop, the goal is in force, and the log since then mentions neither.

    Turning wheels would not prove it: between a turn and a drive they stand.
    """
    status = client.request("status")
    lines = [line for line in client.request("read_log")["lines"] if line["time"] > since]
    only_follower = all(line["level"] == "info" and line["source"] == "follower" for line in lines)
    has_goal = bool(status["operator.goal"]["number"] != 0)
    return status["held"] is None and has_goal and only_follower


def nonsense(folder: Path, lines: int, rng: Random) -> Row:
    """Random invalid requests: all are refused, none moves the robot, other clients are served."""
    quiet, refused = PlainClient(folder), 0
    quiet.request("stop")
    goal = quiet.until(stands)["operator.goal"]["number"]
    quiet.request("subscribe", topic="gate.wheels")
    for _ in range(lines):
        client = PlainClient(folder)
        try:
            client.send(drawn(rng) + b"\n")
            reply = client.read()
        except (BrokenPipeError, ConnectionResetError):
            reply = client.read()
        refused += reply is not None and reply["ok"] is False and bool(reply["cause"])
        client.close()
    status = quiet.request("status")
    unmoved = stands(status) and status["operator.goal"]["number"] == goal
    quiet.request("resume")
    quiet.close()
    return Row(
        "invalid requests: refused with a cause, nothing moves, others served",
        f"{refused} of {lines}",
        "all",
        refused == lines and unmoved,
    )


def drawn(rng: Random) -> bytes:
    """An invalid line: binary, half a line, a wrong type, a number out of range."""
    whole = {"method": "drive", "linear": 0.1, "angular": 0.0}
    wrong = rng.choice(["1e308", "-1e308", "1e999", "NaN", "Infinity", '"0.1"', "[]", "true"])
    field = rng.choice(["linear", "angular"])
    return rng.choice(
        [
            rng.randbytes(rng.randrange(1, 400)).replace(b"\n", b""),
            json.dumps(whole)[: rng.randrange(1, 20)].encode(),
            f'{{"method": "drive", "{field}": {wrong}}}'.encode(),
            f'{{"method": "goto", "x": {wrong}, "y": 0}}'.encode(),
            json.dumps({**whole, "method": rng.choice(["", "drve", None, 3, []])}).encode(),
            json.dumps({**whole, rng.choice(["v", "Linear", "x"]): 1}).encode(),
            b"[" * rng.randrange(1, 60000),
            b"x" * rng.randrange(65537, 200000),
        ]
    )


def stranger(folder: Path) -> Row:
    """Another user, who is not in the group."""
    path = folder / "diffbotctl" / "test.socket"
    folder.chmod(0o755)  # so that only diffbotctl's folder refuses access
    try:
        code = subprocess.run([sys.executable, "-c", KNOCK, str(path)], check=False).returncode
        (folder / "diffbotctl").chmod(0o755)  # so that only the socket refuses access
        second = subprocess.run([sys.executable, "-c", KNOCK, str(path)], check=False).returncode
    finally:
        (folder / "diffbotctl").chmod(0o700)
    good = (code == 7) + (second == 7)
    return Row(
        "another user: refused by the folder, by the socket",
        f"{good} of 2 refused",
        "2 of 2",
        good == 2 and os.getuid() == 0,
    )
