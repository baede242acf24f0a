"""What a run writes and shows: recording or black box, log file, screen, control socket, digest.

Files, screens and sockets belong to child processes; here are the engine's ends of their channels.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from diffbotctl import __version__
from diffbotctl.config.configuration import Configuration
from diffbotctl.drivers.robot_ports import is_simulated_port
from diffbotctl.engine.loop import RunOutcome
from diffbotctl.errors import Problem, RunError
from diffbotctl.graph import LOG, Sink
from diffbotctl.messages import Goal
from diffbotctl.processes import child_process, screen
from diffbotctl.processes.child_process import resume, wait_for_exit
from diffbotctl.processes.screen import RunSnapshot, ScreenFeed
from diffbotctl.recording.black_box import BlackBox
from diffbotctl.recording.black_box_store import BlackBoxStore, RunMetadata
from diffbotctl.recording.recorder import Recorder, last_line, log_sink, open_log
from diffbotctl.recording.viewer_model import viewer_model
from diffbotctl.recording.writer import RecordingHeader, start_recorder
from diffbotctl.render.map_scene import describe_scene
from diffbotctl.runs.build_graph import Assembly, RobotAssembly
from diffbotctl.runs.options import RunOptions

if TYPE_CHECKING:
    from diffbotctl.recording.digest import RunDigest
    from diffbotctl.runs.control_socket import RunControlSocket

Report = Callable[[str], None]
Show = Callable[[Iterator[RunSnapshot]], None]
Instant = tuple[Any, ...]


class RunReports(NamedTuple):
    """What the outputs ask of their run, and where they report."""

    facts: Callable[[], dict[str, str]]  # metadata of the recording; reads all files
    progress: Callable[[], tuple[int, int]]  # goals reached, and goals in all
    take_snapshot: Callable[[], bytes | None]  # the state of all blocks; raises StateError
    announce: Report  # called with each black box file that was written
    loss: Report  # called once for each file that can no longer be written
    screen_closed: Callable[[], None] | None = None


class RunOutputs:
    """All outputs of one run; those that its options do not ask for are None."""

    def __init__(
        self,
        configuration: Configuration,
        assembly: Assembly,
        options: RunOptions,
        reports: RunReports,
        show: Show | None,
    ) -> None:
        """Fork the children. `show` draws the screen. Raises RunError."""
        self.configuration, self.assembly = configuration, assembly
        self.wires = assembly.graph.wires
        self.children: list[int] = []
        self.screen: ScreenFeed | None = None
        self.recorder: Recorder | None = None
        self.black_box: BlackBox | None = None
        self.log_file: Recorder | None = None
        self.control_sockets: list[RunControlSocket] = []  # one for each robot
        self.digest = _start_digest(assembly.graph.kinds) if options.digest else None
        if show is not None:
            channel, pid = screen.start_screen(show, options.dash, is_paced=not options.fast)
            self.children.append(pid)
            self.screen = ScreenFeed(channel, reports.progress, reports.screen_closed)
        store = self._start_recording(configuration, assembly, options, reports)
        if options.log is not None:
            self.log_file, pid = open_log(configuration, options.log, options.fast, reports.loss)
            self.children.append(pid)
        self._start_socket(configuration, assembly, options, store)

    def _start_recording(
        self,
        configuration: Configuration,
        assembly: Assembly,
        options: RunOptions,
        reports: RunReports,
    ) -> BlackBoxStore | None:
        """Start the recording; without one the black box, whose store is returned."""
        if options.record is not None:
            path = options.record

            def lost(cause: str) -> None:
                text = f"RECORDING STOPPED: {path}: {cause}"
                reports.loss(f"{text}; the run continues, the file is incomplete")

            self.recorder, pid = record_to(
                path, configuration, assembly, reports.facts(), options.fast, lost
            )
            self.children.append(pid)
        elif options.flights is not None and (configuration.robot or configuration.robots):
            self.black_box, store = start_black_box(
                options.flights, configuration, assembly, reports
            )
            return store
        return None

    def _start_socket(
        self,
        configuration: Configuration,
        assembly: Assembly,
        options: RunOptions,
        store: BlackBoxStore | None,
    ) -> None:
        """Start the process that serves the control socket and keeps the black box."""
        if options.socket is not None:
            # Imported late: without a socket none of its modules is needed.
            from diffbotctl.runs.control_socket import RunControlSocket

            for part in assembly.of_robots(configuration):
                self.control_sockets.append(
                    RunControlSocket(
                        options.socket.of_robot(part.name),
                        part.configuration,
                        part.assembly,
                        options.port,
                        store=store,
                        is_paced=not options.fast,
                    )
                )
                store = None  # it lives in the process of the first one
        elif store is not None:
            # Imported late: only a run with a black box needs it.
            from diffbotctl.control_socket import process

            self.children.append(process.start_black_box_process(store))

    def sinks(self) -> Iterator[tuple[str, Sink]]:
        """The wires that the screen and the log file follow."""
        if self.screen is not None:
            for wire in self.wires:
                yield wire, self.screen.add_line if wire == LOG else self.screen.sink(wire)
        if self.log_file is not None:
            yield LOG, log_sink(self.log_file)

    def record(self) -> Callable[[Instant], object] | None:
        takers: list[Callable[[Instant], object]] = [
            taker.record
            for taker in (self.recorder, self.black_box, self.digest)
            if taker is not None
        ]
        parts = self.assembly.of_robots(self.configuration)
        for part, control_socket in zip(parts, self.control_sockets, strict=False):
            taker = control_socket.channel.record
            takers.append(record_of_robot(part, self.wires, taker) if part.name else taker)
        if len(takers) < 2:
            return takers[0] if takers else None

        def record_all(instant: Instant) -> None:
            for take in takers:
                take(instant)

        return record_all

    def idle(self) -> Callable[[int], None] | None:
        """What to call in the engine's idle time, with its last time."""
        senders = (self.recorder, self.black_box, self.log_file)
        drains = [sender.drain for sender in senders if sender is not None]
        screen_feed = self.screen
        if screen_feed is None and not drains:
            return None

        def idle(now: int) -> None:
            for drain in drains:
                drain()
            if screen_feed is not None:
                screen_feed.idle(now)

        return idle

    def finish(self, ending: RunOutcome, last: int, truth: str) -> None:
        """Hand on what waits, and how the run ended.

        `last` is the time of the last instant, `truth` the JSON text of the simulated robot's pose.
        """
        self._resume_children()
        line = last_line(ending)
        if self.log_file is not None:
            self.log_file.record(line)
            self.log_file.close()
        for control_socket in self.control_sockets:
            blank = [None] * (control_socket.wires - 1)
            control_socket.channel.record((ending.time, *blank, line))
        summary = {
            "code": str(ending.code),
            "cause": ending.cause,
            "last": str(last),
            "digest": self.digest.text() if self.digest else "",
            "truth": truth,
        }
        if self.recorder is not None:
            self.recorder.close(summary)
        if self.black_box is not None:
            self.black_box.finish(summary)
        if self.screen is not None:
            self.screen.add_line(ending.time, line)
            self.screen.finish(max(last, 0), ending.cause, ending.code != 0)

    def _resume_children(self) -> None:
        """A suspended child would keep what it has received, and the end of the run waiting."""
        for pid in self.children:
            resume(pid)
        for control_socket in self.control_sockets:
            resume(control_socket.pid)

    def close(self) -> None:
        """Wait for the children to end; one that does not is killed."""
        for control_socket in self.control_sockets:
            control_socket.end()
        for pid in self.children:
            wait_for_exit(pid)
        if self.black_box is not None:  # last: no screen is left to draw over what it announces
            self.black_box.close()


def record_of_robot(
    part: RobotAssembly, wires: Sequence[str], take: Callable[[Instant], object]
) -> Callable[[Instant], object]:
    """What takes the instants of all robots, and passes on those of one, on its own wires."""
    place = {wire: number for number, wire in enumerate(wires, 1)}
    own = [place[part.prefix + wire] for wire in part.assembly.graph.wires if wire != LOG]
    pick = itemgetter(*own)
    empty = (None,) * len(own)

    def record(instant: Instant) -> None:
        messages, line = pick(instant), instant[-1]
        if line is not None:
            if line.source.startswith(part.prefix):
                take((instant[0], *messages, line._replace(source=line.source[len(part.prefix) :])))
            elif "." not in line.source:  # of the engine
                take((instant[0], *messages, line))
        elif messages != empty:
            take((instant[0], *messages, None))

    return record


def run_facts(
    configuration: Configuration, options: RunOptions, goals: Sequence[Goal]
) -> dict[str, str]:
    """Metadata that makes a recording self-contained: version, files, options."""
    robots = {name: _recorded(part.robot_file) for name, part in configuration.robots.items()}
    return {
        "version": __version__,
        "epoch": str(time.time_ns()),
        "pipeline": _recorded(configuration.file),
        "robot": _recorded(configuration.robot_file),
        "sets": json.dumps(configuration.settings),
        "port": options.port,
        **({"simulated": "yes"} if is_simulated_port(options.port) else {}),
        "seed": str(options.seed),
        "goals": json.dumps([list(goal) for goal in goals]),
        "duration": json.dumps(options.duration),
        **({"robots": json.dumps(robots)} if robots else {}),
        **({"code": json.dumps(configuration.code)} if configuration.code else {}),
        "files": json.dumps(
            {_recorded(file): file.read_text(encoding="utf-8") for file in configuration.files}
        ),
    }


def _recorded(file: Path | None) -> str:
    """The name of `file`; what of it is no UTF-8 cannot be recorded, and is replaced."""
    return "" if file is None else os.fsencode(file).decode("utf-8", "replace")


def record_to(
    path: Path,
    configuration: Configuration,
    assembly: Assembly,
    facts: dict[str, str],
    waits: bool,
    loss: Report,
) -> tuple[Recorder, int]:
    """Start recording to `path`. Returns the engine's end and the child's pid.

    `loss` is called once, with the cause, when no more can be written. Raises RunError.
    """
    graph = assembly.graph
    try:
        model = viewer_model(configuration, describe_scene(configuration, graph, facts["port"]))
        header = RecordingHeader(graph.kinds, len(graph.sources), facts, model)
        channel, pid = start_recorder(path, header, is_paced=not waits)
    except OSError as error:
        cause = f"cannot record there: {error.strerror}"
        raise RunError(Problem("E-RECORD", str(path), cause, "give another file")) from error

    return Recorder(channel, waits, loss), pid


def start_black_box(
    folder: Path, configuration: Configuration, assembly: Assembly, reports: RunReports
) -> tuple[BlackBox, BlackBoxStore]:
    """Both ends of the black box, which writes to `folder`: the engine's, and the store."""
    graph = assembly.graph
    wires = {wire: graph.kinds[wire] for wire in graph.sources}
    name = f"{datetime.now():%Y%m%d-%H%M%S}-{configuration.name}-{os.getpid()}"
    ours, theirs = socket.socketpair()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, child_process.BUFFER_BYTES)
    about = RunMetadata(folder, name, wires, reports.facts(), tuple(graph.kinds.values()))
    store = BlackBoxStore(theirs, about)

    def lost(cause: str) -> None:
        reports.loss(f"BLACK BOX STOPPED: {cause}; the last minutes of this run are not kept")

    box = BlackBox(ours, len(graph.sources), reports.take_snapshot, reports.announce, lost)
    return box, store


def _start_digest(wires: dict[str, type]) -> RunDigest:
    # Imported late: hashlib loads OpenSSL, 9 ms and 3 MB, and few runs want a digest.
    from diffbotctl.recording.digest import RunDigest

    return RunDigest(wires)
