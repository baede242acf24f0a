"""JSON Schemas (draft 2020-12) of robot, pipeline, trials and view files, for editors.

`python -m tests.support.reference.schemas` writes them to schemas/. An editor sees a file before
includes and variables are applied: with an include any mapping may be incomplete, because includes
are merged, and any value may be a `$name`. The items of lists are complete: lists are replaced.
"""

from __future__ import annotations

import json
from typing import Any, get_args, get_origin

from diffbotctl.block import In, inputs
from diffbotctl.config import lookup, registry
from diffbotctl.config.configuration import Pipeline
from diffbotctl.config.faults import FAULTS, FaultEntry
from diffbotctl.config.node_ports import NODE_NAME
from diffbotctl.config.robot import Robot
from diffbotctl.params import BOUNDS, Declaration, Pin, Section, Spread, declared
from diffbotctl.trials.sections import Trials
from diffbotctl.ui.saved_view import SavedView
from diffbotctl.units import NUMBER, magnitude_max, of_kind

Schema = dict[str, Any]
CODE_NAME = "\\.py:[A-Za-z_][A-Za-z0-9_]*$"  # a class in a file beside the pipeline
DRAFT = "https://json-schema.org/draft/2020-12/schema"
VARIABLE = {"type": "string", "pattern": "\\$[A-Za-z_]"}
WIRE = {"type": "string", "pattern": "^[a-z][a-z0-9_]*(\\.[a-z][a-z0-9_]*){1,2}$"}


def robot() -> Schema:
    """The schema of a robot file as an editor sees it."""
    return _as_written(of_section(Robot, "A robot of diffbotctl"))


def pipeline() -> Schema:
    """The schema of a pipeline file as an editor sees it, with every built-in block."""
    whole = of_section(Pipeline, "A pipeline of diffbotctl")
    entry = whole["$defs"]["BlockEntry"]
    kinds = sorted(registry.BLOCKS)
    entry["properties"]["block"] = {
        "description": entry["properties"]["block"]["description"],
        "anyOf": [
            {"enum": kinds},
            {"type": "string", "pattern": NODE_NAME},
            {"type": "string", "pattern": CODE_NAME},
        ],
    }
    entry["allOf"] = [_when(kind) for kind in kinds]
    entry = whole["$defs"]["SourceEntry"]
    kinds = sorted(registry.DRIVERS)
    entry["properties"]["driver"] = {
        "description": entry["properties"]["driver"]["description"],
        "anyOf": [{"enum": kinds}, {"type": "string", "pattern": NODE_NAME}],
    }
    entry["allOf"] = [_when_driver(kind) for kind in kinds]
    return _as_written(whole)


def view() -> Schema:
    """The schema of a saved view."""
    return of_section(SavedView, "A saved view of diffbotctl")


def trials() -> Schema:
    """The schema of a file of trials."""
    return of_section(Trials, "Trials of diffbotctl")


SCHEMAS = {
    "robot.schema.json": robot,
    "pipeline.schema.json": pipeline,
    "trials.schema.json": trials,
    "view.schema.json": view,
}


def text(schema: Schema) -> str:
    """The text of a schema file."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the schemas into the checkout."""
    for name, make in SCHEMAS.items():
        (lookup.folder("schemas") / name).write_text(text(make()), encoding="utf-8")


def _when(kind: str) -> Schema:
    """What `in` and `with` may hold when the block is a `kind`."""
    block = registry.block(kind)
    ports = {
        name: {**WIRE, "description": f"{port.kind.__name__}. {port.help}".strip()}
        for name, port in inputs(block).items()
        if isinstance(port, In)
    }
    wires = {"type": "object", "additionalProperties": False, "properties": ports}
    return {
        "if": {"properties": {"block": {"const": kind}}, "required": ["block"]},
        "then": {"properties": {"in": wires, "with": of_parameters(block)}},
    }


def _when_driver(kind: str) -> Schema:
    """What `with` may hold when the driver is a `kind`."""
    return {
        "if": {"properties": {"driver": {"const": kind}}, "required": ["driver"]},
        "then": {"properties": {"with": of_parameters(registry.driver(kind))}},
    }


def _when_fault(fault: str) -> Schema:
    """What the size of this fault may be."""
    size = FAULTS[fault].size
    allowed: Schema = {"type": "null", "description": "This fault has no size."}
    if size is not None:
        allowed = of_declaration(size, {})
    return {
        "if": {"properties": {"fault": {"const": fault}}, "required": ["fault"]},
        "then": {"properties": {"size": allowed}},
    }


def _as_written(whole: Schema) -> Schema:
    relaxed: Schema = _with_variables(whole)
    complete = _take_required(relaxed, relaxed["$defs"])
    relaxed["$defs"] = {name: entry for name, entry in sorted(relaxed["$defs"].items()) if entry}
    relaxed["required"] = ["format", "kind"]
    relaxed["if"] = {"not": {"required": ["include"]}}
    relaxed["then"] = complete
    return relaxed


COMPLETE = ".complete"  # ending of a definition that states which keys are required


def _take_required(schema: Schema, definitions: Schema) -> Schema:
    """Make every mapping of `schema` optional, in place; returns a schema that requires its keys.

    Only mappings, not the items of lists. Definitions are changed and added in `definitions`.
    """
    reference = schema.get("$ref")
    if reference is not None:
        name = reference.rsplit("/", 1)[1]
        if name + COMPLETE not in definitions:
            definitions[name + COMPLETE] = {}  # a place, so that a section may contain its like
            definitions[name + COMPLETE] = _take_required(definitions[name], definitions)
        return {"$ref": f"{reference}{COMPLETE}"} if definitions[name + COMPLETE] else {}
    complete: Schema = {}
    for option in schema.get("anyOf", []):  # a section or none: the keywords below skip a none
        complete |= _take_required(option, definitions)
    if "required" in schema:
        complete["required"] = schema.pop("required")
    required = {
        key: _take_required(entry, definitions)
        for key, entry in schema.get("properties", {}).items()
    }
    if any(required.values()):
        complete["properties"] = {key: entry for key, entry in required.items() if entry}
    entries = schema.get("additionalProperties")
    below = _take_required(entries, definitions) if isinstance(entries, dict) else {}
    return {**complete, "additionalProperties": below} if below else complete


def _with_variables(schema: Any) -> Any:
    """`schema` with a `$name` allowed in place of any single value."""
    if isinstance(schema, list):
        return [_with_variables(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    changed = {}
    for key, value in schema.items():
        if key == "properties":
            changed[key] = {name: _or_variable(entry) for name, entry in value.items()}
        elif key in ("items", "additionalProperties") and isinstance(value, dict):
            changed[key] = _or_variable(value)
        else:
            changed[key] = _with_variables(value)
    return changed


VALUE_TYPES = ("number", "integer", "boolean")


def _or_variable(schema: Schema) -> Schema:
    is_value = "enum" in schema or schema.get("type") in VALUE_TYPES
    options = schema.get("anyOf", [])
    is_value = is_value or any(option.get("type") in VALUE_TYPES for option in options)
    inside: Schema = _with_variables(schema)
    if not is_value or schema.get("enum") in ([1], ["robot"], ["pipeline"]):
        return inside
    notes = [key for key in ("description", "x-unit", "default") if key in inside]
    kept: Schema = {key: inside.pop(key) for key in notes}
    return {"anyOf": [*inside.get("anyOf", [inside]), VARIABLE], **kept}


def of_section(kind: type[Section], title: str) -> Schema:
    """The schema of a whole file declared by `kind`.

    Values that two sections share may be in either, so keys of shared sections are not required.
    """
    definitions: Schema = {}
    top = _reference(kind, definitions, False)
    body = definitions.pop(top["$ref"].rsplit("/", 1)[1])
    head = {"$schema": DRAFT, "title": title}
    return {**head, **body, "$defs": dict(sorted(definitions.items()))}


def of_parameters(owner: type) -> Schema:
    """The schema of the `with` mapping of a block class."""
    definitions: Schema = {}
    body = _object(owner, definitions, False)
    body.pop("description", None)
    return {**body, "$defs": definitions} if definitions else body


def of_declaration(declaration: Declaration, definitions: Schema) -> Schema:
    """The schema of one declared setting, with its sentence of help."""
    schema = _of_kind(declaration.kind, declaration, definitions)
    if declaration.none:
        schema = {"anyOf": [schema, {"type": "null"}, {"const": "none"}]}
    schema["description"] = declaration.help
    if declaration.unit:
        schema["x-unit"] = declaration.unit
    default = _default(declaration)
    if default is not None:
        schema["default"] = default
    return schema


def _reference(kind: type[Section], definitions: Schema, is_partial: bool) -> Schema:
    name = f"{kind.__name__}{'.part' if is_partial else ''}"
    if name not in definitions:
        definitions[name] = {}  # a place, so that a section may contain its like
        definitions[name] = _object(kind, definitions, is_partial)
        if kind is FaultEntry:
            definitions[name]["allOf"] = [_when_fault(fault) for fault in FAULTS]
    return {"$ref": f"#/$defs/{name}"}


def _object(owner: type, definitions: Schema, is_partial: bool) -> Schema:
    settings = declared(owner)
    schema: Schema = {
        "description": (owner.__doc__ or "").strip().split("\n\n")[0].replace("\n    ", " "),
        "type": "object",
        "additionalProperties": False,
        "properties": {
            setting.key: of_declaration(setting, definitions) for setting in settings.values()
        },
    }
    required = [
        setting.key
        for setting in settings.values()
        if setting.is_required and not setting.shared and not is_partial
    ]
    return {**schema, "required": required} if required else schema


def _of_kind(kind: Any, declaration: Declaration, definitions: Schema) -> Schema:
    if kind is object:
        return {}
    if kind is dict:
        return {"type": "object"}
    if isinstance(kind, type) and issubclass(kind, Section):
        is_partial = declaration.shared
        return _reference(kind, definitions, is_partial)
    arguments = [_of_kind(argument, declaration, definitions) for argument in get_args(kind)]
    if get_origin(kind) is list:
        return {"type": "array", "items": arguments[0]}
    if get_origin(kind) is tuple:
        count = len(arguments)
        return {"type": "array", "items": arguments[0], "minItems": count, "maxItems": count}
    if get_origin(kind) is dict:
        return {"type": "object", "additionalProperties": arguments[1]}
    return _leaf(kind, declaration)


def _bounds(declaration: Declaration) -> Schema:
    """The bounds of a number: the declared ones, and the largest magnitude of its kind.

    An angle needs its unit, so only 0 may be written as a number.
    """
    if declaration.unit == "rad":
        return {"minimum": 0, "maximum": 0}
    limit = magnitude_max(declaration.unit)
    bounds = declaration.bounds
    lower = {} if {"above", "minimum"} & bounds.keys() else {"minimum": -limit}
    upper = {} if {"below", "maximum"} & bounds.keys() else {"maximum": limit}
    stated = {BOUNDS[bound].keyword: value for bound, value in bounds.items()}
    return {**stated, **lower, **upper}


def _leaf(kind: Any, declaration: Declaration) -> Schema:
    bounds = _bounds(declaration)
    if kind is Spread:
        one = _leaf(float, declaration)
        return {"anyOf": [one, {"type": "array", "items": one, "minItems": 2, "maxItems": 2}]}
    if declaration.choices:
        return {"enum": list(declaration.choices)}
    if kind is float:
        number = {"type": "number", **bounds}
        if not declaration.unit:
            return number
        return {"anyOf": [number, {"type": "string", "pattern": _pattern(declaration.unit)}]}
    if kind is int:
        return {"type": "integer", **bounds}
    if kind is bool:
        return {"type": "boolean"}
    if kind is Pin:
        pin = {"type": "string", "pattern": "^A?[0-9]{1,3}$"}
        return {"anyOf": [{"type": "integer", "minimum": 0, "maximum": 999}, pin]}
    return {"type": "string"}


def _pattern(unit: str) -> str:
    """What a quantity of SI `unit` looks like when it is written with its unit."""
    units = sorted(
        of_kind(unit) + [name.replace("2", "²") for name in of_kind(unit) if "2" in name]
    )
    if unit == "rad":  # only 0 has no unit
        return f"^\\s*({NUMBER}\\s*({'|'.join(units)})|0)\\s*$"
    return f"^\\s*{NUMBER}\\s*({'|'.join(units)})?\\s*$" if units else f"^\\s*{NUMBER}\\s*$"


def _default(declaration: Declaration) -> Any:
    default = declaration.default
    if isinstance(default, bool | int | float | str):
        return default
    if isinstance(default, Spread):
        return default.low if default.low == default.high else list(default)
    return list(default) if isinstance(default, tuple) else None


if __name__ == "__main__":
    main()
