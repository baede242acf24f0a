"""What moves and stops the robot: each verb checks its fields, then makes a command."""

from __future__ import annotations

from diffbotctl.hub.client import Client
from diffbotctl.hub.desk import Desk, Verb, Wanted
from diffbotctl.links.control import RefusalError, Request

FARTHEST = 1000.0  # m; no robot of this kind gets there, so that it is a slip of the finger


def stop(desk: Desk, client: Client, request: Request) -> Wanted:
    request.only("why")
    desk.needs("operator.halt", "this pipeline moves no robot")
    said = request.text("why", "")
    cause = f"{client.who} asked to stop" + (f": {said}" if said else "")
    return Wanted("stop", (cause,))


def resume(desk: Desk, client: Client, request: Request) -> Wanted:
    request.only()
    return Wanted("resume")


def goto(desk: Desk, client: Client, request: Request) -> Wanted:
    request.only("x", "y", "heading")
    desk.needs("operator.goal", "no block of this pipeline follows goals")
    x, y = request.number_of("x", "m"), request.number_of("y", "m")
    heading = request.number_or_none("heading", "rad")
    for name, value in (("x", x), ("y", y)):
        if abs(value) > FARTHEST:
            raise RefusalError("E-REQUEST", f"{name} is more than {FARTHEST:g} m away")
    return Wanted("goto", (x, y, heading))


def drive(desk: Desk, client: Client, request: Request) -> Wanted:
    request.only("linear", "angular", "take_over")
    desk.needs("operator.twist", "this pipeline takes no velocity from a person")
    linear = request.number_of("linear", "m/s", 0.0)
    angular = request.number_of("angular", "rad/s", 0.0)
    desk.within("linear", linear, desk.about.speed, "m/s")
    desk.within("angular", angular, desk.about.turn_rate, "rad/s")
    return Wanted("drive", (linear, angular, request.flag("take_over")))


def release(desk: Desk, client: Client, request: Request) -> Wanted:
    request.only()
    return Wanted("release")


def lost(desk: Desk, client: Client, request: Request) -> Wanted:
    """The client was driving for a person whom it can no longer hear."""
    request.only("why")
    if not client.drives:
        raise RefusalError("E-REQUEST", "this client never drove", "nothing need be done")
    said = request.text("why", "nobody answers there")
    return Wanted("lost", (f"{client.who} was driving and {said}",))


VERBS: dict[str, Verb] = {
    "stop": stop,
    "resume": resume,
    "goto": goto,
    "drive": drive,
    "release": release,
    "lost": lost,
}
