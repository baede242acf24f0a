"""Actions that a person calls, and messages that a person may publish."""

from __future__ import annotations

import inspect
from typing import Any

from diffbotctl.block import actions
from diffbotctl.hub import driving
from diffbotctl.hub.client import Client
from diffbotctl.hub.desk import Desk, Fields, Verb, Wanted, nearest_of
from diffbotctl.hub.looking import topic_of
from diffbotctl.links.control import RefusalError, Request

# What a person may say, each by the verb that checks it.
PUBLISHED = {
    "operator.twist": driving.drive,
    "operator.goal": driving.goto,
    "operator.resume": driving.resume,
    "operator.halt": driving.stop,
}


def publish(desk: Desk, client: Client, request: Request) -> Fields | Wanted:
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


def list_actions(desk: Desk, client: Client, request: Request) -> Fields:
    """Every action that can be called, with its arguments."""
    request.only()
    return {
        "actions": [
            {
                "action": f"{node}.{name}",
                "arguments": _arguments(method),
                "help": inspect.cleandoc(method.__doc__ or ""),
            }
            for node, kind in _targets(desk).items()
            for name, method in actions(kind).items()
        ]
    }


def call(desk: Desk, client: Client, request: Request) -> Wanted:
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
    return Wanted("call", (node, name, tuple(values)))


def _targets(desk: Desk) -> dict[str, type]:
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


VERBS: dict[str, Verb] = {
    "publish": publish,
    "actions": list_actions,
    "call": call,
}
