"""A person who drives through ssh: the link is lost, and `stop` is typed over a dead link."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from diffbotctl.messages import Wheels
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.time import SECOND
from tests.support.far_host import far_host
from tests.support.running import PlainClient, command, moves, running, stands
from tests.support.trials.row import Row

WAY = "OpenSSH to an asyncssh server here"
LOSSES = ("frozen", "killed")
STOPPED_MAX_S, REPORT_MAX_S = 0.5, 3.0
ENDING_S = 60  # for a command whose link is lost
PERSON = r"drive of \S+@\S+"


class LostLink(NamedTuple):
    """What one lost link came to."""

    stopped_s: float
    """from the loss to the last command that was not zero, also after the link works again"""
    report_s: float
    """until `stop` over the dead link has reported that it is unknown whether the robot stopped"""
    is_truthful: bool
    """`stop` reported it, and what to do"""
    is_named: bool
    """the stop's cause names the person"""


def rows(trials: int) -> Iterator[Row]:
    """All rows; `trials` links are frozen or their server killed, in turn."""
    outcomes = [_trial(LOSSES[number % len(LOSSES)]) for number in range(trials)]
    slowest = max(each.stopped_s for each in outcomes)
    yield Row(
        f"12 `drive --at`, {WAY}, link lost: last command that moves, after at most",
        f"{slowest:.2f} s of {trials}",
        f"{STOPPED_MAX_S} s",
        slowest <= STOPPED_MAX_S,
    )
    latest = max(each.report_s for each in outcomes)
    truthful = sum(each.is_truthful for each in outcomes)
    yield Row(
        "12 `stop --at` over the dead link: reports that it is not known, after at most",
        f"{latest:.1f} s, {truthful} of {trials}",
        f"{REPORT_MAX_S:.0f} s",
        latest <= REPORT_MAX_S and truthful == trials,
    )
    named = sum(each.is_named for each in outcomes)
    yield Row("12 the stop names the person", f"{named}", f"{trials}", named == trials)


def _trial(how: str) -> LostLink:
    with TemporaryDirectory() as folder:
        base = Path(folder)
        there, here = base / "there", base / "here"
        there.mkdir()
        here.mkdir()
        with far_host(base / "ssh", there) as (server, path):
            try:
                return _lost_link(how, there, here, server, path)
            finally:
                server.send_signal(signal.SIGCONT)


def _lost_link(
    how: str, there: Path, here: Path, server: subprocess.Popen[bytes], path: str
) -> LostLink:
    file = there / "lost.mcap"
    with running(there, "goal", "--stay", "--goal", "0 0", "--record", str(file)) as run:
        watcher = PlainClient(there)
        driver = _start(here, path, "drive", "--speed", "0.1", "--for", "60s")
        watcher.until(moves)
        lost_at = watcher.request("status")["time"]
        server.send_signal(signal.SIGSTOP if how == "frozen" else signal.SIGKILL)
        begun = time.monotonic()
        stop = _start(here, path, "stop")
        _, output = stop.communicate(timeout=ENDING_S)
        report_s = time.monotonic() - begun
        held = watcher.until(lambda status: status["held"] and stands(status))["held"]
        if how == "frozen":
            watcher.request("resume")
            server.send_signal(signal.SIGCONT)
        driver.communicate(timeout=ENDING_S)
        healed_at = watcher.request("status")["time"]
        watcher.until(lambda status: status["time"] > healed_at + SECOND)
        run.terminate()
        run.wait(timeout=ENDING_S)
    moving = [
        item.time
        for item in RecordingReader(file).messages()
        if isinstance(item.message, Wheels) and item.wire == "gate.wheels" and item.message.left
    ]
    return LostLink(
        (max(moving) - lost_at) / SECOND,
        report_s,
        "NOT KNOWN whether the robot has stopped" in output and "switch it off" in output,
        bool(re.search(PERSON, held["cause"])),
    )


def _start(here: Path, path: str, *words: str) -> subprocess.Popen[str]:
    line, environment = command(here, *words, "--at", "robot")
    return subprocess.Popen(
        line,
        env={**os.environ, **environment, "PATH": path},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
