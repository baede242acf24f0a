"""The methods of the control protocol: each has one declared request and one handler."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from diffbotctl.control_socket import requests
from diffbotctl.control_socket.connection import Client
from diffbotctl.control_socket.engine_channel import EngineLink, EngineRequest, PublishInput
from diffbotctl.control_socket.handlers import commands, introspection
from diffbotctl.control_socket.protocol import Fields, RefusalError, parse_line
from diffbotctl.control_socket.requests import parse_hello, parse_request
from diffbotctl.control_socket.run_state import RequestContext, RunInfo, RunState
from diffbotctl.errors import closest_match, join_words
from diffbotctl.recording.black_box_store import BlackBoxStore

R = TypeVar("R")
AccessLog = Callable[[Fields], None]


@dataclass(frozen=True)
class Method(Generic[R]):
    """A method: the class of its request, and what handles it.

    The handler returns the fields of the reply, or a command for the engine, which replies later.
    """

    request: type[R]
    handle: Callable[[RequestContext, R], Fields | EngineRequest]


METHODS: dict[str, Method[Any]] = {
    "stop": Method(requests.StopRequest, commands.handle_stop),
    "resume": Method(requests.ResumeRequest, commands.forward),
    "goto": Method(requests.GotoRequest, commands.handle_goto),
    "drive": Method(requests.DriveRequest, commands.handle_drive),
    "release": Method(requests.ReleaseRequest, commands.forward),
    "operator_lost": Method(requests.OperatorLostRequest, commands.handle_operator_lost),
    "rearm": Method(requests.RearmRequest, commands.forward),
    "status": Method(requests.StatusRequest, introspection.handle_status),
    "snapshot": Method(requests.SnapshotRequest, introspection.handle_snapshot),
    "scene": Method(requests.SceneRequest, introspection.handle_scene),
    "explain_stop": Method(requests.ExplainStopRequest, introspection.handle_explain_stop),
    "list_topics": Method(requests.ListTopicsRequest, introspection.handle_list_topics),
    "describe_topic": Method(requests.DescribeTopicRequest, introspection.handle_describe_topic),
    "topic_rate": Method(requests.TopicRateRequest, introspection.handle_topic_rate),
    "read_history": Method(requests.ReadHistoryRequest, introspection.handle_read_history),
    "read_map": Method(requests.ReadMapRequest, introspection.handle_read_map),
    "subscribe": Method(requests.SubscribeRequest, introspection.handle_subscribe),
    "unsubscribe": Method(requests.UnsubscribeRequest, introspection.handle_unsubscribe),
    "publish": Method(requests.PublishRequest, commands.handle_publish),
    "list_parameters": Method(requests.ListParametersRequest, commands.handle_list_parameters),
    "set_parameter": Method(requests.SetParameterRequest, commands.handle_set_parameter),
    "list_actions": Method(requests.ListActionsRequest, commands.handle_list_actions),
    "call_action": Method(requests.CallActionRequest, commands.handle_call_action),
    "list_blocks": Method(requests.ListBlocksRequest, introspection.handle_list_blocks),
    "list_wires": Method(requests.ListWiresRequest, introspection.handle_list_wires),
    "read_log": Method(requests.ReadLogRequest, introspection.handle_read_log),
    "save_black_box": Method(requests.SaveBlackBoxRequest, introspection.handle_save_black_box),
    "set_log_level": Method(requests.SetLogLevelRequest, commands.handle_set_log_level),
}


STOP_METHODS = ("stop", "status")  # of a client beyond the limit of ordinary clients


class Dispatcher:
    """Handles the lines of clients: greets, replies, and sends commands to the engine."""

    def __init__(
        self,
        info: RunInfo,
        state: RunState,
        engine: EngineLink,
        log: AccessLog,
        store: BlackBoxStore | None = None,
    ) -> None:
        self.info, self.state, self.engine, self.store = info, state, engine, store
        self.log = log

    def line(self, client: Client, data: bytes) -> None:
        """Handle one line of `client`. Raises RefusalError for a hello that is refused."""
        if not client.name:
            client.name = parse_hello(parse_line(data)) or "client"
            self.log({"event": "connected", "name": client.name, **client.peer._asdict()})
            return
        request_id: int | str | None = None
        try:
            fields = parse_line(data)
            if isinstance(fields.get("id"), int | str):
                request_id = fields["id"]
            self._request(client, request_id, fields)
        except RefusalError as refusal:
            client.answer({"id": request_id, **refusal.fields()})

    def _request(self, client: Client, request_id: int | str | None, fields: Fields) -> None:
        name = fields.get("method")
        method = METHODS.get(name) if isinstance(name, str) else None
        if method is None:
            raise _unknown_method(name)
        if client.is_for_stop and name not in STOP_METHODS:
            cause = f"too many clients are connected; accepted are {join_words(STOP_METHODS)}"
            raise RefusalError("E-BUSY", cause, "disconnect other clients")
        context = RequestContext(self.info, self.state, self.engine, client, self.store)
        reply = method.handle(context, parse_request(method.request, fields))
        if isinstance(reply, dict):
            client.answer({"id": request_id, "ok": True, **reply})
            return
        if self.info.is_replay:
            cause = "this is a replay: it accepts no commands"
            raise RefusalError("E-REQUEST", cause)
        if not isinstance(reply, requests.DriveRequest | PublishInput):
            self.log({"event": name, "fields": reply._asdict(), "by": client.who})
        self.engine.command(client, request_id, reply)


def _unknown_method(name: Any) -> RefusalError:
    if not isinstance(name, str):
        fix = 'such as {"method": "status"}'
        return RefusalError("E-REQUEST", "the field 'method' must be the name of a method", fix)
    near = closest_match(name, METHODS)
    fix = f"did you mean {near}?" if near else f"there are {', '.join(METHODS)}"
    return RefusalError("E-REQUEST", f"there is no method '{name[:40]}'", fix)
