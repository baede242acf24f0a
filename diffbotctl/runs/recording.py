"""What a run writes down about itself: the recording that was asked for, or else the flight."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

from diffbotctl import __version__
from diffbotctl.config.configuration import Configuration
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Goal
from diffbotctl.processes import child_process
from diffbotctl.recording.black_box import BlackBox
from diffbotctl.recording.black_box_store import BlackBoxStore, RunMetadata
from diffbotctl.recording.recorder import Recorder
from diffbotctl.recording.writer import RecordingHeader, start_recorder
from diffbotctl.runs.build_graph import Assembly, mounts

Tell = Callable[[str], None]


def run_facts(
    configuration: Configuration,
    port: str,
    seed: int,
    goals: Sequence[Goal],
    duration: float | None,
) -> dict[str, str]:
    """What explains a recording by itself: version, files, options. `duration` is in s."""
    files = {str(file): file.read_text() for file in configuration.files}
    return {
        "version": __version__,
        "epoch": str(time.time_ns()),
        "pipeline": str(configuration.file),
        "robot": str(configuration.robot_file or ""),
        "sets": json.dumps(configuration.settings),
        "port": port,
        "seed": str(seed),
        "goals": json.dumps([list(goal) for goal in goals]),
        "duration": json.dumps(duration),
        "files": json.dumps(files),
    }


def start_run_recorder(
    path: Path,
    configuration: Configuration,
    assembly: Assembly,
    facts: dict[str, str],
    waits: bool,
    tell: Tell,
) -> tuple[Recorder, int]:
    """Start recording to `path`. Returns the engine's end and the child's pid. Raises RunError."""
    graph = assembly.graph
    try:
        header = RecordingHeader(graph.kinds, len(graph.sources), facts, mounts(configuration))
        channel, pid = start_recorder(path, header)
    except OSError as error:
        cause = f"cannot record there: {error.strerror}"
        raise RunError(Problem("E-RECORD", str(path), cause, "give another file")) from error

    def lost(cause: str) -> None:
        tell(f"RECORDING STOPPED: {path}: {cause}; the run goes on, the file is incomplete")

    return Recorder(channel, waits, lost), pid


def start_black_box(
    folder: Path,
    configuration: Configuration,
    assembly: Assembly,
    facts: dict[str, str],
    snapshot: Callable[[], bytes | None],
    announce: Tell,
    tell: Tell,
) -> tuple[BlackBox, BlackBoxStore]:
    """Both ends of the flight recorder, which writes to `folder`: the engine's, and the hub's.

    `announce` is called with each file that was written, `tell` once when it has failed.
    """
    graph = assembly.graph
    wires = {wire: graph.kinds[wire] for wire in graph.sources}
    name = f"{datetime.now():%Y%m%d-%H%M%S}-{configuration.name}-{os.getpid()}"
    ours, theirs = socket.socketpair()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, child_process.BUFFER_BYTES)
    keeper = BlackBoxStore(theirs, RunMetadata(folder, name, wires, facts))

    def lost(cause: str) -> None:
        tell(f"FLIGHT RECORDER STOPPED: {cause}; the last minutes of this run are not kept")

    return BlackBox(ours, len(graph.sources), snapshot, announce, lost), keeper
