"""The operator: hands out goals, echoes what holds the robot, and decides how the run ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from diffbotctl.engine.driver import Delivery
from diffbotctl.log import LEVEL
from diffbotctl.messages import (
    Goal,
    GoalEnd,
    GoalState,
    LogLevel,
    LogLine,
    Message,
    Path,
    Resume,
    Setting,
    Stop,
)
from diffbotctl.time import NEVER

ENDED: set[GoalEnd] = {"reached", "blocked", "stuck", "timed_out"}


class Operator:
    """A driver that speaks for the person: goals from the files or the command line, in turn.

    What it delivers in answer to a message comes one nanosecond after it: feedback from the end of
    the graph to its beginning goes through here, so that the graph itself has no loop.
    """

    def __init__(self, goals: Sequence[Goal], end: Callable[[int, str], None]) -> None:
        self.waiting = list(goals)
        self.end = end
        self.last: Goal | None = None
        self.under_way: Goal | None = None
        self.outbox: list[Delivery] = []
        self.at = 0
        self.number = 0
        self.reached = 0
        self.stops: list[Stop] = []
        self.holding: dict[str, Stop] = {}
        self.state: GoalState | None = None
        self.paused: Goal | None = None
        self.stays = False
        self._next(0)

    def due(self) -> int:
        """At once when something waits to be delivered."""
        return self.at if self.outbox else NEVER

    def files(self) -> list[int]:
        """None: goals of a file need no waiting."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """Hand out what waits, stamped with `now`."""
        out = [Delivery(wire, _stamped(message, now)) for wire, message in self.outbox]
        self.outbox = []
        return out

    def close(self) -> None:
        """Nothing is held open."""

    def hear_goal_state(self, now: int, state: GoalState) -> None:
        """Take the follower's word: the next goal when one is reached, the end when one failed."""
        self.state = state
        if self.under_way is None or state.number != self.under_way.number:
            return
        if state.state == "reached":
            self.reached += 1
            self.last = self.under_way
            self._next(now)
        elif state.state in ENDED:
            self.under_way = None
            if self.stays:
                return
            self.end(1, f"goal {state.number} was not reached ({state.state}): {state.cause}")

    def hear_path(self, now: int, path: Path) -> None:
        """Take all waypoints of a path as the goals to visit."""
        self.waiting += path.goals
        if self.under_way is None and self.paused is None:
            self._next(now)

    def hear_stop(self, source: str) -> Callable[[int, Stop], None]:
        """A sink for the stops of the block `source`: noted for the summary, and echoed."""

        def hear(now: int, stop: Stop) -> None:
            if stop.code:
                self.stops.append(stop)
                self.holding[source] = stop
            else:
                self.holding.pop(source, None)
            self._say(now, "stop", self._gravest(now))

        return hear

    def take(self, now: int, goal: Goal) -> None:
        """Follow a person's goal in place of all others. From now on no goal ends the run."""
        self.stays = True
        self.paused = None
        self.waiting = [goal]
        self._next(now)

    def pause(self, now: int) -> None:
        """Withdraw the goal under way until `resume`: a person takes over."""
        if self.under_way is None:
            return
        self.paused, self.under_way = self.under_way, None
        self._say(now, "goal", Goal(now, 0))

    def resume(self, now: int) -> None:
        """Consent to move again, and to go on with a goal that waits."""
        self._say(now, "resume", Resume(now))
        if self.paused is not None:
            self.under_way, self.paused = self.paused, None
            self._say(now, "goal", self.under_way)

    def note(self, now: int, level: LogLevel, source: str, text: str) -> None:
        """Put a line into the log for what is no block."""
        self._say(now, "log", LogLine(now, level, source, text))

    def set_level(self, now: int, source: str, level: str) -> None:
        """Hear `source` in the log from `level` on."""
        self._say(now, "setting", Setting(now, source, LEVEL, None, level))

    def _gravest(self, now: int) -> Stop:
        ranked = sorted(self.holding.values(), key=lambda stop: not stop.latched)
        return ranked[0] if ranked else Stop(now, "", "", False)

    def _next(self, now: int) -> None:
        if not self.waiting:
            if self.under_way is not None and not self.stays:
                self.end(0, "all goals reached")
            self.under_way = None
            return
        self.number += 1
        self.under_way = self.waiting.pop(0)._replace(number=self.number)
        self._say(now, "goal", self.under_way)

    def _say(self, now: int, port: str, message: Message) -> None:
        self.outbox.append(Delivery(f"operator.{port}", message))
        self.at = now + 1


def _stamped(message: Message, now: int) -> Message:
    return message._replace(time=now)
