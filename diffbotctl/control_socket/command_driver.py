"""Who is driving by hand, and until when that holds without another word.

The person at the control socket: commands in, messages of the node `operator` out.

Whoever drives must go on saying so. After a silence the wheels are commanded to zero
and the robot is held, and that is decided here, in the engine: a hub that hangs changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

from diffbotctl.control_socket.engine_channel import CommandResult, EngineChannel, EngineCommand
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.engine.driver import Delivery
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.engine.loop import Engine
from diffbotctl.engine.profiler import BlockProfiler
from diffbotctl.messages import Call, Goal, Message, Setting, Stop, Twist
from diffbotctl.time import NEVER

SILENCE = 300_000_000  # ns; with one telemetry period and the way down it stays below 500 ms


class DriveLease:
    """At most one client drives. `deadline` is NEVER while nobody does.

    `silent` and `gone` are the causes to give when that client is lost; they are written when it
    begins, so that nothing need be written when it counts.
    """

    def __init__(self) -> None:
        self.client: int | None = None
        self.deadline = NEVER
        self.silent = self.gone = ""

    @property
    def is_on(self) -> bool:
        """True while someone drives."""
        return self.client is not None

    def is_by(self, client: int) -> bool:
        """True when it is `client` who drives."""
        return self.client == client

    def go_on(self, now: int, command: EngineCommand) -> None:
        """The client of `command` drives, and has just said so."""
        self.deadline = now + SILENCE
        if self.client != command.client:
            self.client = command.client
            self.silent = f"{command.who} was driving and fell silent"
            self.gone = f"{command.who} was driving and is gone"

    def let_go(self) -> None:
        """Nobody drives any more."""
        self.client, self.deadline = None, NEVER


LATER = "later"  # a verb that answers by itself
HOLDING = "gate.stop"  # the wire that says what holds the robot at the last gate

Verb = Callable[["ControlClientDriver", int, EngineCommand], str]


class ControlClientDriver:
    """A driver that follows the commands of one channel. `wakes`: a command wakes the loop.

    A paced simulation is not woken: it has its own exact times, and looks each instant.
    `meter` measures the blocks when someone wants to see what they cost.
    """

    def __init__(
        self, channel: EngineChannel, operator: Operator, changes: LiveChanges, wakes: bool
    ) -> None:
        self.channel = channel
        self.operator = operator
        self.changes = changes
        self.calls: list[int] = []
        self.woken_by = [channel.fileno()] if wakes else []
        self.outbox: list[Delivery] = []
        self.at = 0
        self.driving = DriveLease()
        self.meter: BlockProfiler | None = None

    def can_measure(self, engine: Engine) -> None:
        """Let people see what the blocks of `engine` cost."""
        self.meter = BlockProfiler(engine)

    def due(self) -> int:
        """At once when something waits to be delivered; when whoever drives has been silent."""
        return min(self.at, self.driving.deadline) if self.outbox else self.driving.deadline

    def files(self) -> list[int]:
        """The channel, where commands wake the loop."""
        return self.woken_by if self.channel.is_open else []

    def deliver(self, now: int) -> list[Delivery]:
        """Hand out what waits, stamped with `now`, and notice silence."""
        if now >= self.driving.deadline:
            self._lose(now, self.driving.silent)
        out = [Delivery(wire, message._replace(time=now)) for wire, message in self.outbox]
        self.outbox = []
        return out

    def close(self) -> None:
        """Let the hub know that the run is over."""
        self.channel.close()

    def idle(self, now: int) -> None:
        """Follow the commands that have come. Called when what the instant commanded has left."""
        was_open = self.channel.is_open
        while self.changes.outcomes:
            refused = self.changes.outcomes.pop(0)
            self.channel.answer(
                CommandResult(self.calls.pop(0), "refused" if refused else "", (refused,))
            )
        for command in self.channel.receive():
            code = VERBS[command.verb](self, now, command)
            if code is not LATER:
                self.channel.answer(CommandResult(command.number, code))
        if was_open and not self.channel.is_open and self.driving.is_on:
            self._lose(now, self.driving.gone)
        if self.meter is not None and self.meter.is_on:
            self.channel.loads = self.meter.idle() or self.channel.loads
        self.channel.flush()

    def _stop(self, now: int, command: EngineCommand) -> str:
        """Hold the robot until `resume`."""
        (cause,) = command.values
        if self.driving.is_on:
            self._say(now, "twist", Twist(now, 0.0, 0.0))
        self._say(now, "halt", Stop(now, "operator_stop", cause, True))
        self.driving.let_go()
        return ""

    def _resume(self, now: int, command: EngineCommand) -> str:
        if self.driving.is_on:
            return "driving"  # a goal must not set off under the hands of whoever drives
        self.operator.resume(now)
        return ""

    def _goto(self, now: int, command: EngineCommand) -> str:
        x, y, heading = command.values
        if not (isfinite(x) and isfinite(y) and (heading is None or isfinite(heading))):
            return "not_finite"
        self.operator.take(now, Goal(now, 0, x, y, heading))
        return ""

    def _drive(self, now: int, command: EngineCommand) -> str:
        """Pass a velocity to the mux; a goal under way is withdrawn until `resume`."""
        linear, angular, takes_over = command.values
        if not (isfinite(linear) and isfinite(angular)):
            return "not_finite"
        if self._is_held():
            return "held"
        if not self.driving.is_by(command.client):
            if self.driving.is_on and not takes_over:
                return "busy"
            self.operator.pause(now)
            self.operator.note(now, "info", "operator", f"{command.who} drives by hand")
        self.driving.go_on(now, command)
        self._say(now, "twist", Twist(now, linear, angular))
        return ""

    def _release(self, now: int, command: EngineCommand) -> str:
        """The driver lets go in good order: the robot stands, and nothing is held."""
        if not self.driving.is_by(command.client):
            return "not_driving"
        self._say(now, "twist", Twist(now, 0.0, 0.0))
        self.driving.let_go()
        self.operator.note(now, "info", "operator", f"{command.who} has let go")
        return ""

    def _lost(self, now: int, command: EngineCommand) -> str:
        """The person whom a client drives for is out of reach; another client may drive by now."""
        if self.driving.is_by(command.client) or not self.driving.is_on:
            self._lose(now, command.values[0])
        return ""

    def _set(self, now: int, command: EngineCommand) -> str:
        self._say(now, "setting", Setting(now, *command.values))
        return ""

    def _call(self, now: int, command: EngineCommand) -> str:
        """Call an action; the answer comes when it has been done."""
        self._say(now, "call", Call(now, *command.values))
        self.calls.append(command.number)
        return LATER

    def _measure(self, now: int, command: EngineCommand) -> str:
        """Measure what the blocks cost, for some seconds."""
        if self.meter is not None:
            self.meter.want()
        return ""

    def _leave(self, now: int, command: EngineCommand) -> str:
        """A client has gone: nothing happens unless it was driving."""
        if self.driving.is_by(command.client):
            self._lose(now, self.driving.gone)
        return ""

    def _lose(self, now: int, cause: str) -> None:
        self._say(now, "twist", Twist(now, 0.0, 0.0))
        self._say(now, "halt", Stop(now, "operator_lost", cause, True))
        self.driving.let_go()

    def _is_held(self) -> bool:
        stop = self.operator.holding.get(HOLDING)
        return stop is not None and stop.latched

    def _say(self, now: int, port: str, message: Message) -> None:
        wire = "operator." + port
        if port == "twist":  # of several velocities in one idle time only the last counts
            self.outbox = [each for each in self.outbox if each.wire != wire]
        self.outbox.append(Delivery(wire, message))
        self.at = now + 1


VERBS: dict[str, Verb] = {
    "stop": ControlClientDriver._stop,
    "resume": ControlClientDriver._resume,
    "goto": ControlClientDriver._goto,
    "drive": ControlClientDriver._drive,
    "release": ControlClientDriver._release,
    "lost": ControlClientDriver._lost,
    "set": ControlClientDriver._set,
    "call": ControlClientDriver._call,
    "measure": ControlClientDriver._measure,
    "leave": ControlClientDriver._leave,
}
