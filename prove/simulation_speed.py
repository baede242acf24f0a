"""How fast one simulated run is: `python simulation_speed.py PIPELINE SEED [RECORDING]`.

`bench` starts it with the path of an older version too, so it uses only what that has as well.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from diffbotctl.config.load import load
from diffbotctl.messages import Goal
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

GOALS = tuple(Goal(0, 0, x, y, None) for x, y in ((2.0, 0.0), (0.0, 0.4), (1.0, -0.5), (0.0, 0.0)))
DURATION_S = 60.0  # of simulated time


def main() -> None:
    """Print the seconds of the run and those it took, without start-up, as JSON."""
    pipeline, seed, *recording = sys.argv[1:]
    is_goal = pipeline == "goal"
    options = RunOptions(
        goals=GOALS if is_goal else (),
        seed=int(seed),
        fast=True,
        duration=DURATION_S,
        record=Path(recording[0]) if recording else None,
    )
    run = Run(load(pipeline, None, ["world.walls=[]"] if is_goal else []), options)
    began = time.perf_counter()
    outcome = run.go().ending
    seconds = time.perf_counter() - began
    print(json.dumps({"simulated": outcome.time * 1e-9, "seconds": seconds}))


if __name__ == "__main__":
    main()
