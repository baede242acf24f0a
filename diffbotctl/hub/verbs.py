"""What a client can ask for: each verb checks its fields, then answers or makes a command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.errors import nearest
from diffbotctl.graph import Graph
from diffbotctl.hub.client import Client
from diffbotctl.hub.knowledge import Knowledge
from diffbotctl.hub.why import why
from diffbotctl.links.control import RefusalError, Request
from diffbotctl.links.json_messages import plain


class About(NamedTuple):
    """The run that a hub stands before. Speeds are the robot's limits; None without a robot."""

    name: str
    version: str
    pid: int
    pipeline: str
    robot: str
    port: str
    graph: Graph
    speed: float | None  # m/s
    turn_rate: float | None  # rad/s


class Wanted(NamedTuple):
    """A command for the engine, before it has a number."""

    verb: str
    values: tuple[Any, ...] = ()


Fields = dict[str, Any]
Verb = Callable[["Verbs", Client, Request], Fields | Wanted]


class Verbs:
    """Answers requests from what is known; never waits."""

    def __init__(self, about: About, knowledge: Knowledge) -> None:
        self.about = about
        self.knowledge = knowledge
        wires = [wire for node in about.graph.nodes for wire in node.wires.values()]
        self.heard = set(wires)

    def follow(self, client: Client, request: Request) -> Fields | Wanted:
        """Do what `request` says. Raises RefusalError."""
        name = request.text("do", "")
        verb = VERBS.get(name)
        if verb is None:
            near = nearest(name, VERBS)
            fix = f"did you mean {near}?" if near else f"there are {', '.join(VERBS)}"
            raise RefusalError("E-REQUEST", f"there is no verb '{name}'", fix)
        return verb(self, client, request)

    def _stop(self, client: Client, request: Request) -> Wanted:
        request.only("why")
        self._needs("operator.halt", "this pipeline moves no robot")
        said = request.text("why", "")
        cause = f"{client.who} asked to stop" + (f": {said}" if said else "")
        return Wanted("stop", (cause,))

    def _resume(self, client: Client, request: Request) -> Wanted:
        request.only()
        return Wanted("resume")

    def _goto(self, client: Client, request: Request) -> Wanted:
        request.only("x", "y", "heading")
        self._needs("operator.goal", "no block of this pipeline follows goals")
        x, y = request.number_of("x", "m"), request.number_of("y", "m")
        heading = request.number_or_none("heading", "rad")
        for name, value in (("x", x), ("y", y)):
            if abs(value) > FARTHEST:
                raise RefusalError("E-REQUEST", f"{name} is more than {FARTHEST:g} m away")
        return Wanted("goto", (x, y, heading))

    def _drive(self, client: Client, request: Request) -> Wanted:
        request.only("linear", "angular", "take_over")
        self._needs("operator.twist", "this pipeline takes no velocity from a person")
        linear = request.number_of("linear", "m/s", 0.0)
        angular = request.number_of("angular", "rad/s", 0.0)
        self._within("linear", linear, self.about.speed, "m/s")
        self._within("angular", angular, self.about.turn_rate, "rad/s")
        return Wanted("drive", (linear, angular, request.flag("take_over")))

    def _release(self, client: Client, request: Request) -> Wanted:
        request.only()
        return Wanted("release")

    def _why(self, client: Client, request: Request) -> Fields:
        request.only()
        return {"text": why(self.knowledge, self.about.graph)}

    def _status(self, client: Client, request: Request) -> Fields:
        request.only()
        known, about = self.knowledge, self.about
        held = known.holding()
        said: Fields = {
            "time": known.now,
            "engine": about.name,
            "pid": about.pid,
            "pipeline": about.pipeline,
            "robot": about.robot,
            "port": about.port,
            "speed": about.speed,
            "turn_rate": about.turn_rate,
            "held": None if held is None else {"wire": held[0], **plain(held[1])},
        }
        for wire in ("gate.wheels", "gate.stop", "operator.goal"):
            message = known.latest.get(wire)
            said[wire] = None if message is None else plain(message)
        return said

    def _needs(self, wire: str, cause: str) -> None:
        if wire not in self.heard:
            raise RefusalError("E-REQUEST", cause, f"wire {wire} to a block that takes it")

    def _within(self, name: str, value: float, limit: float | None, unit: str) -> None:
        if limit is not None and abs(value) > limit:
            cause = f"{name} {value:g} {unit} is beyond this robot's limit of {limit:g} {unit}"
            raise RefusalError("E-REQUEST", cause, "ask for less")


FARTHEST = 1000.0  # m; no robot of this kind gets there, so that it is a slip of the finger

VERBS: dict[str, Verb] = {
    "stop": Verbs._stop,
    "resume": Verbs._resume,
    "goto": Verbs._goto,
    "drive": Verbs._drive,
    "release": Verbs._release,
    "why": Verbs._why,
    "status": Verbs._status,
}

# What the engine may say to a command: code, cause, fix.
ANSWERS: dict[str, tuple[str, str, str]] = {
    "not_finite": ("E-REQUEST", "a number is not finite", "send a finite one"),
    "held": ("E-HELD", "the robot is held; `why` tells by what", "send resume first"),
    "busy": ("E-BUSY", "someone else is driving", 'wait, or take over with "take_over": true'),
    "not_driving": ("E-REQUEST", "this client is not driving", "there is nothing to let go of"),
    "driving": ("E-BUSY", "someone is driving", "resume when they have let go"),
    "engine_busy": ("E-BUSY", "the engine does not take commands just now", "try again"),
}
