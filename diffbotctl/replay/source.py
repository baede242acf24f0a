"""What a recording says of its run: enough to assemble the same pipeline again."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.drivers.robot_link import VIRTUAL_PORTS
from diffbotctl.messages import Goal, Message
from diffbotctl.messages import Path as Waypoints
from diffbotctl.recording.info import readable_recording, require_complete
from diffbotctl.recording.mcap_file import RecordingReader


class RecordedRun(NamedTuple):
    """A run as its recording tells it.

    `last` is the time in ns of its last instant; `state` is where a flight begins that has lost the
    run's beginning, as (time in ns, bytes); `spoken` are the operator's messages. `wires` are all
    that the run had, also those that never spoke.
    """

    path: Path
    about: dict[str, str]
    end: dict[str, str] | None
    last: int
    state: tuple[int, bytes] | None
    spoken: tuple[tuple[str, Message], ...]
    wires: tuple[str, ...]

    @property
    def begins(self) -> str:
        """`run`: at its start; `state`: later, in a known state; `unknown`: later, in none."""
        return self.about.get("flight", "run")

    @property
    def is_flight(self) -> bool:
        """Whether it holds what drivers delivered and nothing else."""
        return "flight" in self.about

    @property
    def real(self) -> bool:
        """Whether a real robot drove."""
        return self.about["port"] not in VIRTUAL_PORTS

    def goals(self) -> list[Goal]:
        """The goals that were handed out, in order."""
        said = [m for _, m in self.spoken if isinstance(m, Goal) and m.number]
        return list({goal.number: goal for goal in said}.values())

    def is_driven(self) -> bool:
        """Whether a person did more than wait: then nobody knows what they would do another time.

        A path that a block gave is no person; goals that the files do not hold are.
        """
        if any(wire in BY_PEOPLE for wire, _ in self.spoken):
            return True
        given = json.loads(self.about.get("goals", "[]"))
        paths = any(isinstance(message, Waypoints) for _, message in self.spoken)
        return not paths and len(self.goals()) > len(given)


BY_PEOPLE = (
    "operator.twist",
    "operator.halt",
    "operator.resume",
    "operator.setting",
    "operator.call",
)


def read_run(path: Path) -> RecordedRun:
    """Read through the recording at `path`. Raises RunError for a file that is none."""
    reader = RecordingReader(path)
    spoken: list[tuple[str, Message]] = []
    last = 0
    with readable_recording(path):
        for item in reader.messages():
            last = max(last, item.time)
            if item.wire.startswith("operator."):
                spoken.append((item.wire, item.message))
    require_complete(reader)
    if reader.end is not None:
        last = int(reader.end["last"])
    return RecordedRun(
        path, reader.about, reader.end, last, reader.state, tuple(spoken), tuple(reader.wires)
    )


@contextmanager
def recorded_configuration(run: RecordedRun, sets: tuple[str, ...] = ()) -> Iterator[Configuration]:
    """The configuration that the recording carries, with `sets` on top of its own.

    Its files stand in a folder that is gone afterwards. Raises ConfigurationError.
    """
    with tempfile.TemporaryDirectory() as folder:
        places = _written(json.loads(run.about["files"]), Path(folder))
        robot = places.get(run.about["robot"])
        yield load(
            str(places[run.about["pipeline"]]),
            None if robot is None else str(robot),
            [*json.loads(run.about["sets"]), *sets],
            real=False,
        )


def _written(files: dict[str, str], folder: Path) -> dict[str, Path]:
    """Each file in a folder of its own, with all the others beside it: one may include another."""
    places: dict[str, Path] = {}
    for number, (name, text) in enumerate(files.items()):
        parent = folder / str(number)
        parent.mkdir()
        places[name] = parent / Path(name).name
        places[name].write_text(text)
    for place in places.values():
        for other in places.values():
            beside = place.parent / other.name
            if not beside.exists():
                beside.write_text(other.read_text())
    return places


def goals_given(run: RecordedRun) -> tuple[Goal, ...]:
    """The goals with which the run began."""
    return tuple(Goal(*values) for values in json.loads(run.about.get("goals", "[]")))
