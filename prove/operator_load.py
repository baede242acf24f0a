"""Wire to wire while people watch: each load in turn with none, again and again in one run."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from statistics import median

from diffbotctl.testing.book_board import frame
from diffbotctl.testing.trials.row import Row, printed
from prove import wire

RATE = 50.0  # ticks a second, as the book's robot
SEGMENT = 3.0  # s of one load before the next one
ROUNDS = 4  # times each load has its turn
SETTLING = 4.0  # s for a load's processes to be up; ten of them share two cores
MORE = 0.20  # of the median without load
TAIL = 3.0  # ms, 99th percentile under any load
GROWTH = 8.0  # MB by which the hub may grow
ECHO = "from diffbotctl.cli.main import main; main()"
DEAF = """
import socket, sys, time
made = socket.socket(socket.AF_UNIX); made.connect(sys.argv[1])
made.sendall(b'{"hello": 2}\\n{"method": "subscribe", "topic": "*"}\\n')
time.sleep(3600)
"""
KNOCK = """
import socket, sys, time
due = time.perf_counter()
while True:
    made = socket.socket(socket.AF_UNIX); made.connect(sys.argv[1]); made.close()
    due += 0.001
    time.sleep(max(due - time.perf_counter(), 0))
"""


class Load:
    """Processes that bother the hub while it is entered."""

    def __init__(self, name: str, words: list[str], many: int, environment: dict[str, str]) -> None:
        self.name, self.words, self.many, self.environment = name, words, many, environment
        self.times: list[float] = []
        self.processes: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> None:
        self.processes = [
            subprocess.Popen(
                self.words,
                env=self.environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for _ in range(self.many)
        ]

    def __exit__(self, *_: object) -> None:
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait()


class Ticks:
    """The board's end of the line: ticks in, and how long until the wheels are told."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.answers = wire.Answers(port)
        self.count = 0
        self.places = [0.0, 0.0]

    def send(self, seconds: float) -> list[float]:
        """Seconds from each right tick's last byte to the pair of commands that answers it."""
        times: list[float] = []
        due = time.perf_counter()
        end = due + seconds
        while (due := due + 1.0 / RATE) < end:
            while self.answers.wait(due - time.perf_counter()):
                pass
            self.count += 1
            curve = 8.0 if int(self.count / RATE * 2) % 2 else -8.0
            self.places[0] += (20.0 - curve) / RATE
            self.places[1] += (20.0 + curve) / RATE
            os.write(self.port, frame(127, struct.pack("<f", 25.0 + self.count % 3)))
            os.write(self.port, frame(125, struct.pack("<i", int(self.places[0]))))
            os.write(self.port, frame(126, struct.pack("<i", int(self.places[1]))))
            sent = time.perf_counter()
            if self.answers.wait(wire.ANSWER):
                times.append(time.perf_counter() - sent)
        return times


def rows() -> Iterator[Row]:
    """One row a load, and one for the hub's memory."""
    master, slave = os.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_RUNTIME_DIR": folder}
        words = wire.command(os.ttyname(slave), Path(folder) / "load.mcap")
        process = subprocess.Popen(
            [*words, "--quiet", "--name", "load"],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
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
                        sys.executable,
                        "-c",
                        ECHO,
                        "dash",
                    ],
                    1,
                    environment,
                ),
                Load(
                    "ten `topic echo`",
                    [sys.executable, "-c", ECHO, "topic", "echo", "/odom", "--json"],
                    10,
                    environment,
                ),
                Load(
                    "a client that never reads",
                    [sys.executable, "-c", DEAF, socket],
                    1,
                    environment,
                ),
                Load(
                    "one that connects 1,000 times a second",
                    [sys.executable, "-c", KNOCK, socket],
                    1,
                    environment,
                ),
            ]
            before, after = run(Ticks(master), loads, process.pid)
        finally:
            process.terminate()
            process.wait()
            os.close(master)
            os.close(slave)
    yield from judged(loads)
    grown = after - before
    yield Row(
        "memory of the hub after all that",
        f"{before:.1f} + {grown:.1f} MB",
        f"grows <= {GROWTH:g} MB",
        grown <= GROWTH,
    )


def run(ticks: Ticks, loads: list[Load], pid: int) -> tuple[float, float]:
    """Let each load have its turns; the hub's memory in MB before and after."""
    ticks.send(SETTLING)
    hub = max(children(pid), key=listening)
    before = memory(hub)
    for _ in range(ROUNDS):
        for load in loads:
            with load:
                ticks.send(SETTLING)
                load.times += ticks.send(SEGMENT)
    return before, memory(hub)


def judged(loads: list[Load]) -> Iterator[Row]:
    """Each load's latency beside that without one."""
    usual = median(loads[0].times) * 1e3
    for load in loads:
        times = sorted(load.times)
        half, tail = median(times) * 1e3, times[int(0.99 * len(times))] * 1e3
        yield Row(
            f"wire to wire, {load.name} (n={len(times)})",
            f"{half:.2f}, p99 {tail:.2f} ms",
            f"<= {usual * (1 + MORE):.2f}, p99 <= {TAIL:g} ms",
            half <= usual * (1 + MORE) and tail <= TAIL,
        )


def children(pid: int) -> list[int]:
    """Child processes of `pid`."""
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def listening(pid: int) -> int:
    """How many sockets a process holds that listen at a path: one for the hub, none for others."""
    inodes = {os.readlink(file) for file in Path(f"/proc/{pid}/fd").iterdir()}
    known = [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:]]
    return sum(f"socket:[{line[6]}]" in inodes for line in known if line[-1].endswith(".socket"))


def memory(pid: int) -> float:
    """Resident memory in MB."""
    text = Path(f"/proc/{pid}/status").read_text()
    return int(text.partition("VmRSS:")[2].split()[0]) / 1024


if __name__ == "__main__":
    raise SystemExit(printed(rows()) > 0)
