"""Every way a run can end, at random times, on a pseudo-terminal with the book's board behind."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random

from diffbotctl.recording.reader import RecordingReader
from diffbotctl.testing.book_board import BookBoard, BookBoardPort
from diffbotctl.testing.trials.row import Row, printed

PROGRAM = (
    "from diffbotctl.config import registry\n"
    "registry.BLOCKS['breaks'] = 'prove.breaks:Breaks'\n"
    "from diffbotctl.cli.main import main; main()"
)
ZEROS = 4  # commands at the end of the wire that must be zero: the stop, repeated for both wheels
AT_ONCE = 6  # trials in parallel: each waits most of the time
PATIENCE = 5.0  # s for a recorder whose engine was killed to end by itself
LATEST = 4.0  # s of driving before something happens


class Trial:
    """One run of the product against one board."""

    def __init__(self, chance: Random, folder: Path) -> None:
        self.chance, self.folder = chance, folder
        self.port = BookBoardPort(BookBoard(distance=25.0))
        self.out = ""

    def words(self, pipeline: str, *more: str) -> list[str]:
        """The product's command line."""
        return [
            sys.executable,
            "-c",
            PROGRAM,
            "run",
            pipeline,
            "--port",
            self.port.name,
            "--robot",
            "book_2wd_stock",
            "--set",
            "robot.drive.polarity=checked_by_hand",
            "--goal",
            "9 0",
            "--record",
            str(self.folder / "run.mcap"),
            *more,
        ]

    def start(self, words: list[str], terminal: int | None = None) -> subprocess.Popen[str]:
        """Start it and wait until the wheels turn, and then for a random time."""
        if terminal is None:
            process = subprocess.Popen(
                words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            )
        else:
            process = subprocess.Popen(
                ["setsid", "--ctty", *words],
                stdin=terminal,
                stdout=terminal,
                stderr=terminal,
                text=True,
            )
        self.port.wait_for(lambda board: board.speed["left"] > 3, 30)
        until = self.port.board.now + self.chance.uniform(0.0, LATEST)
        self.port.wait_for(lambda board: board.now > until, 30)
        return process

    def ended_in_zeros(self) -> bool:
        """True when the last commands on the wire were zero, and the motors are off."""
        last = [value for _, _, value in self.port.board.commands[-ZEROS:]]
        return last == [0] * ZEROS and self.port.board.pwm == {"left": 0, "right": 0}

    def kept(self) -> bool:
        """True when the recording can be read. An orphaned recorder may still be writing its last
        second: it is given time."""
        path = self.folder / "run.mcap"
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            if any(True for _ in RecordingReader(path).messages()):
                return True
            time.sleep(0.1)
        return False


def by_signal(number: int, cause: str) -> Callable[[Trial], bool]:
    """The host is asked to end."""

    def trial(what: Trial) -> bool:
        process = what.start(what.words("goal"))
        process.send_signal(number)
        out = process.communicate(timeout=30)[0]
        return what.ended_in_zeros() and cause in out and process.returncode == 130 and what.kept()

    return trial


def killed(what: Trial) -> bool:
    """The host dies without a word; the guardian speaks for it."""
    process = what.start(what.words("goal"))
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    what.port.wait_for(lambda board: board.pwm == {"left": 0, "right": 0}, 5)
    at = what.port.board.now
    what.port.wait_for(lambda board: board.now > at + 0.3, 5)
    return what.ended_in_zeros() and what.kept()


def raises(what: Trial) -> bool:
    """A block raises."""
    after = what.chance.uniform(2.5, 2.5 + LATEST)
    broken = str(Path(__file__).parent / "broken.yaml")
    words = what.words(broken, "--set", f"breaks.after={after:.3f} s")
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    out = process.communicate(timeout=60)[0]
    return (
        what.ended_in_zeros() and "block breaks" in out and process.returncode == 1 and what.kept()
    )


def terminal_closed(what: Trial) -> bool:
    """The window with the live view is closed."""
    master, slave = os.openpty()
    process = what.start(what.words("goal"), terminal=slave)
    os.close(slave)
    os.close(master)
    process.wait(timeout=30)
    return what.ended_in_zeros() and what.kept()


def link_pulled(what: Trial) -> bool:
    """The line is dead for a while and comes back: a stop first, and nothing else."""
    process = what.start(what.words("goal"))
    with what.port.changed:
        what.port.cut = True
        before, at = len(what.port.board.commands), what.port.board.now
    away = what.chance.uniform(1.5, 4.0)
    what.port.wait_for(lambda board: board.now > at + away, 20)
    what.port.cut = False
    what.port.wait_for(lambda board: len(board.commands) > before + 20, 20)
    later = {value for _, _, value in what.port.board.commands[before:]}
    process.terminate()
    out = process.communicate(timeout=30)[0]
    return later == {0} and "telemetry_stale" in out and what.ended_in_zeros()


FAULTS: dict[str, Callable[[Trial], bool]] = {
    "host SIGTERM": by_signal(signal.SIGTERM, "SIGTERM"),
    "host SIGINT": by_signal(signal.SIGINT, "Ctrl-C"),
    "host SIGKILL (guardian)": killed,
    "block raises": raises,
    "terminal closed": terminal_closed,
    "link pulled and back": link_pulled,
}


def one(fault: Callable[[Trial], bool], seed: int) -> bool:
    """One trial of a fault; False also when the trial itself could not be carried through."""
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(Random(seed), Path(folder))
        try:
            return fault(trial)
        except (AssertionError, subprocess.TimeoutExpired):
            return False
        finally:
            trial.port.close()


def rows(seed: int, trials: int) -> Iterator[Row]:
    """One row a fault."""
    for name, fault in FAULTS.items():
        chance = Random(f"{seed} {name}")
        seeds = [chance.getrandbits(32) for _ in range(trials)]
        with ThreadPoolExecutor(AT_ONCE) as pool:
            good = sum(pool.map(lambda number, fault=fault: one(fault, number), seeds))
        yield Row(
            f"{name}: stop last on the wire, cause shown",
            f"{good} of {trials}",
            f"{trials} of {trials}",
            good == trials,
        )


def main() -> int:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trials", type=int, default=50)
    options = parser.parse_args()
    return 1 if printed(rows(options.seed, options.trials)) else 0


if __name__ == "__main__":
    raise SystemExit(main())
