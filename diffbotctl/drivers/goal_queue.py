"""The operator: hands out goals, echoes what holds the robot, and decides how the run ends."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from diffbotctl.engine.driver import Delivery
from diffbotctl.engine.stop_places import StopPlaces
from diffbotctl.log import LEVEL
from diffbotctl.messages import (
    GOAL_EXIT_CODES,
    REACHED_UNSURE,
    Goal,
    GoalState,
    LogLevel,
    LogLine,
    Message,
    Odometry,
    Path,
    Resume,
    Setting,
    Stop,
)
from diffbotctl.time import NEVER

STOPS_MAX = 100  # that are kept for the summary; a run may last for weeks


class Operator:
    """A driver that sends the goals of the files or the command line, one after the other.

    What it delivers in answer to a message comes one nanosecond after it: feedback from the end of
    the graph to its beginning goes through here, so that the graph itself has no loop.

    `end` is called with exit code and cause when the run should end; with `stay` no goal ends it.
    """

    def __init__(
        self,
        goals: Sequence[Goal],
        end: Callable[[int, str], None],
        stay: bool = False,
        rest: int = 0,
    ) -> None:
        """`rest`: ns between a goal and the next one, in which a gyro is zeroed."""
        self.rest = rest
        self._next_goal: Goal | None = None  # which is sent after the rest
        self._next_goal_due = 0
        self.end = end
        self.stay = stay
        self.waiting = list(goals)
        self.active: Goal | None = None
        self.paused: Goal | None = None
        self.goal_reached: Goal | None = None  # at which the robot stands, as it estimates
        self.number = 0  # of the goal sent last; the first one is 1
        self.reached = 0
        self.reached_unsure = 0
        self.unsure = ""  # why the first goal that was reached with an uncertain pose is uncertain
        self.stops: deque[Stop] = deque(maxlen=STOPS_MAX)  # the last ones of the run
        self.places = StopPlaces()
        self.on_new_stop: Callable[[int, Stop], None] = lambda now, stop: None
        self.stops_in_force: dict[str, Stop] = {}  # by the block that holds the robot
        self.outbox: list[Delivery] = []
        self.outbox_due = 0
        self._goals_given = len(goals)
        self._send_next(0)

    def due(self) -> int:
        """At once when something waits to be delivered, or when the robot has rested."""
        rested = self._next_goal_due if self._next_goal is not None else NEVER
        return min(self.outbox_due, rested) if self.outbox else rested

    def files(self) -> list[int]:
        """None: everything comes through method calls."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """The messages that wait, stamped with `now`."""
        if self._next_goal is not None and now >= self._next_goal_due:
            self.outbox.append(Delivery("operator.goal", self._next_goal))
            self._next_goal = None
        messages = [Delivery(wire, message._replace(time=now)) for wire, message in self.outbox]
        self.outbox = []
        return messages

    def close(self) -> None:
        """Nothing is held open."""

    def progress(self) -> tuple[int, int]:
        """Goals reached, and goals in all."""
        return self.reached, max(self._goals_given, self.number)

    def on_goal_state(self, now: int, state: GoalState) -> None:
        """Send the next goal when one is reached; end the run when one failed."""
        if self.active is None or state.number != self.active.number:
            return
        if state.state == "reached":
            self.reached += 1
            self._send_next_from(now, self.active)
        elif state.state == "reached_unsure":
            self.reached_unsure += 1
            self.unsure = self.unsure or f"goal {state.number} reached, but {state.cause}"
            self._send_next_from(now, self.active)
        elif state.state in GOAL_EXIT_CODES:
            self.active = None
            if not self.stay:
                code = GOAL_EXIT_CODES[state.state]
                self.end(
                    code, f"goal {state.number} was not reached ({state.state}): {state.cause}"
                )

    def on_path(self, now: int, path: Path) -> None:
        self.waiting += path.goals
        if self.active is None and self.paused is None:
            self._send_next(now)

    def stop_sink(self, source: str) -> Callable[[int, Stop], None]:
        """A sink for the stops of the block `source`: kept for the summary, and echoed.

        `on_new_stop` is called with each that is not one at the same place as the last.
        """

        def on_stop(now: int, stop: Stop) -> None:
            if stop.code:
                if self.places.begins(source, stop):
                    self.stops.append(stop)
                    self.on_new_stop(now, stop)
                self.stops_in_force[source] = stop
            else:
                self.places.ends(source)
                self.stops_in_force.pop(source, None)
            latched_first = sorted(self.stops_in_force.values(), key=lambda stop: not stop.latched)
            echo = latched_first[0] if latched_first else Stop(now, "", "", False)
            self._send(now, "stop", echo)

        return on_stop

    def on_odometry(self, now: int, odometry: Odometry) -> None:
        """Take the robot's pose: stops at the same place are one stop."""
        self.places.move(odometry)

    def replace_goals(self, now: int, goal: Goal) -> None:
        """Follow `goal` instead of all others. From now on no goal ends the run."""
        self.stay = True
        self.paused = None
        self.waiting = [goal]
        self._send_next(now)

    def pause(self, now: int) -> None:
        """Withdraw the active goal until `resume`, for manual driving."""
        self.goal_reached = None
        if self.active is not None:
            self._next_goal = None
            self.paused, self.active = self.active, None
            self._send(now, "goal", Goal(now, 0))

    def resume(self, now: int) -> None:
        """Allow motion again after a latched stop, and continue with a paused goal."""
        self.allow_motion(now)
        if self.paused is not None:
            self.active, self.paused = self.paused, None
            self._send(now, "goal", self.active)

    def allow_motion(self, now: int) -> None:
        """Allow motion again after a latched stop; a paused goal stays paused."""
        self._send(now, "resume", Resume(now))

    def log(self, now: int, level: LogLevel, source: str, text: str) -> None:
        self._send(now, "log", LogLine(now, level, source, text))

    def set_level(self, now: int, source: str, level: str) -> None:
        """Set the lowest level that is logged from `source`."""
        self._send(now, "setting", Setting(now, source, LEVEL, None, level))

    def set_number(self, now: int, block: str, name: str, value: float) -> None:
        """Set the live parameter `name` of a block."""
        self._send(now, "setting", Setting(now, block, name, value))

    def _send_next_from(self, now: int, reached: Goal) -> None:
        self._send_next(now, self.rest)
        if self.active is None:
            self.goal_reached = reached

    def _send_next(self, now: int, rest: int = 0) -> None:
        self._next_goal = None
        self.goal_reached = None
        if self.waiting:
            self.number += 1
            self.active = self.waiting.pop(0)._replace(number=self.number)
            if rest:
                self._next_goal, self._next_goal_due = self.active, now + rest
            else:
                self._send(now, "goal", self.active)
            return
        if self.active is not None and not self.stay:
            self.end(REACHED_UNSURE if self.unsure else 0, self.unsure or "all goals reached")
        self.active = None

    def _send(self, now: int, port: str, message: Message) -> None:
        self.outbox.append(Delivery(f"operator.{port}", message))
        self.outbox_due = now + 1
