"""Calibration of a simulated robot, and the tools that measure it.

The tools read what the simulated robot really did, where a person would use a tape, a protractor or
the eye. They stand outside of every step: a step asks its question, and an answers file may have it
answered by a tool. No block has access to them.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, hypot, pi, sin
from random import Random

from diffbotctl.calibrate.session import DriverFactory, RobotSession, StopKey
from diffbotctl.config.configuration import RobotFile
from diffbotctl.drivers.robot_link import board_settings, is_duty_board
from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver
from diffbotctl.emulator.emulated_robot import EmulatedBoard, EmulatedRobotDriver, emulated_board
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.driver import RobotDriver
from diffbotctl.errors import join_words
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import PlantTruth, SimulatedRobot, draw_robot
from diffbotctl.plant.world import World
from diffbotctl.prompts.question import Answer, AnswerError, Question

# instrument -> quantities that it can read
INSTRUMENT_QUANTITIES = {
    "tape": ("forward", "left", "distance"),
    "protractor": ("turned", "facing"),
    "ruler": ("gap",),
    "meter": ("battery",),
    "eye": ("wheel",),
}
VISIBLE_TURN_MIN_RAD = pi / 36  # rad; a wheel that turned less than 5 degrees did not visibly turn
HAND_SPEED_RAD_S = 1.5 * pi  # rad/s; three quarters of a turn a second
HAND_TURN_SD_RAD = (
    0.03  # rad, standard deviation: a mark on the tyre is stopped within a millimetre
)
PLACEMENT_SD_M = 0.001  # m, standard deviation: where a hand puts something beside a rule
HAND_RELEASE_TIME_S = 1.0  # s until whoever turned a wheel has let go of it


class SimulatedTools:
    """The truth of one plant since the last mark."""

    def __init__(
        self, plant: SimulatedRobot, wait: Callable[[float], object], chance: Random
    ) -> None:
        """`wait` lets the robot's time pass, in s; `chance` makes instruments blunt."""
        self._plant, self._wait, self._chance = plant, wait, chance
        self._mark: PlantTruth = plant.truth()
        self._gap = 0.0

    @property
    def truth(self) -> PlantTruth:
        """The plant's truth now, for figures that judge a calibration."""
        return self._plant.truth()

    def mark(self) -> None:
        """Readings are taken from how the robot stands now."""
        self._mark = self._plant.truth()

    def read(self, instrument: str, question: Question, noise: float) -> Answer:
        """What `instrument` shows for `question`. Raises AnswerError where it cannot."""
        able = INSTRUMENT_QUANTITIES.get(instrument)
        if able is None:
            raise AnswerError(
                f"there is no instrument '{instrument}': {join_words(INSTRUMENT_QUANTITIES)}"
            )
        if question.quantity not in able:
            wanted = [
                name for name, reads in INSTRUMENT_QUANTITIES.items() if question.quantity in reads
            ]
            other = f"; take the {wanted[0]}" if wanted else "; type it"
            raise AnswerError(f"no {instrument} can read this{other}")
        if question.quantity == "wheel":
            return question.read(self._turning())
        value = self._value(question.quantity) + self._chance.gauss(0.0, noise)
        return question.read(f"{value!r} {question.unit}")

    def roll(self, wheel: str, turns: float) -> None:
        """A hand turns one wheel, nearly as far as it was asked to."""
        angle = 2 * pi * turns + self._chance.gauss(0.0, HAND_TURN_SD_RAD)
        side = 0 if wheel == "left" else 1
        end = self._plant.turn_by_hand(side, angle, HAND_SPEED_RAD_S)
        self._wait((end - self._plant.now) * 1e-9 + HAND_RELEASE_TIME_S)

    def place(self, sensor: str, distance: float) -> None:
        """A hand puts a board across a sensor's axis, nearly at `distance` (m) from its front."""
        self._gap = distance + self._chance.gauss(0.0, PLACEMENT_SD_M)
        self._plant.put_before(sensor, self._gap)
        self._wait(HAND_RELEASE_TIME_S)

    def _value(self, quantity: str) -> float:
        if quantity == "gap":
            return self._gap
        if quantity == "battery":
            return self._plant.supply()
        begun, now = self._mark.pose, self._plant.truth().pose
        x, y = now.x - begun.x, now.y - begun.y
        if quantity == "forward":
            return x * cos(begun.heading) + y * sin(begun.heading)
        if quantity == "left":
            return y * cos(begun.heading) - x * sin(begun.heading)
        if quantity == "distance":
            return hypot(x, y)
        turned = now.heading - begun.heading
        return turned if quantity == "turned" else (turned + pi) % (2 * pi) - pi

    def _turning(self) -> str:
        begun, now = self._mark, self._plant.truth()
        ways = {
            "left": now.left_angle - begun.left_angle,
            "right": now.right_angle - begun.right_angle,
        }
        moved = [side for side, way in ways.items() if abs(way) > VISIBLE_TURN_MIN_RAD]
        if not moved:
            return "none"
        forward = {ways[side] > 0.0 for side in moved}
        if len(forward) == 2:
            return "opposite ways"
        which = moved[0] if len(moved) == 1 else "both"
        return f"{which} {'forward' if forward.pop() else 'backward'}"


def open_simulated(
    file: RobotFile,
    port: str,
    seed: int = 0,
    key: StopKey | None = None,
    world: World | None = None,
) -> tuple[RobotSession, SimulatedTools]:
    """A simulated robot, or one on an emulated board, in virtual time; and tools that measure it.

    Raises EmulatorError when there is no emulator.
    """
    if port == "sim":
        plant = draw_robot(file.robot, file.nominal, seed, world)
        make_driver = _simulated(plant)
    else:
        board = emulated_board(file.nominal, seed, world)
        plant, make_driver = board.plant, _emulated(board)
    session = RobotSession(file, make_driver, VirtualClock(), key)
    return session, SimulatedTools(plant, session.listen, Random(f"instruments {seed}"))


def _simulated(plant: SimulatedRobot) -> DriverFactory:
    def make_driver(file: RobotFile, previous: RobotDriver | None, now: int) -> RobotDriver:
        if previous is not None:
            plant.advance(now)
            plant.rewire(plant_parameters(file.robot, file.nominal))
        return SimulatedRobotDriver(plant, is_duty_board(file.robot))

    return make_driver


def _emulated(board: EmulatedBoard) -> DriverFactory:
    def make_driver(file: RobotFile, previous: RobotDriver | None, now: int) -> RobotDriver:
        board.advance(now)
        board.received.clear()
        return EmulatedRobotDriver(board, DiffbotHost(board_settings(file.robot)))

    return make_driver
