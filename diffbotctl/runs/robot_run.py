"""One robot of a run: its goals, its driver, its live changes, and the clients that command it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.drivers.named_robots import NamedDriver
from diffbotctl.drivers.robot_ports import goal_rest, is_duty_board
from diffbotctl.engine.driver import Driver, RobotDriver
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.engine.stop_places import pose_wire
from diffbotctl.graph import Sink
from diffbotctl.messages import Duty, Goal, GoalState, Link, Odometry, Path, Stop, Wheels
from diffbotctl.recording.black_box import BlackBox
from diffbotctl.runs.build_graph import RobotAssembly, sources, wires_of
from diffbotctl.runs.options import RunOptions
from diffbotctl.time import NEVER, SECOND

if TYPE_CHECKING:
    from diffbotctl.control_socket.command_driver import ControlClientDriver
    from diffbotctl.plant.simulated_robot import PlantTruth, SimulatedRobot

End = Callable[[int, str], None]


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
        self.link = link


class RobotRun:
    """A robot of a run, or the blocks of a pipeline without one.

    `end` ends the run with an exit code and a cause. `ending` is how this robot's goals ended.
    """

    def __init__(self, part: RobotAssembly, options: RunOptions, end: End) -> None:
        self.part = part
        self.end = end
        self.configuration, self.assembly = part.configuration, part.assembly
        self.estimates = wires_of(part.assembly, Odometry)
        self.monitor = RunMonitor()
        self.is_driving = False
        self.goals = list(options.goals) or [
            Goal(0, 0, goal.x, goal.y, goal.heading) for goal in self.configuration.goals
        ]
        self.ending: tuple[int, str] | None = None
        self.goals_ended = 0  # number of the goal with which they ended
        self.waits = options.socket is not None or options.duration is not None or not options.fast
        rest = goal_rest(self.configuration.robot)
        self.operator = Operator(self.goals, self._end_goals, stay=options.stay, rest=rest)
        self.on_goals_end = end
        self.inputs = InputLeases(self.configuration.inputs, self.operator)
        self.robot: RobotDriver | None = None
        self.plant: SimulatedRobot | None = None
        self.changes = LiveChanges(part.assembly.graph, {})
        self.client: ControlClientDriver | None = None

    def open(self, robot: PortRobot) -> None:
        self.robot, self.plant = robot
        named_drivers = {} if self.robot is None else {"robot": self.robot}
        self.changes = LiveChanges(self.assembly.graph, named_drivers)

    @property
    def is_done(self) -> bool:
        """Whether nothing keeps the run from ending: its goals have ended, and no other came."""
        return not self.operator.stay and self.goals_ended == self.operator.number

    def drivers(self) -> list[Driver]:
        """Its drivers, in the order in which they deliver.

        The leases of the inputs are among them only for one of several robots: those of a single
        one deliver after programs and devices.
        """
        found: list[Driver | None] = [self.robot, self.operator, self.client]
        drivers = [driver for driver in found if driver is not None]
        if not self.part.name:
            return drivers
        if self.configuration.inputs:
            drivers.append(self.inputs)
        return [NamedDriver(self.part.name, driver) for driver in drivers]

    def sinks(
        self, stopped: Callable[[], bool], box: BlackBox | None
    ) -> Iterator[tuple[str, Sink]]:
        """Wires and what takes their messages. `stopped`: commands are not sent any more."""
        for wire, sinks in self._sinks(stopped, box).items():
            for sink in sinks:
                yield f"{self.part.prefix}{wire}", sink

    def truth(self) -> PlantTruth | None:
        """The plant's truth, its pose in the frame in which goals were given."""
        if self.plant is None:
            return None
        truth = self.plant.truth()
        return truth if self.estimates else truth._replace(pose=self.plant.truth_in_world())

    def _sinks(self, stopped: Callable[[], bool], box: BlackBox | None) -> dict[str, list[Sink]]:
        sinks: dict[str, list[Sink]] = defaultdict(list)
        assembly, operator = self.assembly, self.operator
        if assembly.command is not None and self.robot is not None:
            sinks[assembly.command].append(self._command_sink(self.robot, stopped))
        for wire in wires_of(assembly, GoalState):
            sinks[wire].append(operator.on_goal_state)
        followed = {wire for node in assembly.graph.nodes for wire in node.wires.values()}
        for wire in wires_of(assembly, Path):
            if wire not in followed:  # otherwise a block follows it, such as path_follower
                sinks[wire].append(operator.on_path)
        for wire in wires_of(assembly, Stop):
            sinks[wire] += [operator.stop_sink(wire), self._on_stop]
        if box is not None:
            operator.on_new_stop = box.stop
        pose = pose_wire(assembly.graph)
        if pose is not None:
            sinks[pose].append(operator.on_odometry)
        for wire in self.estimates or self._camera_wires():
            sinks[wire].append(self.monitor.on_odometry)
        for wire, sink in self.changes.sinks().items():
            sinks[wire].append(sink)
        if self.configuration.robot is not None:
            sinks["robot.link"].append(self.monitor.on_link)
        return sinks

    def _camera_wires(self) -> list[str]:
        """The wires on which overhead cameras deliver the pose, for pipelines without odometry."""
        kinds = sources(self.configuration.robot)
        return [wire for wire, kind in kinds.items() if kind is Odometry]

    def _command_sink(self, robot: RobotDriver, stopped: Callable[[], bool]) -> Sink:
        """The sink that sends commands to the robot; a duty beyond 1 ends the run."""
        takes_duty = self.configuration.robot is not None and is_duty_board(
            self.configuration.robot
        )

        def send(now: int, command: Wheels | Duty) -> None:
            if stopped():
                return  # a stop is under way
            if takes_duty and not (abs(command.left) <= 1.0 and abs(command.right) <= 1.0):
                command = Duty(now, 0.0, 0.0)
                self.end(1, "a motor duty is beyond 1 or not a number")
            self.is_driving = bool(command.left or command.right)
            robot.command(now, command)

        return send

    def _on_stop(self, now: int, stop: Stop) -> None:
        """End the goals at a latched stop which no client can end, nor a fault of the operator."""
        if not stop.latched or self.waits or self.operator.active is None:
            return
        faults = () if self.plant is None else self.plant.faults.faults
        if not any(each.kind == "operator_stop" and now < each.end < NEVER for each in faults):
            number, self.operator.active = self.operator.number, None
            self._end_goals(1, f"goal {number} was not reached ({stop.code}): {stop.cause}")

    def _end_goals(self, code: int, cause: str) -> None:
        self.ending, self.goals_ended = (code, cause), self.operator.number
        self.on_goals_end(code, cause)


def end_with_last(robots: list[RobotRun], end: End) -> None:
    """End the run when the goals of all `robots` have ended, with the worst of their codes.

    One whose goal failed stands; the others go on.
    """

    def on_goals_end(code: int, cause: str) -> None:
        if not all(robot.is_done for robot in robots):
            return
        endings = [(robot.part.name, robot.ending) for robot in robots if robot.ending is not None]
        worst = max(ending[0] for _, ending in endings)
        end(worst, "; ".join(f"{name}: {ending[1]}" for name, ending in endings))

    for robot in robots:
        robot.on_goals_end = on_goals_end


def all_goals(robots: list[RobotRun]) -> tuple[int, int]:
    """Goals reached, and goals in all, of all robots."""
    progress = [robot.operator.progress() for robot in robots]
    return sum(reached for reached, _ in progress), sum(goals for _, goals in progress)


def stops_of(robots: list[RobotRun]) -> tuple[Stop, ...]:
    """The stops of all robots in the order of time; of several, the cause begins with the name."""
    stops: list[Any] = [
        stop if not robot.part.name else stop._replace(cause=f"{robot.part.name}: {stop.cause}")
        for robot in robots
        for stop in robot.operator.stops
    ]
    return tuple(stops) if len(robots) == 1 else tuple(sorted(stops, key=lambda stop: stop.time))
