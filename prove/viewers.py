"""`diffbotctl foxglove`: viewers that are lost while they drive, and the server's load."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

from tests.support.foxglove_viewer import FoxgloveProcess, serving_viewers
from tests.support.running import PlainClient, moves, running, stands
from tests.support.trials.row import Row

VIEWER = [sys.executable, "-m", "tests.support.foxglove_viewer"]
STOP_TIME_MAX_S = 0.5  # from the loss to the zero command of the wheels
DRIVE_TIME_MAX_S = 1.0  # before the loss
RAMP_TIME_S = 0.5  # after a resume, which lets a speed limiter finish its ramp
SETTLING_TIME_S = 2.0
SHARE_MAX = 0.06  # of a core, as for the page
TICK = os.sysconf("SC_CLK_TCK")  # per second, in /proc/PID/stat

Viewer = subprocess.Popen[bytes]
LOSSES: dict[str, Callable[[Viewer], None]] = {
    "killed": lambda viewer: viewer.kill(),
    "frozen": lambda viewer: viewer.send_signal(signal.SIGSTOP),
}


def rows(seed: int, trials: int, load_s: float = 10.0) -> Iterator[Row]:
    """`trials` of each way to lose a viewer that drives; the load of one that watches."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running(folder, "standby", "--stay"):
            with serving_viewers(folder, "--allow", "velocity") as server:
                for what, lose in LOSSES.items():
                    yield _lost(folder, server, what, lose, trials, rng)
            with serving_viewers(folder) as server:
                yield _load(server, load_s)


def _lost(
    folder: Path,
    server: FoxgloveProcess,
    what: str,
    lose: Callable[[Viewer], None],
    trials: int,
    rng: Random,
) -> Row:
    """Drive and lose the viewer at a random time: the wheels stop, and the stop is latched."""
    times, good = [], 0
    client = PlainClient(folder)
    for _ in range(trials):
        time.sleep(RAMP_TIME_S)
        viewer = subprocess.Popen([*VIEWER, server.address, "drive"], stderr=subprocess.DEVNULL)
        client.until(moves)
        time.sleep(rng.uniform(0.0, DRIVE_TIME_MAX_S))
        began = time.monotonic()
        lose(viewer)
        client.until(stands)
        times.append(time.monotonic() - began)
        held = client.until(lambda status: status["held"])["held"]
        good += held["code"] == "operator_lost" and "viewer" in held["cause"] and held["latched"]
        viewer.kill()
        viewer.wait()
        client.request("resume")
        client.until(lambda status: status["held"] is None)
    client.close()
    in_time = sum(each <= STOP_TIME_MAX_S for each in times)
    return Row(
        f"viewer that drives {what}: wheels 0, slowest",
        f"{max(times):.2f} s, {in_time}/{trials}",
        f"<= {STOP_TIME_MAX_S:g} s, all, cause named",
        in_time == good == trials,
    )


def _load(server: FoxgloveProcess, load_s: float) -> Row:
    """The processor time of the server while one viewer watches every topic at 38 Hz."""
    viewer = subprocess.Popen([*VIEWER, server.address, "watch"], stderr=subprocess.DEVNULL)
    time.sleep(SETTLING_TIME_S)
    before, began = _ticks(server.process.pid), time.monotonic()
    time.sleep(load_s)
    share = (_ticks(server.process.pid) - before) / TICK / (time.monotonic() - began)
    viewer.kill()
    viewer.wait()
    return Row(
        "server of a viewer that watches every topic, 38 Hz",
        f"{share:.1%} of a core",
        f"<= {SHARE_MAX:.0%}",
        share <= SHARE_MAX,
    )


def _ticks(pid: int) -> int:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) + int(fields[12])
