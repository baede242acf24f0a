"""What a client can ask for, and the words for what the engine answers."""

from __future__ import annotations

from collections.abc import Iterable

from diffbotctl.errors import nearest
from diffbotctl.hub import calling, driving, layout, looking, parameters, told
from diffbotctl.hub.client import Client
from diffbotctl.hub.desk import Desk, Fields, Verb, Wanted
from diffbotctl.links.control import RefusalError, Request

VERBS: dict[str, Verb] = {
    **driving.VERBS,
    **looking.VERBS,
    **layout.VERBS,
    **parameters.VERBS,
    **calling.VERBS,
    **told.VERBS,
}


def follow(desk: Desk, client: Client, request: Request) -> Fields | Wanted:
    """Do what `request` says: an answer, or a command for the engine. Raises RefusalError."""
    name = request.text("do", "")
    verb = VERBS.get(name)
    if verb is None:
        near = nearest(name, VERBS)
        fix = f"did you mean {near}?" if near else f"there are {', '.join(VERBS)}"
        raise RefusalError("E-REQUEST", f"there is no verb '{name}'", fix)
    found = verb(desk, client, request)
    if desk.about.is_replay and isinstance(found, Wanted):
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


def in_words(code: str, said: Iterable[str] = ()) -> Fields:
    """What a client is told when the engine has answered `code`."""
    if not code:
        return {"ok": True}
    cause = ": ".join([ANSWERS[code][1], *said])
    return RefusalError(ANSWERS[code][0], cause, ANSWERS[code][2]).fields()
