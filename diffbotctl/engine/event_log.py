"""Log lines for the events of a run: goals, stops, the link, commands of the operator.

They are derived from messages, so a replay logs the same lines. Each event is one line; a state is
logged when it begins.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any

from diffbotctl.block import outputs
from diffbotctl.engine.stop_places import StopPlaces, pose_wire
from diffbotctl.graph import Graph, Sink
from diffbotctl.log import ERROR, INFO, LEVEL, WARNING, Log, Logbook
from diffbotctl.messages import (
    GOAL_EXIT_CODES,
    LOG_LEVELS,
    Call,
    Goal,
    GoalState,
    Link,
    LogLine,
    Odometry,
    Resume,
    Setting,
    Stop,
    Text,
)

LINK_LEVELS = {"stale": WARNING, "lost": ERROR}


def event_logger(graph: Graph) -> EventLogger | JoinedEventLogger | None:
    """What logs the events of `graph`; None for a graph without a log."""
    if graph.book is None:
        return None
    if not graph.parts:
        return EventLogger(graph, graph.book)
    return JoinedEventLogger(
        {
            name: EventLogger(part, part.book)
            for name, part in graph.parts.items()
            if part.book is not None
        }
    )


class JoinedEventLogger:
    """The loggers of the parts of a joined graph."""

    def __init__(self, parts: Mapping[str, EventLogger]) -> None:
        self.parts = parts

    def state(self) -> tuple[Any, ...]:
        """The state between two instants, for a snapshot."""
        return tuple(part.state() for part in self.parts.values())

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restore a `state` that was saved for an equal graph."""
        for part, of_part in zip(self.parts.values(), state, strict=True):
            part.restore(of_part)

    def sinks(self) -> dict[str, Sink]:
        return {
            f"{name}.{wire}": sink
            for name, part in self.parts.items()
            for wire, sink in part.sinks().items()
        }


class EventLogger:
    """Logs the events on the wires of `graph` in `book`."""

    def __init__(self, graph: Graph, book: Logbook) -> None:
        self.graph = graph
        self.book = book
        self.robot, self.operator = book.source_log("robot"), book.source_log("operator")
        self.goals: dict[str, tuple[int, str]] = {}
        self.stops: dict[str, str] = {}
        self.places = StopPlaces()
        self.link = ""
        self.restarts = 0

    def state(self) -> tuple[Any, ...]:
        """The state between two instants, for a snapshot."""
        return self.goals, self.stops, self.link, self.restarts, self.places.state()

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restore a `state` that was saved for an equal graph."""
        self.goals, self.stops, self.link, self.restarts, places = state
        self.places.restore(places)

    def sinks(self) -> dict[str, Sink]:
        sinks: dict[str, Sink] = {
            wire: sink for wire, sink in self._of_drivers().items() if wire in self.graph.sources
        }
        for node in self.graph.nodes:
            for port, out in outputs(type(node.block)).items():
                if out.kind is Stop:
                    sinks[f"{node.name}.{port}"] = self._stop(self.book.source_log(node.name))
                elif out.kind is GoalState:
                    sinks[f"{node.name}.{port}"] = self._goal_state(self.book.source_log(node.name))
        pose = pose_wire(self.graph)
        return sinks if pose is None else sinks | {pose: self._odometry}

    def _of_drivers(self) -> dict[str, Sink]:
        return {
            "operator.goal": self._goal,
            "operator.resume": self._resume,
            "operator.setting": self._setting,
            "operator.call": self._call,
            "operator.log": self._line,
            "robot.link": self._link,
            "robot.text": self._text,
        }

    def _stop(self, log: Log) -> Sink:
        def on_stop(now: int, stop: Stop) -> None:
            before = self.stops.get(log.source, "")
            self.stops[log.source] = stop.code
            if stop.code == before:
                return
            if not stop.code:
                if self.places.ends(log.source):
                    log.info(f"stop {before} ended")
            elif not self.places.begins(log.source, stop):
                return
            elif stop.latched:
                log.error(f"STOP {stop.code}: {stop.cause}; waits for `resume`")
            else:
                log.warning(f"STOP {stop.code}: {stop.cause}; ends by itself")

        return on_stop

    def _odometry(self, now: int, odometry: Odometry) -> None:
        for source, code in self.places.move(odometry):
            self.book.source_log(source).info(f"stop {code} ended")

    def _goal_state(self, log: Log) -> Sink:
        def on_goal_state(now: int, state: GoalState) -> None:
            goal = (state.number, state.state)
            if goal == self.goals.get(log.source):
                return
            self.goals[log.source] = goal
            if state.state == "reached":
                log.info(f"goal {state.number} reached, error {_remaining(state)}")
            elif state.state == "reached_unsure":
                left = _remaining(state)
                log.warning(f"goal {state.number} reached, error {left}, unsure: {state.cause}")
            elif state.state == "cancelled":
                log.info(f"goal {state.number} cancelled, {_remaining(state)} away: {state.cause}")
            elif state.state in GOAL_EXIT_CODES:
                why = "" if state.state == "given_up" else f"{state.state.replace('_', ' ')}: "
                log.error(
                    f"goal {state.number} given up, {_remaining(state)} away: {why}{state.cause}"
                )
            elif state.state != "idle":
                log.info(f"goal {state.number}: {state.state}, {_remaining(state)} to go")

        return on_goal_state

    def _goal(self, now: int, goal: Goal) -> None:
        self.goals.clear()  # a goal that continues after a pause is logged again
        if not goal.number:
            self.operator.info("the goal is withdrawn")
            return
        heading = "" if goal.heading is None else f"  heading {degrees(goal.heading):z.0f} deg"
        pose = f"x {goal.x:z.3f} m  y {goal.y:z.3f} m{heading}"
        self.operator.info(f"goal {goal.number} accepted: {pose}")

    def _resume(self, now: int, resume: Resume) -> None:
        self.operator.info("resume: the operator allows motion")

    def _setting(self, now: int, change: Setting) -> None:
        value = change.text if change.number is None else f"{change.number:g}"
        if change.name == LEVEL:
            who = "every block" if change.block not in self.book.logs else change.block
            self.operator.info(f"log level of {who} set to {value}")
        else:
            self.operator.info(f"{change.block}.{change.name} = {value}")

    def _call(self, now: int, call: Call) -> None:
        arguments = ", ".join(f"{value:g}" for value in call.arguments)
        self.operator.info(f"{call.block}.{call.action}({arguments}) called")

    def _line(self, now: int, line: LogLine) -> None:
        """A line that a driver logged, subject to the level of its source."""
        self.book.source_log(line.source).write(LOG_LEVELS.index(line.level), line.text)

    def _link(self, now: int, link: Link) -> None:
        if link.restarts > self.restarts:
            self.robot.warning(f"the board restarted (restart {link.restarts} of this run)")
        self.restarts = link.restarts
        if link.state == self.link:
            return
        self.link = link.state
        why = f": {link.cause}" if link.cause else ""
        self.robot.write(LINK_LEVELS.get(link.state, INFO), f"link {link.state}{why}")

    def _text(self, now: int, text: Text) -> None:
        self.robot.info(text.text)


def _remaining(state: GoalState) -> str:
    return f"{state.distance * 1000:.0f} mm, {abs(degrees(state.turn)):.1f} deg"
