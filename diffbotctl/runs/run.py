"""One run: builds graph, drivers, clock and outputs; runs; stops the robot; closes everything."""

from __future__ import annotations

import gc
import json
from collections import defaultdict
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.drivers.device_sources import open_sources
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS, goal_rest, is_duty_board
from diffbotctl.engine.clock import Clock, PacedClock, VirtualClock
from diffbotctl.engine.driver import Driver, RobotDriver
from diffbotctl.engine.instant_monitor import InstantLimits, instant_limits
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.engine.loop import Engine, RunOutcome, SignalSource
from diffbotctl.errors import Problem, RunError, join_words
from diffbotctl.graph import Sink
from diffbotctl.messages import Duty, Goal, GoalState, Link, Odometry, Path, Stop, Wheels
from diffbotctl.recording import snapshot
from diffbotctl.runs.build_graph import assemble, sources, wires_of
from diffbotctl.runs.options import RunOptions, RunResult
from diffbotctl.runs.outputs import Report, RunOutputs, RunReports, Show, run_facts
from diffbotctl.time import NEVER, SECOND

if TYPE_CHECKING:
    from diffbotctl.control_socket.command_driver import ControlClientDriver
    from diffbotctl.plant.simulated_robot import PlantTruth, SimulatedRobot
    from diffbotctl.programs.driver import ProgramsDriver


def _check_programs(configuration: Configuration, options: RunOptions) -> None:
    """Raise RunError where the programs of a pipeline may not or cannot run."""
    if not configuration.programs:
        return
    names = join_words([use.name for use in configuration.programs], "and")
    if options.programs is None:
        cause = f"this pipeline starts programs, which were not allowed: {names}"
        raise RunError(Problem("E-PROGRAM-CONSENT", "programs", cause, "give --allow-programs"))
    if options.fast:
        cause = f"{names} cannot keep up with a run that is faster than real time"
        raise RunError(Problem("E-PROGRAM", "programs", cause, "run it without --fast"))


def _check_sources(configuration: Configuration, options: RunOptions) -> None:
    """Raise RunError for devices in a run that follows no clock."""
    if configuration.sources and options.fast:
        names = join_words([use.name for use in configuration.sources], "and")
        cause = f"the devices of {names} work in real time; this run is faster"
        raise RunError(Problem("E-SOURCE", "sources", cause, "run it without --fast"))


class PortRobot(NamedTuple):
    """The robot at a port: without a driver for a pipeline without one, `plant` when simulated."""

    driver: RobotDriver | None = None
    plant: SimulatedRobot | None = None


class RunMonitor:
    """The newest odometry and link state of a run, and the distance driven (m)."""

    def __init__(self) -> None:
        self.odometry: Odometry | None = None
        self.link: Link | None = None
        self.distance = 0.0

    def on_odometry(self, now: int, odometry: Odometry) -> None:
        """Take an estimate; the distance grows by speed times the time since the last one."""
        if self.odometry is not None:
            step = (odometry.time - self.odometry.time) / SECOND
            self.distance += abs(odometry.linear) * max(step, 0.0)
        self.odometry = odometry

    def on_link(self, now: int, link: Link) -> None:
        """Take a state of the link."""
        self.link = link


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
        """`show` draws the screen in a process of its own; `tell` takes messages for the user.

        Raises RunError when an output cannot be written or the port cannot be opened.
        """
        self.configuration, self.options, self.tell = configuration, options, tell
        self.is_real = options.port not in VIRTUAL_PORTS
        self.assembly = assemble(configuration, self.is_real)
        self.estimates = wires_of(self.assembly, Odometry)
        self.monitor = RunMonitor()
        self.is_driving = False
        self.goals = list(options.goals) or [
            Goal(0, 0, goal.x, goal.y, goal.heading) for goal in configuration.goals
        ]
        rest = goal_rest(configuration.robot)
        self.operator = Operator(self.goals, self._end, stay=options.stay, rest=rest)
        for source, level in options.levels:
            self.operator.set_level(0, source, level)
        _check_programs(configuration, options)
        _check_sources(configuration, options)
        self.outputs = self._start_outputs(show, screen_closed)
        self.inputs = InputLeases(configuration.inputs, self.operator)
        self.programs = self._start_programs()
        self.devices = open_sources(configuration.sources, self.inputs, self.operator)
        self.robot, self.plant = self._open_robot()
        named_drivers = {} if self.robot is None else {"robot": self.robot}
        self.changes = LiveChanges(self.assembly.graph, named_drivers)
        self.client = self._control_client()
        self.engine = self._build_engine(signals)
        if self.client is not None:
            self.client.can_measure(self.engine)

    def _start_outputs(
        self, show: Show | None, screen_closed: Callable[[], None] | None
    ) -> RunOutputs:
        reports = RunReports(
            run_facts(self.configuration, self.options, self.goals),
            self.operator.progress,
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
        drivers: list[Driver | None] = [
            self.robot,
            self.operator,
            self.client,
            self.programs,
            self.devices,
            inputs,
        ]
        return Engine(
            self.assembly.graph,
            [driver for driver in drivers if driver is not None],
            self._clock(),
            robot=self.robot,
            sinks=self._sinks(),
            record=self.outputs.record(),
            idle=self._idle(),
            signals=signals,
            limits=self._instant_limits(),
            is_driving=lambda: self.is_driving,
        )

    def _instant_limits(self) -> InstantLimits | None:
        """Limits of the time that an instant may take; none for a run that follows no clock."""
        robot = self.configuration.robot
        if robot is None or self.options.fast:
            return None
        return instant_limits(robot.board.deadman, robot.board.telemetry, self.is_real)

    def go(self) -> RunResult:
        """Run; stop the robot; end the children. Never raises for what happened in the run."""
        duration = self.options.duration
        until = NEVER if duration is None else round(duration * SECOND)
        ending = self.engine.run(until, self._limit_code)
        self._close_after(ending)
        outputs, (reached, goals) = self.outputs, self.operator.progress()
        return RunResult(
            ending=ending,
            failure=self.engine.failure,
            reached=reached,
            goals=goals,
            stops=tuple(self.operator.stops),
            odometry=self.monitor.odometry,
            truth=self._truth(),
            path=self.monitor.distance,
            link=self.monitor.link,
            digest=outputs.digest.text() if outputs.digest else None,
            recording=outputs.recorder.lost if outputs.recorder else None,
        )

    def _limit_code(self) -> int:
        """Exit code at the time limit: 1 when a goal of the run was not reached."""
        reached, goals = self.operator.progress()
        return int(not self.options.stay and reached < goals)

    def _open_robot(self) -> PortRobot:
        """The robot at the port of the options. Raises RunError."""
        configuration, options = self.configuration, self.options
        if configuration.robot is None:
            return PortRobot()
        if options.port == "sim":
            # Imported late: a run on a real port needs neither plant nor emulator.
            from diffbotctl.drivers.simulated_robot import simulated_robot_driver

            simulated = simulated_robot_driver(configuration, options.seed)
            return PortRobot(simulated, simulated.robot)
        if options.port == "emulated":
            # Imported late: a run on a real port needs neither plant nor emulator.
            from diffbotctl.emulator.emulated_robot import emulated_robot_driver

            emulated = emulated_robot_driver(configuration, options.seed)
            return PortRobot(emulated, emulated.robot)
        # Imported late: a simulated run needs no protocol; it would start 10 ms later.
        from diffbotctl.drivers.serial_robot import open_serial_robot

        return PortRobot(open_serial_robot(configuration.robot, options.port, self.tell))

    def _control_client(self) -> ControlClientDriver | None:
        """The driver of the control socket. A paced simulation is not woken by commands."""
        control_socket = self.outputs.control_socket
        if control_socket is None:
            return None
        wakes = self.is_real or self.robot is None or bool(self.configuration.inputs)
        return control_socket.client_driver(self.operator, self.changes, wakes, self.inputs)

    def _start_programs(self) -> ProgramsDriver | None:
        """The programs of the pipeline; forked before a port is open, started with the run."""
        uses, driver = self.configuration.programs, self.options.programs
        if not uses or driver is None:
            return None
        return driver(uses, self.assembly.graph.kinds, self.inputs, self.operator)

    def _clock(self) -> Clock:
        if self.is_real:
            return PacedClock(exact=False)
        return VirtualClock() if self.options.fast else PacedClock(exact=True)

    def _sinks(self) -> dict[str, list[Sink]]:
        """What takes the messages of each wire that leaves the graph."""
        sinks: dict[str, list[Sink]] = defaultdict(list)
        assembly, operator, black_box = self.assembly, self.operator, self.outputs.black_box
        if assembly.command is not None and self.robot is not None:
            sinks[assembly.command].append(self._command_sink(self.robot))
        for wire in wires_of(assembly, GoalState):
            sinks[wire].append(operator.on_goal_state)
        for wire in wires_of(assembly, Path):
            sinks[wire].append(operator.on_path)
        for wire in wires_of(assembly, Stop):
            sinks[wire].append(operator.stop_sink(wire))
            if black_box is not None:
                sinks[wire].append(black_box.stop)
        for wire in self.estimates or self._camera_wires():
            sinks[wire].append(self.monitor.on_odometry)
        for wire, sink in self.changes.sinks().items():
            sinks[wire].append(sink)
        if self.configuration.robot is not None:
            sinks["robot.link"].append(self.monitor.on_link)
        for wire, sink in ({} if self.programs is None else self.programs.sinks()).items():
            sinks[wire].append(sink)
        for wire, sink in self.outputs.sinks():
            sinks[wire].append(sink)
        return sinks

    def _camera_wires(self) -> list[str]:
        """The wires on which overhead cameras deliver the pose, for pipelines without odometry."""
        kinds = sources(self.configuration.robot)
        return [wire for wire, kind in kinds.items() if kind is Odometry]

    def _command_sink(self, robot: RobotDriver) -> Sink:
        """The sink that sends commands to the robot; a duty beyond 1 ends the run."""
        takes_duty = self.configuration.robot is not None and is_duty_board(
            self.configuration.robot
        )

        def send(now: int, command: Wheels | Duty) -> None:
            if self.engine.ending is not None or self.engine.stop_waits:
                return  # a stop is under way
            if takes_duty and not (abs(command.left) <= 1.0 and abs(command.right) <= 1.0):
                command = Duty(now, 0.0, 0.0)
                self._end(1, "a motor duty is beyond 1 or not a number")
            self.is_driving = bool(command.left or command.right)
            robot.command(now, command)

        return send

    def _idle(self) -> Callable[[], None] | None:
        """What the engine calls in its idle time: first the client's commands, then the outputs."""
        client, outputs_idle, programs = self.client, self.outputs.idle(), self.programs
        if client is None and outputs_idle is None and programs is None:
            return None

        def idle() -> None:
            if programs is not None:
                programs.idle()
            if client is not None:
                client.idle(self.engine.last_instant)
            if outputs_idle is not None:
                outputs_idle(self.engine.last_instant)

        return idle

    def _end(self, code: int, cause: str) -> None:
        self.engine.end(code, cause)

    def _take_snapshot(self) -> bytes | None:
        try:
            return snapshot.take_snapshot(self.engine)
        except snapshot.StateError:
            return None  # the black box then begins without a state, and says so

    def _report_loss(self, text: str) -> None:
        """Report to the user and in the log that a file can no longer be written."""
        self.tell(text)
        self.operator.log(self.engine.last_instant, "error", "engine", text)

    def _truth(self) -> PlantTruth | None:
        """The plant's truth, its pose in the frame in which goals were given."""
        if self.plant is None:
            return None
        truth = self.plant.truth()
        return truth if self.estimates else truth._replace(pose=self.plant.truth_in_world())

    def _close_after(self, ending: RunOutcome) -> None:
        """Close outputs, drivers and clock, in the order in which they depend on each other."""
        truth = "" if self.plant is None else json.dumps(list(self.plant.truth().pose))
        self.outputs.finish(ending, self.engine.last_instant, truth)
        for driver in self.engine.drivers:
            driver.close()
        self.engine.clock.close()
        self.outputs.close()
