"""One run of the matrix: a random robot, one perturbation, one plant, a random goal, to its end."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.config.robot import Robot
from diffbotctl.graph import Sink
from diffbotctl.messages import GOAL_EXIT_CODES, Duty, Goal, GoalState, Odometry, Wheels
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.runs.build_graph import wires_of
from diffbotctl.runs.options import RunOptions, RunResult
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from diffbotctl.trials.random_robots import RobotDesign, draw_design, yaml_text
from tests.support.nominal_calibration import calibrate
from tests.support.random_robots import ENCODER_FAULTS, PERTURBATIONS
from tests.support.true_pose_controller import TruePoseController

EQUATIONS = {1: "exponential", 2: "torque"}
DURATION_S = 300.0  # of simulated time, beyond every time limit of the follower
ORACLE_S = 120.0  # of simulated time, for the controller that knows the true pose
GOAL_SECONDS = 8.0  # of driving at the robot's speed limit, at most
GOAL_MAX, GOAL_MIN = 2.0, 0.05  # m
STOPPED_S = 1.0  # after which a latched stop ends a run
DISTURBANCES = PERTURBATIONS | ENCODER_FAULTS


class Case(NamedTuple):
    """Which run: its text form can be run alone."""

    seed: int
    robot: int
    perturbation: str
    plant: int
    number: int

    def __str__(self) -> str:
        return ":".join(str(part) for part in self)

    @classmethod
    def parse(cls, text: str) -> Case:
        """The case of its text form. Raises ValueError."""
        seed, robot, perturbation, plant, number = text.split(":")
        if perturbation not in DISTURBANCES or int(plant) not in EQUATIONS:
            raise ValueError(text)
        return cls(int(seed), int(robot), perturbation, int(plant), int(number))


class CaseResult(NamedTuple):
    """How a run ended. Lengths m, angles rad, times s."""

    case: Case
    end: str
    cause: str
    is_feasible: bool
    oracle_seconds: float | None
    seconds: float
    start_distance: float
    farther: float
    farther_limit: float
    true_error: float
    true_turn: float
    estimate_error: float
    """of the position"""
    estimate_turn: float
    position_sigmas: float
    """error of the estimated position over the reported one in its direction"""
    heading_sigmas: float
    reported_position: float
    """root of the trace of the covariance over two: per axis"""
    reported_heading: float
    travel_after: float
    """seconds of motion after the reason for giving up could be known"""
    standing_after: float
    stop: str
    wheel: str
    """the disturbed wheel, left or right, or empty"""

    @property
    def is_named(self) -> bool:
        """Whether the cause names the disturbed wheel, if one is."""
        return self.wheel in self.cause

    @property
    def is_claimed(self) -> bool:
        """Whether it ended at the goal, as it reported."""
        return self.end in ("reached", "reached_unsure")


class CaseSetting(NamedTuple):
    """What a case consists of."""

    configuration: Configuration
    robot: Robot
    goal: Goal
    tolerances: tuple[float, float]
    plant_seed: int
    known_at: float
    """s; before it nothing is wrong"""
    is_fatal: bool
    """whether the robot cannot move from then on"""
    wheel: str
    """the disturbed wheel, left or right, or empty"""


def set_up(case: Case, folder: Path) -> CaseSetting:
    """Draw the robot of a case and its goal, and write its files into `folder`."""
    design = draw_design(case.seed, case.robot)
    rng = Random(f"case {case}")
    perturbation = DISTURBANCES[case.perturbation]
    tree = design.tree()
    simulation = _copied(tree["simulation"]) | {"equations": EQUATIONS[case.plant]}
    tree["simulation"] = simulation
    plant_seed = rng.getrandbits(31)
    if perturbation.lasting:
        perturbation.apply(simulation, design, rng)
    file = folder / "robot.yaml"
    file.write_text(yaml_text(tree))
    position, heading = design.tolerances
    sets = [
        "world.walls=[]",
        f"follower.tolerance={position!r} m",
        f"follower.heading_tolerance={heading!r} rad",
    ]
    nominal = load("goal", str(file), sets).nominal
    assert nominal is not None
    healthy = draw_robot(nominal, nominal, plant_seed)
    tree["calibration"] = calibrate(healthy, nominal, rng)
    if not perturbation.lasting:
        perturbation.apply(simulation, design, rng)
    file.write_text(yaml_text(tree))
    configuration = load("goal", str(file), sets)
    assert configuration.robot is not None
    faults = simulation.get("faults", [])
    sides = {fault["side"] for fault in faults if "side" in fault}
    wheel = sides.pop() if len(sides) == 1 else ""
    return CaseSetting(
        configuration,
        configuration.robot,
        _draw_goal(configuration.robot, design, rng),
        design.tolerances,
        plant_seed,
        min((fault["at"] for fault in faults), default=0.0),
        perturbation.fatal,
        wheel,
    )


def _draw_goal(robot: Robot, design: RobotDesign, rng: Random) -> Goal:
    farthest = min(GOAL_MAX, max(GOAL_SECONDS * robot.limits.speed, 4 * design.tolerances[0]))
    nearest = max(GOAL_MIN, 2 * design.tolerances[0])
    away = sqrt(rng.uniform(min(nearest, farthest) ** 2, farthest**2))
    bearing, heading = rng.uniform(-pi, pi), rng.uniform(-pi, pi)
    return Goal(0, 1, away * cos(bearing), away * sin(bearing), heading)


class ObservedRun(Run):
    """A run that notes how its goal ended, and watches the truth."""

    def __init__(self, setting: CaseSetting) -> None:
        options = RunOptions(
            goals=(setting.goal,), seed=setting.plant_seed, fast=True, duration=DURATION_S
        )
        self.state: GoalState | None = None
        self.commanded: tuple[float, float] = (0.0, 0.0)
        self.farthest = self.travel_after = self.standing_after = 0.0
        self.known = False
        self.commanded_turn = 0.0  # rad, of a wheel that stands
        self.standing_angles: dict[int, float] = {}  # rad, of those wheels
        self.latched_at: int | None = None
        super().__init__(setting.configuration, options, tell=_ignore)
        self._setting, self._looked = setting, 0
        self.engine.idle = self._look

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = super()._sinks()
        for wire in wires_of(self.assembly, GoalState):
            sinks[wire].append(self._on_state)
        assert self.assembly.command is not None
        sinks[self.assembly.command].append(self._on_command)
        return sinks

    def _on_state(self, now: int, state: GoalState) -> None:
        self.state = state

    def _on_command(self, now: int, command: Wheels | Duty) -> None:
        self.commanded = (command.left, command.right)

    def _look(self) -> None:
        plant, setting = self.plant, self._setting
        assert plant is not None
        body, goal = plant.chassis, setting.goal
        distance = hypot(goal.x - body.x, goal.y - body.y)
        self.farthest = max(self.farthest, distance - hypot(goal.x, goal.y))
        seconds = (plant.now - self._looked) / SECOND
        self._looked = plant.now
        self._end_after_stop(plant.now)
        if plant.now >= setting.known_at * SECOND:
            self._note_whether_known(seconds)
        if self.known:
            if any(wheel.speed for wheel in plant.wheels):
                self.travel_after += seconds
            else:
                self.standing_after += seconds

    def _note_whether_known(self, seconds: float) -> None:
        """A fatal disturbance is not known yet when the wheel that stood turns again."""
        if not self.known:
            self.known = self._could_be_known(seconds)
        elif self._setting.is_fatal and self._has_turned_again():
            self.known = False
            self.commanded_turn = self.travel_after = self.standing_after = 0.0

    def _could_be_known(self, seconds: float) -> bool:
        """Whether the disturbance shows in a command to the wheel.

        After a fatal one: in a wheel that stands although an edge was due. A battery that fails in
        steps drives the robot for a while.
        """
        plant, wheel = self.plant, self._setting.wheel
        assert plant is not None
        left, right = self.commanded
        if not self._setting.is_fatal:
            return bool({"left": left, "right": right, "": left or right}[wheel])
        sides = [index for index, side in enumerate(("left", "right")) if wheel in (side, "")]
        speeds = [abs(command) for command in self.commanded]
        standing = [index for index in sides if speeds[index] and not plant.wheels[index].speed]
        stands = max((speeds[index] for index in standing), default=0.0)
        self.commanded_turn = self.commanded_turn + stands * seconds if stands else 0.0
        angles = self._angles()
        self.standing_angles = {index: angles[index] for index in standing}
        return self.commanded_turn > self._pitch

    def _has_turned_again(self) -> bool:
        """Whether a wheel that stood when the disturbance was known has turned since."""
        angles = self._angles()
        return any(
            abs(angles[index] - angle) > self._pitch
            for index, angle in self.standing_angles.items()
        )

    def _angles(self) -> tuple[float, float]:
        assert self.plant is not None
        truth = self.plant.truth()
        return truth.left_angle, truth.right_angle

    @property
    def _pitch(self) -> float:
        return 2.0 * pi / self._setting.robot.drive.left.encoder.slots

    def _end_after_stop(self, now: int) -> None:
        """End the run a while after a stop that only a person could release."""
        latched = [stop for stop in self.operator.stops_in_force.values() if stop.latched]
        if not latched:
            self.latched_at = None
        elif self.latched_at is None:
            self.latched_at = now
        elif now - self.latched_at > STOPPED_S * SECOND:
            self.engine.end(1, f"{latched[0].code}: {latched[0].cause}")


def run_case(case: Case, folder: Path | None = None) -> CaseResult:
    """Run a case, and the controller that knows the true pose. `folder`: keep the files there."""
    if folder is None:
        with TemporaryDirectory() as temporary:
            return run_case(case, Path(temporary))
    folder.mkdir(parents=True, exist_ok=True)
    setting = set_up(case, folder)
    run = ObservedRun(setting)
    result = run.go()
    robot, nominal = setting.robot, setting.configuration.nominal
    assert nominal is not None
    oracle = TruePoseController(robot, setting.goal, setting.tolerances)
    oracle_seconds = oracle.run(
        draw_robot(robot, nominal, setting.plant_seed), round(ORACLE_S * SECOND)
    )
    return _result(case, setting, run, result, oracle_seconds)


def _result(
    case: Case, setting: CaseSetting, run: ObservedRun, result: RunResult, oracle: float | None
) -> CaseResult:
    goal, state, pose, truth = setting.goal, run.state, result.odometry, result.truth
    assert pose is not None and truth is not None
    at = truth.pose
    x, y, turn = at.x - pose.x, at.y - pose.y, _wrap(at.heading - pose.heading)
    limits, lag = setting.robot.limits, setting.robot.drive.left.motor.lag
    xx, _, _, yy, _, hh = pose.covariance
    # Whoever arrives before the end of all motion proves nothing about the time after it.
    seconds = run.engine.last_instant / SECOND
    return CaseResult(
        case,
        _end_of(run, result, state),
        state.cause if state is not None and state.cause else result.ending.cause,
        oracle is not None and not (setting.is_fatal and seconds > setting.known_at),
        oracle,
        seconds,
        hypot(goal.x, goal.y),
        run.farthest,
        max(0.3, limits.speed * (1.0 + lag)),
        hypot(goal.x - at.x, goal.y - at.y),
        abs(_wrap((goal.heading or 0.0) - at.heading)),
        hypot(x, y),
        turn,
        position_sigmas(x, y, pose),
        turn / sqrt(hh) if hh > 0.0 else float("inf"),
        sqrt(max(0.5 * (xx + yy), 0.0)),
        sqrt(max(hh, 0.0)),
        run.travel_after,
        run.standing_after,
        result.stops[-1].code if result.stops else "",
        setting.wheel,
    )


def _end_of(run: ObservedRun, result: RunResult, state: GoalState | None) -> str:
    if result.failure is not None:
        return "failure"
    if run.latched_at is not None:
        return "stopped"
    if state is None or state.state not in GOAL_EXIT_CODES:
        return "time limit"
    return state.state


def position_sigmas(x: float, y: float, pose: Odometry) -> float:
    """The error (x, y) in standard deviations of the reported covariance."""
    xx, xy, _, yy, _, _ = pose.covariance
    determinant = xx * yy - xy * xy
    if determinant <= 0.0:
        return hypot(x, y) / sqrt(max(xx, yy)) if max(xx, yy) > 0.0 else float("inf")
    return sqrt(max((yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant, 0.0))


def _wrap(angle: float) -> float:
    return (angle + pi) % (2.0 * pi) - pi


def _ignore(text: str) -> None:
    """The messages of a run are not shown."""


def _copied(tree: dict[str, Any]) -> dict[str, Any]:
    return {key: dict(value) if isinstance(value, dict) else value for key, value in tree.items()}
