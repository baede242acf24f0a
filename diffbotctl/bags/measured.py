"""The metrics of a recording."""

from __future__ import annotations

import json
from pathlib import Path

from diffbotctl.bags.metrics import Measure, Metrics
from diffbotctl.bags.source import readable, whole
from diffbotctl.hub.recording import RecordingReader


def measured(path: Path, begin: int = 0, until: int | None = None) -> Metrics:
    """The metrics of the recording at `path`, from `begin` to before `until` (ns).

    What was said before `begin` still counts as known: the pose, the goal, what held the robot.
    Raises RunError for a file that is no recording.
    """
    reader = RecordingReader(path)
    measure = Measure()
    with readable(path):
        for item in reader.messages():
            if until is not None and item.time >= until:
                break
            measure.take(item.time, item.wire, item.message)
            if item.time < begin:
                measure.forget()
    whole(reader)
    return measure.metrics(truth_of(reader.end) if until is None else None)


def truth_of(end: dict[str, str] | None) -> tuple[float, float] | None:
    """The true final place (x, y) in m of a simulated robot, where the recording tells it."""
    told = (end or {}).get("truth")
    if not told:
        return None
    x, y = json.loads(told)[:2]
    return float(x), float(y)
