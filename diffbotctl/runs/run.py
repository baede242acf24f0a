"""One run: files in, a robot that was stopped out. Screens and recorder are its children."""

from __future__ import annotations

import gc
import json
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.robot_link import VIRTUAL_PORTS, is_duty_board
from diffbotctl.engine.clock import Clock, PacedClock, VirtualClock
from diffbotctl.engine.driver import Driver, RobotDriver
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.engine.loop import Engine, RunOutcome
from diffbotctl.errors import UserError
from diffbotctl.graph import LOG, Sink
from diffbotctl.messages import Duty, Goal, GoalState, Link, Odometry, Stop
from diffbotctl.messages import Path as Waypoints
from diffbotctl.processes import screen
from diffbotctl.processes.screen import RunSnapshot, ScreenFeed
from diffbotctl.recording import recorder as recorder_module
from diffbotctl.recording import snapshot
from diffbotctl.recording.black_box import BlackBox
from diffbotctl.recording.comparison import RunDigest
from diffbotctl.recording.recorder import Recorder
from diffbotctl.runs import recording as recording_module
from diffbotctl.runs.build_graph import Assembly, assemble, sources, wires_of
from diffbotctl.runs.signals import Signals
from diffbotctl.time import NEVER, SECOND

if TYPE_CHECKING:
    from diffbotctl.control_socket.command_driver import ControlClientDriver
    from diffbotctl.recording.black_box_store import BlackBoxStore
    from diffbotctl.runs.control_socket import RunControlSocket, SocketOptions


class RunOptions(NamedTuple):
    """What the command line says of a run."""

    port: str = "sim"
    goals: tuple[Goal, ...] = ()
    seed: int = 0
    fast: bool = False
    duration: float | None = None  # s
    record: Path | None = None
    digest: bool = False
    socket: SocketOptions | None = None  # None: nobody can speak to this run
    stay: bool = False
    dash: bool = False  # the screen drives as well
    log: Path | None = None
    levels: tuple[tuple[str, str], ...] = ()  # of the log: source and level
    flights: Path | None = None  # folder for the last minutes before a stop; None: not kept


class RunResult(NamedTuple):
    """What a run came to, for the summary and the exit code."""

    ending: RunOutcome
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
        options: RunOptions,
        show: Callable[[Iterator[RunSnapshot]], None] | None = None,
        tell: Callable[[str], None] = print,
        signals: Signals | None = None,
        gone: Callable[[], None] | None = None,
    ) -> None:
        real = options.port not in VIRTUAL_PORTS
        self.configuration, self.options = configuration, options
        self.assembly: Assembly = assemble(configuration, real)
        self.reckoned = wires_of(self.assembly, Odometry)
        self.children: list[int] = []
        self.latest: ScreenFeed | None = None
        self.recorder: Recorder | None = None
        self.tell = tell
        graph = self.assembly.graph
        # Children are forked before a port is open, so that none of them holds it; and after the
        # last collection that walks all objects, which writes to the memory that they share.
        gc.collect()
        gc.freeze()
        if show is not None:
            channel, pid = screen.start_screen(show, options.dash)
            self.children.append(pid)
            self.latest = ScreenFeed(channel, self._progress, gone)
        self.log: Recorder | None = None
        self.flight: BlackBox | None = None
        keeper = self._write_down()
        self.digest = RunDigest(graph.kinds) if options.digest else None
        self.station = self._hub(keeper)
        self.robot = self._robot()
        self.changes = LiveChanges(graph, {"robot": self.robot} if self.robot else {})
        self.seen: dict[str, Any] = {}
        self.travelled = 0.0
        self.operator = Operator(self._goals(), self._end)
        self.total = len(self.operator.waiting) + (self.operator.under_way is not None)
        self.operator.stays = options.stay
        for source, level in options.levels:
            self.operator.set_level(0, source, level)
        drivers: list[Driver] = [*([self.robot] if self.robot else []), self.operator]
        self.person: ControlClientDriver | None = None
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
        if self.person is not None:
            self.person.can_measure(self.engine)

    def go(self) -> RunResult:
        """Run; stop the robot; end the children. Never raises for what happened in the run."""
        options = self.options
        until = NEVER if options.duration is None else round(options.duration * SECOND)
        ending = self.engine.run(until)
        incomplete = self._close(ending)
        operator = self.operator
        return RunResult(
            ending=ending,
            failure=self.engine.failure,
            reached=operator.reached,
            goals=max(self.total, operator.number),
            stops=tuple(operator.stops),
            odometry=self.seen.get("odometry"),
            truth=self._truth(),
            path=self.travelled,
            link=self.seen.get("link"),
            digest=self.digest.text() if self.digest else None,
            recording=incomplete,
        )

    def _truth(self) -> Any:
        """The plant's truth, its pose in the frame in which goals were given."""
        plant = getattr(self.robot, "robot", None)
        if plant is None:
            return None
        truth = plant.truth()
        return truth if self.reckoned else truth._replace(pose=plant.truth_in_world())

    def _seen_from_above(self) -> list[str]:
        """The wires on which cameras tell the pose, where no block reckons it."""
        kinds = sources(self.configuration.robot)
        return [wire for wire, kind in kinds.items() if kind is Odometry]

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
        # Imported late: a run on a real port needs neither plant nor emulator.
        if self.options.port == "sim":
            from diffbotctl.drivers.simulated_robot import simulated_robot_driver

            return simulated_robot_driver(self.configuration, self.options.seed)
        if self.options.port == "emulated":
            from diffbotctl.emulator.emulated_robot import emulated_robot_driver

            return emulated_robot_driver(self.configuration, self.options.seed)
        from diffbotctl.drivers.serial_robot import open_serial_robot

        return open_serial_robot(self.configuration.robot, self.options.port, self.tell)

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
            if self.flight is not None:
                add(wire, self.flight.stop)
        for wire in self.reckoned or self._seen_from_above():
            add(wire, self._note_odometry)
        for wire, sink in self.changes.sinks().items():
            add(wire, sink)
        if self.configuration.robot is not None:
            add("robot.link", self._note_link)
        self._watchers(add)
        return sinks

    def _watchers(self, add: Callable[[str, Sink], None]) -> None:
        """The sinks of what only looks: the screen, and the log's file."""
        if self.latest is not None:
            for wire in self.assembly.graph.wires:
                add(wire, self.latest.sink(wire) if wire != LOG else self.latest.hear)
        if self.log is not None:
            add(LOG, recorder_module.log_sink(self.log))

    def _command(self, robot: RobotDriver) -> Sink:
        duty = self.configuration.robot is not None and is_duty_board(self.configuration.robot)

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
            for each in (
                self.recorder,
                self.flight,
                self.digest,
                self.station.channel if self.station else None,
            )
            if each is not None
        ]
        if len(takers) < 2:
            return takers[0] if takers else None

        def all_of_them(instant: tuple[Any, ...]) -> None:
            for take in takers:
                take(instant)

        return all_of_them

    def _idle(self) -> Callable[[], None] | None:
        recorder = self.recorder or self.flight
        latest, person, log = self.latest, self.person, self.log
        if latest is None and person is None and log is None:
            return None if recorder is None else recorder.drain

        def idle() -> None:
            if person is not None:
                person.idle(self.engine.last_instant)
            if recorder is not None:
                recorder.drain()
            if log is not None:
                log.drain()
            if latest is not None:
                latest.idle(self.engine.last_instant)

        return idle

    def _write_down(self) -> BlackBoxStore | None:
        """Start the recording that was asked for, and the log. Without a recording a flight is
        kept: returns the hub's end of it."""
        keeper = None
        options, tell = self.options, self._tell_loss
        facts = recording_module.run_facts(
            self.configuration, options.port, options.seed, self._goals(), options.duration
        )
        if options.record is not None:
            self.recorder, pid = recording_module.start_run_recorder(
                options.record, self.configuration, self.assembly, facts, options.fast, tell
            )
            self.children.append(pid)
        elif options.flights is not None and self.configuration.robot is not None:
            self.flight, keeper = recording_module.start_black_box(
                options.flights,
                self.configuration,
                self.assembly,
                facts,
                self._snapshot,
                self.tell,
                tell,
            )
        if options.log is not None:
            self.log, pid = recorder_module.open_log(
                self.configuration, options.log, options.fast, tell
            )
            self.children.append(pid)
        return keeper

    def _hub(self, keeper: BlackBoxStore | None) -> RunControlSocket | None:
        """Start the hub: with the control socket that is wanted, or for the flight alone."""
        wanted = self.options.socket
        if wanted is not None:
            from diffbotctl.runs.control_socket import RunControlSocket

            return RunControlSocket(
                wanted, self.configuration, self.assembly, self.options.port, store=keeper
            )
        if keeper is not None:
            from diffbotctl.control_socket import process

            self.children.append(process.start_black_box_process(keeper))
        return None

    def _snapshot(self) -> bytes | None:
        try:
            return snapshot.take_snapshot(self.engine)
        except snapshot.StateError:
            return None  # the flight then begins in a state unknown, and says so

    def _tell_loss(self, text: str) -> None:
        """Tell that a file cannot be written any longer: once, and in the log."""
        self.tell(text)
        self.operator.note(self.engine.last_instant, "error", "engine", text)

    def _say_the_end(self, ending: RunOutcome) -> None:
        """The last line: for files and watchers; a recording has its own record of the end."""
        line = recorder_module.last_line(ending)
        if self.log is not None:
            self.log.record(line)
        if self.latest is not None:
            self.latest.hear(ending.time, line)
        if self.station is not None:
            blank = [None] * (len(self.assembly.graph.wires) - 1)
            self.station.channel.record((ending.time, *blank, line))

    def _truth_text(self) -> str:
        """The simulated robot's true place as JSON [x, y, heading]; empty on a real one."""
        plant = getattr(self.robot, "robot", None)
        return "" if plant is None else json.dumps(list(plant.truth().pose))

    def _close(self, ending: RunOutcome) -> str | None:
        incomplete = None
        self._say_the_end(ending)
        if self.log is not None:
            self.log.close()
        summary = {
            "code": str(ending.code),
            "cause": ending.cause,
            "last": str(self.engine.last_instant),
            "digest": self.digest.text() if self.digest else "",
            "truth": self._truth_text(),
        }
        if self.recorder is not None:
            self.recorder.close(summary)
            incomplete = self.recorder.lost
        if self.flight is not None:
            self.flight.finish(summary)
        if self.latest is not None:
            self.latest.finish(max(self.engine.last_instant, 0))
        for driver in self.engine.drivers:
            driver.close()
        self.engine.clock.close()
        if self.station is not None:
            self.station.end()
        for pid in self.children:
            with suppress(ChildProcessError):
                os.waitpid(pid, 0)
        if self.flight is not None:  # when no screen draws any more over what it announces
            self.flight.close()
        return incomplete
