"""What a run came to, in a few numbers: the same ones for a recording and for its replay.

The metrics of a recording.
"""

from __future__ import annotations

import json
from math import hypot, sqrt
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.messages import Goal, GoalState, Odometry, Stop
from diffbotctl.recording.info import readable_recording, require_complete
from diffbotctl.recording.mcap_file import RecordingReader
from diffbotctl.time import SECOND

DRIVERS = ("operator.", "robot.")  # the gate tells their stops again; each counts once


class Metrics(NamedTuple):
    """Figures of one run; None where it says nothing of the kind.

    `cross_track` is the distance from the straight line between the pose at which a goal was given
    and that goal, as odometry saw it. `final_error` is the last odometry's distance to the last
    goal, `true_error` the same for the simulated robot's true pose.
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
    """Takes the messages of a run in order; `metrics` says what they came to."""

    def __init__(self) -> None:
        self.goal: Goal | None = None
        self.given = self.reached_at = -1
        self.reached: set[int] = set()
        self.pose: Odometry | None = None
        self.start: tuple[float, float] = (0.0, 0.0)
        self.path = self.squares = self.most = self.measured = 0.0
        self.held: dict[str, str] = {}
        self.stops = 0

    def take(self, time: int, wire: str, message: Any) -> None:
        """Take one message, in ns of logical time."""
        if isinstance(message, Odometry):
            self._move(message)
        elif isinstance(message, Goal) and wire == "operator.goal":
            self._aim(time, message)
        elif isinstance(message, GoalState) and message.state == "reached":
            if message.number not in self.reached:
                self.reached.add(message.number)
                self.reached_at = time
        elif isinstance(message, Stop) and not wire.startswith(DRIVERS):
            if message.code and self.held.get(wire) != message.code:
                self.stops += 1
            self.held[wire] = message.code

    def forget(self) -> None:
        """Measure from here on: keep the pose, the goal and what holds, and drop the figures."""
        self.path = self.squares = self.most = self.measured = 0.0
        self.stops = 0
        self.reached.clear()

    def metrics(self, truth: tuple[float, float] | None = None) -> Metrics:
        """The figures so far. `truth` is the true final place (x, y) in m where it is known."""
        pose, goal = self.pose, self.goal
        return Metrics(
            goals_reached=len(self.reached),
            time_to_goal=(self.reached_at - self.given) / SECOND if self.reached else None,
            cross_track_max=self.most if self.measured > 0.0 else None,
            cross_track_rms=sqrt(self.squares / self.measured) if self.measured > 0.0 else None,
            path=self.path if pose is not None else None,
            stops=self.stops,
            final_error=_away(goal, (pose.x, pose.y)) if pose is not None else None,
            true_error=_away(goal, truth),
        )

    def _aim(self, time: int, goal: Goal) -> None:
        if not goal.number:
            return
        if self.given < 0:
            self.given = time
        if self.goal is None or goal.number != self.goal.number:
            self.start = (0.0, 0.0) if self.pose is None else (self.pose.x, self.pose.y)
        self.goal = goal

    def _move(self, pose: Odometry) -> None:
        last, self.pose = self.pose, pose
        if last is None:
            return
        step = hypot(pose.x - last.x, pose.y - last.y)
        self.path += step
        if self.goal is None or self.goal.number in self.reached:
            return
        away = _beside(pose, self.start, self.goal)
        self.most = max(self.most, away)
        self.squares += away * away * step
        self.measured += step


def _beside(pose: Odometry, start: tuple[float, float], goal: Goal) -> float:
    """Distance in m from the line through `start` and `goal`; from `start` when they coincide."""
    along_x, along_y = goal.x - start[0], goal.y - start[1]
    length = hypot(along_x, along_y)
    x, y = pose.x - start[0], pose.y - start[1]
    return abs(along_x * y - along_y * x) / length if length > 0.0 else hypot(x, y)


def _away(goal: Goal | None, place: tuple[float, float] | None) -> float | None:
    if goal is None or place is None:
        return None
    return hypot(goal.x - place[0], goal.y - place[1])


def recorded_metrics(path: Path, begin: int = 0, until: int | None = None) -> Metrics:
    """The metrics of the recording at `path`, from `begin` to before `until` (ns).

    What was said before `begin` still counts as known: the pose, the goal, what held the robot.
    Raises RunError for a file that is no recording.
    """
    reader = RecordingReader(path)
    measure = MetricsAccumulator()
    with readable_recording(path):
        for item in reader.messages():
            if until is not None and item.time >= until:
                break
            measure.take(item.time, item.wire, item.message)
            if item.time < begin:
                measure.forget()
    require_complete(reader)
    return measure.metrics(recorded_truth(reader.end) if until is None else None)


def recorded_truth(end: dict[str, str] | None) -> tuple[float, float] | None:
    """The true final place (x, y) in m of a simulated robot, where the recording tells it."""
    told = (end or {}).get("truth")
    if not told:
        return None
    x, y = json.loads(told)[:2]
    return float(x), float(y)
