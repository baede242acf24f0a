"""Inputs, programs and sources of a pipeline: message types, and whether motion depends on them."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

from diffbotctl.block import outputs
from diffbotctl.config import lookup, registry
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.configuration import (
    InputUse,
    ProgramEntry,
    ProgramUse,
    SourceEntry,
    SourceUse,
)
from diffbotctl.config.node_ports import RESERVED, is_name
from diffbotctl.config.section_reader import read_parameters
from diffbotctl.config.yaml_tree import Value
from diffbotctl.device import DeviceDriver
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.message_parser import MessageError, message_parser
from diffbotctl.message_types import type_name, type_problem
from diffbotctl.messages import Call, GoalState, LogLine, Path, Resume, Scan, Setting, Stop

INPUT = "input"  # the node of the inputs
NOT_DECLARABLE = (Resume, Setting, Call, LogLine)  # from the operator alone
MOTION_TIMEOUT_MAX = 1.0  # s; the gate gives telemetry at most half of it
# Messages by which a block acts on the robot other than by a wire: through the operator.
ACTING = (Path, GoalState, Stop)
# A lidar whose turns are damaged one after another is lost: after 3 turns, and at least 0.5 s.
LOST_TURNS_MAX, SCAN_TIMEOUT_MIN = 3, 0.5


def read_inputs(context: CheckContext) -> None:
    """Find the message types of `inputs`, and read the neutral messages."""
    for name, entry, value in _entries(context, "inputs"):
        kind_value = value.at("type")
        if not is_name(name):
            _refuse_name(context, name, value, "input")
        if entry is None or None in (entry.type, entry.timeout) or kind_value is None:
            continue  # reported where it was read
        kind = message_kind(context, entry.type, kind_value)
        if kind is not None:
            neutral = read_neutral(context, kind, value.at("neutral"))
            wire = f"{INPUT}.{name}"
            context.inputs[wire] = InputUse(wire, kind, entry.timeout, neutral, False)


def read_programs(context: CheckContext, files: Sequence[FilePath]) -> None:
    """Find the message types of what `programs` publish, and split their command lines."""
    for name, entry, value in _entries(context, "programs"):
        run = value.at("run")
        is_free = _is_free_name(context, name, value, "program")
        if not is_free or entry is None or None in (entry.run, entry.timeout) or run is None:
            continue  # reported where it was read
        try:
            words = tuple(shlex.split(entry.run))
        except ValueError:
            words = ()
        if not words:
            context.error("E-PROGRAM", run.place, "this is no command line", "write run: ./program")
        file = lookup.file_of(run.value_place.source.name, files)
        folder = file.resolve().parent if file is not None else FilePath.cwd()
        outputs = _program_outputs(context, name, entry, value)
        context.programs[name] = ProgramUse(
            name, words, folder, dict(entry.wires), outputs, entry.timeout
        )


def read_sources(context: CheckContext) -> None:
    """Find the drivers of `sources`, and read the values of their parameters."""
    for name, entry, value in _entries(context, "sources"):
        kind = value.at("driver")
        is_free = _is_free_name(context, name, value, "source")
        if not is_free or entry is None or None in (entry.driver, entry.timeout) or kind is None:
            continue  # reported where it was read
        try:
            cls = registry.driver(entry.driver)
        except registry.RegistryError as error:
            context.error(error.code, kind.place, str(error), error.fix)
            continue
        _add_source(context, name, cls, entry, value)


def _entries(context: CheckContext, section: str) -> Iterator[tuple[str, Any, Value]]:
    """Name, entry and value of everything in a section of the pipeline; None: not readable."""
    tree = context.pipeline_value(section)
    if context.pipeline is not None and tree is not None:
        read = getattr(context.pipeline, section)
        yield from ((name, read.get(name), value) for name, value in tree.entries.items())


def _add_source(
    context: CheckContext, name: str, cls: type[DeviceDriver], entry: SourceEntry, value: Value
) -> None:
    parameters = value.at("with") or Value({}, value.value_place, value.key_place)
    values: dict[str, Any] = {}
    if isinstance(parameters.data, dict):
        values = read_parameters(parameters, cls, f"{name}.with", context.problems)
    wires: dict[str, type] = {}
    if cls.open_kinds:
        for port, kind, type_value in _named_outputs(context, entry, value):
            if kind in cls.open_kinds:
                wires[f"{name}.{port}"] = kind
                continue
            cause = f"the driver {entry.driver} has no {type_name(kind)}"
            names = ", ".join(map(type_name, cls.open_kinds))
            context.error("E-SOURCE", type_value.place, cause, f"use one of {names}")
    elif entry.types:
        cause = f"the driver {entry.driver} has outputs of its own: {', '.join(outputs(cls))}"
        context.error("E-SOURCE", (value.at("out") or value).name_place, cause, "remove `out`")
    for port, out in outputs(cls).items():
        problem = type_problem(out.kind)
        if problem is None:
            wires[f"{name}.{port}"] = out.kind
            continue
        cause = f"{type_name(out.kind)}, at '{port}' of '{name}', is no message: {problem[0]}"
        context.error("E-MESSAGE-TYPE", value.name_place, cause, problem[1])
    for wire, kind in wires.items():
        context.inputs[wire] = InputUse(wire, kind, entry.timeout, None, False)
    context.sources[name] = SourceUse(
        name, cls, values, wires, entry.timeout, value.place, dict(entry.wires)
    )


def _named_outputs(
    context: CheckContext, entry: ProgramEntry | SourceEntry, value: Value
) -> Iterator[tuple[str, type, Value]]:
    """Name, message class and place of each output that `out` of a program or source names."""
    for port, written in entry.types.items():
        type_value = value.at("out", port)
        if type_value is None or written is None:
            continue
        if not is_name(port):
            _refuse_name(context, port, type_value, "output")
            continue
        kind = message_kind(context, written, type_value)
        if kind is not None:
            yield port, kind, type_value


def read_lidars(context: CheckContext) -> None:
    """Make each lidar of the robot that has a `device` an input; of a real robot a source, too.

    In the simulator the plant delivers on the same wire.
    """
    sensors = (context.robot.sensors if context.robot else None) or {}
    for name, sensor in sensors.items():
        model = LIDARS.get(getattr(sensor, "type", None) or "")
        value = context.robot_value("sensors", name)
        if model is None or value is None or context.pipeline is None or not sensor.device:
            continue
        wire, timeout = f"robot.{name}", max(SCAN_TIMEOUT_MIN, LOST_TURNS_MAX / model.rate)
        context.inputs[wire] = InputUse(wire, Scan, timeout, None, False)
        if context.real:
            cls = registry.driver("lidar")
            values = {
                "device": sensor.device,
                "model": sensor.type,
                "upside_down": sensor.upside_down,
            }
            context.sources[wire] = SourceUse(
                name, cls, values, {wire: Scan}, timeout, value.place, what="sensor"
            )


def _is_free_name(context: CheckContext, name: str, value: Value, what: str) -> bool:
    """Whether a program or source may be called so; notes why not."""
    taken = [*RESERVED, *context.programs]
    for section in ("blocks",) if what == "program" else ("blocks", "programs"):
        nodes = context.pipeline_value(section)
        taken += nodes.entries if nodes is not None else ()
    if not is_name(name):
        _refuse_name(context, name, value, what)
    elif name in taken:
        cause = f"another node is called '{name}'"
        context.error("E-NAME", value.name_place, cause, f"rename the {what}")
    return is_name(name) and name not in taken


def _refuse_name(context: CheckContext, name: str, value: Value, what: str) -> None:
    cause = f"'{name}' is not a valid {what} name"
    context.error("E-NAME", value.name_place, cause, "use lower-case letters, digits and _")


def _program_outputs(
    context: CheckContext, name: str, entry: ProgramEntry, value: Value
) -> dict[str, type]:
    """The wires on which a program publishes, with their classes; they are inputs of the graph."""
    made: dict[str, type] = {}
    neutral = value.at("neutral")
    for port, kind, _ in _named_outputs(context, entry, value):
        wire = f"{name}.{port}"
        made[wire] = kind
        message = read_neutral(context, kind, neutral.at(port) if neutral else None)
        context.inputs[wire] = InputUse(wire, kind, entry.timeout, message, False)
    for port, unknown in (neutral.entries if neutral else {}).items():
        if port not in entry.types:
            cause = f"the program has no output '{port}'"
            context.error("E-PROGRAM", unknown.name_place, cause, "name one of its outputs")
    return made


def message_kind(context: CheckContext, name: str, value: Value) -> type | None:
    """The message class called `name`; None, with an error at `value`, if it cannot be declared."""
    try:
        kind = registry.message_type(name)
    except registry.RegistryError as error:
        context.error(error.code, value.place, str(error), error.fix)
        return None
    if kind in NOT_DECLARABLE:
        cause = f"{name} comes from the operator alone"
        context.error("E-INPUT", value.place, cause, "use the requests of the control socket")
        return None
    return kind


def read_neutral(context: CheckContext, kind: type, value: Value | None) -> Any:
    """The neutral message in `value`; None without one, or, with an error, if it is no message."""
    if value is None or not isinstance(value.data, dict):
        return None
    try:
        return message_parser(kind, with_units=True)(value.plain())
    except MessageError as error:
        context.error("E-INPUT", value.place, f"the neutral message: {error}", "correct the field")
        return None


def mark_motion(context: CheckContext) -> None:
    moving = _upstream_of_motion(context)
    context.moving_parts = {wire.partition(".")[0] for wire in moving} & context.parts.keys()
    for part in (context.parts[name] for name in sorted(context.moving_parts)):
        for use in part.inputs(True):
            if use.timeout > MOTION_TIMEOUT_MAX:
                cause = f"the robot's motion depends on {part.name}, and {use.timeout:g} s is too "
                cause += f"long for {use.wire}"
                fix = f"set at most {MOTION_TIMEOUT_MAX:g} s in {part.configuration.file.name}"
                context.error("E-INPUT", part.value.place, cause, fix)
    for wire, use in context.inputs.items():
        if wire not in moving:
            continue
        context.inputs[wire] = replace(use, feeds_motion=True)
        node, _, name = wire.partition(".")
        section = "sources" if node in context.sources else "programs"
        steps = ("inputs", name) if node == INPUT else (section, node)
        value = context.pipeline_value(*steps)
        if use.timeout > MOTION_TIMEOUT_MAX and value is not None:
            place = (value.at("timeout") or value).place
            cause = (
                f"the robot's motion depends on {wire}, and {use.timeout:g} s is too long for it"
            )
            fix = f"set at most {MOTION_TIMEOUT_MAX:g} s"
            context.error("E-INPUT", place, cause, fix)


def _upstream_of_motion(context: CheckContext) -> set[str]:
    """Every wire that the commands to the robot, its goals or its stops depend on."""
    blocks = context.pipeline_value("blocks")
    wires = {
        name: list(_wires_into(value)) for name, value in (blocks.entries if blocks else {}).items()
    }
    for uses in (context.programs, context.sources):
        wires |= {name: list(use.wires.values()) for name, use in uses.items()}
    robot = context.pipeline_value("robot")
    waiting = list(_wires_into(robot)) if robot is not None else []
    for name, part in context.parts.items():
        wires[name] = list(part.remaps.values())
        if any(out.kind in ACTING for use in part.blocks() for out in outputs(use.cls).values()):
            waiting += wires[name]
    for name, block in context.block_classes.items():
        if any(out.kind in ACTING for out in outputs(block).values()):
            waiting += wires.get(name, [])
    moving: set[str] = set()
    while waiting:
        wire = waiting.pop()
        if wire not in moving:
            moving.add(wire)
            waiting += wires.get(wire.partition(".")[0], [])
    return moving


def _wires_into(value: Value) -> Iterable[str]:
    entries = value.at("in")
    for source in entries.entries.values() if entries else ():
        if isinstance(source.data, str):
            yield source.data
