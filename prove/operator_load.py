"""Latency from wire to wire while clients are connected: loads and no load by turns in one run."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from prove import wire
from tests.support.command_process import children_of, command_line
from tests.support.running import PlainClient
from tests.support.trials.row import Row

RATE = 50.0  # ticks a second, as the book's robot
MEDIAN_INCREASE_MAX = 0.20  # fraction of the median without load
P99_MAX_MS = 3.0  # under any load
GOAL = {"x": 900.0, "y": 0.0}  # m; no segment comes to it
ANSWERED_MIN = 0.5  # of the ticks; with fewer the robot stands, and most commands are the same
WAITING_MAX_S = 0.01  # a second; the rest of a latency is the engine's own, or the kernel's
AGAIN = "none, once more"  # how much two measures without load differ
HUB_GROWTH_MAX_MB = 8.0
ENDING_TIMEOUT_S = 5.0  # in which a run that ends has written its summary
LAST_LINES = 30  # of what a run printed that ended too early
PAGE = [sys.executable, "-m", "tests.support.plain_page"]
NEVER_READS = """
import socket, sys, time
client = socket.socket(socket.AF_UNIX); client.connect(sys.argv[1])
client.sendall(b'{"hello": 2}\\n{"method": "subscribe", "topic": "*"}\\n')
time.sleep(3600)
"""
CONNECTS = """
import socket, sys, time
due = time.perf_counter()
while True:
    client = socket.socket(socket.AF_UNIX); client.connect(sys.argv[1]); client.close()
    due += 0.001
    time.sleep(max(due - time.perf_counter(), 0))
"""


class RunEndedError(Exception):
    """The run ended, or its control socket was closed, while it was measured."""


class Load:
    """Context manager: `count` client processes of the hub."""

    def __init__(
        self, name: str, words: list[str], count: int, environment: dict[str, str]
    ) -> None:
        self.name, self.words, self.count, self.environment = name, words, count, environment
        self.segments: list[slice] = []  # of the ticks, one for each round
        self.waiting_s = 0.0  # that the engine waited for a processor meanwhile
        self.processes: list[subprocess.Popen[bytes]] = []

    def timing(self, times: list[float | None]) -> wire.Timing:
        """Of its segments, from the times of all ticks."""
        return wire.timing([time for part in self.segments for time in times[part]])

    def __enter__(self) -> None:
        self.processes = [
            subprocess.Popen(
                self.words,
                env=self.environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for _ in range(self.count)
        ]

    def __exit__(self, *_: object) -> None:
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait()


class Turns(NamedTuple):
    """How long each load is measured: `rounds` times, `segment_s`; before each, `settling_s`."""

    rounds: int
    segment_s: float
    settling_s: float


def rows(rounds: int, segment_s: float = 3.0, settling_s: float = 4.0) -> Iterator[Row]:
    """One row for each load, and one for the memory of the hub; see `Turns`."""
    turns = Turns(rounds, segment_s, settling_s)
    master, slave = os.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_RUNTIME_DIR": folder}
        recording = Path(folder) / "load.mcap"
        words = wire.command(os.ttyname(slave), recording)
        printed_by_run = Path(folder) / "printed.txt"
        with printed_by_run.open("wb") as output:
            process = subprocess.Popen(
                [*words, "--quiet", "--stay", "--name", "load"],
                env=environment,
                stdout=output,
                stderr=output,
            )
        try:
            wire.negotiate(master)
            socket = str(Path(folder) / "diffbotctl" / "load.socket")
            loads = [
                Load("none", [], 0, environment),
                Load(
                    "a dashboard",
                    [
                        sys.executable,
                        "-m",
                        "prove.screen",
                        "120",
                        "40",
                        *command_line("dash"),
                    ],
                    1,
                    environment,
                ),
                Load("the page", [*PAGE, "load"], 1, environment),
                Load(
                    "the page and 1,000 silent sockets",
                    [*PAGE, "load", "--sockets", "1000"],
                    1,
                    environment,
                ),
                Load("the page and big frames", [*PAGE, "load", "--frames"], 1, environment),
                Load(
                    "the page and 200 refused requests a second",
                    [*PAGE, "load", "--refused"],
                    1,
                    environment,
                ),
                Load(
                    "the page and one that never reads", [*PAGE, "load", "--slow"], 1, environment
                ),
                Load(AGAIN, [], 0, environment),
                Load(
                    "ten `topic echo`",
                    command_line("topic", "echo", "/odom", "--json"),
                    10,
                    environment,
                ),
                Load(
                    "a client that never reads",
                    [sys.executable, "-c", NEVER_READS, socket],
                    1,
                    environment,
                ),
                Load(
                    "one that connects 1,000 times a second",
                    [sys.executable, "-c", CONNECTS, socket],
                    1,
                    environment,
                ),
            ]
            ticks = wire.Ticks(master, RATE)
            try:
                before, after = run(ticks, loads, process.pid, Path(folder), turns)
            except (OSError, RunEndedError) as error:
                raise RunEndedError(_ending(process, Path(folder))) from error
            ticks.send_last()
        finally:
            process.terminate()
            process.wait()
            os.close(master)
            os.close(slave)
        times = ticks.times(recording)
    yield from load_rows({load.name: load.timing(times) for load in loads})
    for load in loads:
        waiting = load.waiting_s / (segment_s * rounds)
        yield Row(
            f"time for which the engine waits for a processor, {load.name}",
            f"{waiting * 1e3:.2f} ms a second",
            f"<= {WAITING_MAX_S * 1e3:g} ms",
            waiting <= WAITING_MAX_S,
        )
    growth = after - before
    yield Row(
        "memory of the hub after these loads",
        f"{before:.1f} + {growth:.1f} MB",
        f"grows <= {HUB_GROWTH_MAX_MB:g} MB",
        growth <= HUB_GROWTH_MAX_MB,
    )


def run(
    ticks: wire.Ticks, loads: list[Load], pid: int, folder: Path, turns: Turns
) -> tuple[float, float]:
    """Measure under each load by turns. Returns the hub's memory in MB before and after.

    A robot that was stopped, as on a computer that did not run the engine, is resumed before each,
    and gets its goal again, which such a stop may have ended. Raises OSError or RunEndedError when
    the run does not go on.
    """
    ticks.send(turns.settling_s)
    client = PlainClient(folder, "load")
    hub = max(children_of(pid), key=listening)
    before = memory(hub)
    for _ in range(turns.rounds):
        for load in loads:
            with load:
                ticks.send(turns.settling_s / 2)
                send_off(client)
                ticks.send(turns.settling_s / 2)
                begin, waited = ticks.count, run_delay(pid)
                ticks.send(turns.segment_s)
                load.segments.append(slice(begin, ticks.count))
                load.waiting_s += run_delay(pid) - waited
    after = memory(hub)
    client.close()
    return before, after


def send_off(client: PlainClient) -> None:
    """Let a stopped robot move again, and give it a goal. Raises RunEndedError."""
    client.request("resume")  # refused while nothing has stopped it
    if client.request("goto", **GOAL) is None:
        raise RunEndedError


def _ending(process: subprocess.Popen[bytes], folder: Path) -> str:
    """Why the run does not go on: its exit code, and the last lines of it and of its server."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(ENDING_TIMEOUT_S)
    code = process.poll()
    first = "its control socket was closed" if code is None else f"the run ended with code {code}"
    lines = [first]
    for file in (folder / "printed.txt", folder / "diffbotctl" / "load.log"):
        with suppress(OSError):
            lines += file.read_text(errors="replace").splitlines()[-LAST_LINES:]
    return "\n".join(lines)


def load_rows(timings: dict[str, wire.Timing]) -> Iterator[Row]:
    """The latency under each load, by name, beside that without load, which is the first one."""
    undisturbed = next(iter(timings.values()))
    if not all(timing.times for timing in timings.values()):
        yield Row("wire to wire under load", "the robot stood", "it drives", False)
        return
    noise = timings[AGAIN].p99 / undisturbed.p99
    median_max = undisturbed.median * 1e3 * (1 + MEDIAN_INCREASE_MAX)
    for name, timing in timings.items():
        middle, p99 = timing.median * 1e3, timing.p99 * 1e3
        ratio = timing.p99 / undisturbed.p99
        share = len(timing.times) / timing.ticks
        yield Row(
            f"wire to wire, {name}; {timing.counts()}",
            f"{middle:.2f}, p99 {p99:.2f} ms, {ratio:.2f}x (without load again {noise:.2f}x)",
            f"<= {median_max:.2f}, p99 <= {P99_MAX_MS:g} ms",
            middle <= median_max and p99 <= P99_MAX_MS and share >= ANSWERED_MIN,
        )


def listening(pid: int) -> int:
    """Number of listening control sockets of a process: one for the hub, none for others."""
    inodes = {os.readlink(file) for file in Path(f"/proc/{pid}/fd").iterdir()}
    table = [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:]]
    return sum(f"socket:[{line[6]}]" in inodes for line in table if line[-1].endswith(".socket"))


def run_delay(pid: int) -> float:
    """Seconds for which the main thread of a process has waited for a processor."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9


def memory(pid: int) -> float:
    """Resident memory in MB."""
    text = Path(f"/proc/{pid}/status").read_text()
    return int(text.partition("VmRSS:")[2].split()[0]) / 1024
