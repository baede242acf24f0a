"""Wire to wire: a tick frame goes in on a pseudo-terminal, a changed wheel command comes out."""

from __future__ import annotations

import os
import select
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import NamedTuple

from diffbotctl.testing.book_board import STOCK, BookBoard, frame
from diffbotctl.testing.command_process import command_line
from diffbotctl.testing.trials.row import Row, printed

SECONDS = 12.0  # of ticks in each run
GOAL_PAIRS = 10  # of 9 m and 12.7 m: no run of a row comes to the end
PAIR = 24  # bytes of both wheels' commands
DRAG = 0.15  # of the speed of a wheel, half a second each
LATE_S = 0.004  # an answer that takes longer is counted, and its number is printed


def command(port: str, recording: Path) -> list[str]:
    """A recorded run of diffbotctl, at a baud rate that does not pace the commands."""
    return command_line(
        "run",
        "goal",
        "--port",
        port,
        *STOCK,
        "--set",
        "robot.link.baud=115200",
        *("--goal", "9 0", "--goal", "0 9") * GOAL_PAIRS,
        "--record",
        recording,
    )


# Reads what arrives and answers each tick at once: its times are those of the machine itself.
BARE = """\
import itertools, os, sys, tty
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(port)
came, answers = 0, itertools.count(1)
while True:
    came += len(os.read(port, 4096))
    if came >= int(sys.argv[2]):
        came = 0
        os.write(port, next(answers).to_bytes(24))
"""


class Answers:
    """Waits for changed commands on the port.

    A pair of commands equal to the one before is a repetition, not an answer.
    """

    def __init__(self, port: int) -> None:
        self.port = port
        self.rest = self.last = b""

    def wait(self, seconds: float) -> bool:
        """True when a changed pair of commands has arrived in that time."""
        end = time.perf_counter() + seconds
        while not self._next_changed():  # several may have come in one read
            remaining = end - time.perf_counter()
            if remaining <= 0 or not select.select([self.port], [], [], remaining)[0]:
                return False
            self.rest += os.read(self.port, 4096)
        return True

    def _next_changed(self) -> bool:
        while len(self.rest) >= PAIR:
            before, self.last = self.last, self.rest[:PAIR]
            self.rest = self.rest[PAIR:]
            if self.last != before:
                return True
        return False


class Timing(NamedTuple):
    """Sorted times (s) from a tick's last byte to the command that answers it, and the ticks sent.

    A tick whose command equals the one before has no answer that could be told from a repetition.
    """

    times: list[float]
    ticks: int

    @property
    def median(self) -> float:
        return median(self.times)

    @property
    def p99(self) -> float:
        return self.times[int(0.99 * len(self.times))]

    def counts(self) -> str:
        """How many ticks were answered, and how many answers were late."""
        late = sum(time > LATE_S for time in self.times)
        return f"{len(self.times)} of {self.ticks} answered, {late} after {LATE_S * 1e3:g} ms"


def measure(rate: float, screen: bool) -> Timing:
    """The times of a run of diffbotctl, with or without the screen."""
    master, slave = os.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as folder:
        terminal, shown = os.openpty()
        words = command(os.ttyname(slave), Path(folder) / "wire.mcap")
        process = subprocess.Popen(
            words if screen else [*words, "--quiet"], stdout=shown, stderr=subprocess.DEVNULL
        )
        swallow = threading.Thread(target=drain, args=(terminal,), daemon=True)
        swallow.start()
        try:
            negotiate(master)
            return stimulate(master, rate)
        finally:
            process.terminate()
            process.wait()
            for fd in (master, slave, terminal, shown):
                os.close(fd)


def bare(rate: float) -> Timing:
    """The times of a program that only reads and writes."""
    master, slave = os.openpty()
    tty.setraw(slave)
    tick = 3 * len(frame(125, bytes(4)))
    process = subprocess.Popen([sys.executable, "-c", BARE, os.ttyname(slave), str(tick)])
    try:
        return stimulate(master, rate)
    finally:
        process.kill()
        process.wait()
        os.close(master)
        os.close(slave)


def drain(terminal: int) -> None:
    """Read and discard what the screen draws."""
    try:
        while os.read(terminal, 65536):
            pass
    except OSError:
        return


def negotiate(port: int) -> None:
    """Answer the topic request as the board does."""
    board = BookBoard()
    while not board.configured:
        board.take(os.read(port, 4096))
    for _, data, _ in board.out:
        os.write(port, data)


def stimulate(port: int, rate: float) -> Timing:
    """Send ticks at `rate` and time every answer."""
    ticks = Ticks(port, rate)
    times = ticks.send(SECONDS)
    return Timing(sorted(times), ticks.count)


class Ticks:
    """The board's end of the line: sends ticks and measures the time to the wheel commands.

    The wheels obey the commands, except that each of them drags by turns: so the robot goes on, and
    nearly every tick is answered by another command.
    """

    def __init__(self, port: int, rate: float) -> None:
        self.port, self.rate = port, rate
        self.answers = Answers(port)
        self.board = BookBoard()
        self.count = 0

    def send(self, seconds: float) -> list[float]:
        """Seconds from the last byte of each tick to the changed commands that answer it.

        An answer is waited for until the next tick is due.
        """
        times: list[float] = []
        due = time.perf_counter()
        end = due + seconds
        while (due := due + 1.0 / self.rate) < end:
            while self.answers.wait(due - time.perf_counter()):
                pass  # further commands of the tick before
            self.write()
            sent = time.perf_counter()
            if self.answers.wait(due + 1.0 / self.rate - sent):
                times.append(time.perf_counter() - sent)
        return times

    def write(self) -> None:
        """Send one tick."""
        self.count += 1
        board, period = self.board, 1.0 / self.rate
        board.take(self.answers.last)
        board.out.clear()
        board.turn(period)
        dragging = "left" if int(self.count / self.rate * 2) % 2 else "right"
        board.place[dragging] -= DRAG * board.speed[dragging] * period
        os.write(self.port, frame(127, struct.pack("<f", 25.0 + self.count % 3)))
        os.write(self.port, frame(125, struct.pack("<i", board.count("left"))))
        os.write(self.port, frame(126, struct.pack("<i", board.count("right"))))


def rows() -> Iterator[Row]:
    """The latency rows, headless and with the screen, at 50 and 200 Hz, beside a bare program's."""
    floors = {rate: bare(rate) for rate in (50.0, 200.0)}
    for rate, floor in floors.items():
        yield Row(
            f"wire to wire at {rate:.0f} Hz, a program that only reads and writes",
            f"{floor.median * 1e3:.2f}, p99 {floor.p99 * 1e3:.2f} ms; {floor.counts()}",
            "(none)",
            True,
        )
    for screen, (median_max, p99_max) in ((False, (0.4, 1.0)), (True, (0.5, 2.0))):
        for rate, floor in floors.items():
            timing = measure(rate, screen)
            name = f"wire to wire at {rate:.0f} Hz, {'with the screen' if screen else 'headless'}"
            if len(timing.times) < 20:
                yield Row(name, timing.counts(), "at least 20 answers", False)
                continue
            middle, tail = timing.median * 1e3, timing.p99 * 1e3
            yield Row(
                name,
                f"{middle:.2f} ({timing.median / floor.median:.1f}x bare), p99 {tail:.2f} ms "
                f"({timing.p99 / floor.p99:.1f}x); {timing.counts()}",
                f"<= {median_max}, p99 <= {p99_max} ms",
                middle <= median_max and tail <= p99_max,
            )


if __name__ == "__main__":
    raise SystemExit(printed(rows()) > 0)
