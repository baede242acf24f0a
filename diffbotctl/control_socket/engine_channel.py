"""The channel between the engine and the server process, both ends.

Commands go to the engine; instants, command results and block loads come back. Nothing here
formats text or waits: datagrams of pickled records, which are dropped and counted when the server
does not keep up, and read by the engine in its idle time.
"""

from __future__ import annotations

import pickle
import socket
import time
from collections.abc import Callable
from enum import StrEnum
from typing import Any, NamedTuple, assert_never

from diffbotctl.control_socket import requests
from diffbotctl.control_socket.connection import Client, TokenBucket
from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.engine.profiler import BlockLoad
from diffbotctl.messages import Call, Setting

COMMAND_MAX_BYTES = 1 << 16
COMMANDS_AT_ONCE = 16  # read in one idle time; the others wait for the next
RESULTS_MAX = 256  # that wait for a server which does not read
UPDATE_MAX_BYTES = 1 << 20
UPDATES_AT_ONCE = 32  # read between two polls of the clients
COMMANDS_PER_SECOND = 500.0  # of all clients together; the engine handles more without strain
COMMAND_BURST = 100.0


class MeasureLoads(NamedTuple):
    """Measure the processor load of the blocks, for some seconds."""


class PublishInput(NamedTuple):
    """A message for a declared input; the engine stamps it."""

    wire: str
    message: Any


class ClientDisconnected(NamedTuple):
    """A client that has driven has disconnected."""


EngineRequest = (
    requests.StopRequest
    | requests.ResumeRequest
    | requests.GotoRequest
    | requests.DriveRequest
    | requests.ReleaseRequest
    | requests.OperatorLostRequest
    | requests.RearmRequest
    | Setting
    | Call
    | MeasureLoads
    | PublishInput
    | ClientDisconnected
)
URGENT = (
    requests.StopRequest,
    ClientDisconnected,
)  # never refused for lack of room, and never dropped


class EngineCommand(NamedTuple):
    """A request of `client`, whose name is `who`. Setting and Call are stamped by the engine."""

    number: int
    client: int
    who: str
    request: EngineRequest


class ResultCode(StrEnum):
    """How the engine answers a command."""

    DONE = ""
    STOPPED = "stopped"
    BUSY = "busy"
    NOT_DRIVING = "not_driving"
    DRIVING = "driving"
    REFUSED = "refused"
    NOT_SENDABLE = "not_sendable"
    OVERLOADED = "overloaded"
    LATE = "late"
    EXPIRED = "expired"
    PUBLISHED_BY_ANOTHER = "published_by_another"


class CommandResult(NamedTuple):
    """The engine's answer to command `number`. `value`: what an action returned."""

    number: int
    code: ResultCode
    detail: str = ""
    value: Any = None


def reply_to(code: ResultCode, detail: str = "") -> Fields:
    """The reply that a client gets for the result of its command."""
    match code:
        case ResultCode.DONE:
            return {"ok": True}
        case ResultCode.STOPPED:
            cause = f"the robot is stopped by {detail or 'what `diffbotctl why` explains'}"
            refusal = RefusalError("E-HELD", cause, "resume first: `diffbotctl resume`")
        case ResultCode.BUSY:
            fix = 'wait, or take over with "take_over": true'
            refusal = RefusalError("E-BUSY", "another client is driving", fix)
        case ResultCode.NOT_DRIVING:
            fix = "only the client that drives can release control"
            refusal = RefusalError("E-REQUEST", "this client is not driving", fix)
        case ResultCode.DRIVING:
            refusal = RefusalError(
                "E-BUSY", "a client is driving", "resume when it has released control"
            )
        case ResultCode.REFUSED:
            refusal = RefusalError("E-REQUEST", f"the block refused: {detail}")
        case ResultCode.NOT_SENDABLE:
            cause = f"the action was done, but what it returned cannot be sent: {detail}"
            fix = "return a number, text, truth value or message, or a tuple of them"
            refusal = RefusalError("E-REQUEST", cause, fix)
        case ResultCode.LATE:
            cause = "the command to drive is older than its lease: the link was too slow"
            refusal = RefusalError("E-LATE", cause, "drive again when the link works")
        case ResultCode.EXPIRED:
            cause = "this client was silent for 300 ms while it drove, and the robot was stopped"
            fix = "command zero or release control first, then drive again"
            refusal = RefusalError("E-LATE", cause, fix)
        case ResultCode.PUBLISHED_BY_ANOTHER:
            fix = "wait until it has disconnected or its message has expired"
            refusal = RefusalError("E-BUSY", f"{detail} publishes on this input", fix)
        case ResultCode.OVERLOADED:
            cause = "the engine has too many commands"
            refusal = RefusalError("E-BUSY", cause, "try again")
        case _:
            assert_never(code)
    return refusal.fields()


class EngineUpdate(NamedTuple):
    """One datagram to the server. `lost` counts the instants that were dropped before these.

    `loads` are the processor loads of the blocks, by name, while a client asks for them.
    """

    lost: int
    instants: list[tuple[Any, ...]]
    results: list[CommandResult]
    loads: dict[str, BlockLoad] | None = None


def receive_all(
    channel: socket.socket, count_max: int, size_max: int
) -> tuple[list[tuple[Any, ...]], bool]:
    """Read up to `count_max` records of up to `size_max` bytes, without waiting.

    Also returns whether the other end is still open.
    """
    records: list[tuple[Any, ...]] = []
    while len(records) < count_max:
        try:
            data = channel.recv(size_max)
        except BlockingIOError:
            break
        except OSError:
            data = b""
        if not data:
            return records, False
        records.append(pickle.loads(data))
    return records, True


def _pickled(record: tuple[Any, ...]) -> bytes:
    return pickle.dumps(tuple(record), pickle.HIGHEST_PROTOCOL)


class EngineChannel:
    """The engine's end: gathers instants with `record`, sends them with `flush`."""

    def __init__(self, channel: socket.socket) -> None:
        self.channel = channel
        self.pending: list[tuple[Any, ...]] = []
        self.results: list[CommandResult] = []
        self.loads: dict[str, BlockLoad] | None = None
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append
        self.lost = 0
        self.is_open = True
        channel.setblocking(False)

    def fileno(self) -> int:
        """The file descriptor that becomes readable when a command comes."""
        return self.channel.fileno()

    def answer(self, result: CommandResult) -> None:
        """Queue the result of a command; sent with the next `flush`."""
        if len(self.results) < RESULTS_MAX:
            self.results.append(result)

    def flush(self) -> None:
        """Send what has gathered. A full channel drops the instants and keeps the results."""
        if not self.is_open:
            self.pending.clear()
            return
        if not self.pending and not self.results and self.loads is None:
            return
        update = EngineUpdate(self.lost, self.pending, self.results, self.loads)
        try:
            self.channel.send(_pickled(update))
        except BlockingIOError:
            self.lost += len(self.pending)
        except OSError:
            self._close()
        else:
            self.lost = 0
            self.loads = None
            self.results.clear()
        self.pending.clear()

    def receive(self) -> list[EngineCommand]:
        """The commands that have come, in order, COMMANDS_AT_ONCE at most.

        `is_open` is False once the server is gone.
        """
        if not self.is_open:
            return []
        records, is_open = receive_all(self.channel, COMMANDS_AT_ONCE, COMMAND_MAX_BYTES)
        if not is_open:
            self._close()
        return [EngineCommand(*record) for record in records]

    def close(self) -> None:
        """Send the rest, and close the channel: the server sees that the run has ended."""
        self.flush()
        self._close()

    def _close(self) -> None:
        if self.is_open:
            self.is_open = False
            self.channel.close()


class EngineLink:
    """The server's end: numbers commands, sends them, and knows which client waits for which."""

    def __init__(self, channel: socket.socket) -> None:
        channel.setblocking(False)
        self.channel = channel
        self.waiting: dict[int, tuple[Client, int | str | None]] = {}
        self.unsent: list[EngineCommand] = []
        self.number = 0
        self.is_open = True
        self.bucket = TokenBucket(COMMANDS_PER_SECOND, COMMAND_BURST, time.monotonic())

    def command(self, client: Client, request_id: int | str | None, request: EngineRequest) -> None:
        """Send a request of `client`; it gets the engine's answer, or a refusal at once."""
        is_urgent = isinstance(request, URGENT)
        if not (self._has_token() or is_urgent):
            client.answer({"id": request_id, **reply_to(ResultCode.OVERLOADED)})
            return
        self.bucket.spend()
        self.number += 1
        command = EngineCommand(self.number, client.number, client.who, request)
        if isinstance(request, PublishInput) and len(_pickled(command)) > COMMAND_MAX_BYTES:
            cause = f"the message is too large: at most {COMMAND_MAX_BYTES} bytes are possible"
            client.answer({"id": request_id, **RefusalError("E-REQUEST", cause).fields()})
            return
        if self.unsent or not self._send(command):
            if not is_urgent:
                client.answer({"id": request_id, **reply_to(ResultCode.OVERLOADED)})
                return
            self.unsent.append(command)
        if not isinstance(request, ClientDisconnected):
            self.waiting[command.number] = (client, request_id)
            client.unanswered += 1
        if isinstance(request, requests.DriveRequest | PublishInput):
            client.has_driven = True

    def measure_loads(self) -> None:
        """Ask for the loads of the blocks; the request may be lost, no client waits for it."""
        if not self.unsent and self._has_token():
            self.bucket.spend()
            self.number += 1
            self._send(EngineCommand(self.number, 0, "the server", MeasureLoads()))

    def retry(self) -> None:
        """Send the urgent commands that did not fit before."""
        while self.unsent and self._send(self.unsent[0]):
            self.unsent.pop(0)

    def updates(self) -> list[EngineUpdate]:
        """What the engine has sent. `is_open` is False once it has ended or died."""
        if not self.is_open:
            return []
        records, self.is_open = receive_all(self.channel, UPDATES_AT_ONCE, UPDATE_MAX_BYTES)
        return [EngineUpdate(*record) for record in records]

    def answer(self, result: CommandResult) -> Client | None:
        """Answer the client that waits for this result, and return it."""
        client, request_id = self.waiting.pop(result.number, (None, None))
        if client is not None:
            client.unanswered -= 1
            reply = reply_to(result.code, result.detail)
            if result.value is not None:
                reply["value"] = result.value
            client.answer({"id": request_id, **reply})
        return client

    def _has_token(self) -> bool:
        return self.bucket.allows(time.monotonic())

    def _send(self, command: EngineCommand) -> bool:
        try:
            self.channel.send(_pickled(command))
        except BlockingIOError:
            return False
        except OSError:
            self.is_open = False
        return True
