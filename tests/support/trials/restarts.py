"""Starts and stops by the hundred: simulated runs and runs on a board, ended at any moment.

Every second run ends by itself; the others end by a signal, some of them while they still load.
After each: no process, and so no pseudo-terminal, which lives as long as a process that holds it;
the motors off; at the end no socket but that of the last killed run.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from random import Random

from diffbotctl.recording.reader import recording_info
from tests.support.book_board import STOCK, BookBoardPort
from tests.support.running import command
from tests.support.trials.child_faults import SensingBoard, is_off
from tests.support.trials.leftovers import leftovers, processes_of
from tests.support.trials.row import Row

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
LIFETIME_MAX_S = 2.0  # of a run that a signal ends
OFF_TIMEOUT_S = 10.0  # after the end of a run, and of its watchdog
END_TIMEOUT_S = 60.0


def restart(rng: Random, number: int, folder: Path, port: BookBoardPort) -> list[str]:
    """One start and stop; what was not as it should be."""
    recording = folder / f"{number % 4}.mcap"
    on_board = number % 4 < 2
    where = ("--port", port.name, *STOCK) if on_board else ("--port", "sim")
    words = ("run", "goal", *where, "--goal", "9 0", "--quiet", "--for", "1.5s")
    line, environment = command(folder, *words, "--record", str(recording), "--force")
    process = subprocess.Popen(
        line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    number_sent = None
    if number % 2:
        time.sleep(rng.uniform(0.0, LIFETIME_MAX_S))
        number_sent = rng.choice(SIGNALS)
        process.send_signal(number_sent)
    try:
        code = process.wait(END_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return ["it did not end"]
    faults = [f"{fault} after {number_sent}" for fault in leftovers(folder) if "process" in fault]
    if number_sent is None and (code != 1 or not recording_info(recording).complete):
        faults.append(f"exit code {code}, or an incomplete recording")
    if on_board:
        try:
            port.wait_for(is_off, OFF_TIMEOUT_S)
        except AssertionError:
            faults.append(f"the motors are on after {number_sent}: {port.board.pwm}")
    return faults


def restarts(seed: int, count: int) -> list[str]:
    """The faults of `count` starts and stops."""
    rng, faults = Random(seed), []
    with (
        tempfile.TemporaryDirectory() as name,
        BookBoardPort(SensingBoard()) as port,
    ):
        folder = Path(name)
        for number in range(count):
            faults += [f"{number}: {fault}" for fault in restart(rng, number, folder, port)]
        sockets = list(folder.glob("diffbotctl/*.socket"))
        if len(sockets) > 1:  # a killed run cannot remove its own; the next one of this name does
            faults.append(f"{len(sockets)} sockets are left")
        for pid in processes_of(folder):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
    return faults


def rows(seed: int, count: int) -> Iterator[Row]:
    """The row; faults are printed."""
    faults = restarts(seed, count)
    for fault in faults:
        print(f"        {fault}")
    what = f"F {count} starts and stops: left behind, or motors on"
    yield Row(what, f"{len(faults)}", "0", not faults)
