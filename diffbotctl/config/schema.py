"""JSON Schema (draft 2020-12) out of the declarations, for editors and for the check of shapes."""

from __future__ import annotations

from typing import Any, get_args, get_origin

from diffbotctl.params import BOUNDS, Declaration, Pin, Section, declared
from diffbotctl.units import NUMBER, of_kind

DRAFT = "https://json-schema.org/draft/2020-12/schema"
NAME = "^[a-z][a-z0-9_]*$"

Schema = dict[str, Any]


def of_section(kind: type[Section], title: str = "", merged: bool = False) -> Schema:
    """The schema of a whole file declared by `kind`.

    `merged` is the shape after what two sections share was copied into both: then every required
    key must stand in each.
    """
    definitions: Schema = {}
    top = _reference(kind, definitions, merged, False)
    body = definitions.pop(top["$ref"].rsplit("/", 1)[1])
    head: Schema = {"$schema": DRAFT}
    if title:
        head["title"] = title
    return {**head, **body, "$defs": dict(sorted(definitions.items()))}


def of_parameters(owner: type) -> Schema:
    """The schema of the `with` mapping of a block class."""
    definitions: Schema = {}
    body = _object(owner, definitions, False, False)
    body.pop("description", None)
    return {**body, "$defs": definitions} if definitions else body


def of_declaration(declaration: Declaration, definitions: Schema, merged: bool = False) -> Schema:
    """The schema of one declared setting, with its sentence of help."""
    made = _of_kind(declaration.kind, declaration, definitions, merged)
    if declaration.none:
        made = {"anyOf": [made, {"type": "null"}, {"const": "none"}]}
    made["description"] = declaration.help
    if declaration.unit:
        made["x-unit"] = declaration.unit
    default = _default(declaration)
    if default is not None:
        made["default"] = default
    return made


def _reference(kind: type[Section], definitions: Schema, merged: bool, is_partial: bool) -> Schema:
    name = f"{kind.__name__}{'.part' if is_partial else ''}"
    if name not in definitions:
        definitions[name] = {}  # a place, so that a section may contain its like
        definitions[name] = _object(kind, definitions, merged, is_partial)
    return {"$ref": f"#/$defs/{name}"}


def _object(owner: type, definitions: Schema, merged: bool, is_partial: bool) -> Schema:
    settings = declared(owner)
    made: Schema = {
        "description": (owner.__doc__ or "").strip().split("\n\n")[0].replace("\n    ", " "),
        "type": "object",
        "additionalProperties": False,
        "properties": {
            setting.key: of_declaration(setting, definitions, merged)
            for setting in settings.values()
        },
    }
    required = [] if is_partial else _required(settings, merged)
    return {**made, "required": required} if required else made


def _required(settings: dict[str, Declaration], merged: bool) -> list[str]:
    return [
        setting.key
        for setting in settings.values()
        if setting.is_required and (merged or not setting.shared)
    ]


def _of_kind(kind: Any, declaration: Declaration, definitions: Schema, merged: bool) -> Schema:
    if kind is object:
        return {}
    if kind is dict:
        return {"type": "object"}
    if isinstance(kind, type) and issubclass(kind, Section):
        is_partial = declaration.shared and not (merged and declaration.is_required)
        return _reference(kind, definitions, merged, is_partial)
    inside = [_of_kind(each, declaration, definitions, merged) for each in get_args(kind)]
    if get_origin(kind) is list:
        return {"type": "array", "items": inside[0]}
    if get_origin(kind) is tuple:
        count = len(inside)
        return {"type": "array", "items": inside[0], "minItems": count, "maxItems": count}
    if get_origin(kind) is dict:
        return {"type": "object", "additionalProperties": inside[1]}
    return _leaf(kind, declaration)


def _leaf(kind: Any, declaration: Declaration) -> Schema:
    bounds = {BOUNDS[bound].keyword: limit for bound, limit in declaration.bounds.items()}
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
    number = NUMBER.replace("\\d", "[0-9]")
    return f"^\\s*{number}\\s*({'|'.join(units)})?\\s*$" if units else f"^\\s*{number}\\s*$"


def _default(declaration: Declaration) -> Any:
    default = declaration.default
    if isinstance(default, bool | int | float | str):
        return default
    return list(default) if isinstance(default, tuple) else None
