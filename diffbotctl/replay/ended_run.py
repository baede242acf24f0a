"""Why the robot of the last run stopped: from the black box, or from the note of the run's end."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from diffbotctl.control_socket.engine_channel import EngineUpdate
from diffbotctl.control_socket.run_state import RunState
from diffbotctl.control_socket.stop_explanation import StopExplanation, explain_end, explain_stop
from diffbotctl.errors import UserError
from diffbotctl.graph import Graph
from diffbotctl.recording.run_end import RunEnd, last_run_end, newest_flight
from diffbotctl.replay.recorded_run import RecordedRun, read_run
from diffbotctl.replay.replay import ReplayOptions, replay_run
from diffbotctl.time import SECOND


def explain_last_run() -> StopExplanation | None:
    """Explain the last stop of this user's last run; None where no run has left anything.

    The chain of causes comes from a replay of the black box file. Without one, or when it cannot be
    replayed without the consent to import code, the explanation is what was noted or recorded.
    Raises RunError for a file that cannot be read.
    """
    flight = newest_flight()
    end = last_run_end(flight)
    if end is not None and (flight is None or flight.name != end.flight):
        reason = "The chain of causes is not known: the run kept no black box file."
        return _explain_noted(end, reason)
    return None if flight is None else _explain_flight(flight, end)


def _explain_flight(path: Path, end: RunEnd | None) -> StopExplanation:
    run = read_run(path)
    try:
        followed = _replay(run)
    except UserError as error:
        reason = f"The chain of causes is not known: {error.problems[0].cause}."
        if end is not None:
            return _explain_noted(end, reason)
        followed = None
    else:
        reason = ""
    ending = (run.end or {}).get("cause", "its end is not in the file")
    title = _title(run.about["pipeline"], int(run.about["epoch"]))
    if followed is None:
        summary = f"{title} {explain_end(None, ending)}"
        return StopExplanation(summary, f"{summary} {reason}".rstrip())
    return StopExplanation(*(f"{title} {text}" for text in explain_stop(*followed, ending=ending)))


def _replay(run: RecordedRun) -> tuple[RunState, Graph] | None:
    """The state at the end of a replay, and its graph; None for a run without an instant."""
    followed: list[tuple[RunState, Graph]] = []

    def watch(graph: Graph, instant: tuple[Any, ...]) -> None:
        if not followed:
            followed.append((RunState(graph), graph))
        followed[0][0].update(EngineUpdate(0, [instant], []))

    replay_run(run, ReplayOptions(watch=watch))
    return followed[0] if followed else None


def _explain_noted(end: RunEnd, reason: str) -> StopExplanation:
    """What the note states; `reason`: why there is no chain of causes, for the long text."""
    summary = f"{_title(end.pipeline, end.began)} {explain_end(end.stop, end.cause)}"
    return StopExplanation(summary, f"{summary} {reason}" if end.stop is not None else summary)


def _title(pipeline: str, began: int) -> str:
    begun = time.localtime(began / SECOND)
    return f"The run of {Path(pipeline).stem}, {time.strftime('%F %R', begun)}."
