"""Simulating a recorded run again with something changed: the robot reacts to the change."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from diffbotctl.recording.metrics import recorded_metrics
from diffbotctl.replay.recorded_run import RecordedRun, recorded_configuration
from diffbotctl.replay.replay import ReplayOptions, ReplayResult, recording_lost
from diffbotctl.runs.options import RunOptions, SocketOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import NEVER, SECOND

DURATION_MAX_RATIO = 10  # to the recorded run; one that does not end by itself is ended then


def why_not_resimulable(run: RecordedRun) -> str | None:
    """Why this run cannot be simulated again; None when it can."""
    if run.about["port"] != "sim":
        return "a real or emulated robot drove, and its motion is as recorded"
    if run.begins != "run":
        return "the recording does not begin at the start of the run"
    if run.is_driven():
        return "a client drove or sent goals, and would have reacted to another motion"
    if run.has_published_messages:
        return "other programs published messages, and would have reacted to another motion"
    if "goals" not in run.about:
        return "the recording does not contain the goals of the run"
    return None


def resimulate(run: RecordedRun, options: ReplayOptions) -> ReplayResult:
    """Simulate the run again with `options.sets`: same robot, same seed, same goals, other motion.

    Raises ConfigurationError for wrong `sets`, RunError when `options.record` cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = options.record or Path(folder) / "resimulated.mcap"
        with recorded_configuration(run.path, run.about, options.sets) as configuration:
            run_options = RunOptions(
                goals=() if configuration.robots else run.initial_goals,
                seed=int(run.about["seed"]),
                fast=options.speed is None,
                duration=_duration(run, options),
                record=path,
                digest=True,
                socket=SocketOptions() if options.dash else None,
                dash=options.dash,
                rehearses=True,
            )
            result = Run(configuration, run_options, options.show).go()
        if result.recording is not None:
            raise recording_lost(path, result.recording)
        until = options.until if options.until < NEVER else None
        metrics = recorded_metrics(path, options.begin, until)
    version = run.about.get("version", "")
    return ReplayResult(
        result.ending,
        result.digest or "",
        0,
        None,
        version,
        metrics,
        "run",
        failure=result.failure,
    )


def _duration(run: RecordedRun, options: ReplayOptions) -> float:
    """Time limit of the simulation in s."""
    recorded = json.loads(run.about.get("duration", "null"))
    limit = DURATION_MAX_RATIO * run.last / SECOND if recorded is None else recorded
    return float(min(limit, options.until / SECOND))
