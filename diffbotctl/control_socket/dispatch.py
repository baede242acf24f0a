"""What a client can ask for, and the words for what the engine answers."""

from __future__ import annotations

from collections.abc import Iterable

from diffbotctl.control_socket.connection import Client
from diffbotctl.control_socket.handlers import commands, introspection, parameters
from diffbotctl.control_socket.protocol import RefusalError, Request
from diffbotctl.control_socket.request_context import CommandDraft, Fields, RequestContext, Verb
from diffbotctl.errors import closest_match

REQUESTS: dict[str, Verb] = {
    **commands.MOTION_REQUESTS,
    **introspection.STATE_REQUESTS,
    **introspection.GRAPH_REQUESTS,
    **parameters.PARAMETER_REQUESTS,
    **commands.ACTION_REQUESTS,
    **introspection.LOG_REQUESTS,
}


def dispatch(desk: RequestContext, client: Client, request: Request) -> Fields | CommandDraft:
    """Do what `request` says: an answer, or a command for the engine. Raises RefusalError."""
    name = request.text("do", "")
    verb = REQUESTS.get(name)
    if verb is None:
        near = closest_match(name, REQUESTS)
        fix = f"did you mean {near}?" if near else f"there are {', '.join(REQUESTS)}"
        raise RefusalError("E-REQUEST", f"there is no verb '{name}'", fix)
    found = verb(desk, client, request)
    if desk.about.is_replay and isinstance(found, CommandDraft):
        raise RefusalError("E-REQUEST", "this is a replay: what has happened cannot be commanded")
    return found


# What the engine may say to a command: code, cause, fix.
ANSWERS: dict[str, tuple[str, str, str]] = {
    "not_finite": ("E-REQUEST", "a number is not finite", "send a finite one"),
    "held": (
        "E-HELD",
        "the robot is held; `why` tells by what",
        "resume first: `diffbotctl resume`",
    ),
    "busy": ("E-BUSY", "someone else is driving", 'wait, or take over with "take_over": true'),
    "not_driving": ("E-REQUEST", "this client is not driving", "there is nothing to let go of"),
    "driving": ("E-BUSY", "someone is driving", "resume when they have let go"),
    "refused": ("E-REQUEST", "the block refuses", ""),
    "engine_busy": ("E-BUSY", "the engine does not take commands just now", "try again"),
}


def error_reply(code: str, said: Iterable[str] = ()) -> Fields:
    """What a client is told when the engine has answered `code`."""
    if not code:
        return {"ok": True}
    cause = ": ".join([ANSWERS[code][1], *said])
    return RefusalError(ANSWERS[code][0], cause, ANSWERS[code][2]).fields()
