"""The pipeline as it runs: its blocks and wires, with their rates."""

from __future__ import annotations

from diffbotctl.block import outputs
from diffbotctl.hub.client import Client
from diffbotctl.hub.desk import Desk, Fields, Verb
from diffbotctl.hub.looking import rate_of
from diffbotctl.hub.told import level_of
from diffbotctl.links.control import Request
from diffbotctl.links.json_messages import plain


def blocks(desk: Desk, client: Client, request: Request) -> Fields:
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


def graph(desk: Desk, client: Client, request: Request) -> Fields:
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


VERBS: dict[str, Verb] = {"blocks": blocks, "graph": graph}
