"""Metrics of a run: goals, cross-track error, path, stops and final error."""

from __future__ import annotations

import json
from math import hypot, sqrt
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.engine.stop_places import StopPlaces
from diffbotctl.messages import Goal, GoalState, Odometry, Stop
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.time import SECOND

DRIVERS = ("operator", "robot")  # the gate repeats their stops; each counts once


class Metrics(NamedTuple):
    """Metrics of one run; None where the run has no such value.

    `cross_track` is the distance, by odometry, from the straight line between the goal and the pose
    at which it was given. `final_error` is the distance of the last odometry pose to the last goal,
    `true_error` the same for the true pose of the simulated robot.
    """

    goals_reached: int
    time_to_goal: float | None  # s from the first goal to the last one that was reached
    cross_track_max: float | None  # m
    cross_track_rms: float | None  # m, over the distance driven
    path: float | None  # m driven
    stops: int
    final_error: float | None  # m
    true_error: float | None  # m


class MetricsAccumulator:
    """Accumulates the messages of a run, in order, into Metrics."""

    def __init__(self) -> None:
        self.goal: Goal | None = None
        self.first_goal_at = self.reached_at = -1  # ns
        self.reached: set[tuple[str, int]] = set()  # name of a robot of several, and number
        self.pose: Odometry | None = None
        self.start: tuple[float, float] = (0.0, 0.0)
        self.stop_codes: dict[str, str] = {}
        self.places = StopPlaces()
        self.forget()

    def forget(self) -> None:
        """Measure from here on: keep the pose, the goal and the stops in force."""
        self.path = 0.0  # m
        self.cross_track_max = 0.0  # m
        self.cross_track_integral = 0.0  # m^3: square of the cross-track error over the path
        self.tracked_path = 0.0  # m, driven towards goals
        self.stops = 0
        self.reached.clear()

    def take(self, time: int, wire: str, message: Any) -> None:
        """Add one message, in ns of logical time."""
        node = wire.rpartition(".")[0]
        robot, _, node = node.rpartition(".")
        match message:
            case Odometry() | Goal() if robot:
                pass  # the paths of several robots are not one
            case Odometry():
                self._add_pose(message)
            case Goal() if wire == "operator.goal" and message.number:
                self._add_goal(time, message)
            case GoalState(state="reached") if (robot, message.number) not in self.reached:
                self.reached.add((robot, message.number))
                self.reached_at = time
            case Stop() if node not in DRIVERS:
                if not message.code:
                    self.places.ends(wire)
                elif self.stop_codes.get(wire) != message.code:
                    self.stops += self.places.begins(wire, message)
                self.stop_codes[wire] = message.code

    def metrics(self, truth: tuple[float, float] | None = None) -> Metrics:
        """The metrics so far. `truth` is the true final position (x, y) in m where it is known."""
        pose, goal, tracked = self.pose, self.goal, self.tracked_path
        return Metrics(
            goals_reached=len(self.reached),
            time_to_goal=(self.reached_at - self.first_goal_at) / SECOND
            if self.reached and self.first_goal_at >= 0
            else None,
            cross_track_max=self.cross_track_max if tracked > 0.0 else None,
            cross_track_rms=sqrt(self.cross_track_integral / tracked) if tracked > 0.0 else None,
            path=self.path if pose is not None else None,
            stops=self.stops,
            final_error=_distance(goal, (pose.x, pose.y)) if pose is not None else None,
            true_error=_distance(goal, truth),
        )

    def _add_goal(self, time: int, goal: Goal) -> None:
        if self.first_goal_at < 0:
            self.first_goal_at = time
        if self.goal is None or goal.number != self.goal.number:
            self.start = (0.0, 0.0) if self.pose is None else (self.pose.x, self.pose.y)
        self.goal = goal

    def _add_pose(self, pose: Odometry) -> None:
        last, self.pose = self.pose, pose
        self.places.move(pose)
        if last is None:
            return
        step = hypot(pose.x - last.x, pose.y - last.y)
        self.path += step
        if self.goal is None or ("", self.goal.number) in self.reached:
            return
        cross_track = _cross_track(pose, self.start, self.goal)
        self.cross_track_max = max(self.cross_track_max, cross_track)
        self.cross_track_integral += cross_track * cross_track * step
        self.tracked_path += step


def _cross_track(pose: Odometry, start: tuple[float, float], goal: Goal) -> float:
    """Distance in m from the line through `start` and `goal`; from `start` when they coincide."""
    along_x, along_y = goal.x - start[0], goal.y - start[1]
    length = hypot(along_x, along_y)
    x, y = pose.x - start[0], pose.y - start[1]
    return abs(along_x * y - along_y * x) / length if length > 0.0 else hypot(x, y)


def _distance(goal: Goal | None, position: tuple[float, float] | None) -> float | None:
    if goal is None or position is None:
        return None
    return hypot(goal.x - position[0], goal.y - position[1])


def recorded_metrics(path: Path, begin: int = 0, until: int | None = None) -> Metrics:
    """The metrics of the recording at `path`, from `begin` to before `until` (ns).

    The pose, the goal and the stops in force at `begin` are taken from what came before it. Raises
    RunError for a file that is not a recording.
    """
    reader = RecordingReader(path)
    accumulator = MetricsAccumulator()
    for item in reader.messages():
        if until is not None and item.time >= until:
            break
        accumulator.take(item.time, item.wire, item.message)
        if item.time < begin:
            accumulator.forget()
    return accumulator.metrics(final_true_position(reader.end) if until is None else None)


def final_true_position(end: dict[str, str] | None) -> tuple[float, float] | None:
    """The true final position (x, y) in m of a simulated robot, from a recording's end."""
    truth = (end or {}).get("truth")
    if not truth:
        return None
    x, y = json.loads(truth)[:2]
    return float(x), float(y)
