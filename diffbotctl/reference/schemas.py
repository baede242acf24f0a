"""The schemas that editors use: `python -m diffbotctl.reference.schemas` writes them to schemas/.

An editor sees a file as it is written: before its include, and with its variables. So a file that
includes another need not be whole, and any value may be a `$name`.
"""

from __future__ import annotations

import json
from typing import Any

from diffbotctl.block import In, inputs
from diffbotctl.config import lookup, registry
from diffbotctl.config.pipeline import Pipeline
from diffbotctl.config.robot import Robot
from diffbotctl.config.schema import NAME, Schema, of_parameters, of_section

VARIABLE = {"type": "string", "pattern": "\\$[A-Za-z_]"}
WIRE = {"type": "string", "pattern": "^[a-z][a-z0-9_]*\\.[a-z][a-z0-9_]*$"}


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
        "anyOf": [{"enum": kinds}, {"type": "string", "pattern": NAME}],
    }
    entry["allOf"] = [_when(kind) for kind in kinds]
    return _as_written(whole)


SCHEMAS = {"robot.schema.json": robot, "pipeline.schema.json": pipeline}


def text(schema: Schema) -> str:
    """A schema as it stands in its file."""
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


def _as_written(whole: Schema) -> Schema:
    relaxed: Schema = _with_variables(whole)
    required = relaxed.pop("required", [])
    relaxed["required"] = ["format", "kind"]
    relaxed["if"] = {"not": {"required": ["include"]}}
    relaxed["then"] = {"required": required}
    return relaxed


def _with_variables(schema: Any) -> Any:
    """`schema` with a `$name` allowed wherever a single value stands."""
    if isinstance(schema, list):
        return [_with_variables(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    changed = {}
    for key, value in schema.items():
        if key == "properties":
            changed[key] = {name: _or_variable(each) for name, each in value.items()}
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


if __name__ == "__main__":
    main()
