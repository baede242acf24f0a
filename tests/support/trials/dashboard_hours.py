"""Hours of a run with its dashboard: memory of all processes, and what the end leaves behind.

The simulated robot drives at SPEED times real time; engine, server and dashboard are the real
processes on a real pseudo-terminal, and the dashboard draws in real time.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from diffbotctl.cli import main as cli_main
from diffbotctl.engine.clock import Clock, ScaledClock
from diffbotctl.runs import run as runs
from tests.support.running import command
from tests.support.terminal import Terminal
from tests.support.trials.leftovers import leftovers, processes_of
from tests.support.trials.long_run import PAGE_BYTES
from tests.support.trials.row import Row

MODULE = "tests.support.trials.dashboard_hours"  # also where it is __main__
SPEED = 60.0
# The dashboard first imports its libraries, then its plots fill with two minutes of values
# (`HISTORY_MAX_VALUES`), both in real time. A shorter run settles for a part of its length.
SETTLING_S, SETTLING_SHARE = 150.0, 0.65
SAMPLE_PERIOD_S = 0.5
GROWTH_MAX_BYTES = 3 << 20
SLOWNESS_MAX = 5.0  # a busy machine may take this much longer than planned, and a minute
ALTERNATE_SCREEN = 1049


class ScaledRun(runs.Run):
    """A run at SPEED times real time."""

    def _clock(self) -> Clock:
        return ScaledClock(SPEED, 0)


class DashboardHours(NamedTuple):
    """`growth`: of all processes' resident memory after settling, bytes. `faults` at the end."""

    growth: int
    faults: list[str]


def measure(hours: float) -> DashboardHours:
    """Run for simulated `hours`."""
    planned = hours * 3600.0 / SPEED
    deadline = time.monotonic() + 60.0 + SLOWNESS_MAX * planned
    sizes: list[int] = []
    times: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _, environment = command(folder)
        words = ("run", "wander", "--dash", "--for", f"{hours * 3600.0:.0f}s", "--seed", "4")
        line = [sys.executable, "-m", MODULE, *words]
        with Terminal(line, environment, columns=120, lines=40) as terminal:
            terminal.until(lambda text: "SIMULATED" in text, "the dashboard")
            sampled_at = time.monotonic()
            while terminal.process.poll() is None and time.monotonic() < deadline:
                terminal.look()
                if time.monotonic() >= sampled_at + SAMPLE_PERIOD_S:
                    sampled_at = time.monotonic()
                    times.append(sampled_at)
                    sizes.append(sum(map(_resident_bytes, processes_of(folder))))
            faults = [] if terminal.process.poll() == 0 else [f"code {terminal.process.poll()}"]
            terminal.look()
            if ALTERNATE_SCREEN in terminal.screen.modes:
                faults.append("the terminal shows the alternate screen")
            faults += leftovers(folder)
    settled_at = times[0] + min(SETTLING_S, SETTLING_SHARE * planned)
    settled = [size for at, size in zip(times, sizes, strict=True) if at >= settled_at]
    settled = settled[:-2]  # the last ones fall into the end
    return DashboardHours(max(settled) - settled[0], faults)


def _resident_bytes(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_BYTES
    except OSError:
        return 0


def rows(hours: float) -> Iterator[Row]:
    """The row; faults are printed."""
    use = measure(hours)
    for fault in use.faults:
        print(f"        {fault}")
    yield Row(
        f"F {hours:g} h with the dashboard, {SPEED:g} times real time: memory, left",
        f"+{use.growth / 1e6:.1f} MB, {len(use.faults)}",
        "3 MB, 0",
        use.growth <= GROWTH_MAX_BYTES and not use.faults,
    )


if __name__ == "__main__":  # words of diffbotctl, to be run at SPEED
    setattr(runs, "Run", ScaledRun)  # noqa: B010 - the commands import it late
    cli_main.main()
