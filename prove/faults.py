"""Every way a run can end, at random times, on a pseudo-terminal with the book's board behind."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from random import Random

from diffbotctl.drivers.watchdog_process import STOPPED_TEXT
from diffbotctl.recording.reader import RecordingReader
from tests.support.book_board import STOCK, BookBoard, BookBoardPort
from tests.support.command_process import (
    command_line_with_block,
    start_in_pipe,
    start_on_terminal,
)
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

ZEROS = 4  # last commands on the wire that must be zero: the stop, repeated, for both wheels
PARALLEL_TRIALS = 6  # each waits most of the time
RECORDER_TIMEOUT_S = 5.0  # for a recorder whose engine was killed to finish its file
DRIVE_TIME_MAX_S = 4.0  # before the fault


class Trial:
    """One run of diffbotctl with one board."""

    def __init__(self, rng: Random, folder: Path) -> None:
        self.rng, self.folder = rng, folder
        self.port = BookBoardPort(BookBoard(distance=25.0))
        self.output = ""

    def words(self, pipeline: str, *more: str) -> list[str]:
        """The command line of diffbotctl."""
        words = ("run", pipeline, "--port", self.port.name, *STOCK, "--goal", "9 0")
        recording = self.folder / "run.mcap"
        line = (*words, "--record", recording, *more)
        return command_line_with_block("breaks", "prove.breaks:Breaks", *line)

    def start(self, words: list[str], terminal: int | None = None) -> subprocess.Popen[str]:
        """Start it, wait until the wheels turn, and then for a random time."""
        process = start_in_pipe(words) if terminal is None else start_on_terminal(words, terminal)
        self.port.wait_for(lambda board: board.speed["left"] > 3, 30)
        until = self.port.board.now + self.rng.uniform(0.0, DRIVE_TIME_MAX_S)
        self.port.wait_for(lambda board: board.now > until, 30)
        return process

    def ended_in_zeros(self) -> bool:
        """Whether the last commands on the wire were zero and the motors are off."""
        last = [value for _, _, value in self.port.board.commands[-ZEROS:]]
        return last == [0] * ZEROS and self.port.board.pwm == {"left": 0, "right": 0}

    def has_recording(self) -> bool:
        """Whether the recording can be read.

        A recorder without an engine may still be writing its last second, so this waits for it.
        """
        path = self.folder / "run.mcap"
        deadline = time.monotonic() + RECORDER_TIMEOUT_S
        while time.monotonic() < deadline:
            if any(True for _ in RecordingReader(path).messages()):
                return True
            time.sleep(0.1)
        return False


def by_signal(number: int, cause: str) -> Callable[[Trial], bool]:
    """The engine gets a signal."""

    def end_by_signal(trial: Trial) -> bool:
        process = trial.start(trial.words("goal"))
        process.send_signal(number)
        output = process.communicate(timeout=30)[0]
        return (
            trial.ended_in_zeros()
            and cause in output
            and process.returncode == 130
            and trial.has_recording()
        )

    return end_by_signal


def killed(trial: Trial) -> bool:
    """The engine is killed; the guardian process stops the robot."""
    process = trial.start(trial.words("goal"))
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    trial.port.wait_for(lambda board: board.pwm == {"left": 0, "right": 0}, 5)
    at = trial.port.board.now
    trial.port.wait_for(lambda board: board.now > at + 0.3, 5)
    output = process.communicate(timeout=30)[0]
    return trial.ended_in_zeros() and STOPPED_TEXT in output and trial.has_recording()


def raises(trial: Trial) -> bool:
    """A block raises."""
    after = trial.rng.uniform(2.5, 2.5 + DRIVE_TIME_MAX_S)
    broken = str(Path(__file__).parent / "broken.yaml")
    words = trial.words(broken, "--set", f"breaks.after={after:.3f} s")
    process = start_in_pipe(words)
    output = process.communicate(timeout=60)[0]
    return (
        trial.ended_in_zeros()
        and "block breaks" in output
        and process.returncode == 1
        and trial.has_recording()
    )


def terminal_closed(trial: Trial) -> bool:
    """The terminal with the live view is closed."""
    master, slave = os.openpty()
    process = trial.start(trial.words("goal"), terminal=slave)
    os.close(slave)
    os.close(master)
    process.wait(timeout=30)
    return trial.ended_in_zeros() and trial.has_recording()


def link_pulled(trial: Trial) -> bool:
    """The line is interrupted for a while: afterwards the board gets nothing but zero commands."""
    process = trial.start(trial.words("goal"))
    with trial.port.changed:
        trial.port.cut = True
        before, at = len(trial.port.board.commands), trial.port.board.now
    interruption = trial.rng.uniform(1.5, 4.0)
    trial.port.wait_for(lambda board: board.now > at + interruption, 20)
    trial.port.cut = False
    trial.port.wait_for(lambda board: len(board.commands) > before + 20, 20)
    later = {value for _, _, value in trial.port.board.commands[before:]}
    process.terminate()
    output = process.communicate(timeout=30)[0]
    return later == {0} and "telemetry_stale" in output and trial.ended_in_zeros()


FAULTS: dict[str, Callable[[Trial], bool]] = {
    "host SIGTERM": by_signal(signal.SIGTERM, "SIGTERM"),
    "host SIGINT": by_signal(signal.SIGINT, "Ctrl-C"),
    "host SIGQUIT": by_signal(signal.SIGQUIT, "Ctrl-\\"),
    "host SIGKILL (guardian)": killed,
    "block raises": raises,
    "terminal closed": terminal_closed,
    "link pulled and back": link_pulled,
}


def run_trial(fault: Callable[[Trial], bool], seed: int) -> bool:
    """Whether one trial of a fault succeeds; False also when the trial could not be completed."""
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(Random(seed), Path(folder))
        try:
            return fault(trial)
        except (AssertionError, subprocess.TimeoutExpired):
            return False
        finally:
            trial.port.close()


def rows(seed: int, trials: int, kinds: int = len(FAULTS)) -> Iterator[Row]:
    """One row for each fault."""
    for name, fault in drawn(FAULTS.items(), kinds, seed):
        rng = Random(f"{seed} {name}")
        seeds = [rng.getrandbits(32) for _ in range(trials)]
        with ThreadPoolExecutor(PARALLEL_TRIALS) as pool:
            good = sum(pool.map(partial(run_trial, fault), seeds))
        yield Row.counted(f"{name}: stop last on the wire, cause shown", good, trials)
