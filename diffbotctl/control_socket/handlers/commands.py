"""What moves and stops the robot: each verb checks its fields, then makes a command.

Actions that a person calls, and messages that a person may publish.
"""

from __future__ import annotations

import inspect
from typing import Any

from diffbotctl.block import actions
from diffbotctl.control_socket.connection import Client
from diffbotctl.control_socket.handlers.introspection import topic_of
from diffbotctl.control_socket.protocol import RefusalError, Request
from diffbotctl.control_socket.request_context import (
    CommandDraft,
    Fields,
    RequestContext,
    Verb,
    nearest_of,
)

FARTHEST = 1000.0  # m; no robot of this kind gets there, so that it is a slip of the finger


def handle_stop(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    request.only("why")
    desk.needs("operator.halt", "this pipeline moves no robot")
    said = request.text("why", "")
    cause = f"{client.who} asked to stop" + (f": {said}" if said else "")
    return CommandDraft("stop", (cause,))


def handle_resume(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    request.only()
    return CommandDraft("resume")


def handle_goto(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    request.only("x", "y", "heading")
    desk.needs("operator.goal", "no block of this pipeline follows goals")
    x, y = request.number_of("x", "m"), request.number_of("y", "m")
    heading = request.number_or_none("heading", "rad")
    for name, value in (("x", x), ("y", y)):
        if abs(value) > FARTHEST:
            raise RefusalError("E-REQUEST", f"{name} is more than {FARTHEST:g} m away")
    return CommandDraft("goto", (x, y, heading))


def handle_drive(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    request.only("linear", "angular", "take_over")
    desk.needs("operator.twist", "this pipeline takes no velocity from a person")
    linear = request.number_of("linear", "m/s", 0.0)
    angular = request.number_of("angular", "rad/s", 0.0)
    desk.within("linear", linear, desk.about.speed, "m/s")
    desk.within("angular", angular, desk.about.turn_rate, "rad/s")
    return CommandDraft("drive", (linear, angular, request.flag("take_over")))


def handle_release(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    request.only()
    return CommandDraft("release")


def handle_lost(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    """The client was driving for a person whom it can no longer hear."""
    request.only("why")
    if not client.drives:
        raise RefusalError("E-REQUEST", "this client never drove", "nothing need be done")
    said = request.text("why", "nobody answers there")
    return CommandDraft("lost", (f"{client.who} was driving and {said}",))


MOTION_REQUESTS: dict[str, Verb] = {
    "stop": handle_stop,
    "resume": handle_resume,
    "goto": handle_goto,
    "drive": handle_drive,
    "release": handle_release,
    "lost": handle_lost,
}


# What a person may say, each by the verb that checks it.
PUBLISHED = {
    "operator.twist": handle_drive,
    "operator.goal": handle_goto,
    "operator.resume": handle_resume,
    "operator.halt": handle_stop,
}


def handle_publish(desk: RequestContext, client: Client, request: Request) -> Fields | CommandDraft:
    """Say a person's message; what blocks and drivers say is theirs alone."""
    request.only("topic", "message")
    name, message = request.text("topic"), request.fields.get("message")
    if name.strip("/") in ("robot.wheels", "robot.duty", desk.about.command):
        cause = f"{name} is a driver's input: motion passes the mux, the limits and the last gate"
        raise RefusalError("E-REQUEST", cause, "publish to operator.twist, or use drive")
    wire = topic_of(desk, name)
    verb = PUBLISHED.get(wire)
    if verb is None:
        owner = wire.partition(".")[0]
        fix = f"you may publish to {', '.join(PUBLISHED)}"
        raise RefusalError("E-REQUEST", f"only {owner} itself says {wire}", fix)
    if not isinstance(message, dict):
        raise RefusalError("E-REQUEST", "the message must be an object", 'such as {"linear": 0.1}')
    return verb(desk, client, Request(message))


def handle_list_actions(desk: RequestContext, client: Client, request: Request) -> Fields:
    """Every action that can be called, with its arguments."""
    request.only()
    return {
        "actions": [
            {
                "action": f"{node}.{name}",
                "arguments": _arguments(method),
                "units": getattr(method, "units", {}),
                "help": inspect.cleandoc(method.__doc__ or ""),
            }
            for node, kind in _targets(desk).items()
            for name, method in actions(kind).items()
        ]
    }


def handle_call(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    """Call an action with numbers as its arguments, by name."""
    request.only("action", "arguments")
    wanted = request.text("action")
    node, _, name = wanted.partition(".")
    found = {
        f"{each}.{action}": method
        for each, kind in _targets(desk).items()
        for action, method in actions(kind).items()
    }
    method = found.get(wanted)
    if method is None:
        raise RefusalError(
            "E-REQUEST", f"there is no action '{node}.{name}'", nearest_of(node, found)
        )
    given = request.fields.get("arguments", {})
    if not isinstance(given, dict):
        raise RefusalError("E-REQUEST", "the arguments must be an object", 'such as {"x": 0.5}')
    asked = Request(given)
    asked.only(*_arguments(method))
    values = [asked.number_of(*each) for each in _defaults(method)]
    return CommandDraft("call", (node, name, tuple(values)))


def _targets(desk: RequestContext) -> dict[str, type]:
    return {**{name: type(block) for name, block in desk.blocks.items()}, **desk.about.drivers}


def _arguments(method: Any) -> list[str]:
    return list(inspect.signature(method).parameters)[2:]  # without self and now


def _defaults(method: Any) -> list[tuple[str, str, float | None]]:
    """Name, unit and default of each argument."""
    known = list(inspect.signature(method).parameters.items())[2:]
    return [
        (name, "SI", None if each.default is inspect.Parameter.empty else each.default)
        for name, each in known
    ]


ACTION_REQUESTS: dict[str, Verb] = {
    "publish": handle_publish,
    "actions": handle_list_actions,
    "call": handle_call,
}
