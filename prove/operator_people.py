"""Drivers who are lost, watchers who go, nonsense, strangers: against a paced simulation."""

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
from pathlib import Path
from random import Random
from typing import Any

from diffbotctl.testing.running import PlainClient, command, moves, running, stands
from diffbotctl.testing.trials.row import Row

LIMIT = 0.5  # s from the loss to the wheels commanded to zero
LATEST = 1.0  # s of driving before something happens
RUN = ("goal", "--stay", "--goal", "9 0")
KNOCK = """
import os, socket, sys
os.setgroups([]); os.setgid(65534); os.setuid(65534)
try: socket.socket(socket.AF_UNIX).connect(sys.argv[1])
except PermissionError: sys.exit(7)
"""
Loss = Callable[[subprocess.Popen[bytes], int], None]


def kill(process: subprocess.Popen[bytes], terminal: int) -> None:
    """SIGKILL."""
    process.kill()


def freeze(process: subprocess.Popen[bytes], terminal: int) -> None:
    """SIGSTOP: it holds its connection and says no more."""
    process.send_signal(signal.SIGSTOP)


def hang_up(process: subprocess.Popen[bytes], terminal: int) -> None:
    """Close its terminal."""
    os.close(terminal)


LOSSES: dict[str, Loss] = {"killed": kill, "frozen": freeze, "its terminal closed": hang_up}


def rows(seed: int, trials: int, lines: int) -> Iterator[Row]:
    """All rows. `trials` of each loss, `lines` of nonsense."""
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
    """Drive, lose the driver at a random time, and see the wheels stand and the goal wait."""
    times, good = [], 0
    for _ in range(trials):
        client = PlainClient(folder)
        client.until(moves)
        driver, terminal = drive(folder)
        client.until(is_driven)
        time.sleep(rng.uniform(0.0, LATEST))
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
            and times[-1] <= LIMIT
        )
        driver.kill()
        driver.wait()
        client.request("resume")
        client.close()
    return Row(
        f"driver {what}: zero within, cause names it, goal waits",
        f"{good} of {trials}, {max(times) * 1e3:.0f} ms",
        f"all, {LIMIT * 1e3:.0f} ms",
        good == trials,
    )


def is_driven(status: dict[str, Any]) -> bool:
    """The goal is withdrawn, and the wheels follow the one who drives, backwards."""
    wheels = status["gate.wheels"]
    return status["operator.goal"]["number"] == 0 and wheels["left"] < 0 and wheels["right"] < 0


def drive(folder: Path) -> tuple[subprocess.Popen[bytes], int]:
    """`diffbotctl drive` backwards, on a terminal of its own; the terminal's other end."""
    words, environment = command(folder, "drive", "--v", "-0.15", "--for", "60s")
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        ["setsid", "--ctty", *words], env=environment, stdin=theirs, stdout=theirs, stderr=theirs
    )
    os.close(theirs)
    return process, ours


def watchers(folder: Path, trials: int) -> Row:
    """Watchers killed and frozen while a goal is under way."""
    words, environment = command(folder, "topic", "echo", "*", "--json")
    client, good = PlainClient(folder), 0
    for trial in range(trials):
        client.until(moves)
        watcher = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE)
        assert watcher.stdout is not None
        watcher.stdout.readline()
        watcher.send_signal(signal.SIGKILL if trial % 2 else signal.SIGSTOP)
        began = client.request("status")["time"]
        client.until(lambda status, began=began: status["time"] > began + LIMIT * 1e9)
        good += is_undisturbed(client, began)
        watcher.kill()
        watcher.communicate()
    client.until(moves)
    client.close()
    return Row(
        "a watcher killed or frozen changes nothing", f"{good} of {trials}", "all", good == trials
    )


def is_undisturbed(client: PlainClient, since: int) -> bool:
    """Nothing holds the robot, the goal is in force, and since then nobody spoke of either.

    That the wheels turn at one moment says less: between a turn and a drive they stand.
    """
    status = client.request("status")
    said = [line for line in client.request("read_log")["lines"] if line["time"] > since]
    calm = all(line["level"] == "info" and line["source"] == "follower" for line in said)
    return status["held"] is None and status["operator.goal"]["number"] != 0 and calm


def nonsense(folder: Path, lines: int, rng: Random) -> Row:
    """Lines drawn from what goes wrong in practice; none may be obeyed, others are served."""
    quiet, refused = PlainClient(folder), 0
    quiet.request("stop")
    goal = quiet.until(stands)["operator.goal"]["number"]
    quiet.request("subscribe", topic="gate.wheels")
    for _ in range(lines):
        client = PlainClient(folder)
        try:
            client.send(drawn(rng) + b"\n")
            said = client.read()
        except (BrokenPipeError, ConnectionResetError):
            said = client.read()
        refused += said is not None and said["ok"] is False and bool(said["cause"])
        client.close()
    still = quiet.request("status")
    unmoved = stands(still) and still["operator.goal"]["number"] == goal
    quiet.request("resume")
    quiet.close()
    return Row(
        "nonsense: refused in words, nothing moves, others served",
        f"{refused} of {lines}",
        "all",
        refused == lines and unmoved,
    )


def drawn(rng: Random) -> bytes:
    """A wrong line: binary, half a line, a wrong type, a number that no robot can follow."""
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
    """Another user, without the group."""
    path = folder / "diffbotctl" / "test.socket"
    folder.chmod(0o755)  # so that it is our own folder that refuses
    try:
        code = subprocess.run([sys.executable, "-c", KNOCK, str(path)], check=False).returncode
        (folder / "diffbotctl").chmod(0o755)  # and then the socket itself
        second = subprocess.run([sys.executable, "-c", KNOCK, str(path)], check=False).returncode
    finally:
        (folder / "diffbotctl").chmod(0o700)
    good = (code == 7) + (second == 7)
    return Row(
        "another user (uid nobody): by the folder, by the socket",
        f"{good} of 2 refused",
        "2 of 2",
        good == 2 and os.getuid() == 0,
    )
