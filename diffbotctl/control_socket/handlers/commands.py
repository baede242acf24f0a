"""Requests that become commands for the engine: motion, live parameters, actions, log levels.

A handler checks what depends on the run, such as limits and names, and returns the command.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from math import isfinite
from typing import Any, TypeVar

from diffbotctl.block import action_arguments, actions, takes_text
from diffbotctl.config.declared_inputs import INPUT
from diffbotctl.config.robot import Robot
from diffbotctl.control_socket import requests
from diffbotctl.control_socket.engine_channel import EngineRequest, PublishInput
from diffbotctl.control_socket.protocol import RESET_ACTIONS, Fields, RefusalError
from diffbotctl.control_socket.requests import (
    TEXT_MAX_LENGTH,
    finite,
    parse_request,
    refuse_unknown,
    wrong_field,
)
from diffbotctl.control_socket.run_state import RequestContext, suggestion
from diffbotctl.log import LEVEL
from diffbotctl.message_parser import MessageError, message_parser
from diffbotctl.messages import Call, Setting
from diffbotctl.params import Declaration, declared
from diffbotctl.units import UnitError, quantity

# The last part of a service's name in ROS and turtlesim: the actions that do the same here.
ROS_SERVICES = {
    "reset": RESET_ACTIONS,
    "clear": ("canvas.clear",),
    "spawn": ("canvas.spawn",),
    "kill": ("canvas.kill",),
    "teleport_absolute": ("robot.teleport",),
    "teleport_relative": ("robot.hop",),
    "set_pose": ("odometry.set_pose",),
}
# Those that are parameters here.
ROS_PARAMETERS = {
    "set_pen": "`diffbotctl param set canvas.pen_red 255`, and pen_green, pen_blue, pen_width, "
    "pen; `diffbotctl call canvas.set_pen name=turtle2 red=255` for a further turtle"
}
VALUE_MAX = 1e300  # beyond any parameter; a larger whole number may not fit into a float


def _require_input(context: RequestContext, wire: str, cause: str, other: str = "") -> None:
    """Refuse a request that no block of this pipeline would receive; `other` names what would."""
    if wire not in context.state.inputs:
        raise RefusalError("E-REQUEST", cause, f"{other}wire {wire} to a block that takes it")


def _require_limit(name: str, value: float, limit: float | None, unit: str) -> None:
    if limit is not None and abs(value) > limit:
        cause = f"{name} {value:g} {unit} is beyond this robot's limit of {limit:g} {unit}"
        raise RefusalError("E-REQUEST", cause, "ask for less")


PUBLISHABLE = ("operator.twist", "operator.goal", "operator.resume", "operator.halt")


R = TypeVar("R", bound=EngineRequest)


def forward(context: RequestContext, request: R) -> R:
    """Handle a request that only the engine can check."""
    return request


def handle_stop(context: RequestContext, request: requests.StopRequest) -> requests.StopRequest:
    _require_input(context, "operator.halt", "this pipeline drives no robot")
    return request


def handle_goto(context: RequestContext, request: requests.GotoRequest) -> requests.GotoRequest:
    other = "`diffbotctl run standby` is driven by hand and follows goals; or "
    _require_input(context, "operator.goal", "no block of this pipeline follows goals", other)
    return request


def handle_drive(context: RequestContext, request: requests.DriveRequest) -> requests.DriveRequest:
    _require_input(context, "operator.twist", "this pipeline accepts no velocity from a client")
    if not context.info.is_paced:
        # Its lease of 0.3 s of the run is over before the next command can come.
        cause = "this run is faster than real time, too fast for a client to drive the robot"
        raise RefusalError("E-REQUEST", cause, "run it without --fast")
    _require_limit("linear", request.linear, context.info.speed, "m/s")
    _require_limit("angular", request.angular, context.info.turn_rate, "rad/s")
    return request


def handle_operator_lost(
    context: RequestContext, request: requests.OperatorLostRequest
) -> requests.OperatorLostRequest:
    if not context.client.has_driven:
        raise RefusalError("E-REQUEST", "this client has not driven", "no action is needed")
    return request


def handle_publish(context: RequestContext, request: requests.PublishRequest) -> EngineRequest:
    """Publish as the operator or on an input; blocks and drivers publish on their own wires."""
    name, message = request.topic, request.message
    if name.strip("/") in ("robot.wheels", "robot.duty", context.info.command):
        cause = f"{name} is a driver's input: motion passes the mux, the limits and the safety gate"
        raise RefusalError("E-REQUEST", cause, "publish to operator.twist, or use drive")
    match wire := context.wire(name):
        case "operator.twist":
            return handle_drive(context, parse_request(requests.DriveRequest, message))
        case "operator.goal":
            return handle_goto(context, parse_request(requests.GotoRequest, message))
        case "operator.resume":
            return parse_request(requests.ResumeRequest, message)
        case "operator.halt":
            return handle_stop(context, parse_request(requests.StopRequest, message))
    owner = wire.rpartition(".")[0]
    if _is_input(owner):
        return _input_message(context, wire, message)
    inputs = [wire for wire in context.state.wires if _is_input(wire.rpartition(".")[0])]
    fix = f"you may publish to {', '.join([*inputs, *PUBLISHABLE])}"
    raise RefusalError("E-REQUEST", f"only {owner} publishes {wire}", fix)


def _is_input(node: str) -> bool:
    """Whether a node has the inputs of the pipeline, or of one that it includes under a name."""
    return node.rpartition(".")[2] == INPUT


def _input_message(context: RequestContext, wire: str, fields: Fields) -> PublishInput:
    """A message for the declared input `wire`. Raises RefusalError for one of another type."""
    absence = context.state.absent_turtle(wire)
    if absence:
        raise RefusalError("E-REQUEST", absence, "`diffbotctl call canvas.spawn` adds one")
    parsers = context.state.parsers
    if wire not in parsers:
        parsers[wire] = message_parser(context.state.wires[wire])
    try:
        return PublishInput(wire, parsers[wire](fields))
    except MessageError as error:
        raise RefusalError("E-REQUEST", f"{wire}: {error}", "see `topic type`") from None


def handle_list_parameters(
    context: RequestContext, request: requests.ListParametersRequest
) -> Fields:
    rows = [
        {
            "parameter": f"{name}.{declaration.key}",
            "value": _plain_value(getattr(block, attribute)),
            "unit": declaration.unit,
            "live": declaration.live,
            "changed": (name, attribute) in context.state.changed,
            "help": declaration.help,
        }
        for name, block in context.state.blocks.items()
        for attribute, declaration in declared(type(block)).items()
    ]
    return {"parameters": rows}


def handle_set_parameter(context: RequestContext, request: requests.SetParameterRequest) -> Setting:
    path = request.parameter
    block, attribute, declaration = _parameter(context, path)
    if not declaration.live:
        fix = f"run again with --set {path}=..."
        raise RefusalError("E-REQUEST", f"{path} cannot change while running", fix)
    value = _parameter_value(declaration, request.value, path)
    if isinstance(value, str):
        return Setting(0, block, attribute, None, value)
    return Setting(0, block, attribute, None if value is None else float(value))


def _parameter(context: RequestContext, path: str) -> tuple[str, str, Declaration]:
    """Block, attribute and declaration of the parameter `path`. Raises RefusalError."""
    name, _, key = path.rpartition(".")
    if name in context.state.blocks:
        for attribute, declaration in declared(type(context.state.blocks[name])).items():
            if key in (declaration.key, attribute):
                return name, attribute, declaration
    paths = [
        f"{name}.{declaration.key}"
        for name, block in context.state.blocks.items()
        for declaration in declared(type(block)).values()
    ]
    cause, fix = f"there is no parameter '{path}'", suggestion(path, paths)
    field, first = path.removeprefix("robot."), path.partition(".")[0]
    if first == "robot" or first in declared(Robot):
        cause = f"{field} is a value of the robot file, which cannot change while running"
        fix = f"run again with --set robot.{field}=..."
    raise RefusalError("E-REQUEST", cause, fix)


def _parameter_value(declaration: Declaration, value: Any, path: str) -> Any:
    """`value` as the parameter's type, in SI. Raises RefusalError."""
    written = str(value)[:TEXT_MAX_LENGTH]
    if declaration.none and value == "none":
        value = None
    elif isinstance(value, str) and declaration.kind in (float, int) and value != "none":
        try:
            value = quantity(value[:TEXT_MAX_LENGTH], declaration.unit)
        except UnitError as error:
            raise RefusalError("E-REQUEST", f"{path}: {error}") from None
    elif declaration.kind is bool and value in ("true", "false"):
        value = value == "true"
    complaint = _type_complaint(declaration.kind, value) or declaration.complaint(value)
    if complaint:
        smaller = declaration.thousandth(written, value)
        fix = f"did you mean {smaller}?" if smaller else ""
        raise RefusalError("E-REQUEST", f"{path} {complaint}", fix)
    return value


def _type_complaint(kind: type, value: Any) -> str | None:
    if value is None:
        return None
    if kind not in (float, int):
        return None if isinstance(value, kind) else f"must be a {kind.__name__}"
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number:
        return "must be a number"
    if not abs(value) < VALUE_MAX:
        return f"must be a number below {VALUE_MAX:g}"
    return "must be a whole number" if kind is int and value != int(value) else None


def _plain_value(value: Any) -> Any:
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value if isinstance(value, int | float | str | bool | None) else str(value)


def handle_list_actions(context: RequestContext, request: requests.ListActionsRequest) -> Fields:
    rows = [
        {
            "action": name,
            "arguments": [argument.name for argument in action_arguments(method)],
            "texts": [each.name for each in action_arguments(method) if takes_text(each)],
            "units": getattr(method, "units", {}),
            "help": inspect.cleandoc(method.__doc__ or ""),
        }
        for name, method in _actions(context).items()
    ]
    return {"actions": rows}


def handle_call_action(context: RequestContext, request: requests.CallActionRequest) -> Call:
    available = _actions(context)
    block, _, action = request.action.rpartition(".")
    method = available.get(request.action)
    if method is None:
        cause = f"there is no action '{request.action}'"
        raise RefusalError("E-REQUEST", cause, _action_hint(request.action, available))
    arguments = action_arguments(method)
    refuse_unknown(request.arguments, [argument.name for argument in arguments])
    numbers: list[float] = []
    texts: list[str] = []
    for argument in arguments:
        default = None if argument.default is argument.empty else argument.default
        value = request.arguments.get(argument.name, default)
        if takes_text(argument):
            texts.append(_text_argument(argument.name, value))
            continue
        number = finite(value)
        if number is None:
            raise wrong_field(argument.name, float, "SI", value)
        numbers.append(number)
    return Call(0, block, action, tuple(numbers), tuple(texts))


def _text_argument(name: str, value: Any) -> str:
    if isinstance(value, str) and len(value) <= TEXT_MAX_LENGTH and value.isprintable():
        return value
    raise wrong_field(name, str, "", value)


def _action_hint(name: str, available: Iterable[str]) -> str:
    """The fix for an action that does not exist, which may be called like a service of ROS."""
    service = name.strip("/").split("/")[-1]
    if service in ROS_PARAMETERS:
        return f"here these are parameters: {ROS_PARAMETERS[service]}"
    meant = [action for action in ROS_SERVICES.get(service, ()) if action in available]
    return f"here it is {' and '.join(meant)}" if meant else suggestion(name, available)


def _actions(context: RequestContext) -> dict[str, Callable[..., Any]]:
    """Every action of a block or driver by its full name."""
    targets = {name: type(block) for name, block in context.state.blocks.items()}
    return {
        f"{node}.{name}": method
        for node, kind in {**targets, **context.info.drivers}.items()
        for name, method in actions(kind).items()
    }


def handle_set_log_level(context: RequestContext, request: requests.SetLogLevelRequest) -> Setting:
    context.require_source(request.block)
    return Setting(0, request.block, LEVEL, None, request.level)
