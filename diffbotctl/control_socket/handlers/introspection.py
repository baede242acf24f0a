"""Requests that only read: topics, the state of the run, its blocks and wires, the log."""

from __future__ import annotations

from math import isfinite

from diffbotctl.block import outputs
from diffbotctl.control_socket import requests
from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.control_socket.requests import ALL
from diffbotctl.control_socket.run_state import RequestContext
from diffbotctl.control_socket.stop_explanation import explain_stop
from diffbotctl.drivers.robot_ports import is_simulated_port
from diffbotctl.graph import Node
from diffbotctl.message_types import type_name
from diffbotctl.messages import LOG_LEVELS, Message, ScanPoints
from diffbotctl.recording.json_codec import plain
from diffbotctl.recording.message_schema import json_schema


def handle_list_topics(context: RequestContext, request: requests.ListTopicsRequest) -> Fields:
    wires = context.state.wires
    return {"topics": [{"topic": wire, **rate_of(context, wire)} for wire in wires]}


def handle_topic_rate(context: RequestContext, request: requests.TopicRateRequest) -> Fields:
    wire = context.wire(request.topic)
    is_read = wire in context.state.inputs or wire in context.info.readers
    return {"topic": wire, **rate_of(context, wire), "is_read": is_read}


def handle_describe_topic(
    context: RequestContext, request: requests.DescribeTopicRequest
) -> Fields:
    wire = context.wire(request.topic)
    kind = context.state.wires[wire]
    newest = context.state.newest.get(wire)
    last = None if newest is None else plain(newest)
    return {
        "topic": wire,
        "type": type_name(kind),
        "schema": json_schema(kind),
        "last": last,
        "feeds_motion": wire in context.info.motion_inputs,
    }


def handle_read_history(context: RequestContext, request: requests.ReadHistoryRequest) -> Fields:
    wire = context.wire(request.topic)
    return {"topic": wire, **context.state.history.topics[wire].reply()}


def handle_read_map(context: RequestContext, request: requests.ReadMapRequest) -> Fields:
    tiles = context.state.tiles
    places, number = tiles.since(int(request.map), int(request.since))
    return {
        "map": tiles.map,
        "number": number,
        "version": tiles.version,
        "sha256": tiles.sha256,
        "resolution": tiles.resolution,
        "places": [each for place in places for each in place],
        "tiles": [tiles.tiles[place] for place in places],
        "is_last": number == tiles.number,
    }


def handle_subscribe(context: RequestContext, request: requests.SubscribeRequest) -> Fields:
    wires = context.topics(request.topic)
    context.client.topics.update(wires)
    if request.last:
        for wire in wires:
            if wire in context.state.newest:
                context.client.push(
                    context.state.subscriptions.line(wire, context.state.newest[wire])
                )
    if request.topic == ALL:
        return {"topic": ALL}
    return {"topic": wires[0], "silence": context.state.silence(wires[0])}


def handle_unsubscribe(context: RequestContext, request: requests.UnsubscribeRequest) -> Fields:
    context.client.topics -= set(context.topics(request.topic))
    return {}


def rate_of(context: RequestContext, wire: str) -> Fields:
    """Type, rate, gaps, count and age of a wire, as in replies."""
    rate = context.state.rate(wire)
    gaps = {"least_gap": rate.least_gap, "most_gap": rate.most_gap}
    return {
        "type": type_name(context.state.wires[wire]),
        "rate": rate.rate,
        **{name: gap if isfinite(gap) else None for name, gap in gaps.items()},
        "messages": rate.messages,
        "age": context.state.age(wire),
    }


def handle_explain_stop(context: RequestContext, request: requests.ExplainStopRequest) -> Fields:
    return explain_stop(context.state, context.info.graph)._asdict()


def handle_status(context: RequestContext, request: requests.StatusRequest) -> Fields:
    state, info = context.state, context.info
    wires = ("gate.wheels", "gate.stop", "operator.goal", "robot.link")
    frame = state.newest.get("robot.encoders")
    return {
        "time": state.now,
        "frame_time": None if frame is None else frame.time,
        "engine": info.name,
        "pid": info.pid,
        "pipeline": info.pipeline,
        "robot": info.robot,
        "port": info.port,
        "simulated": is_simulated_port(info.port),
        "paced": info.is_paced,
        "speed": info.speed,
        "turn_rate": info.turn_rate,
        "held": _stop_in_force(context),
        "goal_state": _plain_or_none(state.goal_state()),
        **{wire: _plain_or_none(state.newest.get(wire)) for wire in wires},
    }


def handle_snapshot(context: RequestContext, request: requests.SnapshotRequest) -> Fields:
    return {
        "time": context.state.now,
        "held": _stop_in_force(context),
        "messages": {
            wire: plain(message)
            for wire, message in context.state.newest.items()
            if type(message) is not ScanPoints  # large, and the scan is there
        },
    }


def handle_scene(context: RequestContext, request: requests.SceneRequest) -> Fields:
    return context.info.scene


def handle_list_blocks(context: RequestContext, request: requests.ListBlocksRequest) -> Fields:
    """Every block with the rate of its busiest output, the age of its newest message, its load.

    The engine measures loads only while a client asks: they are None at first, and change once a
    second.
    """
    context.engine.measure_loads()
    return {"blocks": [_block_row(context, node) for node in context.info.graph.nodes]}


def _block_row(context: RequestContext, node: Node) -> Fields:
    state, book = context.state, context.info.graph.book
    wires = [f"{node.name}.{port}" for port in outputs(type(node.block))]
    rates = [state.rate(wire) for wire in wires]
    load = state.loads.get(node.name)
    return {
        "block": node.name,
        "class": type(node.block).__name__,
        "rate": max((rate.rate for rate in rates), default=0.0),
        "messages": sum(rate.messages for rate in rates),
        "age": min((age for wire in wires if (age := state.age(wire)) is not None), default=None),
        "busy": None if load is None else load.busy,
        "reactions": None if load is None else load.reactions,
        "overruns": None if load is None else load.overruns,
        "level": "" if book is None else book.level(node.name),
        "last_error": _plain_or_none(state.errors.get(node.name)),
    }


def handle_list_wires(context: RequestContext, request: requests.ListWiresRequest) -> Fields:
    wires = [
        (wire, node.name, port)
        for node in context.info.graph.nodes
        for port, wire in node.wires.items()
    ]
    command = context.info.command
    if command is not None:
        wires.append((command, "robot", command.partition(".")[2]))
    rows = [
        {"topic": wire, "to": node, "port": port, **rate_of(context, wire)}
        for wire, node, port in wires
    ]
    return {"wires": rows, "blocks": list(context.state.blocks)}


def handle_read_log(context: RequestContext, request: requests.ReadLogRequest) -> Fields:
    context.require_source(request.block)
    levels = LOG_LEVELS[LOG_LEVELS.index(request.level) :]
    lines = [
        plain(line)
        for line in context.state.lines
        if line.level in levels and request.block in (ALL, line.source)
    ]
    return {"lines": lines[max(len(lines) - int(request.last), 0) :]}


def _stop_in_force(context: RequestContext) -> Fields | None:
    stop = context.state.stop_in_force()
    return None if stop is None else {"wire": stop[0], **plain(stop[1])}


def _plain_or_none(message: Message | None) -> Fields | None:
    return None if message is None else plain(message)


def handle_save_black_box(context: RequestContext, request: requests.SaveBlackBoxRequest) -> Fields:
    """Begin to write a file, or report whether one was written. Another process writes it."""
    store = context.store
    if store is None:
        cause = (
            "this robot keeps no black box: its run is recorded from its start, has no robot, or "
            "the first of several robots keeps it"
        )
        raise RefusalError("E-REQUEST", cause, "use its recording, or `diffbotctl bag record`")
    number = int(request.number) or store.save(f"saved by {context.client.who}")
    if number is None:
        raise RefusalError("E-REQUEST", "nothing has happened in this run yet", "try again")
    if number > store.files:
        raise RefusalError("E-REQUEST", f"this run has no file {number}")
    path = store.path(number)
    return {"file": str(path), "number": number, "is_written": path.exists()}
