"""A recorded run: its files, options and inputs, enough to build and drive the same pipeline."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from diffbotctl import __version__
from diffbotctl.config.code_files import CodeFiles
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS
from diffbotctl.engine.driver import Delivery
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Goal, MapUpdate, Message
from diffbotctl.messages import Path as Waypoints
from diffbotctl.recording.reader import RecordedMessage, RecordingReader
from diffbotctl.recording.run_metadata import LIVE, check_replayable
from diffbotctl.time import NEVER

CLIENT_WIRES = (  # with messages that only a client of the control socket causes
    "operator.twist",
    "operator.halt",
    "operator.resume",
    "operator.setting",
    "operator.call",
)


class RecordedRun(NamedTuple):
    """Contents of a recording about its run.

    `last` is the time in ns of its last instant; `state` is the state, as (time in ns, bytes), from
    which a black box file starts when the beginning of the run is lost: None when another version
    of the program saved it, which has other blocks; `operator_messages` are
    (wire, message); `wires` are all wires of the run, also those without a message.
    """

    path: Path
    about: dict[str, str]
    end: dict[str, str] | None
    last: int
    state: tuple[int, bytes] | None
    operator_messages: tuple[tuple[str, Message], ...]
    wires: tuple[str, ...]
    has_published_messages: bool = False  # of clients and programs, on inputs of the pipeline
    is_cut: bool = False  # messages after its last one may be lost

    @property
    def begins(self) -> str:
        """`run`: at its start; `state`: later, in a known state; `unknown`: later, in none."""
        begins = self.about.get("flight", "run")
        return "unknown" if begins == "state" and self.state is None else begins

    @property
    def state_version(self) -> str | None:
        """The other version of the program that saved the state in the file."""
        has_state = self.about.get("flight") == "state" and self.state is None
        return self.about.get("version", "unknown") if has_state else None

    @property
    def is_black_box(self) -> bool:
        """Whether it holds what drivers delivered and nothing else."""
        return "flight" in self.about

    @property
    def real(self) -> bool:
        return self.about["port"] not in VIRTUAL_PORTS

    @property
    def initial_goals(self) -> tuple[Goal, ...]:
        return tuple(Goal(*values) for values in json.loads(self.about.get("goals", "[]")))

    def goals(self) -> list[Goal]:
        """All goals of the run, in order."""
        goals = [(w, m) for w, m in self.operator_messages if isinstance(m, Goal) and m.number]
        return list({(wire, goal.number): goal for wire, goal in goals}.values())

    def is_driven(self) -> bool:
        """Whether a client commanded anything, so that the run cannot be simulated again.

        Goals that are not in the files come from a client, unless a block gave a path.
        """
        if any(wire.endswith(CLIENT_WIRES) for wire, _ in self.operator_messages):
            return True
        paths = any(isinstance(message, Waypoints) for _, message in self.operator_messages)
        return not paths and len(self.goals()) > len(self.initial_goals)


def read_run(path: Path) -> RecordedRun:
    """Read the recording at `path`. Raises RunError for a file that is none."""
    reader = RecordingReader(path)
    operator_messages: list[tuple[str, Message]] = []
    has_published_messages = False
    last = 0
    for item in reader.messages():
        last = max(last, item.time)
        node = item.wire.rpartition(".")[0].rpartition(".")[2]  # without the name of a robot
        if node == "operator":
            operator_messages.append((item.wire, item.message))
        elif item.from_driver and node != "robot" and not isinstance(item.message, MapUpdate):
            has_published_messages = True
    if LIVE in reader.about:
        cause = "`bag record` made it of a running engine: it does not hold how the run began"
        fix = "replay one of `diffbotctl bag save`, or of `run --record`"
        raise RunError(Problem("E-RECORDING", str(path), cause, fix))
    try:
        check_replayable(reader.about)
    except ValueError as error:
        cause = f"metadata 'run': {error}"
        raise RunError(Problem("E-RECORDING", str(path), cause)) from error
    is_black_box = "flight" in reader.about
    # A black box file begins with its end record, other recordings end with it.
    is_cut = reader.cut is not None if is_black_box else reader.end is None
    if reader.end is not None and not is_cut:
        last = int(reader.end["last"])
    return RecordedRun(
        path,
        reader.about,
        reader.end,
        last,
        reader.state if reader.about.get("version") == __version__ else None,
        tuple(operator_messages),
        tuple(reader.wires),
        has_published_messages,
        is_cut,
    )


class ReplayDriver:
    """A driver that delivers what the drivers of a recorded run delivered, at the same times."""

    def __init__(self, recorded: Iterable[RecordedMessage]) -> None:
        self.instants = _deliveries(recorded)
        self.next = next(self.instants, None)

    def due(self) -> int:
        """The time of the next recorded delivery, in ns."""
        return NEVER if self.next is None else self.next[0]

    def files(self) -> list[int]:
        """None: nothing wakes the loop."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """All deliveries up to `now`."""
        deliveries: list[Delivery] = []
        while self.next is not None and self.next[0] <= now:
            deliveries += self.next[1]
            self.next = next(self.instants, None)
        return deliveries

    def close(self) -> None:
        """Nothing is open."""


def _deliveries(recorded: Iterable[RecordedMessage]) -> Iterator[tuple[int, list[Delivery]]]:
    for _, group in groupby(recorded, key=lambda item: item.instant):
        items = [item for item in group if item.from_driver]
        if items:
            yield items[0].time, [Delivery(item.wire, item.message) for item in items]


@contextmanager
def recorded_configuration(
    path: Path, about: Mapping[str, str], sets: tuple[str, ...] = ()
) -> Iterator[Configuration]:
    """The configuration that the recording at `path` carries, with `sets` on top of its own.

    `about`: metadata of its run, which `check_replayable` accepts. Its files are in a temporary
    folder. Files with code are not in it: they are searched for, by their hash, beside the
    recording and in the present folder. Raises ConfigurationError.
    """
    with tempfile.TemporaryDirectory() as folder:
        places = _write_files(json.loads(about["files"]), Path(folder))
        robot = places.get(about.get("robot", ""))
        robots: dict[str, str] = json.loads(about.get("robots", "{}"))
        yield load(
            str(places[about["pipeline"]]),
            None if robot is None else str(robot),
            [*json.loads(about["sets"]), *sets],
            real=False,
            robot_files={name: str(places[file]) for name, file in robots.items()},
            code=CodeFiles(json.loads(about.get("code", "{}")), (path.parent, Path.cwd())),
        )


def _write_files(files: dict[str, str], folder: Path) -> dict[str, Path]:
    """Write each file to its own folder, with copies of all others: one may include another."""
    places: dict[str, Path] = {}
    for number, (name, text) in enumerate(files.items()):
        parent = folder / str(number)
        parent.mkdir()
        places[name] = parent / Path(name).name
        places[name].write_text(text, encoding="utf-8")
    for place in places.values():
        for other in places.values():
            copy = place.parent / other.name
            if not copy.exists():
                copy.write_bytes(other.read_bytes())
    return places
