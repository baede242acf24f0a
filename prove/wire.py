"""Wire to wire: a tick frame goes in on a pseudo-terminal, a changed wheel command comes out."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from statistics import median
from typing import NamedTuple

from diffbotctl.processes.real_time import ENGINE_PRIORITY, prefer, preferred
from prove.tick_answers import (
    Answers,
    answer_times,
    commands_of,
    distance,
    pair,
    recorded_commands,
)
from tests.support.book_board import STOCK, BookBoard, frame
from tests.support.command_process import command_line
from tests.support.trials.row import Row

SECONDS = 12.0  # of ticks in each run
GOAL_PAIRS = 10  # of 9 m and 12.7 m: no run of a row comes to the end
DRAG = 0.15  # of the speed of a wheel, half a second each
LAST_ANSWER_S = 0.2  # in which those of the last ticks come
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
import os, sys, tty
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(port)
came, answers = 0, [bytes.fromhex(text) for text in sys.argv[3:]]
while True:
    came += len(os.read(port, 4096))
    if came >= int(sys.argv[2]):
        came = 0
        answers.reverse()
        os.write(port, answers[0])
"""


class Timing(NamedTuple):
    """Sorted times (s) from a tick's last byte to the command that answers it, and the ticks sent.

    The answer of a tick whose command equals the one before looks the same as a repetition:
    `unchanged` counts these. An answer that did not come took an infinite time.
    """

    times: list[float]
    ticks: int
    unchanged: int = 0

    @property
    def median(self) -> float:
        return median(self.times)

    @property
    def p99(self) -> float:
        return self.times[int(0.99 * len(self.times))]

    def counts(self) -> str:
        """How many ticks were answered, and how many answers were late."""
        late = sum(LATE_S < time < inf for time in self.times)
        answered = sum(time < inf for time in self.times)
        return (
            f"{answered} of {self.ticks - self.unchanged} answered, {late} after "
            f"{LATE_S * 1e3:g} ms; {self.unchanged} change nothing"
        )


def measure(rate: float, screen: bool, seconds: float) -> Timing:
    """The times of a run of diffbotctl, with or without the screen."""
    master, slave = os.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as folder:
        terminal, shown = os.openpty()
        recording = Path(folder) / "wire.mcap"
        words = command(os.ttyname(slave), recording)
        process = subprocess.Popen(
            words if screen else [*words, "--quiet"], stdout=shown, stderr=subprocess.DEVNULL
        )
        swallow = threading.Thread(target=drain, args=(terminal,), daemon=True)
        swallow.start()
        ticks = Ticks(master, rate)
        try:
            negotiate(master)
            ticks.send(seconds)
            ticks.send_last()
        finally:
            process.terminate()
            process.wait()
            for fd in (master, slave, terminal, shown):
                os.close(fd)
        return timing(ticks.times(recording)[:-1])


def bare(rate: float, seconds: float) -> Timing:
    """The times of a program that only reads and writes."""
    with bare_program(rate) as ticks:
        return Timing(sorted(ticks.send(seconds)), ticks.count)


@contextmanager
def bare_program(rate: float) -> Iterator[Ticks]:
    """A program that only reads and writes, with an engine's priority: ticks that it answers."""
    master, slave = os.openpty()
    tty.setraw(slave)
    tick = 3 * len(frame(125, bytes(4)))
    answers = [pair(duty, duty).hex() for duty in (0, 1)]  # by turns; no wheel turns by them
    process = subprocess.Popen([sys.executable, "-c", BARE, os.ttyname(slave), str(tick), *answers])
    prefer(process.pid, ENGINE_PRIORITY)
    try:
        yield Ticks(master, rate)
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


def timing(times: list[float | None]) -> Timing:
    """The times of these ticks; None for those that left the command as it was."""
    answers = sorted(time for time in times if time is not None)
    return Timing(answers, len(times), len(times) - len(answers))


class Ticks:
    """The board's end of the line: sends ticks and keeps when commands for the wheels come.

    The wheels obey the commands, except that each of them drags by turns: so the robot goes on, and
    most ticks are answered by another command.
    """

    def __init__(self, port: int, rate: float) -> None:
        self.port, self.rate = port, rate
        self.answers = Answers(port)
        self.board = BookBoard()
        self.sent: list[float] = []  # when the last byte of each tick was written (s)

    @property
    def count(self) -> int:
        """How many ticks have been sent."""
        return len(self.sent)

    def send(self, seconds: float) -> list[float]:
        """Send ticks for a time. Returns seconds from each to the next changed command.

        An answer is waited for until the next tick is due. A board has a processor of its own: the
        ticks are sent and the commands are read before other programs run, where that is permitted.
        """
        times: list[float] = []
        due = time.perf_counter()
        end = due + seconds
        with preferred():
            while (due := due + 1.0 / self.rate) < end:
                while self.answers.wait(due - time.perf_counter()):
                    pass  # further commands of the tick before
                self.write()
                if self.answers.wait(due + 1.0 / self.rate - self.sent[-1]):
                    times.append(self.answers.received[-1].time - self.sent[-1])
        return times

    def send_last(self) -> None:
        """Send one more tick, after which nothing is measured, and wait for what still comes."""
        self.write()
        while self.answers.wait(LAST_ANSWER_S):
            pass

    def write(self) -> None:
        """Send one tick, in one piece."""
        board, period = self.board, 1.0 / self.rate
        board.take(self.answers.last)
        board.out.clear()
        board.turn(period)
        dragging = "left" if int(self.count / self.rate * 2) % 2 else "right"
        board.place[dragging] -= DRAG * board.speed[dragging] * period
        tick = frame(127, struct.pack("<f", distance(self.count)))
        tick += frame(125, struct.pack("<i", board.count("left")))
        tick += frame(126, struct.pack("<i", board.count("right")))
        os.write(self.port, tick)
        self.sent.append(time.perf_counter())

    def times(self, recording: Path) -> list[float | None]:
        """For each tick, seconds to the command that answers it by the complete recording.

        None for a tick that left the command as it was, infinity for one without an answer.
        """
        commands = commands_of(self.count, recorded_commands(recording))
        return answer_times(self.sent, self.answers.received, commands)


def rows(seconds: float = SECONDS) -> Iterator[Row]:
    """The latency rows, headless and with the screen, at 50 and 200 Hz, beside a bare program's."""
    floors = {rate: bare(rate, seconds) for rate in (50.0, 200.0)}
    for rate, floor in floors.items():
        yield Row(
            f"wire to wire at {rate:.0f} Hz, a program that only reads and writes",
            f"{floor.median * 1e3:.2f}, p99 {floor.p99 * 1e3:.2f} ms; {floor.counts()}",
            "(none)",
            True,
        )
    for screen, (median_max, p99_max) in ((False, (0.4, 1.0)), (True, (0.5, 2.0))):
        for rate, floor in floors.items():
            measured = measure(rate, screen, seconds)
            name = f"wire to wire at {rate:.0f} Hz, {'with the screen' if screen else 'headless'}"
            middle, tail = measured.median * 1e3, measured.p99 * 1e3
            yield Row(
                name,
                f"{middle:.2f} ({measured.median / floor.median:.1f}x bare), p99 {tail:.2f} ms "
                f"({measured.p99 / floor.p99:.1f}x); {measured.counts()}",
                f"<= {median_max}, p99 <= {p99_max} ms",
                middle <= median_max and tail <= p99_max,
            )
