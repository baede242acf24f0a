"""Why the robot of a run that has ended stopped: from the newest file of the black box."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from diffbotctl.control_socket.engine_channel import EngineUpdate
from diffbotctl.control_socket.run_state import RunState
from diffbotctl.control_socket.stop_explanation import StopExplanation, explain_stop
from diffbotctl.graph import Graph
from diffbotctl.recording.black_box_store import black_box_folder
from diffbotctl.replay.recorded_run import read_run
from diffbotctl.replay.replay import ReplayOptions, replay_run


def newest_flight() -> Path | None:
    """The newest file of this user's black box; None where there is none."""
    files = black_box_folder().glob("*.mcap")
    return max(files, key=lambda path: path.stat().st_mtime_ns, default=None)


def explain_ended_run(path: Path) -> StopExplanation:
    """Replay the run in the file at `path`, and explain its last stop.

    Raises RunError for a file that cannot be replayed.
    """
    followed: list[tuple[RunState, Graph]] = []

    def watch(graph: Graph, instant: tuple[Any, ...]) -> None:
        if not followed:
            followed.append((RunState(graph), graph))
        followed[0][0].update(EngineUpdate(0, [instant], []))

    run = read_run(path)
    replay_run(run, ReplayOptions(watch=watch))
    ending = (run.end or {}).get("cause", "its end is not in the file")
    begun = time.localtime(int(run.about["epoch"]) / 1e9)
    title = f"The run of {Path(run.about['pipeline']).stem}, {time.strftime('%F %R', begun)}."
    if not followed:
        return StopExplanation(*[f"{title} {ending}"] * 2)
    explanation = explain_stop(*followed[0], ending=ending)
    return StopExplanation(*(f"{title} {text}" for text in explanation))
