"""One run of the matrix: a random robot, one perturbation, one plant, a random goal, to its end."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from diffbotctl.config.load import load
from diffbotctl.config.robot import Robot
from diffbotctl.control.motion_profile import shortest_turn
from diffbotctl.graph import Sink
from diffbotctl.messages import Duty, Goal, Odometry, Wheels
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.runs.options import RunResult
from diffbotctl.time import SECOND
from diffbotctl.trials.plan import Trial
from diffbotctl.trials.random_robots import RobotDesign, draw_design, yaml_text
from diffbotctl.trials.sections import Expectation
from diffbotctl.trials.trial_run import TrialResult, TrialRun, trial_result
from tests.support.nominal_calibration import calibrate
from tests.support.random_robots import ENCODER_FAULTS, PERTURBATIONS
from tests.support.true_pose_controller import TruePoseController

EQUATIONS = {1: "exponential", 2: "torque"}
DURATION_S = 300.0  # of simulated time, beyond every time limit of the follower
ORACLE_S = 120.0  # of simulated time, for the controller that knows the true pose
GOAL_SECONDS = 8.0  # of driving at the robot's speed limit, at most
GOAL_MAX, GOAL_MIN = 2.0, 0.05  # m
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
    """How the trial of a case ended. Lengths m, angles rad, times s."""

    case: Case
    trial: TrialResult
    cause: str
    """of the end of the goal, or of the run"""
    is_feasible: bool
    farther_limit: float
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
    wheel: str
    """the disturbed wheel, left or right, or empty"""

    @property
    def is_named(self) -> bool:
        """Whether the cause names the disturbed wheel, if one is."""
        return self.wheel in self.cause

    @property
    def true_error(self) -> float:
        """Distance from the goal to where the robot really is."""
        return self.trial.error or 0.0

    @property
    def farther(self) -> float:
        """How much farther from the goal it was than at the start."""
        return self.trial.farther or 0.0


class CaseSetting(NamedTuple):
    """What a case consists of."""

    trial: Trial
    robot: Robot
    tolerances: tuple[float, float]
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
    goal = _draw_goal(configuration.robot, design, rng)
    trial = Trial(
        str(case),
        case.perturbation,
        str(case.robot),
        configuration,
        (goal,),
        plant_seed,
        "sim",
        DURATION_S,
        Expectation(),
    )
    return CaseSetting(
        trial,
        configuration.robot,
        design.tolerances,
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


class ObservedRun(TrialRun):
    """The run of a trial that notes when a person could have known that its goal is lost."""

    def __init__(self, setting: CaseSetting) -> None:
        self.commanded: tuple[float, float] = (0.0, 0.0)
        self.travel_after = self.standing_after = 0.0
        self.known = False
        self.commanded_turn = 0.0  # rad, of a wheel that stands
        self.standing_angles: dict[int, float] = {}  # rad, of those wheels
        self._setting, self._seen = setting, 0
        super().__init__(setting.trial)

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = super()._sinks()
        assert self.assembly.command is not None
        sinks[self.assembly.command].append(self._on_command)
        return sinks

    def _on_command(self, now: int, command: Wheels | Duty) -> None:
        self.commanded = (command.left, command.right)

    def _look(self) -> None:
        super()._look()
        plant = self.plant
        assert plant is not None
        seconds = (plant.now - self._seen) / SECOND
        self._seen = plant.now
        if plant.now >= self._setting.known_at * SECOND:
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


def run_case(case: Case, folder: Path | None = None) -> CaseResult:
    """Run a case, and the controller that knows the true pose. `folder`: keep the files there."""
    if folder is None:
        with TemporaryDirectory() as temporary:
            return run_case(case, Path(temporary))
    folder.mkdir(parents=True, exist_ok=True)
    setting = set_up(case, folder)
    run = ObservedRun(setting)
    result = run.go()
    robot, nominal = setting.robot, setting.trial.configuration.nominal
    assert nominal is not None
    oracle = TruePoseController(robot, setting.trial.goals[0], setting.tolerances)
    seconds = oracle.run(draw_robot(robot, nominal, setting.trial.seed), round(ORACLE_S * SECOND))
    return _result(case, setting, run, result, seconds is not None)


def _result(
    case: Case, setting: CaseSetting, run: ObservedRun, result: RunResult, oracle_reaches: bool
) -> CaseResult:
    found, state, pose, truth = trial_result(run, result), run.state, result.odometry, result.truth
    assert pose is not None and truth is not None
    at = truth.pose
    turn = shortest_turn(at.heading - pose.heading)
    xx, _, _, yy, _, hh = pose.covariance
    return CaseResult(
        case,
        found,
        state.cause if state is not None and state.cause else found.cause,
        # Whoever arrives before the end of all motion proves nothing about the time after it.
        oracle_reaches and not (setting.is_fatal and found.time > setting.known_at),
        max(0.3, setting.robot.limits.speed * (1.0 + setting.robot.drive.left.motor.lag)),
        turn,
        position_sigmas(at.x - pose.x, at.y - pose.y, pose),
        turn / sqrt(hh) if hh > 0.0 else float("inf"),
        sqrt(max(0.5 * (xx + yy), 0.0)),
        sqrt(max(hh, 0.0)),
        run.travel_after,
        run.standing_after,
        setting.wheel,
    )


def position_sigmas(x: float, y: float, pose: Odometry) -> float:
    """The error (x, y) in standard deviations of the reported covariance."""
    xx, xy, _, yy, _, _ = pose.covariance
    determinant = xx * yy - xy * xy
    if determinant <= 0.0:
        return hypot(x, y) / sqrt(max(xx, yy)) if max(xx, yy) > 0.0 else float("inf")
    return sqrt(max((yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant, 0.0))


def _copied(tree: dict[str, Any]) -> dict[str, Any]:
    return {key: dict(value) if isinstance(value, dict) else value for key, value in tree.items()}
