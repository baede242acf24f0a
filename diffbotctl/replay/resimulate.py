"""Driving a recorded simulated run once more with something changed: the robot answers anew."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from diffbotctl.recording.metrics import recorded_metrics
from diffbotctl.replay import source
from diffbotctl.replay.replay import ReplayOptions, ReplayResult
from diffbotctl.replay.source import RecordedRun
from diffbotctl.runs.control_socket import SocketOptions
from diffbotctl.runs.run import Run, RunOptions
from diffbotctl.time import NEVER, SECOND

PATIENCE = 10  # times the recorded run's length; one that never comes to an end is ended then


def why_not_resimulable(run: RecordedRun) -> str | None:
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


def resimulate(run: RecordedRun, wanted: ReplayOptions) -> ReplayResult:
    """Simulate the run again with `wanted.sets`: same robot, same seed, same goals, other motion.

    Raises ConfigurationError for wrong `sets`, RunError when `wanted.record` cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = wanted.record or Path(folder) / "once_more.mcap"
        with source.recorded_configuration(run, wanted.sets) as configuration:
            options = RunOptions(
                goals=source.goals_given(run),
                seed=int(run.about["seed"]),
                fast=wanted.speed is None,
                duration=_limit(run, wanted),
                record=path,
                digest=True,
                socket=SocketOptions() if wanted.dash else None,
                dash=wanted.dash,
            )
            result = Run(configuration, options, wanted.show).go()
        if result.failure is not None:
            raise result.failure
        until = wanted.until if wanted.until < NEVER else None
        metrics = recorded_metrics(path, wanted.begin, until)
    version = run.about.get("version", "")
    return ReplayResult(result.ending, result.digest or "", 0, None, version, metrics, "run")


def _limit(run: RecordedRun, wanted: ReplayOptions) -> float:
    told = json.loads(run.about.get("duration", "null"))
    longest = told if told is not None else PATIENCE * run.last / SECOND
    return float(min(longest, wanted.until / SECOND))
