"""Driver for the clients of the control socket: their commands become messages of `operator`.

One client drives at a time, and must repeat its command. After 300 ms without one the wheels are
commanded to zero and the robot is stopped. That is decided here, in the engine, so that a server
process that hangs changes nothing.
"""

from __future__ import annotations

from typing import Any, assert_never

from diffbotctl.control_socket import requests
from diffbotctl.control_socket.engine_channel import (
    ClientDisconnected,
    CommandResult,
    EngineChannel,
    EngineCommand,
    MeasureLoads,
    PublishInput,
    ResultCode,
)
from diffbotctl.control_socket.protocol import DRIVE_LEASE_S
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.engine.driver import Delivery
from diffbotctl.engine.live_changes import CallOutcome, LiveChanges
from diffbotctl.engine.loop import Engine
from diffbotctl.engine.profiler import BlockProfiler
from diffbotctl.messages import Call, Goal, Message, Setting, Stop, StopCode, Twist
from diffbotctl.recording.json_codec import plain
from diffbotctl.time import MILLISECOND, NEVER, SECOND

TEXT_MAX_LENGTH = 10_000  # characters
PARTS_MAX = 1000  # of a tuple
NESTING_MAX = 2  # of tuples and messages


def sendable_value(value: Any, depth: int = 0) -> Any:
    """`value` as JSON types; nan and infinities as texts. Raises ValueError for other values."""
    if hasattr(value, "_asdict"):
        return dict(zip(value._fields, _parts(value, depth), strict=True))
    if isinstance(value, tuple | list):
        return _parts(value, depth)
    result = plain(value)
    if not (result is None or isinstance(result, bool | int | float | str)):
        raise ValueError(f"it is a {type(value).__name__}")
    if isinstance(result, str) and len(result) > TEXT_MAX_LENGTH:
        raise ValueError(f"it is a text of more than {TEXT_MAX_LENGTH} characters")
    return result


def _parts(values: tuple[Any, ...] | list[Any], depth: int) -> list[Any]:
    if len(values) > PARTS_MAX or depth > NESTING_MAX:
        raise ValueError(f"it has more than {PARTS_MAX} parts, or is nested too deeply")
    return [sendable_value(value, depth + 1) for value in values]


DRIVE_TIMEOUT = 300 * MILLISECOND  # with a telemetry period and the way down it is below 500 ms
STOP_COMMAND = "`diffbotctl stop`"  # the client of that command
GATE_STOP = "gate.stop"  # the wire with the stop in force at the safety gate


class DriveLease:
    """The client that drives, None for none, and the time limit of its next command (ns).

    `expired` are the clients that fell silent while they drove, and from when on each is accepted
    again. Such a client may not know that the robot was stopped: when its link works again, it
    would go on as if nothing had happened.
    """

    def __init__(self) -> None:
        self.client: int | None = None
        self.who = ""
        self.deadline = NEVER
        self.expired: dict[int, int] = {}

    def renew(self, now: int, command: EngineCommand) -> None:
        """The client of `command` drives, until DRIVE_TIMEOUT from now."""
        self.deadline = now + DRIVE_TIMEOUT
        self.client, self.who = command.client, command.who

    def end(self) -> None:
        self.client, self.deadline = None, NEVER

    def expire(self) -> None:
        """The client was silent for too long: it is accepted only when it begins afresh."""
        if self.client is not None:
            self.expired[self.client] = NEVER
        self.end()

    def begin_afresh(self, client: int) -> None:
        """`client` commands zero, releases control, resumes or has gone: it is not refused."""
        self.expired.pop(client, None)

    def refuses(self, now: int, client: int) -> bool:
        """Whether `client` has expired and goes on; a pause of DRIVE_TIMEOUT is a fresh start."""
        if client not in self.expired:
            return False
        if now >= self.expired[client]:
            self.begin_afresh(client)
            return False
        self.expired[client] = now + DRIVE_TIMEOUT
        return True


class ControlClientDriver:
    """A driver that follows the commands of one channel. `wakes`: a command wakes the loop.

    A paced simulation without inputs is not woken: it has exact times, and reads commands at each
    instant. `inputs` are the leases of those who publish on inputs.
    """

    def __init__(
        self,
        channel: EngineChannel,
        operator: Operator,
        changes: LiveChanges,
        wakes: bool,
        inputs: InputLeases | None = None,
    ) -> None:
        self.inputs = inputs
        self.channel = channel
        self.operator = operator
        self.changes = changes
        self.calls: list[int] = []  # numbers of commands whose action has not run yet
        self.wake_files = [channel.fileno()] if wakes else []
        self.outbox: list[Delivery] = []
        self.outbox_due = 0
        self.lease = DriveLease()
        self.lost_client: int | None = None  # the last one that reported its operator as lost
        self.lost_cause = ""
        self.profiler: BlockProfiler | None = None

    def can_measure(self, engine: Engine, prefix: str = "") -> None:
        """Allow clients to measure the load of the blocks of `engine` that begin with `prefix`."""
        self.profiler = BlockProfiler(engine, prefix)

    def due(self) -> int:
        """When a message waits to be delivered, or the drive lease ends."""
        return min(self.outbox_due, self.lease.deadline) if self.outbox else self.lease.deadline

    def files(self) -> list[int]:
        """The channel, where commands wake the loop."""
        return self.wake_files if self.channel.is_open else []

    def deliver(self, now: int) -> list[Delivery]:
        """Deliver what waits, stamped with `now`, and end a lease that has run out."""
        if now >= self.lease.deadline:
            cause = f"{self.lease.who} was driving and sent no command for 300 ms"
            self.lease.expire()
            self._stop_lost(now, cause)
        deliveries = [Delivery(wire, message._replace(time=now)) for wire, message in self.outbox]
        self.outbox = []
        return deliveries

    def close(self) -> None:
        """Close the channel: the server sees that the run has ended."""
        self.channel.close()

    def idle(self, now: int) -> None:
        """Follow the commands that have come. Called when the instant's commands have left."""
        was_open = self.channel.is_open
        while self.changes.outcomes:
            outcome = self.changes.outcomes.pop(0)
            self.channel.answer(call_result(self.calls.pop(0), outcome))
        for command in self.channel.receive():
            if isinstance(command.request, PublishInput):
                self.channel.answer(self._publish(now, command, command.request))
                continue
            result = self._follow(now, command)
            if result is not None:
                stop = self._held_by() if result is ResultCode.STOPPED else None
                detail = f"{stop.code}: {stop.cause}" if stop else ""
                self.channel.answer(CommandResult(command.number, result, detail))
        if was_open and not self.channel.is_open:
            if self.lease.client is not None:
                self._stop_gone(now)
            if self.inputs is not None:
                self.inputs.end_clients(now, "the server of the control socket has ended")
        if self.profiler is not None and self.profiler.is_on:
            self.channel.loads = self.profiler.report() or self.channel.loads
        self.channel.flush()

    def _follow(self, now: int, command: EngineCommand) -> ResultCode | None:
        """Follow one command. None: its result comes later."""
        request = command.request
        match request:
            case requests.DriveRequest():
                return self._drive(now, command, request)
            case requests.StopRequest():
                self._stop(now, command.who, request.reason)
            case requests.ResumeRequest():
                if self.lease.client is not None:
                    return ResultCode.DRIVING  # a goal must not start while a client drives
                self.lease.begin_afresh(command.client)
                self.operator.resume(now)
            case requests.GotoRequest(x, y, heading):
                self.operator.replace_goals(now, Goal(now, 0, x, y, heading))
            case requests.ReleaseRequest():
                return self._release(now, command)
            case requests.OperatorLostRequest():
                # Without a lease the robot has been stopped already, and only the cause is better
                # known; after a resume the report of the same loss is out of date.
                is_stopped = self.lease.client is None and self._is_stopping()
                if self.lease.client == command.client or is_stopped:
                    self.lost_client = command.client
                    self.lost_cause = f"{command.who} was driving and {request.reason}"
                    self._stop_lost(now, self.lost_cause)
            case requests.RearmRequest():
                return self._rearm(now, command)
            case _:
                return self._follow_other(now, command, request)
        return ResultCode.DONE

    def _follow_other(
        self,
        now: int,
        command: EngineCommand,
        request: Setting | Call | MeasureLoads | PublishInput | ClientDisconnected,
    ) -> ResultCode | None:
        match request:
            case Setting():
                self._queue("setting", now, request)
            case Call():
                self._queue("call", now, request)
                self.calls.append(command.number)
                return None
            case MeasureLoads():
                if self.profiler is not None:
                    self.profiler.request()
            case ClientDisconnected():
                self.lease.begin_afresh(command.client)
                if self.lease.client == command.client:
                    self._stop_gone(now)
                if self.inputs is not None:
                    self.inputs.end(now, command.client, f"{command.who} has disconnected")
            case PublishInput():
                pass  # followed before
            case _:
                assert_never(request)
        return ResultCode.DONE

    def _publish(self, now: int, command: EngineCommand, request: PublishInput) -> CommandResult:
        """Deliver a message on an input, unless another one publishes there."""
        if self.inputs is None:
            return CommandResult(command.number, ResultCode.REFUSED, "there is no such input")
        other = self.inputs.renew(now + 1, request.wire, command.client, command.who)
        if other is not None:
            return CommandResult(command.number, ResultCode.PUBLISHED_BY_ANOTHER, other)
        self.outbox.append(Delivery(request.wire, request.message))
        self.outbox_due = now + 1
        return CommandResult(command.number, ResultCode.DONE)

    def _drive(
        self, now: int, command: EngineCommand, request: requests.DriveRequest
    ) -> ResultCode:
        """Pass a velocity to the mux; an active goal is paused until `resume`."""
        if is_late(now, request.time, request.lease):
            return ResultCode.LATE
        if request.linear == 0.0 and request.angular == 0.0:
            self.lease.begin_afresh(command.client)
        has_expired = self.lease.refuses(now, command.client)
        if self._held_by():
            return ResultCode.STOPPED
        if has_expired:
            return ResultCode.EXPIRED
        if self.lease.client != command.client:
            if self.lease.client is not None and not request.take_over:
                return ResultCode.BUSY
            self.operator.pause(now)
            self.operator.log(now, "info", "operator", f"{command.who} is driving")
        self.lease.renew(now, command)
        self._queue("twist", now, Twist(now, request.linear, request.angular))
        return ResultCode.DONE

    def _release(self, now: int, command: EngineCommand) -> ResultCode:
        self.lease.begin_afresh(command.client)
        if self.lease.client != command.client:
            return ResultCode.NOT_DRIVING
        self._queue("twist", now, Twist(now, 0.0, 0.0))
        self.lease.end()
        self.operator.log(now, "info", "operator", f"{command.who} released control")
        return ResultCode.DONE

    def _rearm(self, now: int, command: EngineCommand) -> ResultCode:
        """Allow motion again after the stop that this client itself asked for.

        A stop of any other cause, also one beside it, waits for a person.
        """
        latched = [stop for stop in self.operator.stops_in_force.values() if stop.latched]
        is_own = all(stop.cause == self.lost_cause for stop in latched)
        if not latched or not is_own or self.lost_client != command.client:
            return ResultCode.STOPPED
        self.lost_client = None
        self.operator.allow_motion(now)
        return ResultCode.DONE

    def _stop(self, now: int, who: str, reason: str) -> None:
        if self.lease.client is not None:
            self._queue("twist", now, Twist(now, 0.0, 0.0))
        name = who.partition(" (process ")[0]
        cause = f"{name} asked to stop"
        if name == STOP_COMMAND:
            cause = f"{name} was called in another terminal"
        cause += f": {reason}" if reason else ""
        self._queue_stop(now, "operator_stop", cause)

    def _stop_gone(self, now: int) -> None:
        self._stop_lost(now, f"{self.lease.who} was driving and disconnected")

    def _is_stopping(self) -> bool:
        """Whether a latched stop is in force, or waits to be delivered."""
        waits = any(wire == "operator.halt" for wire, _ in self.outbox)
        return waits or self._held_by() is not None

    def _held_by(self) -> Stop | None:
        """The latched stop in force at the safety gate."""
        stop = self.operator.stops_in_force.get(GATE_STOP)
        return stop if stop is not None and stop.latched else None

    def _stop_lost(self, now: int, cause: str) -> None:
        self._queue("twist", now, Twist(now, 0.0, 0.0))
        self._queue_stop(now, "operator_lost", cause)

    def _queue_stop(self, now: int, code: StopCode, cause: str) -> None:
        self._queue("halt", now, Stop(now, code, cause, True))
        self.lease.end()

    def _queue(self, port: str, now: int, message: Message) -> None:
        """Deliver `message` in the next instant; of several velocities only the last."""
        wire = "operator." + port
        if port == "twist":
            self.outbox = [delivery for delivery in self.outbox if delivery.wire != wire]
        self.outbox.append(Delivery(wire, message))
        self.outbox_due = now + 1


def call_result(number: int, outcome: CallOutcome) -> CommandResult:
    """The answer to the command `number`, a call of an action."""
    if outcome.refusal:
        return CommandResult(number, ResultCode.REFUSED, outcome.refusal)
    try:
        return CommandResult(number, ResultCode.DONE, value=sendable_value(outcome.value))
    except ValueError as error:
        return CommandResult(number, ResultCode.NOT_SENDABLE, str(error))


def is_late(now: int, stamp: float | None, lease: float | None) -> bool:
    """Whether a command to drive, made at `stamp` (ns), is older than its lease (s) at `now`."""
    if stamp is None:
        return False
    return now - stamp > (DRIVE_LEASE_S if lease is None else lease) * SECOND
