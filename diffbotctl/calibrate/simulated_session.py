"""Calibration of a simulated robot, and the tools that measure it.

The tools read what the simulated robot really did, where a person would use a tape, a protractor or
the eye. They stand outside of every step: a step asks its question, and an answers file may have it
answered by a tool. No block has access to them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import cos, hypot, pi, sin
from random import Random
from typing import assert_never

from diffbotctl.calibrate.dead_reckoning import wrap_angle
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import DriverFactory, RobotSession, StopKey
from diffbotctl.calibrate.simulated_truth import ComparedValue, compare_findings
from diffbotctl.calibrate.wiring_detection import WheelMotion
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.robot import SIDES
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.drivers.robot_ports import is_duty_board
from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver
from diffbotctl.emulator.emulated_robot import EmulatedBoard, EmulatedRobotDriver, emulated_board
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.driver import RobotDriver
from diffbotctl.errors import join_words
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import PlantTruth, SimulatedRobot, draw_robot
from diffbotctl.plant.world import World
from diffbotctl.prompts.question import Answer, AnswerError, MeasuredQuantity, Question

TOOL_QUANTITIES: dict[str, tuple[MeasuredQuantity, ...]] = {
    "tape": ("forward", "left", "distance"),
    "protractor": ("facing",),
    "ruler": ("gap",),
    "meter": ("battery",),
    "eye": ("wheel",),
}
# Standard deviation of one reading, in SI; of the meter relative.
TOOL_NOISE = {"tape": 0.001, "protractor": pi / 180, "ruler": 0.0005, "meter": 0.005, "eye": 0.0}
VISIBLE_TURN_MIN_RAD = pi / 36
HAND_SPEED_RAD_S = 1.5 * pi
HAND_TURN_SD_RAD = 0.03  # a mark on the tyre is stopped within a millimetre
PLACEMENT_SD_M = 0.001  # of an object beside a ruler
LIFT_SD_RAD = 0.05  # of the angle, and about the other axis
LIFT_TIME_S = 1.0
HAND_RELEASE_TIME_S = 1.0


class SimulatedTools:
    """Measures one simulated robot, relative to the last mark, and moves it as a person would."""

    def __init__(self, plant: SimulatedRobot, wait: Callable[[float], object], rng: Random) -> None:
        """`wait` lets the robot's time pass, in s; `rng` draws the errors of the measurements."""
        self._plant, self._wait, self._rng = plant, wait, rng
        self._mark: PlantTruth = plant.truth()
        self._gap = 0.0

    @property
    def truth(self) -> PlantTruth:
        return self._plant.truth()

    def compare(self, findings: Iterable[Finding]) -> list[ComparedValue]:
        """The findings beside the true values."""
        return list(compare_findings(findings, self._plant))

    def mark(self) -> None:
        """Measure relative to the present pose and wheel angles from now on."""
        self._mark = self._plant.truth()

    def read(self, instrument: str, question: Question, noise: float) -> Answer:
        """The reading of `instrument`. Raises AnswerError if it cannot measure the quantity."""
        self.refuse_instrument(instrument, question)
        if question.quantity == "wheel":
            return self._wheel_motion()
        value = self._value(question.quantity) + self._rng.gauss(0.0, noise)
        return question.parse(f"{value!r} {question.unit}")

    def refuse_instrument(self, instrument: str, question: Question) -> None:
        """Raises AnswerError if `instrument` cannot measure what is asked."""
        quantities = TOOL_QUANTITIES.get(instrument)
        if quantities is None:
            tools = join_words(TOOL_QUANTITIES)
            raise AnswerError(f"there is no instrument '{instrument}'; use {tools}")
        quantity = question.quantity
        if quantity not in quantities:
            suitable = [tool for tool, measured in TOOL_QUANTITIES.items() if quantity in measured]
            hint = f"; use the {suitable[0]}" if suitable else "; write the answer"
            raise AnswerError(f"the {instrument} cannot measure this{hint}")

    def offer(self, question: Question) -> str:
        """What the usual instrument reads, with its noise; empty if none measures the quantity."""
        for tool, quantities in TOOL_QUANTITIES.items():
            if question.quantity in quantities:
                noise = TOOL_NOISE[tool]
                if question.quantity == "battery":
                    noise *= self._plant.battery_voltage()
                return question.format_answer(self.read(tool, question, noise))
        return ""

    def raise_wheels(self, is_raised: bool) -> None:
        """Put a box under the chassis, or take it away."""
        self._plant.raise_wheels(is_raised)

    def roll(self, wheel: str, turns: float) -> None:
        """Turn one wheel by hand, with a small error at the end."""
        angle = 2 * pi * turns + self._rng.gauss(0.0, HAND_TURN_SD_RAD)
        end = self._plant.turn_by_hand(SIDES.index(wheel), angle, HAND_SPEED_RAD_S)
        self._wait((end - self._plant.now) * 1e-9 + HAND_RELEASE_TIME_S)

    def place(self, sensor: str, distance: float) -> None:
        """Put a card in front of a sensor, about `distance` (m) from its front."""
        self._gap = distance + self._rng.gauss(0.0, PLACEMENT_SD_M)
        self._plant.put_before(sensor, self._gap)
        self._wait(HAND_RELEASE_TIME_S)

    def lift(self, side: str, angle: float) -> None:
        """Lift the front or the left side to about `angle` (rad), or put it down with 0."""
        other = 0.0
        if angle:
            angle += self._rng.gauss(0.0, LIFT_SD_RAD)
            other = self._rng.gauss(0.0, LIFT_SD_RAD)
        front, left = (angle, other) if side == "front" else (other, angle)
        self._plant.lift_by_hand(front, left, LIFT_TIME_S)
        self._wait(LIFT_TIME_S + HAND_RELEASE_TIME_S)

    def _value(self, quantity: MeasuredQuantity) -> float:
        start, pose = self._mark.pose, self._plant.truth().pose
        x, y = pose.x - start.x, pose.y - start.y
        match quantity:
            case "gap":
                return self._gap
            case "battery":
                return self._plant.battery_voltage()
            case "forward":
                return x * cos(start.heading) + y * sin(start.heading)
            case "left":
                return y * cos(start.heading) - x * sin(start.heading)
            case "distance":
                return hypot(x, y)
            case "facing":
                return wrap_angle(pose.heading - start.heading)
            case "wheel" | "":
                raise ValueError("not a number")
            case _:
                assert_never(quantity)

    def _wheel_motion(self) -> WheelMotion:
        start, end = self._mark, self._plant.truth()
        turned = {
            "left": end.left_angle - start.left_angle,
            "right": end.right_angle - start.right_angle,
        }
        moved = [side for side, angle in turned.items() if abs(angle) > VISIBLE_TURN_MIN_RAD]
        if not moved:
            return WheelMotion.NONE
        directions = {"forward" if turned[side] > 0.0 else "backward" for side in moved}
        if len(directions) == 2:
            return WheelMotion.OPPOSITE_WAYS
        return WheelMotion(f"{moved[0] if len(moved) == 1 else 'both'} {directions.pop()}")


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
        plant = draw_robot(file.robot, file.nominal, seed, world, is_upward_checked=False)
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
            plant.restart_board(plant_parameters(file.robot, file.nominal, False))
        return SimulatedRobotDriver(plant, is_duty_board(file.robot))

    return make_driver


def _emulated(board: EmulatedBoard) -> DriverFactory:
    def make_driver(file: RobotFile, previous: RobotDriver | None, now: int) -> RobotDriver:
        board.advance(now)
        board.received.clear()
        return EmulatedRobotDriver(board, DiffbotHost(board_settings(file.robot, False)))

    return make_driver
