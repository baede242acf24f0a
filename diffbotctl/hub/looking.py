"""What only looks: topics, their messages and rates, and why the robot stopped."""

from __future__ import annotations

from math import isfinite
from typing import Any

from diffbotctl.errors import nearest
from diffbotctl.hub.client import Client
from diffbotctl.hub.desk import Desk, Fields, Verb
from diffbotctl.hub.ros_names import ours
from diffbotctl.hub.why import why as told
from diffbotctl.links.control import RefusalError, Request
from diffbotctl.links.json_messages import encoder, json_schema, plain


def why(desk: Desk, client: Client, request: Request) -> Fields:
    """The cause chain of the last stop."""
    request.only()
    return {"text": told(desk.knowledge, desk.about.graph)}


def status(desk: Desk, client: Client, request: Request) -> Fields:
    """The run, what holds the robot, what is commanded, how the goal is doing."""
    request.only()
    known, about = desk.knowledge, desk.about
    held, goal_state = known.holding(), known.goal_state()
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
        "goal_state": None if goal_state is None else plain(goal_state),
    }
    for wire in ("gate.wheels", "gate.stop", "operator.goal"):
        message = known.latest.get(wire)
        said[wire] = None if message is None else plain(message)
    return said


def look(desk: Desk, client: Client, request: Request) -> Fields:
    """The newest message of every wire, and what holds the robot: one picture of the run."""
    request.only()
    known = desk.knowledge
    held = known.holding()
    return {
        "time": known.now,
        "held": None if held is None else {"wire": held[0], **plain(held[1])},
        "messages": {wire: plain(message) for wire, message in known.latest.items()},
    }


def scene(desk: Desk, client: Client, request: Request) -> Fields:
    """What a map draws that does not change: walls, the robot's outline, its sensors."""
    request.only()
    return desk.about.scene


def topics(desk: Desk, client: Client, request: Request) -> Fields:
    """Every wire with its type, its rate, and how old its last message is."""
    request.only()
    return {"topics": [{"topic": wire, **rate_of(desk, wire)} for wire in desk.knowledge.wires]}


def rate(desk: Desk, client: Client, request: Request) -> Fields:
    """How often one topic carries a message."""
    request.only("topic")
    wire = topic_of(desk, request.text("topic"))
    return {"topic": wire, **rate_of(desk, wire)}


def kind(desk: Desk, client: Client, request: Request) -> Fields:
    """The type of a topic, as a JSON Schema, and its last message."""
    request.only("topic")
    wire = topic_of(desk, request.text("topic"))
    found = desk.knowledge.wires[wire]
    latest = desk.knowledge.latest.get(wire)
    last = None if latest is None else plain(latest)
    return {"topic": wire, "type": found.__name__, "schema": json_schema(found), "last": last}


def watch(desk: Desk, client: Client, request: Request) -> Fields:
    """Stream a topic from now on, `*` for all; with `last`, its last message first."""
    request.only("topic", "last")
    name = request.text("topic")
    wires = list(desk.knowledge.wires) if name == "*" else [topic_of(desk, name)]
    client.watched.update(wires)
    if request.flag("last"):
        for wire in wires:
            if wire in desk.knowledge.latest:
                text = encoder(desk.knowledge.wires[wire])(desk.knowledge.latest[wire])
                client.push(b'{"topic": "%s", "message": %s}\n' % (wire.encode(), text))
    return {"topic": wires[0] if len(wires) == 1 else name}


def unwatch(desk: Desk, client: Client, request: Request) -> Fields:
    """Stream a topic no more; `*` for all."""
    request.only("topic")
    name = request.text("topic")
    client.watched -= set(desk.knowledge.wires) if name == "*" else {topic_of(desk, name)}
    return {}


def topic_of(desk: Desk, name: str) -> str:
    """The wire called `name`, also by its ROS name. Raises RefusalError with the nearest one."""
    wires = desk.knowledge.wires
    if name in wires:
        return name
    known = ours(name, wires)
    if known is not None:
        return known
    whole = [wire for wire in wires if wire.partition(".")[0] == name]
    if len(whole) == 1:  # a block with one output is meant by its name
        return whole[0]
    near = whole[0] if whole else nearest(name.strip("/").replace("/", "."), wires)
    fix = f"did you mean {near}?" if near else "`diffbotctl topic list` shows them all"
    raise RefusalError("E-REQUEST", f"there is no topic '{name}'", fix)


def rate_of(desk: Desk, wire: str) -> dict[str, Any]:
    """Type, rate, gaps, count and age of a wire, as answers have them."""
    known = desk.knowledge.rate(wire)
    gaps = {"least_gap": known.least_gap, "most_gap": known.most_gap}
    return {
        "type": desk.knowledge.wires[wire].__name__,
        "rate": known.rate,
        **{name: gap if isfinite(gap) else None for name, gap in gaps.items()},
        "messages": known.messages,
        "age": desk.knowledge.age(wire),
    }


VERBS: dict[str, Verb] = {
    "status": status,
    "look": look,
    "scene": scene,
    "why": why,
    "topics": topics,
    "rate": rate,
    "type": kind,
    "watch": watch,
    "unwatch": unwatch,
}
