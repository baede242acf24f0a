"""The simulated robot behind the node `robot`."""

from __future__ import annotations

from math import cos, sin

from diffbotctl.block import action
from diffbotctl.config.configuration import Configuration
from diffbotctl.drivers.robot_link import is_duty_board
from diffbotctl.engine.driver import Delivery
from diffbotctl.messages import Duty, Encoders, Link, Wheels
from diffbotctl.plant.simulated_robot import CapturedEdge, SimulatedRobot, draw_robot
from diffbotctl.plant.world import build_world
from diffbotctl.time import SECOND

STILL = SECOND // 4  # ns without an edge: at 4 cm/s and more they come faster than that
COASTED = 7 * SECOND // 10  # ns of zero command, over four lags of a slow motor: slower ones stand


class SimulatedRobotDriver:
    """A driver that lets the plant's time pass and hands out what its board sends."""

    def __init__(self, robot: SimulatedRobot, takes_duty: bool) -> None:
        self.robot = robot
        self.zero: type[Duty] | type[Wheels] = Duty if takes_duty else Wheels
        self.frames = 0
        self.report_at = 0
        self.counts: tuple[int, int] | None = None
        self.still_since = self.zero_since = 0
        self.stopping = False
        self.stopped = False

    def due(self) -> int:
        """When the next message arrives."""
        return self.robot.due()

    def files(self) -> list[int]:
        """None."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """Let the plant's time pass until `now`."""
        self.robot.advance(now)
        heard = []
        for port, message in self.robot.deliver():
            heard.append(Delivery(f"robot.{port}", message))
            if isinstance(message, Encoders):
                self.frames += 1
                if self.stopping:
                    self._watch(now, message)
        if heard and now >= self.report_at:
            self.report_at = now + SECOND
            heard.append(Delivery("robot.link", Link(now, "up", received=self.frames)))
        return heard

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """Send a command to the simulated board."""
        self.robot.advance(now)
        self.robot.command(now, wanted)

    def capture(self, now: int, on: bool) -> None:
        """Begin or end to gather every flank of both encoders in `edges`, unfiltered."""
        self.robot.advance(now)
        self.robot.capture(on)

    @property
    def edges(self) -> list[CapturedEdge]:
        """What the board captured, until it is taken."""
        return self.robot.captured_edges

    @action(x="m", y="m", heading="rad")
    def teleport(self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Put the robot elsewhere in the world, as a hand does: x and y in m, heading in rad."""
        self.robot.advance(now)
        self.robot.teleport(x, y, heading)

    @action(distance="m", turn="rad")
    def hop(self, now: int, distance: float = 0.0, turn: float = 0.0) -> None:
        """Put the robot elsewhere, seen from itself: turn by so many rad, then so many m ahead."""
        self.robot.advance(now)
        here = self.robot.truth_in_world()
        heading = here.heading + turn
        x, y = here.x + distance * cos(heading), here.y + distance * sin(heading)
        self.robot.teleport(x, y, heading)

    @action
    def home(self, now: int) -> None:
        """Put the robot back to where it stood when the run began."""
        self.robot.advance(now)
        self.robot.home()

    def stop(self, now: int) -> None:
        """Stop the wheels; `stopped` becomes true when they have stood still for a while."""
        self.stopping, self.stopped = True, False
        self.still_since = self.zero_since = now
        self.counts = None
        self.command(now, self.zero(now, 0.0, 0.0))

    def close(self) -> None:
        """Nothing is held open."""

    def _watch(self, now: int, encoders: Encoders) -> None:
        counts = (encoders.left, encoders.right)
        if encoders.left_command or encoders.right_command:
            self.zero_since = now
        if counts != self.counts:
            self.counts, self.still_since = counts, now
        self.stopped = now - self.still_since >= STILL and now - self.zero_since >= COASTED


def simulated_robot_driver(configuration: Configuration, seed: int) -> SimulatedRobotDriver:
    """The simulated robot of a configuration, drawn by `seed` from its `simulation` section."""
    robot, nominal = configuration.robot, configuration.nominal
    assert robot is not None and nominal is not None
    plant = draw_robot(robot, nominal, seed, build_world(configuration.world))
    return SimulatedRobotDriver(plant, is_duty_board(robot))
