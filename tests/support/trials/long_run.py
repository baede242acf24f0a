"""Memory of a run over simulated hours: a robot that drives all the time, without its recording."""

from __future__ import annotations

import gc
import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from diffbotctl.config.load import load
from diffbotctl.messages import Goal
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND

SETTLING_SHARE = 0.1  # of the run: caches and histories of limited length fill up
SAMPLES = 40
HOUR = 3600 * SECOND
PAGES = Path("/proc/self/statm")
PAGE_BYTES = 4096


class MemoryUse(NamedTuple):
    """Memory over one run: sampled resident sizes in bytes, after a collection, with their times.

    `goals` were reached.
    """

    times: list[float]  # h
    sizes: list[int]
    goals: int

    @property
    def growth(self) -> int:
        """Greatest size after the first tenth of the run, less the size at its end, in bytes."""
        begin = int(len(self.sizes) * SETTLING_SHARE)
        return max(self.sizes[begin:]) - self.sizes[begin]


def resident_bytes() -> int:
    """Resident memory of this process."""
    return int(PAGES.read_text().split()[1]) * PAGE_BYTES


def measure(pipeline: str, robot: str, hours: float, seed: int) -> MemoryUse:
    """Run `pipeline` for `hours` of simulated time; goals begin again when all are reached."""
    configuration = load(pipeline, robot)
    options = RunOptions(fast=True, duration=hours * 3600, stay=True, seed=seed)
    run = Run(configuration, options, tell=lambda text: None)
    operator, engine = run.operator, run.engine
    course = [Goal(0, 0, goal.x, goal.y, goal.heading) for goal in configuration.goals]
    period = round(hours * HOUR / SAMPLES)
    use = MemoryUse([], [], 0)
    former = engine.idle

    def idle() -> None:
        now = engine.last_instant
        if course and not operator.waiting:
            operator.waiting += course
            if operator.active is None:
                operator.resume(now)
                operator.replace_goals(now, operator.waiting.pop(0))
                operator.waiting += course[1:]
        if now >= period * (len(use.times) + 1):
            gc.collect()
            use.times.append(now / HOUR)
            use.sizes.append(resident_bytes())
        if former is not None:
            former()

    engine.idle = idle
    run.go()
    return use._replace(goals=operator.reached)


def measure_in_process(pipeline: str, robot: str, hours: float, seed: int) -> MemoryUse:
    """As `measure`, in a process of its own: the memory is that of the run alone."""
    words = [sys.executable, "-m", __name__, pipeline, robot, str(hours), str(seed)]
    output = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True).stdout
    return MemoryUse(*json.loads(output.splitlines()[-1]))


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4]))))
