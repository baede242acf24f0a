"""The simulated robot behind the node `robot`."""

from __future__ import annotations

from math import cos, sin

from diffbotctl.block import action
from diffbotctl.config.configuration import Configuration
from diffbotctl.drivers.robot_ports import is_duty_board
from diffbotctl.engine.driver import Delivery
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_states import BATTERY_CAUSE, BUTTON_CAUSE, gyro_fix, wheel_fault_cause
from diffbotctl.messages import Battery, Duty, Encoders, Link, Resume, Stop, Wheels
from diffbotctl.plant.simulated_robot import CapturedEdge, SimulatedRobot, draw_robot
from diffbotctl.plant.world import build_world
from diffbotctl.time import SECOND

STILL_TIME = SECOND // 4  # without an edge: at 4 cm/s and more they come faster than that
LOW_READINGS_MAX = 5  # one in 2 s: 10 s, as in the firmware
COASTING_TIME = 7 * SECOND // 10  # of zero command: four lags of a slow motor


class OperatorFaults:
    """The stops by the operator among the faults of a robot."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot, self._is_stopped = robot, False

    def deliver(self, now: int) -> list[Delivery]:
        """The stop when one begins, and what allows motion again at its end."""
        is_stopped = self._robot.faults.active.has("operator_stop")
        if is_stopped is self._is_stopped:
            return []
        self._is_stopped = is_stopped
        if is_stopped:
            stop = Stop(now, "operator_stop", "stopped by the operator (a fault of trials)", True)
            return [Delivery("operator.halt", stop)]
        return [Delivery("operator.resume", Resume(now))]


class SimulatedRobotDriver:
    """A driver that lets time pass in the plant and delivers what its board sends."""

    def __init__(
        self,
        robot: SimulatedRobot,
        takes_duty: bool,
        field: tuple[float, float] | None = None,
    ) -> None:
        """`field`: width and depth in m of the walled field that the robot cannot leave."""
        self.robot = robot
        self.field = field
        self.command_class: type[Duty] | type[Wheels] = Duty if takes_duty else Wheels
        self.frames = 0
        self.report_at = 0
        self.stopping = False
        self._awaits_gyro = True
        self.stopped = False
        self._hold: Stop | None = None  # by the board, until a command after `resume`
        self._low_readings, self._volts = 0, 0.0
        self._drives = False
        self._operator = OperatorFaults(robot)
        self._counts: tuple[int, int] | None = None
        self._still_since = self._zero_since = 0

    def due(self) -> int:
        """When the next message arrives."""
        return self.robot.due()

    def files(self) -> list[int]:
        """None."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """Let time pass in the plant until `now`."""
        self.robot.advance(now)
        deliveries = []
        for port, message in self.robot.deliver():
            deliveries.append(Delivery(f"robot.{port}", message))
            if isinstance(message, Encoders):
                self.frames += 1
                self._check_gyro(message)
                if self.stopping:
                    self._check_stopped(now, message)
            elif isinstance(message, Battery):
                self._count_low(message)
        deliveries += self._check_hold(now)
        deliveries += self._operator.deliver(now)
        if deliveries and now >= self.report_at:
            self.report_at = now + SECOND
            deliveries.append(Delivery("robot.link", Link(now, "up", received=self.frames)))
        return deliveries

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Send a command to the simulated board.

        During a hold by the board, zero changes nothing, and motion is the consent to end it.
        """
        self.robot.advance(now)
        self._drives = bool(command.left or command.right)
        if self._hold is not None and self._drives:
            self._hold, self._low_readings = None, 0
            self.robot.board.clear_fault()
        self.robot.command(now, command)

    def _check_gyro(self, encoders: Encoders) -> None:
        """Refuse a gyro that has never worked, before any motion. Raises RunError."""
        if not self._awaits_gyro:
            return
        self._awaits_gyro = False
        if encoders.turn_fault:
            raise RunError(
                Problem(
                    "E-IMU-FAULT",
                    "simulated robot",
                    encoders.turn_fault,
                    gyro_fix(encoders.turn_fault),
                )
            )

    def _count_low(self, battery: Battery) -> None:
        """As the firmware counts: a moment of full load is not a low battery."""
        self._low_readings += 1 if battery.low else -1
        self._low_readings = max(0, min(self._low_readings, LOW_READINGS_MAX))
        self._volts = battery.volts

    def _check_hold(self, now: int) -> list[Delivery]:
        """The stop by the board: a wheel fault, or a battery that stays low."""
        if self._hold is not None:
            return []
        flags = self.robot.board.fault_flags
        if flags:
            self._hold = Stop(now, "wheel_fault", wheel_fault_cause(flags), True)
        elif self.robot.board.button_pressed:
            self._hold = Stop(now, "stop_button", BUTTON_CAUSE, True)
        elif self._low_readings >= LOW_READINGS_MAX and self._drives:
            cause = BATTERY_CAUSE.format(
                volts=f": {self._volts:.1f} V, below {self.robot.parameters.low:g} V"
            )
            self._hold = Stop(now, "battery_low", cause, True)
            self.robot.command(now, self.command_class(now, 0.0, 0.0))
        return [] if self._hold is None else [Delivery("robot.stop", self._hold)]

    def capture(self, now: int, on: bool) -> None:
        """Start or stop collecting every edge of both encoders in `edges`, unfiltered."""
        self.robot.advance(now)
        self.robot.capture(on)

    @property
    def edges(self) -> list[CapturedEdge]:
        """What the board has captured, until it is taken."""
        return self.robot.captured_edges

    @action(x="m", y="m", heading="rad")
    def teleport(self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Move the robot to a pose in the world: x and y in m, heading in rad."""
        self._require_inside(x, y)
        self.robot.advance(now)
        self.robot.teleport(x, y, heading)

    def _require_inside(self, x: float, y: float) -> None:
        """Raise ValueError for a place outside of the field."""
        for axis, place, end in zip("xy", (x, y), self.field or (), strict=False):
            if not 0.0 <= place <= end:
                raise ValueError(f"{axis} is 0 to {end:g} m in the field; it is {place:g} m")

    @action(distance="m", turn="rad")
    def hop(self, now: int, distance: float = 0.0, turn: float = 0.0) -> None:
        """Move the robot relative to its pose: turn by `turn` rad, then `distance` m ahead."""
        self.robot.advance(now)
        pose = self.robot.truth_in_world()
        heading = pose.heading + turn
        x, y = pose.x + distance * cos(heading), pose.y + distance * sin(heading)
        self._require_inside(x, y)
        self.robot.teleport(x, y, heading)

    @action
    def home(self, now: int) -> None:
        """Move the robot back to where the run began."""
        self.robot.advance(now)
        self.robot.home()

    def stop(self, now: int) -> None:
        """Stop the wheels; `stopped` becomes true when they have stood still for a while."""
        self.stopping, self.stopped = True, False
        self._still_since = self._zero_since = now
        self._counts = None
        self.command(now, self.command_class(now, 0.0, 0.0))

    def close(self) -> None:
        """Nothing is held open."""

    def _check_stopped(self, now: int, encoders: Encoders) -> None:
        counts = (encoders.left, encoders.right)
        if encoders.left_command or encoders.right_command:
            self._zero_since = now
        if counts != self._counts:
            self._counts, self._still_since = counts, now
        is_still = now - self._still_since >= STILL_TIME
        self.stopped = is_still and now - self._zero_since >= COASTING_TIME


def simulated_robot_driver(configuration: Configuration, seed: int) -> SimulatedRobotDriver:
    """The simulated robot of a configuration, drawn by `seed` from its `simulation` section."""
    robot, nominal = configuration.robot, configuration.nominal
    assert robot is not None and nominal is not None
    plant = draw_robot(robot, nominal, seed, build_world(configuration.world))
    return SimulatedRobotDriver(plant, is_duty_board(robot), configuration.world.field)
