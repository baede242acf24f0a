"""One run: files in, a robot that was stopped out. Screens and recorder are its children."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl import __version__
from diffbotctl.config.configuration import Configuration
from diffbotctl.drivers.operator import Operator
from diffbotctl.drivers.person import Person
from diffbotctl.engine.changes import Changes
from diffbotctl.engine.clock import Clock, PacedClock, VirtualClock
from diffbotctl.engine.digest import Digest
from diffbotctl.engine.driver import Driver, RobotDriver
from diffbotctl.engine.loop import Ending, Engine
from diffbotctl.engine.recorder import Recorder
from diffbotctl.errors import Problem, RunError, UserError
from diffbotctl.graph import NEVER, Sink
from diffbotctl.hub import recorder_process, screen_process
from diffbotctl.hub.latest import Latest, Snapshot
from diffbotctl.messages import Duty, Goal, GoalState, Link, Odometry, Stop
from diffbotctl.messages import Path as Waypoints
from diffbotctl.runs.assembly import Assembly, assemble, wires_of
from diffbotctl.runs.real import serial_robot
from diffbotctl.runs.signals import Signals
from diffbotctl.runs.simulation import simulated, takes_duty
from diffbotctl.runs.station import Socket, Station

SECOND = 1_000_000_000


class Options(NamedTuple):
    """What the command line says of a run."""

    port: str = "sim"
    goals: tuple[Goal, ...] = ()
    seed: int = 0
    fast: bool = False
    duration: float | None = None  # s
    record: Path | None = None
    digest: bool = False
    socket: Socket | None = None  # None: nobody can speak to this run
    stay: bool = False
    dash: bool = False  # the screen drives as well


class Result(NamedTuple):
    """What a run came to, for the summary and the exit code."""

    ending: Ending
    failure: UserError | None
    reached: int
    goals: int
    stops: tuple[Stop, ...]
    odometry: Odometry | None
    truth: Any
    path: float
    link: Link | None
    digest: str | None
    recording: str | None  # why the recording is incomplete


class Run:
    """Everything of one run, wired; `go` runs it to its end."""

    def __init__(
        self,
        configuration: Configuration,
        options: Options,
        show: Callable[[Iterator[Snapshot]], None] | None = None,
        tell: Callable[[str], None] = print,
        signals: Signals | None = None,
        gone: Callable[[], None] | None = None,
    ) -> None:
        real = options.port not in ("sim", "emulated")
        self.configuration, self.options = configuration, options
        self.assembly: Assembly = assemble(configuration, real)
        self.children: list[int] = []
        self.latest: Latest | None = None
        self.recorder: Recorder | None = None
        self.tell = tell
        graph = self.assembly.graph
        # Children are forked before a port is open, so that none of them holds it.
        if show is not None:
            channel, pid = screen_process.start(show, options.dash)
            self.children.append(pid)
            self.latest = Latest(channel, self._progress, gone)
        if options.record is not None:
            self.recorder = self._recorder(options.record)
        self.digest = Digest(graph.kinds) if options.digest else None
        self.station: Station | None = None
        if options.socket is not None:
            self.station = Station(options.socket, configuration, self.assembly, options.port)
        self.robot = self._robot()
        self.changes = Changes(graph, {"robot": self.robot} if self.robot else {})
        self.seen: dict[str, Any] = {}
        self.travelled = 0.0
        self.operator = Operator(self._goals(), self._end)
        self.total = len(self.operator.waiting) + (self.operator.under_way is not None)
        self.operator.stays = options.stay
        drivers: list[Driver] = [*([self.robot] if self.robot else []), self.operator]
        self.person: Person | None = None
        if self.station is not None:
            self.person = self.station.person(
                self.operator, self.changes, real or self.robot is None
            )
            drivers.append(self.person)
        self.engine = Engine(
            graph,
            drivers,
            self._clock(real),
            robot=self.robot,
            sinks=self._sinks(),
            record=self._record(),
            idle=self._idle(),
            signals=signals,
        )

    def go(self) -> Result:
        """Run; stop the robot; end the children. Never raises for what happened in the run."""
        options = self.options
        until = NEVER if options.duration is None else round(options.duration * SECOND)
        ending = self.engine.run(until)
        incomplete = self._close(ending)
        operator = self.operator
        plant = getattr(self.robot, "robot", None)
        return Result(
            ending=ending,
            failure=self.engine.failure,
            reached=operator.reached,
            goals=max(self.total, operator.number),
            stops=tuple(operator.stops),
            odometry=self.seen.get("odometry"),
            truth=plant.truth() if plant is not None else None,
            path=self.travelled,
            link=self.seen.get("link"),
            digest=self.digest.text() if self.digest else None,
            recording=incomplete,
        )

    def _end(self, code: int, cause: str) -> None:
        self.engine.end(code, cause)

    def _progress(self) -> tuple[int, int]:
        return self.operator.reached, max(self.total, self.operator.number)

    def _goals(self) -> list[Goal]:
        if self.options.goals:
            return list(self.options.goals)
        return [Goal(0, 0, g.x, g.y, g.heading) for g in self.configuration.goals]

    def _clock(self, real: bool) -> Clock:
        if real:
            return PacedClock(exact=False)
        return VirtualClock() if self.options.fast else PacedClock(exact=True)

    def _robot(self) -> RobotDriver | None:
        if self.configuration.robot is None:
            return None
        if self.options.port == "sim":
            return simulated(self.configuration, self.options.seed)
        if self.options.port == "emulated":
            from diffbotctl.runs.emulation import emulated  # needs a compiler: only when asked

            return emulated(self.configuration, self.options.seed)
        return serial_robot(self.configuration.robot, self.options.port, self.tell)

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks: dict[str, list[Sink]] = {}

        def add(wire: str, sink: Sink) -> None:
            sinks.setdefault(wire, []).append(sink)

        if self.assembly.command is not None and self.robot is not None:
            add(self.assembly.command, self._command(self.robot))
        for wire in wires_of(self.assembly, GoalState):
            add(wire, lambda now, state: self.operator.hear_goal_state(now, state))
        for wire in wires_of(self.assembly, Waypoints):
            add(wire, self.operator.hear_path)
        for wire in wires_of(self.assembly, Stop):
            add(wire, self.operator.hear_stop(wire))
        for wire in wires_of(self.assembly, Odometry):
            add(wire, self._note_odometry)
        for wire, sink in self.changes.sinks().items():
            add(wire, sink)
        if self.configuration.robot is not None:
            add("robot.link", self._note_link)
        if self.latest is not None:
            for wire in self.assembly.graph.wires:
                add(wire, self.latest.sink(wire))
        return sinks

    def _command(self, robot: RobotDriver) -> Sink:
        duty = self.configuration.robot is not None and takes_duty(self.configuration.robot)

        def leave(now: int, wanted: Any) -> None:
            if self.engine.ending is not None:
                return  # the final stop is under way
            if duty and not (abs(wanted.left) <= 1.0 and abs(wanted.right) <= 1.0):
                wanted = Duty(now, 0.0, 0.0)
                self._end(1, "a motor duty is beyond 1 or not a number")
            robot.command(now, wanted)

        return leave

    def _note_odometry(self, now: int, odometry: Odometry) -> None:
        last = self.seen.get("odometry")
        if last is not None:
            step = (odometry.time - last.time) / SECOND
            self.travelled += abs(odometry.linear) * max(step, 0.0)
        self.seen["odometry"] = odometry

    def _note_link(self, now: int, link: Link) -> None:
        self.seen["link"] = link

    def _record(self) -> Callable[[tuple[Any, ...]], object] | None:
        takers: list[Callable[[tuple[Any, ...]], object]] = [
            each.record
            for each in (self.recorder, self.digest, self.station.channel if self.station else None)
            if each is not None
        ]
        if len(takers) < 2:
            return takers[0] if takers else None

        def all_of_them(instant: tuple[Any, ...]) -> None:
            for take in takers:
                take(instant)

        return all_of_them

    def _idle(self) -> Callable[[], None] | None:
        recorder, latest, person = self.recorder, self.latest, self.person
        if latest is None and person is None:
            return None if recorder is None else recorder.drain

        def idle() -> None:
            if person is not None:
                person.idle(self.engine.last)
            if recorder is not None:
                recorder.drain()
            if latest is not None:
                latest.idle(self.engine.last)

        return idle

    def _recorder(self, path: Path) -> Recorder:
        graph = self.assembly.graph
        try:
            channel, pid = recorder_process.start(
                path, graph.kinds, len(graph.sources), self._about()
            )
        except OSError as error:
            cause = f"cannot record there: {error.strerror}"
            raise RunError(Problem("E-RECORD", str(path), cause, "give another file")) from error
        self.children.append(pid)

        def lost(cause: str) -> None:
            self.tell(
                f"RECORDING STOPPED: {path}: {cause}; the run goes on, the file is incomplete"
            )

        return Recorder(channel, waits=self.options.fast, tell=lost)

    def _about(self) -> dict[str, str]:
        """What explains a recording by itself: version, files, options."""
        files = {str(file): file.read_text() for file in self.configuration.files}
        import json

        return {
            "version": __version__,
            "epoch": str(time.time_ns()),
            "pipeline": str(self.configuration.file),
            "robot": str(self.configuration.robot_file or ""),
            "sets": json.dumps(self.configuration.settings),
            "port": self.options.port,
            "seed": str(self.options.seed),
            "files": json.dumps(files),
        }

    def _close(self, ending: Ending) -> str | None:
        incomplete = None
        if self.recorder is not None:
            summary = {
                "code": str(ending.code),
                "cause": ending.cause,
                "last": str(self.engine.last),
                "digest": self.digest.text() if self.digest else "",
            }
            self.recorder.close(summary)
            incomplete = self.recorder.lost
        if self.latest is not None:
            self.latest.finish(max(self.engine.last, 0))
        for driver in self.engine.drivers:
            driver.close()
        self.engine.clock.close()
        if self.station is not None:
            self.station.end()
        for pid in self.children:
            with suppress(ChildProcessError):
                os.waitpid(pid, 0)
        return incomplete
