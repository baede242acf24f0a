"""Driving a recorded simulated run once more with something changed: the robot answers anew."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from diffbotctl.bags.measured import measured
from diffbotctl.graph import NEVER, SECOND
from diffbotctl.runs import recorded
from diffbotctl.runs.again import Replayed, Wanted
from diffbotctl.runs.recorded import RecordedRun
from diffbotctl.runs.run import Options, Run
from diffbotctl.runs.station import Socket

PATIENCE = 10  # times the recorded run's length; one that never comes to an end is ended then


def obstacle_to(run: RecordedRun) -> str | None:
    """Why the robot of this recording cannot drive once more, in words; None when it can."""
    if run.about["port"] != "sim":
        return "a real or emulated robot drove, and its motion is as recorded"
    if run.begins != "run":
        return "the recording begins in the midst of a run"
    if run.is_driven():
        return "a person drove or gave goals, whose answer to another motion nobody knows"
    if "goals" not in run.about:
        return "the recording does not tell which goals it was given"
    return None


def drive_once_more(run: RecordedRun, wanted: Wanted) -> Replayed:
    """Simulate the run again with `wanted.sets`: same robot, same seed, same goals, other motion.

    Raises ConfigurationError for wrong `sets`, RunError when `wanted.record` cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = wanted.record or Path(folder) / "once_more.mcap"
        with recorded.configuration(run, wanted.sets) as configuration:
            options = Options(
                goals=recorded.goals_given(run), seed=int(run.about["seed"]),
                fast=wanted.speed is None, duration=_limit(run, wanted), record=path, digest=True,
                socket=Socket() if wanted.dash else None, dash=wanted.dash,
            )  # fmt: skip
            result = Run(configuration, options, wanted.show).go()
        if result.failure is not None:
            raise result.failure
        until = wanted.until if wanted.until < NEVER else None
        metrics = measured(path, wanted.begin, until)
    version = run.about.get("version", "")
    return Replayed(result.ending, result.digest or "", 0, None, version, metrics, "run")


def _limit(run: RecordedRun, wanted: Wanted) -> float:
    told = json.loads(run.about.get("duration", "null"))
    longest = told if told is not None else PATIENCE * run.last / SECOND
    return float(min(longest, wanted.until / SECOND))
