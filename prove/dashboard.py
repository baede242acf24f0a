"""Load and start of the dashboard while a robot drives; teleop drivers whose terminal is lost."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from random import Random
from statistics import median

from prove.screen import Drain
from tests.support.lost_terminal import drive, lose, ssh_server
from tests.support.running import PlainClient, command, moves, running, stands
from tests.support.terminal import Terminal
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

SIZE = (120, 40)
LOAD_MAX_PERCENT = 15.0  # of a core
FIRST_SCREEN_MAX_S = 0.8
STOP_TIME_MAX_S = 0.5  # from the loss to the zero command of the wheels
DRIVE_TIME_MAX_S = 0.5  # before the loss
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
FAR = ("goal", "--stay", "--goal", "9 0", "--goal", "-9 0")


LOSSES = [*product(("here", "ssh"), ("hold", "latched"), ("SIGKILL", "SIGSTOP", "closed"))]


def rows(
    seed: int, trials: int, kinds: int = len(LOSSES), starts: int = 5, load_s: float = 15.0
) -> Iterator[Row]:
    """The cost of a dashboard over `starts` starts and `load_s` seconds; lost drivers.

    `trials` of each of `kinds` ways to lose the driver.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running(folder, *FAR):
            yield from costs(folder, starts, load_s)
            rng = Random(seed)
            for place, mode, loss in drawn(LOSSES, kinds, seed):
                yield lost(folder, place, mode, loss, trials, rng)


def costs(folder: Path, starts: int, load_s: float) -> Iterator[Row]:
    """CPU time and start, with map, values, plots, blocks and log on the screen."""
    client = PlainClient(folder)
    client.until(moves)
    words, environment = command(folder, "dash", "--hz", "10")
    start_times = []
    for _ in range(starts):
        drain = Drain(*SIZE, words, environment)
        start_times.append(drain.until(b"SIMULATED", 20.0))
        drain.close()
    drain = Drain(*SIZE, words, environment)
    drain.until(b"kinematics", 20.0)  # a row of the block table: now every panel has content
    before, began = cpu_time(drain.process.pid), time.perf_counter()
    drain.read_for(load_s)
    load = 100 * (cpu_time(drain.process.pid) - before) / (time.perf_counter() - began)
    driving = moves(client.request("status"))
    drain.close()
    client.close()
    yield Row(
        "dashboard, 10 Hz, 120x40, robot driving",
        f"{load:.1f} % of a core",
        f"<= {LOAD_MAX_PERCENT:g} %",
        driving and load <= LOAD_MAX_PERCENT,
    )
    yield Row.at_most(
        f"dashboard, first screen (median of {starts})",
        median(start_times),
        FIRST_SCREEN_MAX_S,
        "s",
        ".2f",
    )


def cpu_time(pid: int) -> float:
    """CPU time in s that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def lost(folder: Path, place: str, mode: str, loss: str, trials: int, rng: Random) -> Row:
    """Drive by `teleop` and lose the driver: the robot stops, and the cause names the driver."""
    times, good = [], 0
    words, environment = command(folder, "teleop", "--mode", mode)
    client = PlainClient(folder)
    for _ in range(trials):
        client.until(moves)
        with (
            ssh_server(folder, "teleop", "--mode", mode) as ssh,
            Terminal(ssh if place == "ssh" else words, environment) as terminal,
        ):
            terminal.until(lambda text: "pose" in text, "the first screen")
            drive(terminal, client, mode)
            hold(terminal, mode, rng.uniform(0.0, DRIVE_TIME_MAX_S))
            began = time.monotonic()
            lose(terminal, loss)
            client.until(stands)
            times.append(time.monotonic() - began)
            status = client.until(lambda status: status["held"])
            named = "teleop" in status["held"]["cause"]
            good += (
                status["held"]["code"] == "operator_lost"
                and named
                and status["operator.goal"]["number"] == 0
                and times[-1] <= STOP_TIME_MAX_S
            )
            terminal.process.send_signal(signal.SIGCONT)
        (folder / "port").unlink()
        client.request("resume")
    client.close()
    return Row(
        f"teleop, {mode}, {place}: {loss}",
        f"{good} of {trials}, {max(times) * 1e3:.0f} ms",
        f"all, {STOP_TIME_MAX_S * 1e3:.0f} ms",
        good == trials,
    )


def hold(terminal: Terminal, mode: str, seconds: float) -> None:
    """Continue to drive for `seconds`."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if mode == "hold":
            terminal.type("i")
        terminal.look(0.03)
