"""What the dashboard costs while a robot drives, and whoever is lost behind a terminal."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from statistics import median

from diffbotctl.testing.lost_terminal import drive, lose, ssh_server
from diffbotctl.testing.running import PlainClient, command, moves, running, stands
from diffbotctl.testing.terminal import Terminal
from diffbotctl.testing.trials.row import Row, printed
from prove.screen import Drain

SIZE = (120, 40)
CORE = 15.0  # % of a core
FIRST = 0.8  # s to the first picture
STARTS = 5
WATCHED = 15.0  # s
LIMIT = 0.5  # s from the loss to the wheels commanded to zero
LATEST = 0.5  # s of driving before something happens
TICKS = os.sysconf("SC_CLK_TCK")
FAR = ("goal", "--stay", "--goal", "9 0", "--goal", "-9 0")


def rows(seed: int, trials: int) -> Iterator[Row]:
    """All rows; `trials` of each loss."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running(folder, *FAR):
            yield from costs(folder)
            chance = Random(seed)
            for way in ("here", "ssh"):
                for mode in ("hold", "latched"):
                    for how in ("SIGKILL", "SIGSTOP", "closed"):
                        yield lost(folder, way, mode, how, trials, chance)


def costs(folder: Path) -> Iterator[Row]:
    """Processor and start, with map, facts, plots, blocks and log on the screen."""
    client = PlainClient(folder)
    client.until(moves)
    words, environment = command(folder, "dash", "--hz", "10")
    firsts = []
    for _ in range(STARTS):
        drain = Drain(*SIZE, words, environment)
        firsts.append(drain.until(b"SIMULATED", 20.0))
        drain.close()
    drain = Drain(*SIZE, words, environment)
    drain.until(b"kinematics", 20.0)  # the block table: every panel has something
    before, began = spent(drain.process.pid), time.perf_counter()
    drain.for_so_long(WATCHED)
    share = 100 * (spent(drain.process.pid) - before) / (time.perf_counter() - began)
    driving = moves(client.request("status"))
    drain.close()
    client.close()
    yield Row(
        "dashboard, 10 Hz, 120x40, robot driving",
        f"{share:.1f} % of a core",
        f"<= {CORE:g} %",
        driving and share <= CORE,
    )
    yield Row(
        f"dashboard, first picture (median of {STARTS})",
        f"{median(firsts):.2f} s",
        f"<= {FIRST:g} s",
        median(firsts) <= FIRST,
    )


def spent(pid: int) -> float:
    """Seconds of processor that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def lost(folder: Path, way: str, mode: str, how: str, trials: int, chance: Random) -> Row:
    """Drive by `teleop` and lose the person; the robot stands, the cause says who."""
    times, good = [], 0
    words, environment = command(folder, "teleop", "--mode", mode)
    client = PlainClient(folder)
    for _ in range(trials):
        client.until(moves)
        with (
            ssh_server(folder, "teleop", "--mode", mode) as ssh,
            Terminal(ssh if way == "ssh" else words, environment) as terminal,
        ):
            terminal.until(lambda text: "pose" in text, "the first picture")
            drive(terminal, client, mode)
            hold(terminal, mode, chance.uniform(0.0, LATEST))
            began = time.monotonic()
            lose(terminal, how)
            client.until(stands)
            times.append(time.monotonic() - began)
            status = client.until(lambda status: status["held"])
            named = "teleop" in status["held"]["cause"]
            good += (
                status["held"]["code"] == "operator_lost"
                and named
                and status["operator.goal"]["number"] == 0
                and times[-1] <= LIMIT
            )
            terminal.process.send_signal(signal.SIGCONT)
        (folder / "port").unlink()
        client.request("resume")
    client.close()
    return Row(
        f"teleop, {mode}, {way}: {how}",
        f"{good} of {trials}, {max(times) * 1e3:.0f} ms",
        f"all, {LIMIT * 1e3:.0f} ms",
        good == trials,
    )


def hold(terminal: Terminal, mode: str, seconds: float) -> None:
    """Go on driving for so long."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if mode == "hold":
            terminal.type("i")
        terminal.look(0.03)


if __name__ == "__main__":
    raise SystemExit(printed(rows(1, 2)) > 0)
