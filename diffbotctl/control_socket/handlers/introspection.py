"""The pipeline as it runs: its blocks and wires, with their rates.

What only looks: topics, their messages and rates, and why the robot stopped.

What ROS calls things, and what they are called here: for the fingers that know the old names.

The log: what blocks and drivers have said, and from which level on they are heard.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from diffbotctl.block import outputs
from diffbotctl.control_socket.connection import Client
from diffbotctl.control_socket.protocol import RefusalError, Request
from diffbotctl.control_socket.request_context import (
    CommandDraft,
    Fields,
    RequestContext,
    Verb,
    nearest_of,
)
from diffbotctl.control_socket.run_state import MOST_LINES
from diffbotctl.control_socket.stop_explanation import explain_stop as told
from diffbotctl.errors import closest_match
from diffbotctl.log import ALL, LEVEL
from diffbotctl.messages import (
    LOG_LEVELS,
    Battery,
    Goal,
    GoalState,
    Odometry,
    Path,
    Range,
    Scan,
    Twist,
    Wheels,
)
from diffbotctl.recording.json_codec import json_schema, message_encoder, plain


def handle_blocks(desk: RequestContext, client: Client, request: Request) -> Fields:
    """Every block: how often its busiest output speaks, how old the last word is, what it costs.

    The engine measures costs only while someone asks: at first they are None, and each second new.
    """
    request.only()
    desk.whisper("measure")
    rows = []
    for node in desk.about.graph.nodes:
        wires = [f"{node.name}.{port}" for port in outputs(type(node.block))]
        rates = [desk.knowledge.rate(wire) for wire in wires]
        load = desk.knowledge.loads.get(node.name)
        error = desk.knowledge.errors.get(node.name)
        ages = [age for wire in wires if (age := desk.knowledge.age(wire)) is not None]
        rows.append(
            {
                "block": node.name,
                "class": type(node.block).__name__,
                "rate": max((each.rate for each in rates), default=0.0),
                "messages": sum(each.messages for each in rates),
                "age": min(ages, default=None),
                "busy": None if load is None else load.busy,
                "reactions": None if load is None else load.reactions,
                "overruns": None if load is None else load.overruns,
                "level": level_of(desk, node.name),
                "last_error": None if error is None else plain(error),
            }
        )
    return {"blocks": rows}


def handle_graph(desk: RequestContext, client: Client, request: Request) -> Fields:
    """Every wire: where from, where to, its type, its rate and age."""
    request.only()
    wires = [
        (wire, node.name, port)
        for node in desk.about.graph.nodes
        for port, wire in node.wires.items()
    ]
    if desk.about.command is not None:
        wires.append((desk.about.command, "robot", desk.about.command.partition(".")[2]))
    rows = [
        {"topic": wire, "to": node, "port": port, **rate_of(desk, wire)}
        for wire, node, port in wires
    ]
    return {"wires": rows, "blocks": list(desk.blocks)}


GRAPH_REQUESTS: dict[str, Verb] = {"blocks": handle_blocks, "graph": handle_graph}


def handle_why(desk: RequestContext, client: Client, request: Request) -> Fields:
    """The cause chain of the last stop."""
    request.only()
    return {"text": told(desk.knowledge, desk.about.graph)}


def handle_status(desk: RequestContext, client: Client, request: Request) -> Fields:
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


def handle_snapshot(desk: RequestContext, client: Client, request: Request) -> Fields:
    """The newest message of every wire, and what holds the robot: one picture of the run."""
    request.only()
    known = desk.knowledge
    held = known.holding()
    return {
        "time": known.now,
        "held": None if held is None else {"wire": held[0], **plain(held[1])},
        "messages": {wire: plain(message) for wire, message in known.latest.items()},
    }


def handle_scene(desk: RequestContext, client: Client, request: Request) -> Fields:
    """What a map draws that does not change: walls, the robot's outline, its sensors."""
    request.only()
    return desk.about.scene


def handle_topics(desk: RequestContext, client: Client, request: Request) -> Fields:
    """Every wire with its type, its rate, and how old its last message is."""
    request.only()
    return {"topics": [{"topic": wire, **rate_of(desk, wire)} for wire in desk.knowledge.wires]}


def handle_rate(desk: RequestContext, client: Client, request: Request) -> Fields:
    """How often one topic carries a message."""
    request.only("topic")
    wire = topic_of(desk, request.text("topic"))
    return {"topic": wire, **rate_of(desk, wire)}


def handle_kind(desk: RequestContext, client: Client, request: Request) -> Fields:
    """The type of a topic, as a JSON Schema, and its last message."""
    request.only("topic")
    wire = topic_of(desk, request.text("topic"))
    found = desk.knowledge.wires[wire]
    latest = desk.knowledge.latest.get(wire)
    last = None if latest is None else plain(latest)
    return {"topic": wire, "type": found.__name__, "schema": json_schema(found), "last": last}


def handle_watch(desk: RequestContext, client: Client, request: Request) -> Fields:
    """Stream a topic from now on, `*` for all; with `last`, its last message first."""
    request.only("topic", "last")
    name = request.text("topic")
    wires = list(desk.knowledge.wires) if name == "*" else [topic_of(desk, name)]
    client.watched.update(wires)
    if request.flag("last"):
        for wire in wires:
            if wire in desk.knowledge.latest:
                text = message_encoder(desk.knowledge.wires[wire])(desk.knowledge.latest[wire])
                client.push(b'{"topic": "%s", "message": %s}\n' % (wire.encode(), text))
    return {"topic": wires[0] if len(wires) == 1 else name}


def handle_unwatch(desk: RequestContext, client: Client, request: Request) -> Fields:
    """Stream a topic no more; `*` for all."""
    request.only("topic")
    name = request.text("topic")
    client.watched -= set(desk.knowledge.wires) if name == "*" else {topic_of(desk, name)}
    return {}


def topic_of(desk: RequestContext, name: str) -> str:
    """The wire called `name`, also by its ROS name. Raises RefusalError with the nearest one."""
    wires = desk.knowledge.wires
    if name in wires:
        return name
    known = our_wire(name, wires)
    if known is not None:
        return known
    whole = [wire for wire in wires if wire.partition(".")[0] == name]
    if len(whole) == 1:  # a block with one output is meant by its name
        return whole[0]
    near = whole[0] if whole else closest_match(name.strip("/").replace("/", "."), wires)
    fix = f"did you mean {near}?" if near else "`diffbotctl topic list` shows them all"
    raise RefusalError("E-REQUEST", f"there is no topic '{name}'", fix)


def rate_of(desk: RequestContext, wire: str) -> dict[str, Any]:
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


STATE_REQUESTS: dict[str, Verb] = {
    "status": handle_status,
    "look": handle_snapshot,
    "scene": handle_scene,
    "why": handle_why,
    "topics": handle_topics,
    "rate": handle_rate,
    "type": handle_kind,
    "watch": handle_watch,
    "unwatch": handle_unwatch,
}


# The topic's last word: where it comes from here, or the message class that carries the same.
TOPICS: dict[str, str | type] = {
    "cmd_vel": "operator.twist",
    "odom": Odometry,
    "pose": Odometry,  # turtlesim's
    "scan": Scan,
    "range": Range,
    "sonar": Range,
    "goal": "operator.goal",
    "goal_pose": "operator.goal",
    "path": "operator.path",
    "plan": Path,
    "status": GoalState,
    "battery_state": Battery,
    "wheel_cmd": Wheels,
    "lwheel": "robot.encoders",
    "rwheel": "robot.encoders",
    "joint_states": "robot.encoders",
    "twist": Twist,
    "current_goal": Goal,
    "rosout": "log",
    "rosout_agg": "log",
}


def our_wire(name: str, wires: Mapping[str, type]) -> str | None:
    """The wire that a ROS user means by `name`, such as `/odom`; None when there is none."""
    wanted = TOPICS.get(name.strip("/").split("/")[-1])
    if wanted is None:
        return None
    if isinstance(wanted, str):
        return wanted if wanted in wires else None
    return next((wire for wire, kind in wires.items() if kind is wanted), None)


LAST = 50  # lines, when nobody says how many: a screenful


def handle_log(desk: RequestContext, client: Client, request: Request) -> Fields:
    """The newest lines, the oldest of them first."""
    request.only("last", "level", "block")
    last = request.number_of("last", "lines", LAST)
    if not 0 <= last <= MOST_LINES:
        cause = f"the last {last:g} lines are not kept"
        raise RefusalError("E-REQUEST", cause, f"ask for 0 to {MOST_LINES}")
    wanted = LOG_LEVELS[_rank(request.text("level", LOG_LEVELS[0])) :]
    source = request.text("block", ALL)
    if source != ALL:
        _source(desk, source)
    found = [
        plain(line)
        for line in desk.knowledge.lines
        if line.level in wanted and source in (ALL, line.source)
    ]
    return {"lines": found[len(found) - min(int(last), len(found)) :]}


def handle_log_level(desk: RequestContext, client: Client, request: Request) -> CommandDraft:
    """From now on hear a source from a level on."""
    request.only("block", "level")
    source, level = request.text("block"), LOG_LEVELS[_rank(request.text("level"))]
    if source != ALL:
        _source(desk, source)
    return CommandDraft("set", (source, LEVEL, None, level))


def level_of(desk: RequestContext, source: str) -> str:
    """From which level on `source` is heard."""
    book = desk.about.graph.book
    return "" if book is None else book.level(source)


def _rank(level: str) -> int:
    if level not in LOG_LEVELS:
        raise RefusalError(
            "E-REQUEST", f"there is no level '{level}'", f"there are {', '.join(LOG_LEVELS)}"
        )
    return LOG_LEVELS.index(level)


def _source(desk: RequestContext, name: str) -> None:
    book = desk.about.graph.book
    known = [] if book is None else list(book.logs)
    if name not in known:
        raise RefusalError("E-REQUEST", f"there is no block '{name}'", nearest_of(name, known))


LOG_REQUESTS: dict[str, Verb] = {"log": handle_log, "log_level": handle_log_level}
