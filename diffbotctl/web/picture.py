"""What the page draws of a run, as JSON values, in the words of the other screens."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, isfinite
from typing import Any

from diffbotctl.control_socket.protocol import Fields
from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.messages import (
    Battery,
    Goal,
    GoalState,
    Imu,
    Link,
    Odometry,
    Path,
    Range,
    Scan,
    Text,
)
from diffbotctl.time import SECOND
from diffbotctl.ui import run_text
from diffbotctl.ui.dash.state import Request, RunView
from diffbotctl.ui.map.layers import covariance_ellipse, pose_at

MILLIMETRES = 1000
Row = tuple[str, str, bool]  # name, text, whether it needs attention


class RunPicture:
    """Follows the replies of the engine. `whole` is everything, `changes` what is new."""

    def __init__(self) -> None:
        self.view = RunView()
        self.scene: Fields = {}
        self.held: Fields | None = None
        self.new_points: list[tuple[float, float]] = []
        self.is_trail_new = True
        self.scan_times: dict[str, int] = {}

    def take(self, request: Request, reply: Fields) -> None:
        """Update with the reply to `request`."""
        if request == "scene":
            self.scene = {name: value for name, value in reply.items() if name not in ("id", "ok")}
        points = self.view.trail.points
        last = points[-1] if points else None
        self.view.take_reply(request, reply)
        if points and points[-1] is not last:
            self.is_trail_new |= len(points) == 1
            self.new_points.append(points[-1])

    def take_trail(self, reply: Fields) -> None:
        """Take the trail from before this server was attached, in a reply to `read_history`."""
        self.view.take_trail(reply)
        self.new_points, self.is_trail_new = list(self.view.trail.points), True

    def changes(self) -> Fields:
        """What is new since the last call."""
        scans = {
            wire: scan for wire, scan in self._scans() if self.scan_times.get(wire, -1) < scan.time
        }
        self.scan_times |= {wire: scan.time for wire, scan in scans.items()}
        fields = {
            **self._present(),
            "scans": {wire: self._scan_fields(scan) for wire, scan in scans.items()},
            "trail": _points(self.new_points),
            "trail_begins": self.is_trail_new,
        }
        self.new_points, self.is_trail_new = [], False
        return fields

    def whole(self) -> Fields:
        """Everything, for a page that has just been opened or has fallen behind."""
        return {
            **self._present(),
            "scene": self.scene,
            "scans": {wire: self._scan_fields(scan) for wire, scan in self._scans()},
            "trail": _points(list(self.view.trail.points)),
            "trail_begins": True,
        }

    def _scans(self) -> Iterator[tuple[str, Scan]]:
        for wire, message in self.view.snapshot.messages.items():
            if isinstance(message, Scan):
                yield wire, message

    def _scan_fields(self, scan: Scan) -> Fields:
        """The pose in the middle of the turn, and distances in whole mm, 0: nothing measured."""
        middle = scan.time - round(0.5 * SECOND * scan.duration)
        odometry = run_text.newest_odometry(self.view.snapshot)
        return {
            "pose": None if odometry is None else _place_fields(pose_at(odometry, middle)),
            "start": scan.start,
            "step": scan.step,
            "mm": [
                round(distance * MILLIMETRES) if isfinite(distance) else 0
                for distance in scan.distances
            ],
        }

    def _present(self) -> Fields:
        """The newest of what is small."""
        snapshot = self.view.snapshot
        odometry = run_text.newest_odometry(snapshot)
        goal = run_text.newest_message(snapshot, Goal)
        path = run_text.newest_message(snapshot, Path)
        stop = self.view.held
        return {
            "time": snapshot.time / SECOND,
            "pose": None if odometry is None else _pose_fields(odometry),
            "goal": None if goal is None or not goal.number else _goal_fields(goal),
            "path": [] if path is None else [[each.x, each.y] for each in path.goals],
            "ranges": {
                wire: [message.state, _finite(message.distance)]
                for wire, message in snapshot.messages.items()
                if isinstance(message, Range)
            },
            "facts": list(_facts(self.view)),
            "stop": None if stop is None else _stop_fields(stop),
        }


def _place_fields(odometry: Odometry) -> list[float]:
    """x, y and heading."""
    place = (odometry.x, odometry.y, odometry.heading)
    return [round(value, 4) if isfinite(value) else 0.0 for value in place]


def _pose_fields(odometry: Odometry) -> list[Any]:
    """x, y, heading, and the ellipse of the position: half axes and direction."""
    pose = [odometry.x, odometry.y, odometry.heading, *covariance_ellipse(odometry.covariance)]
    return [round(value, 4) if isfinite(value) else 0.0 for value in pose]


def _goal_fields(goal: Goal) -> list[float | None]:
    return [goal.x, goal.y, goal.heading]


def _points(points: list[tuple[float, float]]) -> list[float]:
    """x and y of one point after the other, to the mm."""
    return [round(value, 3) for point in points for value in point]


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _stop_fields(stop: Fields) -> Fields:
    """The stop in force, and how it ends."""
    end = "waits for `resume`" if stop["latched"] else "ends by itself"
    return {**{name: stop[name] for name in ("code", "cause", "latched")}, "end": end}


def _facts(view: RunView) -> Iterator[Row]:
    """The rows of values: the names and the words of the other screens."""
    snapshot = view.snapshot
    odometry = run_text.newest_odometry(snapshot)
    if odometry is not None:
        yield "pose", run_text.pose_text(odometry), False
        speed = f"{odometry.linear:+.3f} m/s {odometry.angular:+.2f} rad/s"
        yield "body", speed, False
    yield from _goal_rows(view)
    if (wheels := run_text.commanded_wheels(snapshot)) is not None:
        yield "wheels", run_text.wheel_speeds_text(wheels, None), False
    if (imu := run_text.newest_message(snapshot, Imu)) is not None:
        yield "imu", imu_text(imu), imu.state != "working"
    for message in snapshot.messages.values():
        if isinstance(message, Range):
            yield "range", run_text.range_text(message), message.state == "fault"
    if (battery := run_text.newest_message(snapshot, Battery)) is not None:
        yield "supply", f"{battery.volts:.1f} V", battery.low
    if (link := run_text.newest_message(snapshot, Link)) is not None:
        yield "link", run_text.link_text(link), link.state != "up"
    for wire, message in snapshot.messages.items():
        if isinstance(message, Text):
            yield wire.partition(".")[0], message.text, False


def _goal_rows(view: RunView) -> Iterator[Row]:
    goal = run_text.newest_message(view.snapshot, Goal)
    state = run_text.newest_message(view.snapshot, GoalState)
    if goal is not None and goal.number:
        heading = "" if goal.heading is None else f"  heading {degrees(goal.heading):.0f} deg"
        yield "goal", f"x {goal.x:.3f} m  y {goal.y:.3f} m{heading}", False
    if state is not None and state.state != "idle":
        is_bad = state.state in ("reached_unsure", "blocked", "stuck", "given_up", "cancelled")
        yield "state", run_text.goal_state_text(state), is_bad
