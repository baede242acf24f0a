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

from diffbotctl.testing.book_board import BookBoard, frame
from diffbotctl.testing.trials.row import Row, printed

SECONDS = 12.0  # of ticks a run
PAIR = 24  # bytes of both wheels' commands
ANSWER = 0.004  # s; a command that comes later belongs to the repetition, not to the tick
PROGRAM = "from diffbotctl.cli.main import main; main()"


def command(port: str, recording: Path) -> list[str]:
    """The product on a line so fast that no pacing is in the way, recording all the time."""
    return [
        sys.executable,
        "-c",
        PROGRAM,
        "run",
        "goal",
        "--port",
        port,
        "--robot",
        "book_2wd_stock",
        "--set",
        "robot.drive.polarity=checked_by_hand",
        "--set",
        "robot.link.baud=115200",
        "--goal",
        "9 0",
        "--goal",
        "0 9",
        "--record",
        str(recording),
    ]


# Reads what comes and answers each tick at once: what is left is this machine's own.
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
    """Waits for changed commands to come out of the port.

    A pair that says the same as the one before repeats it, and answers nothing.
    """

    def __init__(self, port: int) -> None:
        self.port = port
        self.rest = self.last = b""

    def wait(self, seconds: float) -> bool:
        """True when another pair of commands than before has come in that time."""
        end = time.perf_counter() + seconds
        while (left := end - time.perf_counter()) > 0:
            if not select.select([self.port], [], [], left)[0]:
                return False
            self.rest += os.read(self.port, 4096)
            while len(self.rest) >= PAIR:
                before, self.last = self.last, self.rest[:PAIR]
                self.rest = self.rest[PAIR:]
                if self.last != before:
                    return True
        return False


def measure(rate: float, screen: bool) -> list[float]:
    """Seconds from the right tick's last byte to the pair that answers it."""
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


def bare(rate: float) -> list[float]:
    """The same seconds of a program that does nothing but read and write."""
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
    """Read away what the screen draws."""
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


def stimulate(port: int, rate: float) -> list[float]:
    """Send tick pairs at `rate`, turning now left and now right, and time the answers."""
    answers = Answers(port)
    times: list[float] = []
    begin = time.perf_counter()
    due = begin
    places = [0.0, 0.0]
    while time.perf_counter() - begin < SECONDS:
        due += 1.0 / rate
        while answers.wait(due - time.perf_counter()):
            pass
        curve = 8.0 if int((due - begin) * 2) % 2 else -8.0
        places[0] += (20.0 - curve) / rate
        places[1] += (20.0 + curve) / rate
        os.write(port, frame(127, struct.pack("<f", 25.0 + (int(due * rate) % 3))))
        os.write(port, frame(125, struct.pack("<i", int(places[0]))))
        os.write(port, frame(126, struct.pack("<i", int(places[1]))))
        sent = time.perf_counter()
        if answers.wait(ANSWER):
            times.append(time.perf_counter() - sent)
    return times


def rows() -> Iterator[Row]:
    """The latency rows, headless and with the screen, at 50 and 200 Hz, beside a bare program's."""
    for rate in (50.0, 200.0):
        times = sorted(bare(rate))
        half, tail = median(times) * 1e3, times[int(0.99 * len(times))] * 1e3
        yield Row(
            f"wire to wire at {rate:.0f} Hz, a program that only reads and writes",
            f"{half:.2f}, p99 {tail:.2f} ms",
            "(none)",
            True,
        )
    for screen, most in ((False, (0.4, 1.0)), (True, (0.5, 2.0))):
        for rate in (50.0, 200.0):
            times = sorted(measure(rate, screen))
            name = f"wire to wire at {rate:.0f} Hz, {'with the screen' if screen else 'headless'}"
            if len(times) < 20:
                yield Row(name, f"{len(times)} answers", "enough to tell", False)
                continue
            half, tail = median(times) * 1e3, times[int(0.99 * len(times))] * 1e3
            yield Row(
                f"{name} (n={len(times)})",
                f"{half:.2f}, p99 {tail:.2f} ms",
                f"<= {most[0]}, p99 <= {most[1]} ms",
                half <= most[0] and tail <= most[1],
            )


if __name__ == "__main__":
    raise SystemExit(printed(rows()) > 0)
