"""One run of trials, simulated, and watched by what is really true of the robot."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Literal, NamedTuple, cast

from diffbotctl.control.motion_profile import shortest_turn
from diffbotctl.control.pose_sd import PoseSd
from diffbotctl.graph import Sink
from diffbotctl.messages import GOAL_EXIT_CODES, Goal, GoalEnd, GoalState
from diffbotctl.plant.collision import BodyOutline, clearance
from diffbotctl.programs.driver import ProgramsDriver
from diffbotctl.runs.build_graph import wires_of
from diffbotctl.runs.options import RunOptions, RunResult
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND, SECOND
from diffbotctl.trials.plan import Trial
from diffbotctl.trials.sections import CLEARANCE_MAX

STOPPED_TIME = SECOND  # ns after which a stop that only `resume` could end is the end of the run
LOOK_PERIOD = 50 * MILLISECOND  # at 0.3 m/s the robot drives 15 mm
PATH_POINTS_MAX = 120

Outcome = GoalEnd | Literal["stopped", "time_limit", "ended", "failed", "crashed"]


class StopRecord(NamedTuple):
    """A stop of the robot, or the end of a goal that was not reached: `time` in s."""

    time: float
    code: str
    cause: str


class TrialResult(NamedTuple):
    """What came of one run. Lengths in m, angles in rad, times in s; None: not known.

    The errors are at the end of the run: `error` and `heading_error` from the last goal to where
    the robot really is, `estimate_error` between estimate and truth, `estimate_sigmas` this over
    the standard deviation that odometry reports. `farther`: how much farther from its goal it was
    than at the start. `fault_at`: when the first fault began. `unbegun`: kinds of those that never
    did.
    """

    name: str
    case: str
    robot: str
    seed: int
    outcome: Outcome
    cause: str
    time: float = 0.0
    reached: int = 0
    goals: int = 0
    error: float | None = None
    heading_error: float | None = None
    estimate_error: float | None = None
    estimate_sigmas: float | None = None
    farther: float | None = None
    clearance: float = CLEARANCE_MAX
    fault_at: float = 0.0
    unbegun: tuple[str, ...] = ()
    stops: tuple[StopRecord, ...] = ()
    path: tuple[tuple[float, float], ...] = ()

    @property
    def has_contact(self) -> bool:
        """Whether the robot touched a wall or an obstacle."""
        return self.clearance <= 0.0

    @property
    def is_claimed(self) -> bool:
        """Whether it ended at the goal, as it reported."""
        return self.outcome in ("reached", "reached_unsure")


class TrialRun(Run):
    """The run of a trial: it notes how the goals end, and watches the true robot.

    It is as fast as possible, but in real time with programs, which must have been allowed.
    """

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.state: GoalState | None = None
        self.latched_at: int | None = None
        self.farther, self.clearance = 0.0, CLEARANCE_MAX
        self.path: list[tuple[float, float]] = []
        self._looked = -LOOK_PERIOD
        self._goal: Goal | None = None
        self._goal_distance = 0.0
        options = RunOptions(
            rehearses=True,
            port=trial.port,
            goals=trial.goals,
            seed=trial.seed,
            fast=not trial.configuration.programs,
            programs=ProgramsDriver,
            duration=trial.time_limit,
        )
        super().__init__(trial.configuration, options, tell=lambda text: None)
        robot = trial.configuration.robot
        assert robot is not None
        body = robot.body
        self._outline = BodyOutline(body.front, body.back, body.width / 2)

    def _idle(self) -> Callable[[], None]:
        rest = super()._idle()  # of programs

        def idle() -> None:
            if rest is not None:
                rest()
            self._look()

        return idle

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = super()._sinks()
        for wire in wires_of(self.assembly, GoalState):
            sinks[wire].append(self._on_state)
        return sinks

    def _on_state(self, now: int, state: GoalState) -> None:
        self.state = state

    def _look(self) -> None:
        plant = self.plant
        assert plant is not None
        self._end_after_stop(plant.now)
        if plant.now - self._looked < LOOK_PERIOD:
            return
        self._looked = plant.now
        body = plant.chassis
        self.path.append((round(body.x, 3), round(body.y, 3)))
        self.clearance = min(
            self.clearance,
            clearance(self._outline, plant.pose_in_world(), plant.world, self.clearance),
        )
        if plant.has_contact:
            self.clearance = 0.0
        goal = self.operator.active
        if goal is None:
            return
        distance = hypot(goal.x - body.x, goal.y - body.y)
        if goal is not self._goal:
            self._goal, self._goal_distance = goal, distance
        self.farther = max(self.farther, distance - self._goal_distance)

    def _end_after_stop(self, now: int) -> None:
        """End the run a while after a stop that only a person could release."""
        latched = [stop for stop in self.operator.stops_in_force.values() if stop.latched]
        if not latched:
            self.latched_at = None
        elif self.latched_at is None:
            self.latched_at = now
        elif now - self.latched_at > STOPPED_TIME:
            self.engine.end(1, f"{latched[0].code}: {latched[0].cause}")

    def goal_at_end(self, result: RunResult) -> Goal | None:
        """The goal at which the robot stands, or to which it drove last."""
        return result.goal or self._goal or next(iter(self.robots[0].goals), None)

    def outcome(self, result: RunResult) -> Outcome:
        """How the run ended."""
        if result.failure is not None:
            return "failed"
        if result.ending.cause.startswith("time limit"):
            return "time_limit"
        if self.latched_at is not None:
            return "stopped"
        state = self.state
        if state is None or state.state not in GOAL_EXIT_CODES:
            return "ended"
        is_unsure = state.state == "reached" and result.unsure
        return "reached_unsure" if is_unsure else cast("GoalEnd", state.state)


def run_trial(trial: Trial) -> TrialResult:
    """Run a trial to its end. Raises whatever a block or the plant raises."""
    run = TrialRun(trial)
    return trial_result(run, run.go())


def trial_result(run: TrialRun, result: RunResult) -> TrialResult:
    """What came of a run that has ended."""
    assert run.plant is not None
    trial, faults = run.trial, run.plant.faults.faults
    outcome = run.outcome(result)
    goal = run.goal_at_end(result)
    stops = [StopRecord(stop.time / SECOND, stop.code, stop.cause) for stop in result.stops]
    state = run.state
    if state is not None and outcome in ("blocked", "stuck", "given_up"):
        stops.append(StopRecord(state.time / SECOND, state.state, state.cause))
    end = result.ending
    found = TrialResult(
        *(trial.name, trial.case, trial.robot, trial.seed, outcome, end.cause, end.time / SECOND),
        result.reached + result.unsure,
        result.goals,
        farther=None if goal is None else run.farther,
        clearance=run.clearance,
        fault_at=min((fault.start for fault in faults), default=0) / SECOND,
        unbegun=tuple(fault.kind for fault in faults if fault.start > end.time),
        stops=tuple(stops),
        path=tuple(run.path[:: -(-len(run.path) // PATH_POINTS_MAX) or 1]),
    )
    return _with_errors(found, result, goal)


def _with_errors(found: TrialResult, result: RunResult, goal: Goal | None) -> TrialResult:
    """`found` with the errors at the end, as far as they are known."""
    truth, pose = result.truth, result.odometry
    if truth is None:
        return found
    at = truth.pose
    if goal is not None:
        turn = None if goal.heading is None else abs(shortest_turn(at.heading - goal.heading))
        found = found._replace(error=hypot(goal.x - at.x, goal.y - at.y), heading_error=turn)
    if pose is None:
        return found
    off, sd = hypot(pose.x - at.x, pose.y - at.y), PoseSd.of(pose, counts_geometry=True).position
    return found._replace(estimate_error=off, estimate_sigmas=off / sd if sd > 0.0 else None)
