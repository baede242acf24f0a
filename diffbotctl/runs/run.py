"""One run: builds graph, drivers, clock and outputs; runs; stops the robot; closes everything."""

from __future__ import annotations

import gc
import json
from collections import defaultdict
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from diffbotctl.config.configuration import Configuration, SourceUse
from diffbotctl.drivers.device_sources import open_sources
from diffbotctl.drivers.named_robots import RobotGroup
from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS
from diffbotctl.drivers.virtual_sources import open_virtual_sources
from diffbotctl.engine.clock import Clock, PacedClock, VirtualClock
from diffbotctl.engine.driver import Driver, RobotDriver
from diffbotctl.engine.instant_monitor import InstantLimits, instant_limits
from diffbotctl.engine.loop import Engine, RunOutcome, SignalSource
from diffbotctl.errors import Problem, RunError, join_words
from diffbotctl.graph import Sink
from diffbotctl.log import ALL
from diffbotctl.messages import REACHED_UNSURE, Goal
from diffbotctl.processes.real_time import preferred_engine
from diffbotctl.recording import snapshot
from diffbotctl.runs.build_graph import assemble
from diffbotctl.runs.options import RunOptions, RunResult
from diffbotctl.runs.outputs import Report, RunOutputs, RunReports, Show, run_facts
from diffbotctl.runs.robot_run import PortRobot, RobotRun, all_goals, end_with_last, stops_of
from diffbotctl.time import NEVER, SECOND

if TYPE_CHECKING:
    from diffbotctl.programs.driver import ProgramsDriver


def _check_robots(configuration: Configuration, options: RunOptions) -> None:
    """Raise RunError where several robots cannot run."""
    if not configuration.robots:
        return
    if options.port != "sim":
        cause = f"several robots in one pipeline are simulated; {options.port} is one robot"
        fix = "start an engine for each robot, with --port and --name"
        raise RunError(Problem("E-SEVERAL-ROBOTS", str(configuration.file), cause, fix))
    if options.goals:
        cause = "there are several robots, and each has goals of its own"
        fix = "write goals in the files, or use `goto` with --engine"
        raise RunError(Problem("E-SEVERAL-ROBOTS", "--goal", cause, fix))


def _check_programs(configuration: Configuration, options: RunOptions) -> None:
    """Raise RunError where the programs of a pipeline may not or cannot run."""
    if not configuration.programs:
        return
    names = join_words([use.name for use in configuration.programs], "and")
    if options.fast:
        cause = f"{names} cannot keep up with a run that is faster than real time"
        raise RunError(Problem("E-PROGRAM", "programs", cause, "run it without --fast"))
    if options.programs is None:
        cause = f"this pipeline starts programs, which were not allowed: {names}"
        raise RunError(Problem("E-PROGRAM-CONSENT", "programs", cause, "give --allow-programs"))


def _check_sources(configuration: Configuration, options: RunOptions) -> None:
    """Raise RunError for devices in a run that follows no clock."""
    devices = [use.name for use in configuration.sources if use.cls.virtual_delay is None]
    if devices and options.fast:
        names = join_words(devices, "and")
        cause = f"the devices of {names} work in real time; this run is faster"
        raise RunError(Problem("E-SOURCE", "sources", cause, "run it without --fast"))


def _simulated(configuration: Configuration, seed: int) -> PortRobot:
    # Imported late: a run on a real port needs neither plant nor emulator.
    from diffbotctl.drivers.simulated_robot import simulated_robot_driver

    simulated = simulated_robot_driver(configuration, seed)
    return PortRobot(simulated, simulated.robot)


class GoalEnds(NamedTuple):
    """Goals reached, reached unsurely, and given; the one at which the first robot stands."""

    reached: int
    unsure: int
    goals: int
    last: Goal | None


class Run:
    """Everything of one run, connected; `go` runs it to its end."""

    def __init__(
        self,
        configuration: Configuration,
        options: RunOptions,
        show: Show | None = None,
        tell: Report = print,
        signals: SignalSource | None = None,
        screen_closed: Callable[[], None] | None = None,
    ) -> None:
        """`show` draws the screen in a process of its own; `tell` shows a message to the user.

        Raises RunError when an output cannot be written or the port cannot be opened.
        """
        self.configuration, self.options, self.tell = configuration, options, tell
        self.is_real = options.port not in VIRTUAL_PORTS
        _check_robots(configuration, options)
        self.assembly = assemble(configuration, self.is_real)
        parts = self.assembly.of_robots(configuration)
        self.robots = [RobotRun(part, options, self._end) for part in parts]
        if self.assembly.parts:
            end_with_last(self.robots, self._end)
        self.operator = self.robots[0].operator
        self.at_limit: GoalEnds | None = None
        self._set_levels()
        _check_programs(configuration, options)
        _check_sources(configuration, options)
        self.outputs = self._start_outputs(show, screen_closed)
        self.inputs = self.robots[0].inputs  # several robots have no programs and devices
        self.programs = self._start_programs()
        computed = [use for use in configuration.sources if self._is_computed(use)]
        devices = [use for use in configuration.sources if use not in computed]
        self.devices = open_sources(devices, self.inputs, self.operator, self.assembly.graph.kinds)
        self.computed = open_virtual_sources(computed, self.operator.log, options.rehearses)
        if self.assembly.parts:
            self._open_robots()
        else:
            self.robots[0].open(self._open_robot())
        self.robot, self.plant = self.robots[0].robot, self.robots[0].plant
        if self.programs is not None and self.plant is not None:
            self.programs.set_faults(self.plant.faults.faults)
        self._connect_clients()
        self.engine = self._build_engine(signals)
        for robot in self.robots:
            if robot.client is not None:
                robot.client.can_measure(self.engine, robot.part.prefix)

    def _is_computed(self, use: SourceUse) -> bool:
        """Whether the engine waits for the answers of a source: the run follows no real time."""
        return not self.is_real and use.cls.virtual_delay is not None

    def _start_outputs(
        self, show: Show | None, screen_closed: Callable[[], None] | None
    ) -> RunOutputs:
        reports = RunReports(
            partial(run_facts, self.configuration, self.options, self._goals()),
            partial(all_goals, self.robots),
            self._take_snapshot,
            self.tell,
            self._report_loss,
            screen_closed,
        )
        # Children are forked before a port is open, so that none of them holds it; and after the
        # last collection that walks all objects, which writes to the memory that they share.
        gc.collect()
        gc.freeze()
        return RunOutputs(self.configuration, self.assembly, self.options, reports, show)

    def _build_engine(self, signals: SignalSource | None) -> Engine:
        inputs = self.inputs if self.configuration.inputs else None
        others: list[Driver | None] = [self.programs, self.devices, self.computed, inputs]
        drivers = [driver for robot in self.robots for driver in robot.drivers()]
        return Engine(
            self.assembly.graph,
            [*drivers, *(driver for driver in others if driver is not None)],
            self._clock(),
            robot=self._robot_to_stop(),
            sinks=self._sinks(),
            record=self.outputs.record(),
            idle=self._idle(),
            signals=signals,
            limits=self._instant_limits(),
            is_driving=lambda: any(robot.is_driving for robot in self.robots),
        )

    def _robot_to_stop(self) -> RobotDriver | None:
        """What the engine stops at its end: the robot, or all of several."""
        if not self.assembly.parts:
            return self.robot
        drivers = [(robot.part.name, robot.robot) for robot in self.robots]
        return RobotGroup([(name, driver) for name, driver in drivers if driver is not None])

    def _instant_limits(self) -> InstantLimits | None:
        """Limits of the time that an instant may take; none for a run that follows no clock."""
        robots = [part.configuration.robot for part in self.robots]
        boards = [robot.board for robot in robots if robot is not None]
        if not boards or self.options.fast:
            return None
        deadman = min(board.deadman for board in boards)
        return instant_limits(deadman, max(board.telemetry for board in boards), self.is_real)

    def go(self) -> RunResult:
        """Run; stop the robot; end the children. Never raises for what happened in the run."""
        duration = self.options.duration
        until = NEVER if duration is None else round(duration * SECOND)
        with preferred_engine() if self.is_real else nullcontext():
            ending = self.engine.run(until, self._limit_code)
        self._close_after(ending)
        is_alone = not self.assembly.parts  # the poses of several robots have no sum
        outputs, ends = self.outputs, self.at_limit or self._goal_ends()
        robot = self.robots[0]
        return RunResult(
            ending=ending,
            failure=self.engine.failure,
            reached=ends.reached,
            goals=ends.goals,
            unsure=ends.unsure,
            goal=ends.last if is_alone else None,
            stops=stops_of(self.robots),
            odometry=robot.monitor.odometry if is_alone else None,
            truth=robot.truth() if is_alone else None,
            path=sum(robot.monitor.distance for robot in self.robots),
            link=robot.monitor.link if is_alone else None,
            digest=outputs.digest.text() if outputs.digest else None,
            recording=outputs.recorder.lost if outputs.recorder else None,
            log=outputs.log_file.lost if outputs.log_file else None,
        )

    def _limit_code(self) -> int:
        """Exit code at the time limit: 1 when a goal of the run was not reached.

        What is reached while the robot is stopped after it does not count.
        """
        self.at_limit = ends = self._goal_ends()
        if self.options.stay:
            return 0
        if ends.reached + ends.unsure < ends.goals:
            return 1
        return REACHED_UNSURE if ends.unsure else 0

    def _goal_ends(self) -> GoalEnds:
        reached, goals = all_goals(self.robots)
        unsure = sum(robot.operator.reached_unsure for robot in self.robots)
        return GoalEnds(reached, unsure, goals, self.operator.goal_reached)

    def _goals(self) -> list[Goal]:
        return [goal for robot in self.robots for goal in robot.goals]

    def _set_levels(self) -> None:
        """The levels of the log that the options give, for each robot's blocks."""
        for source, level in self.options.levels:
            for robot in self.robots:
                prefix = robot.part.prefix
                if source == ALL or source.startswith(prefix):
                    robot.operator.set_level(0, source.removeprefix(prefix), level)

    def _open_robots(self) -> None:
        """Several robots, all simulated; their seeds differ, so that they are not the same one."""
        for number, robot in enumerate(self.robots):
            robot.open(_simulated(robot.configuration, self.options.seed + number))

    def _open_robot(self) -> PortRobot:
        """The robot at the port of the options. Raises RunError."""
        configuration, options = self.configuration, self.options
        if configuration.robot is None:
            return PortRobot()
        if options.port == "sim":
            return _simulated(configuration, options.seed)
        if options.port == "emulated":
            # Imported late: a run on a real port needs neither plant nor emulator.
            from diffbotctl.emulator.emulated_robot import emulated_robot_driver

            emulated = emulated_robot_driver(configuration, options.seed)
            return PortRobot(emulated, emulated.robot)
        # Imported late: a simulated run needs no protocol; it would start 10 ms later.
        from diffbotctl.drivers.serial_robot import open_serial_robot

        return PortRobot(open_serial_robot(configuration.robot, options.port, self.tell))

    def _connect_clients(self) -> None:
        """The drivers of the control sockets. A paced simulation is not woken by commands."""
        for robot, control_socket in zip(self.robots, self.outputs.control_sockets, strict=False):
            inputs = [use for use in robot.configuration.inputs if not use.is_of_robot]
            wakes = self.is_real or self.robot is None or bool(inputs)
            robot.client = control_socket.client_driver(
                robot.operator, robot.changes, wakes, robot.inputs
            )

    def _start_programs(self) -> ProgramsDriver | None:
        """The programs of the pipeline; forked before a port is open, started with the run."""
        uses, driver = self.configuration.programs, self.options.programs
        if not uses or driver is None:
            return None
        sockets = [each.path for each in self.outputs.control_sockets]
        path = sockets[0] if sockets else None
        return driver(uses, self.assembly.graph.kinds, self.inputs, self.operator, path)

    def _clock(self) -> Clock:
        if self.is_real:
            return PacedClock(exact=False)
        return VirtualClock() if self.options.fast else PacedClock(exact=True)

    def _sinks(self) -> dict[str, list[Sink]]:
        """What takes the messages of each wire that leaves the graph."""
        sinks: dict[str, list[Sink]] = defaultdict(list)
        for robot in self.robots:
            for wire, sink in robot.sinks(self._is_stopping, self.outputs.black_box):
                sinks[wire].append(sink)
        for takers in (self.programs, self.devices, self.computed, self.outputs):
            for wire, sink in () if takers is None else takers.sinks():
                sinks[wire].append(sink)
        return sinks

    def _is_stopping(self) -> bool:
        return self.engine.ending is not None or self.engine.stop_waits

    def _idle(self) -> Callable[[], None] | None:
        """What the engine calls in its idle time: first the client's commands, then the outputs."""
        outputs_idle, programs = self.outputs.idle(), self.programs
        clients = [robot.client for robot in self.robots if robot.client is not None]
        devices = self.devices
        if not clients and outputs_idle is None and programs is None and devices is None:
            return None

        def idle() -> None:
            if devices is not None:
                devices.idle(self.engine.last_instant)
            if programs is not None:
                programs.idle()
            for client in clients:
                client.idle(self.engine.last_instant)
            if outputs_idle is not None:
                outputs_idle(self.engine.last_instant)

        return idle

    def _end(self, code: int, cause: str) -> None:
        self.engine.end(code, cause)

    def _take_snapshot(self) -> bytes:
        return snapshot.take_snapshot(self.engine)

    def _report_loss(self, text: str) -> None:
        """Report to the user and in the log that a file can no longer be written."""
        self.tell(text)
        self.operator.log(self.engine.last_instant, "error", "engine", text)

    def _close_after(self, ending: RunOutcome) -> None:
        """Close outputs, drivers and clock, in the order in which they depend on each other."""
        truth = ""
        if self.plant is not None and not self.assembly.parts:
            truth = json.dumps(list(self.plant.truth().pose))
        self.outputs.finish(ending, self.engine.last_instant, truth)
        for driver in self.engine.drivers:
            driver.close()
        self.engine.clock.close()
        self.outputs.close()
