"""Running a recording again, from nothing but the file: configuration, version and inputs."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.engine.changes import Changes
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.digest import Digest
from diffbotctl.engine.loop import Ending, Engine
from diffbotctl.engine.replay import Checker, Difference, Replay
from diffbotctl.errors import Problem, RunError
from diffbotctl.graph import NEVER
from diffbotctl.hub.recording import RecordingReader
from diffbotctl.runs.assembly import assemble


class Replayed(NamedTuple):
    """What a replay came to. `compared` counts messages; `difference` is the first one, or None."""

    ending: Ending
    digest: str
    compared: int
    difference: Difference | None
    version: str


def replay(path: Path, check: bool) -> Replayed:
    """Replay the recording at `path`; with `check`, compare every message with the recorded one.

    Raises RunError for a file that is no recording, or one that is incomplete and to be checked.
    """
    about, end = _read_ends(path)
    if check and end is None:
        cause = "the recording is incomplete: it was cut, or the disk was full"
        fix = "replay it without --check, up to where it ends"
        raise RunError(Problem("E-RECORDING-CUT", str(path), cause, fix))
    with tempfile.TemporaryDirectory() as folder:
        configuration = _configuration(about, Path(folder))
    graph = assemble(configuration, about["port"] not in ("sim", "emulated")).graph
    digest = Digest(graph.kinds)
    checker = Checker(graph.kinds, RecordingReader(path).messages())

    def record(instant: tuple[Any, ...]) -> None:
        digest.record(instant)
        if check:
            checker.record(instant)

    driver = Replay(RecordingReader(path).messages())
    sinks = {wire: [sink] for wire, sink in Changes(graph, {}).sinks().items()}
    engine = Engine(graph, [driver], VirtualClock(), sinks=sinks, record=record)
    until = int(end["last"]) + 1 if end is not None else _last_delivery(path) + 1
    ending = engine.run(min(until, NEVER))
    if check:
        checker.finish()
    return Replayed(
        ending, digest.text(), checker.compared, checker.difference, about.get("version", "")
    )


def _read_ends(path: Path) -> tuple[dict[str, str], dict[str, str] | None]:
    reader = RecordingReader(path)
    try:
        for _ in reader.messages():
            pass
    except OSError as error:
        problem = Problem("E-RECORDING", str(path), f"cannot read it: {error.strerror}", "")
        raise RunError(problem) from error
    if not reader.about:
        cause = "this is no recording of diffbotctl"
        raise RunError(Problem("E-RECORDING", str(path), cause, "make one: run goal --record FILE"))
    return reader.about, reader.end


def _last_delivery(path: Path) -> int:
    return max((item.time for item in RecordingReader(path).messages()), default=0)


def _configuration(about: dict[str, str], folder: Path) -> Configuration:
    """The configuration that the recording carries, written out and read as files are."""
    places: dict[str, Path] = {}
    for number, (name, text) in enumerate(json.loads(about["files"]).items()):
        parent = folder / str(number)
        parent.mkdir()
        places[name] = parent / Path(name).name
        places[name].write_text(text)
    for place in places.values():  # what a file includes stands beside it
        for other in places.values():
            beside = place.parent / other.name
            if not beside.exists():
                beside.write_text(other.read_text())
    robot = places.get(about["robot"])
    return load(
        str(places[about["pipeline"]]), None if robot is None else str(robot),
        json.loads(about["sets"]), real=False,
    )  # fmt: skip
